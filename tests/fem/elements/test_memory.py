"""Memory of a solve: predicted before it is begun, and refused in words where there is less."""

import re
import resource
import subprocess
import sys
from pathlib import Path

import ngsolve
import pytest
from netgen.meshing import NgException

from spinlev.fem.elements import spaces as memory
from spinlev.fem.elements.ladder import refinement_of
from spinlev.fem.elements.magnetostatics import assemble
from spinlev.fem.elements.spaces import TooLargeError, free_memory, memory_need
from spinlev.fem.plate.eddy import EddySpace, ShiftedSystem
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import horizontal, vertical
from spinlev.geometry.meshes.magnets import MeshSettings, mesh_magnets
from spinlev.geometry.meshes.plate import plate_mesh
from spinlev.geometry.shapes import Box

ROTOR = vertical(0.014, 0.01, 1.305, 1.05)


def magnets():
    system = assemble(mesh_magnets(ROTOR, refinement_of(3, MeshSettings(), 0.05).mesh), 3)
    return system.space, system.space.FreeDofs(True), system.stiffness.mat


def plate():
    conductors = plate_mesh(Box((0.1, 0.24, 0.03)), 3.5e7, [[0.03, 0.02, 0.04]], 100.0)
    system = ShiftedSystem(EddySpace(conductors, 2), 628j)
    return system.fes, system.fes.FreeDofs(True), system.form.mat


@pytest.mark.parametrize("made", [magnets, plate])
def test_the_prediction_is_what_the_factor_takes(made):
    """Numbers as the solver counts them; the elements' share is the matrix and what static condensation keeps."""
    space, free, matrix = made()
    number = 16 if space.is_complex else 8
    factor = matrix.Inverse(free, inverse="sparsecholesky")
    elements, taken = memory_need(space, free)
    print(f"\n{number * factor.nze / taken:.2f} of the predicted factor")
    assert 0.4 < number * factor.nze / taken < 1.2
    assert 0.3 < number * matrix.nze / elements < 1.1


def test_a_solve_that_the_memory_does_not_hold_is_refused(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 3e6)
    with pytest.raises(TooLargeError, match=r"of order \d need about .* GB .*; 0\.003 GB are free\. Allow .*--rtol"):
        rotor_table(horizontal(2e-3, 10e-3, 1.305, 1.05), "fem", 1e-6)
    with pytest.raises(TooLargeError, match=r"--plate-rtol.*use a machine with more"):
        plate()


@pytest.mark.slow
def test_a_limit_of_the_process_is_seen_before_it_is_hit():
    """A child that may have 60 MB more than it has and NGSolve's heap: refused in words where the solver would die."""
    code = (
        "import resource, psutil, test_memory as t\n"
        "from spinlev.geometry.meshes.magnets import MeshSettings\n"
        "mesh = t.mesh_magnets(t.ROTOR, t.refinement_of(4, MeshSettings(), 0.05).mesh)\n"
        "size = psutil.Process().memory_info().vms + 360_000_000\n"
        "resource.setrlimit(resource.RLIMIT_AS, (size, size))\n"
        "t.assemble(mesh, 4)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    said = re.search(r"TooLargeError: .* need about (\S+) GB .*; (\S+) GB are free", done.stderr)
    assert said, done.stderr
    assert float(said[1]) > 0.1
    assert float(said[2]) <= 0.06


def test_a_memory_that_runs_out_all_the_same_is_no_fault_of_the_mesh(monkeypatch):
    class Full:
        def __init__(self, *_, **__):
            pass

        __iadd__ = lambda self, _: self  # noqa: E731

        def Assemble(self):
            raise NgException("Could not allocate localheap, heapsize = 200000000")

    mesh = mesh_magnets(ROTOR)
    monkeypatch.setattr("ngsolve.BilinearForm", Full)
    with pytest.raises(TooLargeError, match=r"ran out in elements of order 1.*localheap.*--rtol"):
        assemble(mesh, 1)


def test_the_limit_of_a_container_counts(monkeypatch, tmp_path):
    whole = free_memory(tmp_path)
    assert whole > 1e7
    (tmp_path / "memory.max").write_text("1500000\n")
    (tmp_path / "memory.stat").write_text("anon 500000\nfile 900000\n")
    assert free_memory(tmp_path) == 1e6
    (tmp_path / "memory.max").write_text("max\n")
    assert free_memory(tmp_path) > 1e6
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (1000, 1000))
    assert free_memory(tmp_path) == 0.0


def test_nothing_is_counted_where_nothing_is_coupled():
    space = ngsolve.H1(mesh_magnets(ROTOR).mesh, order=1)
    none = ngsolve.BitArray(space.ndof)
    none.Clear()
    assert memory_need(space, none)[1] == 0
