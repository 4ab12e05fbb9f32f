"""Currents of a plate from solves at one real shift: their stated errors against finite elements at the frequency."""

from __future__ import annotations

import numpy as np
import pytest

from spinlev.fem.closed_forms.potentials import unit_dipoles
from spinlev.fem.plate.choice import reachable_region
from spinlev.fem.plate.currents import (
    CURRENTS,
    OtherSources,
    error_of,
    outer_box,
    outer_frequencies,
    solve_currents,
    space_couplings,
    train,
)
from spinlev.fem.plate.eddy import MESH_SHARE, EddySpace, Ladder, solve_eddy
from spinlev.fem.plate.rotor_share import TurningRotor, rotor_box
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.models import AccuracyError
from spinlev.geometry.magnets import horizontal, vertical
from spinlev.geometry.meshes.plate import MeshRule, plate_mesh
from spinlev.geometry.scene.contents import Plate
from spinlev.geometry.shapes import Box

PLATE = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.055)), 3.5e7)
REGION = reachable_region(PLATE, (0.0, 0.0, -0.02), (0.003, 0.003, 0.003), 6.35e-3)
RULE = MeshRule(2.0, 3.0, 3.0)
FREQUENCIES, RTOL = (5.0, 250.0), 0.05
HALF = PLATE.box.half_edges
ROTORS = [rotor_table(r, "cuboid") for r in (horizontal(0.002, 0.01, 1.3, 1.0), vertical(0.014, 0.01, 1.3, 1.0))]


@pytest.fixture(scope="module")
def space():
    mesh = plate_mesh(PLATE.body, PLATE.conductivity, REGION.grid((2, 2, 2), fold=(0, 1, 2)), 250.0, RULE)
    return EddySpace(mesh, 2)


@pytest.fixture(scope="module")
def boxes():
    return [outer_box(REGION, PLATE.body), outer_box(rotor_box(PLATE, ROTORS[0]), PLATE.body)]


@pytest.fixture(scope="module")
def solution(boxes):
    return solve_currents(PLATE, boxes, FREQUENCIES, RTOL, RULE)


@pytest.mark.parametrize("frequency", [250.0, *(pytest.param(f, marks=pytest.mark.slow) for f in (5.0, 40.0))])
def test_what_residuals_bound_is_no_larger(space, frequency):
    """Own tensors of unseen dipoles against the complex solution on the same elements, for two tolerances."""
    probes = REGION.lower + (REGION.upper - REGION.lower) * np.random.default_rng(1).random((3, 3))
    exact = solve_eddy(space.conductors, 2, frequency, unit_dipoles(probes), space).couplings
    for allowed in (1e-2, 1e-4):
        grid = REGION.grid((3, 3, 3), fold=(0, 1, 2))
        made, worst, *_ = train(space, grid, probes, OtherSources(), FREQUENCIES, allowed)
        found = space_couplings(made.couplings(unit_dipoles(probes)), made.inductances, 2j * np.pi * frequency)
        blocks = [np.einsum("iaib->iab", c.reshape(3, 3, 3, 3)) for c in (found, exact)]
        error = np.max(np.linalg.norm(blocks[0] - blocks[1], axis=(1, 2)) / np.linalg.norm(blocks[1], axis=(1, 2)))
        print(f"\n{frequency:g} Hz: error {error:.1e}, stated {worst:.1e}, asked {allowed:.0e}")
        assert error <= worst
        assert worst < 20 * allowed


@pytest.mark.parametrize("rotor", ROTORS, ids=["of the box", "beyond the box"])
def test_the_bound_for_a_rotor_that_was_not_trained_holds(solution, rotor):
    """Its field in the region against the complex solution on the same elements, at the highest frequency."""
    probes = TurningRotor(PLATE, rotor).others().probes
    stated = error_of(solution, probes)
    places = solution.probes[solution.boxes[0].contains(solution.probes)]
    corners = np.concatenate([box.grid((2, 2, 2), fold=(0, 1, 2)) for box in solution.boxes])
    mesh = plate_mesh(PLATE.body, PLATE.conductivity, corners, 250.0, RULE)
    response = solve_eddy(mesh, solution.space.order, 250.0, probes)
    exact = response.couplings_to(unit_dipoles(places)).T
    omega = 2 * np.pi * 250.0
    pairs = zip(
        solution.space.couplings(probes),
        solution.space.couplings(unit_dipoles(places)),
        solution.space.inductances,
        strict=True,
    )
    found = sum(-1j * omega * r @ np.linalg.solve(np.eye(len(i)) + 1j * omega * i, d.T) for r, d, i in pairs)
    error = np.max(np.linalg.norm(found - exact, axis=1) / np.linalg.norm(exact, axis=1))
    print(f"\nerror {error:.1e}, stated {stated:.1e}")
    assert error <= stated


def test_one_solution_serves_other_rotors_and_nearby_places(boxes, solution):
    """Another rotor in the same box and a place half a millimetre off ask for the same boxes."""
    shifted = Region(REGION.lower + 5e-4, REGION.upper + 5e-4)
    other = rotor_table(horizontal(0.0021, 0.01, 1.3, 1.0), "dipole")
    asked = []

    def solve(plate, asked_boxes, *others):
        asked.append(asked_boxes)
        return solution

    table, share = PlateAround(PLATE, other, shifted, FREQUENCIES, RTOL, rule=RULE).tables(solve)
    assert len(asked) == 1
    for wanted, there in zip(asked[0], boxes, strict=True):
        assert np.array_equal(wanted.lower, there.lower)
        assert np.array_equal(wanted.upper, there.upper)
    assert table.errors.total <= RTOL
    assert share.error <= RTOL


def test_a_rotor_that_no_dipole_stands_for_is_solved_for_itself(solution):
    """A magnet far beyond the box: the second request holds the rotor."""
    far = rotor_table(vertical(0.1, 0.01, 1.3, 1.0), "cuboid")
    asked = []

    def solve(plate, asked_boxes, frequencies, rtol, rule, others=None):
        asked.append(others)
        if others:
            raise InterruptedError
        return solution

    with pytest.raises(InterruptedError):
        PlateAround(PLATE, far, REGION, FREQUENCIES, 1e-4, rule=RULE).tables(solve)
    assert asked[0] is None
    assert len(asked[1].training) > 0


def test_boxes_grow_outwards_and_stay_off_the_plate():
    """Random boxes over the face: nothing of them is lost, and at least 0.65 of the distance is left."""
    rng = np.random.default_rng(2)
    for _ in range(100):
        low = np.array([*rng.uniform(-0.02, 0.02, 2), HALF[2] + 10 ** rng.uniform(-3, -1)])
        box = Region(low, low + 10 ** rng.uniform(-3, -1.5, 3))
        outer = outer_box(box, PLATE.body)
        assert outer.contains([box.lower, box.upper]).all()
        assert outer.lower[2] - HALF[2] >= 0.65 * (box.lower[2] - HALF[2])
    assert outer_frequencies((0.5, 250.0)) == (0.5, 250.0)
    assert outer_frequencies((0.5, 260.0)) == (0.5, 375.0)


def test_a_solution_survives_the_disk(solution, tmp_path):
    """Couplings to single precision, everything else exactly."""
    CURRENTS.save(solution, tmp_path / "s.nc")
    read = CURRENTS.load(tmp_path / "s.nc")
    place = REGION.center
    for kept, back in zip(
        solution.space.couplings(unit_dipoles(place)), read.space.couplings(unit_dipoles(place)), strict=True
    ):
        assert back == pytest.approx(kept, abs=1e-6 * abs(kept).max())
    assert np.array_equal(read.residuals, solution.residuals)
    assert (read.mesh_error, read.space_error, read.frequencies) == (
        solution.mesh_error, solution.space_error, solution.frequencies,
    )  # fmt: skip


def test_a_tolerance_that_a_mesh_misses_is_named_as_the_user_gave_it():
    """`--plate-rtol` is what was given, not `rtol`, and a mesh rule says nothing to whom did not choose one."""
    ladder = Ladder(
        PLATE, REGION.grid((2, 2, 2), fold=(0, 1, 2)), FREQUENCIES[1], RULE, MESH_SHARE * 1e-5, growing=True
    )
    ladder.order, ladder.errors = ladder.highest, np.array([6e-3])
    with pytest.raises(AccuracyError) as refused:
        ladder.refuse()
    said = str(refused.value)
    assert said.startswith(
        "Input --plate-rtol (plate_rtol in Python, --rtol of the command plate) must be at least 0.01 "
    )
    assert "instead received 1e-05." in said
    assert "MeshRule" not in said
