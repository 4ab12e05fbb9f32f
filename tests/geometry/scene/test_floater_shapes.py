"""Floaters that are no spheres: mass and inertia, keys that belong to a shape, contact at the start."""

from dataclasses import replace

import netgen.occ as occ
import numpy as np
import pytest

from spinlev.dynamics.continuation.slow_drift import SlowTorque
from spinlev.geometry.common import MU_0, InputError
from spinlev.geometry.scene.contents import Drag
from spinlev.geometry.scene.files import parse_scene, scene, scene_text
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.scene.making import tilt
from spinlev.geometry.scene.messages import SceneError
from spinlev.geometry.shapes import Box, rotation_matrix

ROTOR = tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
MATERIAL = {"remanence_T": 1.3, "recoil_permeability": 1.0, "density_kg_m3": 7500.0}
CYLINDER = {"shape": "cylinder", "diameter_mm": 12.0, "height_mm": 6.0, **MATERIAL}
CUBOID = {"shape": "cuboid", "size_mm": [12.0, 8.0, 6.0], **MATERIAL}


def made(floater, **more):
    return scene(frequency_hz=100.0, rotor=ROTOR, floater=floater, **more)


@pytest.mark.parametrize("keys", [CYLINDER, CUBOID], ids=["cylinder", "cuboid"])
def test_mass_moment_and_inertia_are_those_of_points_drawn_in_the_body(keys):
    floater = made(keys).floater
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (400_000, 3)) * floater.bodies[0].size
    inside = floater.bodies[0].distance(points) <= 0
    volume = np.prod(floater.bodies[0].size) * inside.mean()
    assert floater.mass == pytest.approx(7500.0 * volume, rel=3e-3)
    assert floater.moment == pytest.approx(1.3 * volume / MU_0, rel=3e-3)
    square = points[inside] ** 2
    inertia = 7500.0 * volume * (square.sum(axis=1).mean() - square.mean(axis=0))
    assert floater.principal_inertia == pytest.approx(inertia, rel=1e-2)
    assert floater.inner_radius == pytest.approx(3e-3)
    assert (
        floater.radius == pytest.approx(np.linalg.norm(floater.bodies[0].size[[0, 2]] / 2), rel=1e-9) or keys is CUBOID
    )


@pytest.mark.parametrize(("hole", "height"), [(1.0, 6.0), (8.0, 6.0), (8.0, 1.0), (0.0, 6.0)])
def test_the_largest_sphere_that_a_ring_holds_is_the_deepest_of_points_drawn_in_it(hole, height):
    """The drag of a body is no less than that of a sphere in it: where a ring's centre is in its hole, in its wall."""
    shape = {"shape": "ring", "inner_diameter_mm": hole} if hole else {}
    floater = made(CYLINDER | {"height_mm": height} | shape).floater
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (200_000, 3)) * floater.bodies[0].size
    deepest = -floater.bodies[0].distance(points).min()
    assert 0.97 * floater.held_radius < deepest <= floater.held_radius * (1 + 1e-12)
    assert (floater.inner_radius > 0) == (hole == 0)


@pytest.mark.parametrize("keys", [CYLINDER, CUBOID], ids=["cylinder", "cuboid"])
def test_it_is_written_and_read(keys):
    first = made(keys)
    again = parse_scene(scene_text(first))
    assert again.floater.shape == keys["shape"]
    assert again.floater.bodies[0].size == pytest.approx(first.floater.bodies[0].size)
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
        (
            {"shape": "cone", "diameter_mm": 12.0},
            "floater.shape must be 'sphere', 'cuboid', 'cylinder', 'ring' or 'file'",
        ),
        ({"shape": "sphere"}, "floater.diameter_mm must be given; instead it is missing"),
        ({"shape": "sphere", "diameter_mm": 12.0, "height_mm": 3.0}, "floater must have diameter_mm, as the shape is"),
        ({"diameter_mm": 12.0, "height_mm": 6.0, "conductivity_S_m": -1e6}, "floater.conductivity_S_m must be"),
        ({"diameter_mm": 12.0, "height_mm": -6.0}, "floater.height_mm must be at least 0.001"),
    ],
)
def test_what_no_shape_has_is_told(keys, said):
    with pytest.raises(SceneError, match=said) as caught:
        made({"shape": "cylinder", **MATERIAL, **keys})
    assert len(caught.value.faults) == 1


MAGNET = {"size_mm": [8.0, 8.0, 4.0], "polarization_T": [0.0, 0.0, 1.3], "density_kg_m3": 7500.0}
HALVES = [{**MAGNET, "center_mm": [1.0, 2.0, 3.0 + z]} for z in (-2.0, 2.0)]
LEAD = {"shape": "sphere", "diameter_mm": 6.0, "density_kg_m3": 11300.0}


def test_two_halves_are_one_cube():
    """Wherever their centre of mass is, which is the origin of the floater's frame."""
    halves = made({"magnets": HALVES}).floater
    cube = Floater(4e-3 * 3**0.5, 1.3, 1.05, 7500.0, None, Box((8e-3,) * 3))
    assert halves.principal_inertia == pytest.approx(cube.principal_inertia)
    assert halves.dipole == pytest.approx(cube.dipole)
    assert halves.mass == pytest.approx(cube.mass)
    assert halves.radius == pytest.approx(cube.radius)
    assert not halves.round
    assert halves.shape == "composite"
    assert 0.9 * cube.inner_radius < halves.inner_radius < cube.inner_radius  # each half's own face is at the centre
    apart = [{**half, "center_mm": [1.0, 2.0, 3.0 + z]} for half, z in zip(HALVES, (-3.0, 3.0), strict=True)]
    assert made({"magnets": apart}).floater.inner_radius == 0.0  # the centre is in the gap between them


def test_a_composite_has_the_inertia_of_points_drawn_in_it():
    """In a frame turned against the file's: its axes are principal, and the moment turns with it."""
    keys = {
        "magnets": [{**MAGNET, "center_mm": [3.0, 0.0, 2.0], "rotation_deg": [0.0, 30.0, 10.0]}],
        "bodies": [{**LEAD, "center_mm": [-4.0, 1.0, -3.0]}],
    }
    floater = made(keys).floater
    points = np.random.default_rng(1).uniform(-12e-3, 12e-3, (600_000, 3))
    weights = np.zeros(len(points))
    for part in floater.parts:
        weights += part.density * (part.magnet.body.distance(points) <= 0)
    weights *= (24e-3) ** 3 / len(points)
    assert weights.sum() == pytest.approx(floater.mass, rel=1e-2)
    assert np.linalg.norm(weights @ points) < 1e-2 * floater.mass * floater.radius
    squares = np.einsum("n,ni,nj->ij", weights, points, points)
    inertia = np.trace(squares) * np.eye(3) - squares
    assert inertia == pytest.approx(np.diag(floater.principal_inertia), abs=1e-2 * floater.principal_inertia.max())
    assert floater.moment == pytest.approx(1.3 * 256e-9 / MU_0)
    turn = rotation_matrix((0.0, 30.0, 10.0))
    assert floater.pointing == pytest.approx(floater.file_axes @ turn[:, 2])


def test_bodies_on_one_axis_are_round_about_it():
    """Whichever way the axis lies in the file."""
    turned = {"shape": "cylinder", "diameter_mm": 8.0, "height_mm": 5.0, "rotation_deg": [0.0, 90.0, 0.0]}
    turned["center_mm"] = [0.0, 0.0, 0.0]
    magnet = {**turned, "polarization_T": [0.0, 0.0, -1.2], "density_kg_m3": 7500.0}
    ballast = {**LEAD, "center_mm": [6.0, 0.0, 0.0]}
    floater = made({"magnets": [magnet], "bodies": [ballast]}).floater
    assert floater.round
    assert floater.pointing == pytest.approx([0.0, 0.0, 1.0])
    assert pytest.approx([-1.0, 0.0, 0.0]) == floater.file_axes.T @ [0.0, 0.0, 1.0]
    assert not made({"magnets": [magnet], "bodies": [{**ballast, "center_mm": [6.0, 0.1, 0.0]}]}).floater.round


def test_a_file_is_the_shape_that_it_holds_or_any_other(tmp_path):
    """A cuboid of a STEP file is computed as one; a corner cut off leaves a part, with the moments of what is left."""
    cube = occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(8, 8, 8))
    cube.WriteStep(str(tmp_path / "cube.step"))
    (cube - occ.Box(occ.Pnt(4, 4, 0), occ.Pnt(8, 8, 8))).WriteStep(str(tmp_path / "ell.step"))
    found = made({"shape": "file", "file": str(tmp_path / "cube.step"), **MATERIAL}).floater
    assert found.shape == "cuboid"
    assert found.principal_inertia == pytest.approx(7500.0 * 512e-9 * np.array([128e-6] * 3) / 12, rel=1e-7)
    scene = made({"shape": "file", "file": str(tmp_path / "ell.step"), **MATERIAL})
    ell = scene.floater
    parts = [{**MAGNET, "size_mm": size, "center_mm": center, "polarization_T": [0.0, 0.0, 1.3]}
             for size, center in (([8.0, 4.0, 8.0], [4.0, 2.0, 4.0]), ([4.0, 4.0, 8.0], [2.0, 6.0, 4.0]))]  # fmt: skip
    same = made({"magnets": parts}).floater
    assert ell.principal_inertia == pytest.approx(same.principal_inertia, rel=1e-6)
    assert ell.dipole == pytest.approx(same.dipole, rel=1e-6)
    again = parse_scene(scene_text(scene))
    assert again.floater.principal_inertia == pytest.approx(ell.principal_inertia)


def test_a_composite_is_written_and_read():
    first = made({"magnets": HALVES, "bodies": [{**LEAD, "center_mm": [1.0, 2.0, -5.0]}]})
    replaced = replace(first, floater=replace(first.floater))
    again = parse_scene(scene_text(replaced)).floater
    assert again.principal_inertia == pytest.approx(first.floater.principal_inertia)
    assert again.dipole == pytest.approx(first.floater.dipole)
    assert again.mass == pytest.approx(first.floater.mass)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"bodies": [LEAD | {"center_mm": [0.0] * 3}]}, "floater.magnets must have at least one magnet"),
        ({"magnets": []}, "floater.magnets must have at least one magnet"),
        ({"magnets": HALVES, "density_kg_m3": 7500.0}, "floater must have its sizes and materials in floater.magnets"),
        ({"magnets": [HALVES[0], HALVES[0]]}, "floater must have magnets and bodies that do not overlap"),
        ({"magnets": [{**HALVES[0], "densty_kg_m3": 1.0}]}, "did you mean `density_kg_m3`"),
        ({"magnets": [{**HALVES[0], "shape": "ring"}]}, r"floater.magnets\[0\] must have diameter_mm"),
        ({**CUBOID, "inertia_kg_m2": [1e-7, 1e-7, 3e-7]}, "none is larger than the other two together"),
        ({"shape": "file", **MATERIAL}, "floater.file must be given, as the shape is 'file'"),
        ({**CUBOID, "file": "x.step"}, "floater.file must be left out, or shape be 'file'"),
    ],
)
def test_what_no_composite_has_is_told(keys, said):
    with pytest.raises(SceneError, match=said) as caught:
        made(keys)
    assert len(caught.value.faults) == 1


def test_given_moments_of_inertia_take_the_place_of_the_shapes():
    given = [3e-8, 4e-8, 5e-8]
    floater = made({**CUBOID, "inertia_kg_m2": given}).floater
    assert floater.principal_inertia.tolist() == given
    assert not made({**CYLINDER, "inertia_kg_m2": given}).floater.round
    assert parse_scene(scene_text(made({**CUBOID, "inertia_kg_m2": given}))).floater.moments_of_inertia == tuple(given)


def test_a_direction_that_changes_nothing_is_refused():
    start = {"position_mm": [0.0, 0.0, -25.0], "body_x": [0.0, 1.0, 0.0]}
    assert made(CUBOID, start=start).start.body_x is not None
    with pytest.raises(SceneError, match=r"start\.body_x must be left out of a floater that is round"):
        made(CYLINDER, start=start)


def test_what_needs_another_shape_says_so():
    with pytest.raises(InputError, match=r'floater.shape must be "sphere" for its slow drift; instead received "cub'):
        SlowTorque.of(made(CUBOID), None)
