"""Floaters that are no spheres: mass and inertia, keys that belong to a shape, contact at the start."""

import numpy as np
import pytest

from spinlev.geometry.common import MU_0, InputError
from spinlev.geometry.scene.contents import Drag, Floater
from spinlev.geometry.scene.files import parse_scene, scene, scene_text
from spinlev.geometry.scene.making import tilt
from spinlev.geometry.scene.messages import SceneError

ROTOR = tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
MATERIAL = {"remanence_T": 1.3, "recoil_permeability": 1.0, "density_kg_m3": 7500.0}
CYLINDER = {"shape": "cylinder", "diameter_mm": 12.0, "height_mm": 6.0, **MATERIAL}
CUBOID = {"shape": "cuboid", "size_mm": [12.0, 8.0, 6.0], **MATERIAL}


def made(floater, **more):
    return scene(frequency_hz=100.0, rotor=ROTOR, floater=floater, **more)


@pytest.mark.parametrize("keys", [CYLINDER, CUBOID], ids=["cylinder", "cuboid"])
def test_mass_moment_and_inertia_are_those_of_points_drawn_in_the_body(keys):
    floater = made(keys).floater
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (400_000, 3)) * floater.solid.size
    inside = floater.solid.distance(points) <= 0
    volume = np.prod(floater.solid.size) * inside.mean()
    assert floater.mass == pytest.approx(7500.0 * volume, rel=3e-3)
    assert floater.moment == pytest.approx(1.3 * volume / MU_0, rel=3e-3)
    square = points[inside] ** 2
    inertia = 7500.0 * volume * (square.sum(axis=1).mean() - square.mean(axis=0))
    assert floater.principal_inertia == pytest.approx(inertia, rel=1e-2)
    assert floater.inner_radius == pytest.approx(3e-3)
    assert floater.radius == pytest.approx(np.linalg.norm(floater.solid.size[[0, 2]] / 2), rel=1e-9) or keys is CUBOID


@pytest.mark.parametrize("keys", [CYLINDER, CUBOID], ids=["cylinder", "cuboid"])
def test_it_is_written_and_read(keys):
    first = made(keys)
    again = parse_scene(scene_text(first))
    assert again.floater.shape == keys["shape"]
    assert again.floater.solid.size == pytest.approx(first.floater.solid.size)
    assert scene_text(again) == scene_text(first)
    assert keys["shape"] in repr(first)


def test_left_out_the_drag_is_that_of_the_sphere_of_its_volume():
    disc = made(CYLINDER)
    like = Drag.stokes((disc.floater.volume * 0.75 / np.pi) ** (1 / 3))
    assert [disc.drag.linear, disc.drag.angular] == pytest.approx([like.linear, like.angular])


def test_a_start_is_free_as_the_body_lies():
    """A disc 6 mm high and 12 mm wide under a cube whose lowest corner is at -5.79 mm."""
    lying = {"position_mm": [0.0, 0.0, -9.0], "moment": [0.0, 0.0, 1.0]}
    assert made(CYLINDER, start=lying).start.position[2] == pytest.approx(-9e-3)
    standing = {**lying, "moment": [1.0, 0.0, 0.0]}
    with pytest.raises(SceneError, match="overlaps rotor magnet 1 by"):
        made(CYLINDER, start=standing)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"diameter_mm": 12.0}, "floater must have diameter_mm and height_mm, as the shape is 'cylinder'"),
        ({"size_mm": [1.0, 1.0, 1.0]}, "floater must have diameter_mm and height_mm, as the shape is 'cylinder'"),
        ({"shape": "cuboid", "diameter_mm": 12.0}, "floater must have size_mm, as the shape is 'cuboid'"),
        ({"shape": "ring", "diameter_mm": 12.0}, "floater.shape must be 'sphere', 'cuboid' or 'cylinder'"),
        ({"shape": "sphere"}, "floater.diameter_mm must be given; instead it is missing"),
        ({"shape": "sphere", "diameter_mm": 12.0, "height_mm": 3.0}, "floater must have diameter_mm, as the shape is"),
        ({"diameter_mm": 12.0, "height_mm": 6.0, "conductivity_S_m": 1e6}, "floater.conductivity_S_m must be left out"),
        ({"diameter_mm": 12.0, "height_mm": -6.0}, "floater.height_mm must be at least 0.001"),
    ],
)
def test_what_no_shape_has_is_told(keys, said):
    with pytest.raises(SceneError, match=said) as caught:
        made({"shape": "cylinder", **MATERIAL, **keys})
    assert len(caught.value.faults) == 1


def test_air_beyond_stokes_is_that_of_spheres():
    with pytest.raises(SceneError, match=r'drag.model must be "stokes"'):
        made(CYLINDER, drag={"model": "air"})


def test_what_needs_another_shape_says_so():
    with pytest.raises(InputError, match=r'floater.shape must be "sphere" there; instead received "cuboid". Do this.'):
        made(CUBOID).floater.must_be("sphere", where="there", instead="Do this.")
    Floater(6e-3, 1.3, 1.0, 7500.0).must_be("sphere", where="there", instead="Do this.")
