"""The working point of magnets: against exact values, magpylib, and an integral equation of the magnetisation."""

import magpylib
import numpy as np
import pytest

from spinlev.fem.rotor.near_field import near_field
from spinlev.fem.rotor.working_point import EasyField, working_points
from spinlev.geometry.common import MU_0
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.shapes import Box, Sphere, ring, rotation_matrix

J = 1.3
CUBE = Box((0.01,) * 3)
FACE = -J * (0.5 + np.arctan(0.25 / np.sqrt(1.5)) / np.pi)
"""In the middle of a cube's charged face: half of it by this face, the solid angle of the other over 4π besides."""
SURFACE = 2e-4
"""T: the field changes by 80 T/m at the face, and the search ends a micrometre off it."""


def knee_at(level):
    """Coercivity (A/m) with the knee at a field, T."""
    return -level / MU_0


def grid(count):
    """Middles (n³, 3) m of the cells of the cube."""
    line = (np.arange(count) + 0.5) / count * 0.01 - 0.005
    return np.stack(np.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)


def test_a_cube_is_lowest_in_the_middle_of_its_charged_faces_and_its_share_is_magpylibs():
    knee = -0.6
    turned = Box(CUBE.size, (1e-3, 0.0, 0.0), rotation_matrix((10.0, 20.0, 30.0)))
    (found,) = working_points(EasyField([Magnet(turned, (J, 0, 0), coercivity=knee_at(knee))]))
    assert found.lowest == pytest.approx(FACE, abs=SURFACE)
    assert abs(found.lowest - FACE) <= found.error
    assert np.abs(turned.to_body(found.place)[0]) == pytest.approx(5e-3, abs=2e-6)
    theirs = magpylib.magnet.Cuboid(dimension=CUBE.size, polarization=(J, 0, 0)).getH(grid(40))[:, 0] * MU_0
    assert found.share_below == pytest.approx(np.mean(theirs < knee), abs=4e-3)
    assert abs(found.share_below - np.mean(theirs < knee)) < 4 * found.share_error
    assert np.quantile(found.levels, 0.5) == pytest.approx(np.quantile(theirs, 0.5), abs=2e-3)
    assert found.margin == pytest.approx(found.lowest - knee)


@pytest.mark.parametrize("permeability", [1.0, 1.05])
def test_a_sphere_works_everywhere_at_a_third_of_its_magnetisation(permeability):
    """H = -J/(μ + 2): all of it is below a knee just above, nothing below one just underneath."""
    level = -J / (permeability + 2)
    for factor, share in ((0.99, 1.0), (1.01, 0.0)):
        magnet = Magnet(Sphere(5e-3), (0, J, 0), permeability, coercivity=knee_at(factor * level))
        (found,) = working_points(EasyField([magnet]))
        assert found.lowest == pytest.approx(level, abs=1e-9)
        assert found.share_below == share
        assert found.share_error == 0


def test_a_floater_and_a_touching_magnet_add_what_magpylib_adds():
    """μr = 1, a second cube that touches: the field along the easy axis is infinite at edges, and kept off them."""
    magnets = [Magnet(CUBE, (J, 0, 0)), Magnet(Box(CUBE.size, (0, 0, 0.01)), (0, 0, J))]
    ball = Magnet(Sphere(6.35e-3, (1e-3, 0, -19e-3)), J * np.array([-0.28, 0, 0.96]))
    field = EasyField(magnets, ball)
    found = working_points(field)
    sources = [
        magpylib.magnet.Cuboid(dimension=CUBE.size, polarization=(J, 0, 0)),
        magpylib.magnet.Cuboid(dimension=CUBE.size, polarization=(0, 0, J), position=(0, 0, 0.01)),
        magpylib.magnet.Sphere(diameter=12.7e-3, polarization=ball.polarization, position=ball.body.center),
    ]
    for k, (point, magnet) in enumerate(zip(found, magnets, strict=True)):
        axis = magnet.polarization / J
        assert magpylib.getH(sources, point.place, sumup=True) @ axis * MU_0 == pytest.approx(point.lowest, abs=1e-9)
        places = grid(24)
        off = np.sort(0.005 - np.abs(places), axis=1)[:, 1] > point.clear
        around = magpylib.getH(sources, places[off] + magnet.body.center, sumup=True) @ axis * MU_0
        assert point.lowest <= around.min() + point.error
        # the rotor turning past the floater: magpylib's sphere on its way round
        ways = [(field.of_floater(k, places, angle), angle) for angle in (0.0, 90.0, 235.0)]
        for ours, angle in ways:
            turn = rotation_matrix((0, 0, angle))
            there = magpylib.magnet.Sphere(
                diameter=12.7e-3, polarization=turn @ ball.polarization, position=turn @ ball.body.center
            )
            assert ours == pytest.approx(there.getH(places) @ axis * MU_0, abs=1e-9)
        assert point.lowest_turning <= point.lowest


@pytest.mark.slow
def test_a_thin_ring_across_its_axis_is_nearly_free_of_iron():
    """H = -J where a thin wall stands across the polarisation: all but the sides is lost at a knee of half of that."""
    thin = Magnet(ring(10e-3, 9.9e-3, 20e-3), (J, 0, 0), coercivity=knee_at(-0.5 * J))
    (found,) = working_points(EasyField([thin]))
    assert found.lowest == pytest.approx(-J, rel=0.02)
    # in the wall H is -J cos²φ along the axis: below -J/2 over half of the turn
    assert found.share_below == pytest.approx(0.5, abs=0.02)


def test_without_polarisation_there_is_no_working_point():
    assert working_points(EasyField([Magnet(CUBE, (0, 0, 0))])) == (None,)


@pytest.mark.slow
def test_a_permeable_cube_agrees_with_an_integral_equation_of_the_magnetisation():
    """μr = 1.05: magnetisation constant in n³ boxes, magpylib's field of each, extrapolated in the boxes' size."""

    def middle_of_face(count):
        source = magpylib.magnet.Cuboid(dimension=(0.01 / count,) * 3, polarization=(1, 0, 0))
        places, face = grid(count), np.array([[5e-3 - 1e-9, 0, 0]])
        tensor = np.empty((len(places) + 1, 3, len(places), 3))
        for axis in range(3):
            source.polarization = np.eye(3)[axis]
            apart = np.concatenate([places, face])[:, None] - places
            tensor[:, :, :, axis] = MU_0 * np.moveaxis(source.getH(apart.reshape(-1, 3)).reshape(*apart.shape), 2, 1)
        own, there = tensor[:-1].reshape(3 * len(places), -1), tensor[-1].reshape(3, -1)
        polarization = np.tile([J, 0, 0], len(places))
        magnetization = np.linalg.solve(np.eye(len(own)) - 0.05 * own, polarization)
        inner = int(np.argmin(np.linalg.norm(places - face, axis=1)))
        flux = (there @ magnetization)[0] + magnetization[3 * inner]  # in the box's middle M is another, B nearly not
        return float(flux - J) / 1.05

    coarse, fine = middle_of_face(5), middle_of_face(9)
    exact = fine + (fine - coarse) / ((9 / 5) ** 2 - 1)
    (found,) = working_points(EasyField([Magnet(CUBE, (J, 0, 0), 1.05)]))
    print(f"integral equation {exact:.5f} T, finite elements {found.lowest:.5f} ± {found.error:.1g} T")
    assert found.lowest == pytest.approx(exact, abs=found.error + abs(fine - exact))
    assert found.error < 1e-3 * J
    near = near_field([Magnet(CUBE, (J, 0, 0), 1.05)], found.place[None])
    assert near.field[0, 0] == pytest.approx(found.lowest, abs=found.error + near.error[0])
