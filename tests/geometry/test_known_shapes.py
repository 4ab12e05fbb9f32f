"""Solids of STEP files that are a cuboid, a cylinder, a ring or a sphere, in any pose, and such that are nearly one."""

import netgen.occ as occ
import numpy as np
import pytest
from article import BALL

from spinlev.geometry.meshes.solids import occ_solid
from spinlev.geometry.scene.files import load_scene, scene
from spinlev.geometry.scene.making import magnets
from spinlev.geometry.shapes import Box, Cylinder, Sphere, ring, rotation_matrix
from spinlev.geometry.solids import known_shape, moved
from spinlev.geometry.step_file import read_part

CENTER, TURN = np.array([1e-3, -2e-3, 3e-3]), rotation_matrix((25.0, -40.0, 10.0))
BODIES = [Box((0.01, 0.012, 0.004)), Cylinder(5e-3, 8e-3), Cylinder(1e-2, 1e-3), ring(5e-3, 2e-3, 8e-3), Sphere(9.5e-3)]


def written(solid, path):
    solid.WriteStep(str(path))
    return path


@pytest.mark.parametrize("turn", [np.eye(3), TURN], ids=["straight", "turned"])
@pytest.mark.parametrize("body", BODIES, ids=["box", "rod", "disc", "ring", "sphere"])
def test_a_solid_is_known_with_its_place_and_axes(body, turn, tmp_path):
    """Sizes, place and volume of the shape that was written, and a surface at the same distances."""
    body = moved(body, CENTER, turn)
    file = written(occ_solid(body, np.zeros(3), 1e-3), tmp_path / "part.step")
    part = read_part(file)
    known = known_shape(moved(part, -part.origin, np.eye(3)))
    assert type(known) is type(body)
    assert np.sort(known.shape_numbers) == pytest.approx(np.sort(body.shape_numbers), rel=1e-10)
    points = CENTER + np.random.default_rng(0).uniform(-0.015, 0.015, (200, 3))
    assert known.distance(points) == pytest.approx(body.distance(points), abs=1e-11)
    if turn is not TURN:
        assert np.array_equal(known.rotation, np.eye(3))


@pytest.mark.slow
def test_what_is_only_nearly_a_shape_stays_a_part(tmp_path):
    cube = occ.Box(occ.Pnt(-5, -5, -5), occ.Pnt(5, 5, 5))
    rod = occ.Cylinder(occ.Pnt(0, 0, 0), occ.Z, r=5, h=8)
    solids = {
        "chamfer": cube.MakeChamfer(cube.edges[:1], 0.01),
        "ell": cube - occ.Box(occ.Pnt(0, 0, -5), occ.Pnt(5, 5, 5)),
        "bored": rod - occ.Cylinder(occ.Pnt(1, 0, 0), occ.Z, r=1, h=8),
        "half": occ.Sphere(occ.Pnt(0, 0, 0), 5) - occ.Box(occ.Pnt(-5, -5, -5), occ.Pnt(5, 5, 0)),
    }
    for name, solid in solids.items():
        assert known_shape(read_part(written(solid, tmp_path / f"{name}.step"))) is None


def test_a_turned_cube_in_a_file_is_the_same_magnet_by_keys_and_the_reader_says_so(tmp_path, caplog):
    """Polarised along the file's axes, wherever the cube's own axes lie in it."""
    body = Box((0.01,) * 3, CENTER, TURN)
    written(occ_solid(body, np.zeros(3), 1e-3), tmp_path / "cube.step")
    (tmp_path / "scene.toml").write_text(
        "frequency_hz = 100.0\n[floater]\ndiameter_mm = 12.7\nremanence_T = 1.3\ndensity_kg_m3 = 7500.0\n"
        "[[rotor.magnets]]\nfile = 'cube.step'\ncenter_mm = [0.0, 0.0, 2.0]\nrotation_deg = [0.0, 0.0, 90.0]\n"
        "polarization_T = [1.0, 0.0, 0.5]\n"
    )
    with caplog.at_level("INFO", "spinlev"):
        read = load_scene(tmp_path / "scene.toml")
    assert caplog.messages == ["cube.step is a cuboid, (10, 10, 10) mm, and is computed as one"]
    (magnet,) = read.rotor
    assert isinstance(magnet.body, Box)
    assert magnet.polarization_in_rotor == pytest.approx([0.0, 1.0, 0.5])
    assert magnet.body.center == pytest.approx([2e-3, 1e-3, 5e-3])
    keys = {"center_mm": 1e3 * magnet.body.center, "rotation_deg": [0.0, 0.0, 0.0], "size_mm": [10.0] * 3}
    again = scene(frequency_hz=100.0, rotor=magnets({**keys, "polarization_T": [0.0, 1.0, 0.5]}), floater=BALL)
    assert again.rotor[0].moment == pytest.approx(magnet.moment, rel=1e-12)
