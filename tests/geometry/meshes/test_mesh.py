"""Meshes: exact volumes, named regions, exchange with other programs, and input that makes no sense."""

import meshio
import ngsolve as ng
import numpy as np
import pytest

from spinlev.geometry.magnets import Magnet, horizontal, vertical
from spinlev.geometry.meshes.magnets import MeshSettings, mesh_magnets, to_meshio
from spinlev.geometry.shapes import Box, rotation_matrix

TURNED = (Magnet(Box((0.01, 0.006, 0.002), (0.001, 0.002, 0.003), rotation_matrix((20, 30, 40))), (1, 0, 0), 1.05),)


@pytest.mark.parametrize("rotor", [TURNED, vertical(0.01, 0.01, 1.3, 1.05), vertical(0.013, 0.01, 1.3, 1.05)])
@pytest.mark.parametrize("hp_layers", [0, 1, 2])
def test_regions_have_the_volumes_of_the_bodies(rotor, hp_layers):
    mesh = mesh_magnets(rotor, MeshSettings(hp_layers=hp_layers))
    for k, magnet in enumerate(rotor):
        volume = ng.Integrate(ng.CF(1) * ng.dx(f"magnet{k}"), mesh.mesh) * mesh.unit**3
        assert volume == pytest.approx(magnet.box.volume, rel=1e-10)  # flat faces: exact but for round-off
    air = ng.Integrate(ng.CF(1) * ng.dx("air"), mesh.mesh) * mesh.unit**3
    ball = 4 / 3 * np.pi * (mesh.ball_radius * mesh.unit) ** 3
    assert air == pytest.approx(ball - sum(m.box.volume for m in rotor), rel=1e-4)  # the sphere, curved elements


def _volumes(cells, points):
    """Six times the volume at the first corner of each cell: positive where the order of vertices is right."""
    neighbours = {"tetra": (1, 2, 3), "wedge": (1, 2, 3), "pyramid": (1, 3, 4)}[cells.type]
    corners = points[cells.data]
    return np.linalg.det(np.stack([corners[:, i] - corners[:, 0] for i in neighbours], axis=1))


@pytest.mark.parametrize("suffix", ["vtu", "msh"])
def test_mesh_survives_exchange(tmp_path, suffix):
    mesh = mesh_magnets(vertical(0.01, 0.01, 1.3, 1.05))
    to_meshio(mesh).write(tmp_path / f"m.{suffix}", {"msh": "gmsh22"}.get(suffix))
    read = meshio.read(tmp_path / f"m.{suffix}")
    assert sum(len(cells.data) for cells in read.cells) == mesh.elements
    assert {number for part in read.cell_data["gmsh:physical"] for number in part} == {1, 2, 3}
    assert all((_volumes(cells, read.points) > 0).all() for cells in read.cells)
    assert set(to_meshio(mesh).field_data) == {"magnet0", "magnet1", "air"}


def test_input_that_makes_no_sense_is_refused():
    with pytest.raises(ValueError, match="must not overlap"):
        mesh_magnets(vertical(0.009, 0.01, 1.3, 1.05))
    with pytest.raises(ValueError, match="at least one magnet"):
        mesh_magnets(())
    with pytest.raises(ValueError, match="hp_factor"):
        MeshSettings(hp_factor=0.25)
    with pytest.raises(ValueError, match="ball_radius"):
        mesh_magnets(horizontal(0.0, 0.01, 1.3, 1.05), MeshSettings(ball_radius=1.0))
