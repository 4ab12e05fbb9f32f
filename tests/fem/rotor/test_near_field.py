"""B, H and M next to magnets, in gaps and inside: against closed forms, the exact sphere, and themselves."""

import magpylib
import numpy as np
import pytest
from second_opinions.axisymmetric import RoundMagnet

from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.near_field import complete, near_field
from spinlev.fem.rotor.table import RangeError
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.shapes import Box, Cylinder, Sphere, ring, rotation_matrix

POLARIZATION = np.array([1.2, 0.0, 0.5])
TURN = rotation_matrix((25.0, -40.0, 10.0))
CUBE = Box((0.01,) * 3, (2e-3, 0.0, 0.0), TURN)


def places_about(body, clear_of_edges, reach=1e-3, count=400):
    """Inside and up to `reach` off the surface, but so far from edges."""
    half = body.half_edges + reach
    points = body.center + np.random.default_rng(4).uniform(-half, half, (count, 3)) @ body.rotation.T
    return points[(body.edge_distance(points) > clear_of_edges) & (body.distance(points) < reach)]


def test_in_and_beside_a_cube_it_is_the_closed_form():
    """μr = 1: magpylib's cuboid, inside and within 1 mm, 0.5 mm off the edges; 1e-4 is asked for."""
    magnet, points = Magnet(CUBE, POLARIZATION), places_about(CUBE, 0.5e-3)
    found = near_field((magnet,), points)
    source = magpylib.magnet.Cuboid(dimension=CUBE.size, polarization=POLARIZATION)
    theirs = source.getB(CUBE.to_body(points)) @ CUBE.rotation.T
    assert np.abs(found.flux_density - theirs).max() < 1e-12
    inside = CUBE.distance(points) < 0
    assert inside.any()
    assert np.array_equal(found.magnet == 0, inside)
    assert np.abs(found.magnetization[inside] - magnet.polarization_in_rotor).max() < 1e-12
    assert not found.magnetization[~inside].any()


@pytest.mark.parametrize("permeability", [1.05, 3.0])
def test_in_a_permeable_sphere_everything_is_uniform_and_exact(permeability):
    magnet = Magnet(Sphere(9.5e-3, (1e-3, 0, 0)), POLARIZATION, permeability)
    points = places_about(magnet.body, 0.0)
    found = near_field((magnet,), points)
    inside = found.magnet == 0
    assert np.abs(found.field[inside] + POLARIZATION / (permeability + 2)).max() < 1e-9
    assert np.abs(found.flux_density[inside] - 2 * POLARIZATION / (permeability + 2)).max() < 1e-9
    outside = points[~inside]
    assert found.flux_density[~inside] == pytest.approx(rotor_table((magnet,), "fem").evaluate(outside)[0], abs=1e-9)


@pytest.mark.slow
def test_in_a_permeable_cylinder_two_accuracies_agree_within_what_they_state():
    body = Cylinder(5e-3, 8e-3, (2e-3, 0.0, 0.0), TURN)
    magnet, points = Magnet(body, POLARIZATION, 1.05), places_about(body, 0.5e-3)
    coarse, fine = (near_field((magnet,), points, rtol) for rtol in (1e-3, 1e-4))
    assert fine.order > coarse.order
    apart = np.linalg.norm(coarse.flux_density - fine.flux_density, axis=1)
    assert np.all(apart <= coarse.error + fine.error)
    assert fine.error.max() < 1e-4 * np.linalg.norm(POLARIZATION)


@pytest.mark.slow
def test_in_a_permeable_cube_and_a_gap_the_field_converges_and_jumps_as_it_must():
    """Two cubes 1 mm apart, μr = 1.05: B normal to the faces is continuous, H along them, and 1e-4 is reached."""
    lower, upper = Box((0.01,) * 3), Box((0.01,) * 3, (0, 0, 0.011))
    magnets = (Magnet(lower, (1.3, 0, 0), 1.05), Magnet(upper, (0, 0, 1.3), 1.05))
    places = np.array([[x, 1e-3, 0.0] for x in (-3e-3, 0.0, 2e-3)])
    tiny = np.array([0.0, 0.0, 2e-7])  # B changes by 0.1 mT in a micrometre here
    face = np.array([0.0, 0.0, 5e-3])
    points = np.concatenate([places + face - tiny, places + face + tiny, places + face + [0, 0, 0.5e-3]])
    found = near_field(magnets, points)
    below, above, gap = np.split(np.arange(9), 3)
    assert list(found.magnet[below]) == [0] * 3
    assert list(found.magnet[gap]) == [-1] * 3
    jump = 1e-4 * 1.3
    assert np.abs(found.flux_density[below, 2] - found.flux_density[above, 2]).max() < jump
    assert np.abs(found.field[below, :2] - found.field[above, :2]).max() < jump
    assert found.error.max() < 1e-4 * 1.3


@pytest.mark.slow
def test_far_away_it_is_the_table():
    magnet = Magnet(Cylinder(5e-3, 8e-3), POLARIZATION, 1.05)
    points = np.array([[0.0, 0.0, -0.02], [0.03, 0.01, 0.0]])
    found = near_field((magnet,), points)
    field, gradient = rotor_table((magnet,), "fem").evaluate(points)
    assert found.flux_density == pytest.approx(field, rel=1e-4)
    assert found.gradient == pytest.approx(gradient, rel=1e-3, abs=1e-5 * np.abs(gradient).max())


def test_the_gradient_is_that_of_the_field():
    magnet = Magnet(Cylinder(5e-3, 8e-3), POLARIZATION, 1.05)
    points = np.array([[1e-3, 2e-3, 1e-3], [6e-3, 0.5e-3, 2e-3], [-2e-3, -1e-3, -5e-3]])
    step = 1e-6
    moved = np.concatenate([points + s * step * axis for axis in np.eye(3) for s in (1, -1)])
    found = near_field((magnet,), np.concatenate([points, moved]), 1e-3)
    around = found.flux_density[3:].reshape(3, 2, 3, 3)
    numeric = np.moveaxis((around[:, 0] - around[:, 1]) / (2 * step), 0, -1)
    assert np.abs(found.gradient[:3] - numeric).max() < 2e-2 * np.abs(numeric).max()


@pytest.mark.parametrize(
    ("body", "point"),
    [
        (Box((0.01,) * 3), (5e-3, 5e-3, 1e-3)),
        (Cylinder(5e-3, 8e-3), (3e-3, 4e-3, 4e-3)),
        (ring(5e-3, 3e-3, 8e-3), (0.0, -3e-3, -4e-3)),
    ],
)
def test_a_point_on_an_edge_is_refused(body, point):
    with pytest.raises(InputError, match="must not lie on an edge of a magnet, where the field is infinite"):
        near_field((Magnet(body, POLARIZATION),), [point])


def test_a_complete_table_has_the_near_field_and_the_far_table_alike():
    """A sphere of μr = 1.05, exact: uniform inside, a dipole outside; the motion's table is the one of before."""
    magnet = Magnet(Sphere(5e-3), (0, 0, 1.3), 1.05)
    far = rotor_table((magnet,), "fem")
    table = complete(far)
    points = np.array([[0.0, 1e-3, 2e-3], [0.0, 0.0, 5.0001e-3], [0.0, 0.0, -2e-2]])
    field, gradient = table.evaluate(points)
    exact = 2 * 1.3 / 3.05 * np.array([1.0, (5 / 5.0001) ** 3, (5 / 20) ** 3])
    assert np.abs(field[:, 2] - exact).max() < 1e-8
    assert np.abs(gradient[0]).max() < 1e-5
    assert gradient[1:, 2, 2] == pytest.approx(-3 * exact[1:] / points[1:, 2], rel=1e-5)
    error, steep = table.absolute_error(points)
    assert np.all(np.abs(field[:, 2] - exact) <= error + 1e-10)
    assert np.all(np.isfinite(steep))
    assert np.all(table.relative_error(points)[0] < 1e-4)
    assert np.array_equal(table.in_range(points), far.in_range(points))
    assert np.array_equal(table.evaluate(points[2:])[0], far.evaluate(points[2:])[0])
    with pytest.raises(RangeError):
        far.evaluate(points)
    found = table.fields(points)
    assert found.field[0] == pytest.approx([0, 0, -1.3 / 3.05], abs=1e-9)
    assert list(found.magnet) == [0, -1, -1]


def test_a_complete_table_of_closed_forms_is_magpylibs_and_refuses_edges():
    magnet, points = Magnet(CUBE, POLARIZATION, 1.05), places_about(CUBE, 0.5e-3)
    table = complete(rotor_table((magnet,), "cuboid"))  # which is that of μr = 1
    source = magpylib.magnet.Cuboid(dimension=CUBE.size, polarization=POLARIZATION)
    assert np.abs(table.evaluate(points)[0] - source.getB(CUBE.to_body(points)) @ CUBE.rotation.T).max() < 1e-12
    for place in (CUBE.corners[0], CUBE.corners[:2].mean(axis=0)):
        with pytest.raises(InputError, match="must not lie on an edge"):
            table.evaluate([place])
    dipole = rotor_table((magnet,), "dipole")
    assert complete(dipole) is dipole


@pytest.mark.slow
def test_the_table_of_moments_and_the_elements_agree_within_what_they_state():
    """Cube, μr = 1.05: 1 mm beyond the sphere through its corners, 1e-3 asked of the elements."""
    magnet = Magnet(Box((0.01,) * 3), (1.3, 0, 0), 1.05)
    table = complete(rotor_table((magnet,), "fem", 1e-5), 1e-3)
    ways = np.random.default_rng(2).normal(size=(60, 3))
    points = ways / np.linalg.norm(ways, axis=1)[:, None] * (magnet.body.circumradius + 1e-3)
    points = points[table.in_range(points)]
    assert len(points) > 30
    found = near_field((magnet,), points, 1e-3)
    apart = np.linalg.norm(found.flux_density - table.evaluate(points)[0], axis=1)
    assert np.all(apart <= found.error + table.absolute_error(points)[0])


@pytest.mark.parametrize("permeability", [1.0, 1.05])
def test_on_a_face_the_field_is_the_one_just_outside(permeability):
    """B across a face is the same on either side, H along it, too; the sphere is exact."""
    ball = Magnet(Sphere(5e-3), (0, 0, 1.3), permeability)
    found = near_field((ball,), [[0.0, 0.0, 5e-3], [5e-3, 0.0, 0.0]])
    inside = 1.3 / (permeability + 2)
    assert found.flux_density[:, 2] == pytest.approx([2 * inside, -inside], abs=1e-6)
    assert not found.magnetization.any()
    if permeability == 1:
        cube = Magnet(Box((0.01,) * 3, (2e-3, 0, 0), TURN), POLARIZATION)
        at = cube.body.center + np.array([[5e-3, 1e-3, 2e-3], [-1e-3, -5e-3, 1e-3], [1e-3, 1e-3, 5e-3]]) @ TURN.T
        out = np.array([[1e-7, 0, 0], [0, -1e-7, 0], [0, 0, 1e-7]]) @ TURN.T
        on, beside = near_field((cube,), at).flux_density, near_field((cube,), at + out).flux_density
        assert on == pytest.approx(beside, abs=5e-5)


ROUND = {
    "cylinder": (Cylinder(4.65e-3, 6.1e-3), (4.65e-3, 0.0, 6.1e-3, 1.27, 1.1), (0.2533e-3, 4.6573e-3, 3.0641e-3)),
    "ring": (ring(8.5e-3, 3.5e-3, 5.2e-3), (8.5e-3, 3.5e-3, 5.2e-3, 1.18, 1.05), (-1.3809e-3, -8.4073e-3, 2.5e-3)),
}
"""Body; its numbers, whose field by surface charge is good to 3e-7 T; a place (m) where too little was stated."""


@pytest.mark.slow
@pytest.mark.parametrize("name", ROUND)
def test_stated_errors_hold_near_the_edges_of_round_magnets(name):
    """10 to 300 µm off the edges, each place asked for alone: their number makes no statement safer."""
    body, numbers, place = ROUND[name]
    permeability, remanence = numbers[-1], numbers[-2]
    magnet = Magnet(body, (0, 0, remanence), permeability)
    table, truth = complete(rotor_table((magnet,), "fem", 1e-3), 1e-3), RoundMagnet(*numbers)
    draw = np.random.default_rng(1)
    radii = [radius for radius in (body.radius, getattr(body, "inner_radius", None)) if radius]
    points = [place]
    for _ in range(12):
        off, turn, around = 10 ** draw.uniform(-5, -3.52), *draw.uniform(0, 2 * np.pi, 2)
        across = draw.choice(radii) + off * np.cos(turn)
        height = draw.choice([-0.5, 0.5]) * body.height + off * np.sin(turn)
        points.append((across * np.cos(around), across * np.sin(around), height))
    found = [table.fields([point]) for point in points]
    flux, stated = (np.array([getattr(one, key)[0] for one in found]) for key in ("flux_density", "error"))
    true = np.linalg.norm(flux - truth.flux_density(points), axis=1)
    assert np.all(true < stated + 3e-7)
    assert stated.max() < 1e-3 * remanence  # of use, too: no more than was asked for
