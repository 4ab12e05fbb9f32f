"""Any rigid floater in a rotor's field: against magpylib's sums over cells, taken to their limit, at twenty poses."""

import magpylib as magpy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spinlev.fem.harmonics.interior import field_coefficients, harmonics, matrices, shells, shifted, sizes, turns
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.floater import floater_sources, force_and_torque, slopes_of
from spinlev.geometry.common import even_directions
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.scene.floater import Floater, FloaterPart
from spinlev.geometry.shapes import Box, Cylinder, ring, rotation_matrix

CUBE = Magnet(Box((0.01,) * 3, (2e-3, 0.0, 0.0)), (1.3, 0.0, 0.0))
SOURCE = magpy.magnet.Cuboid(dimension=(0.01,) * 3, position=(2e-3, 0, 0), polarization=(1.3, 0, 0))
TABLE = rotor_table((CUBE,), "cuboid")
RANDOM = np.random.default_rng(5)
TURNS = Rotation.random(20, random_state=RANDOM).as_matrix()
PLACES = np.column_stack([RANDOM.uniform(-8e-3, 8e-3, (20, 2)), RANDOM.uniform(-32e-3, -21e-3, 20)])


def part(body, *polarization, density=7500.0):
    return FloaterPart(Magnet(body, polarization), density)


BODIES = {
    "cube": Floater(0.01 * 3**0.5 / 2, 1.3, 1.0, 7500.0, None, Box((0.01,) * 3)),
    "disc": Floater(0.0065, 1.3, 1.0, 7500.0, None, Cylinder(6e-3, 5e-3)),
    "ring": Floater(0.0065, 1.3, 1.0, 7500.0, None, ring(6e-3, 3e-3, 5e-3)),
    "composite": Floater.composed(
        [
            part(Box((6e-3, 6e-3, 4e-3), (0.0, 1e-3, 3e-3), rotation_matrix((0, 20, 0))), 0.4, 0.0, 1.2),
            part(Cylinder(3e-3, 4e-3, (1e-3, 0.0, -3e-3), rotation_matrix((90, 0, 0))), 0.0, 0.0, -1.1),
            part(Box((4e-3, 4e-3, 2e-3), (0.0, 0.0, -7e-3)), 0.0, 0.0, 0.0, density=1200.0),
        ]
    ),
}


def summed(floater, place, turn, n):
    """Force and torque about the centre of mass by magpylib's sums over cells, `n` along a radius or an edge."""
    total = np.zeros((2, 3))
    for magnet in floater.magnets_at(place, turn):
        body = magnet.body
        where = {"polarization": magnet.polarization, "position": body.center}
        where["orientation"] = Rotation.from_matrix(body.rotation)
        if isinstance(body, Box):
            targets, meshing = [magpy.magnet.Cuboid(dimension=body.size, **where)], (n, n, n)
        else:  # in thirds, as the innermost cells of a whole turn would be larger than others
            size = body.inner_radius, body.radius, body.height
            thirds = ((0, 120), (120, 240), (240, 360))
            targets = [magpy.magnet.CylinderSegment(dimension=(*size, *third), **where) for third in thirds]
            meshing = (4 * n, n, n)
        total += sum(np.array(magpy.getFT(SOURCE, target, pivot=place, meshing=meshing)) for target in targets)
    return total


SLOW = {"disc", "ring", "composite"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in BODIES]
)
def test_force_and_torque_are_the_limit_of_magpylibs_sums(name):
    """The sums err by even powers of the cells' edges, of which two are taken off; its steps in place leave 4e-7."""
    floater = BODIES[name]
    force, torque = force_and_torque(floater_sources(floater), TABLE, PLACES, TURNS)
    for place, turn, *found in zip(PLACES, TURNS, force, torque, strict=True):
        a, b, c = (summed(floater, place, turn, n) for n in (4, 8, 16))
        once, twice = (4 * b - a) / 3, (4 * c - b) / 3
        known = (16 * twice - once) / 15
        for ours, theirs in zip(found, known, strict=True):
            assert np.linalg.norm(ours - theirs) < 1e-6 * np.linalg.norm(theirs)


@pytest.mark.parametrize("name", BODIES)
def test_multipoles_feel_what_the_body_feels(name):
    """U = Σ A M, its change by place and turn: to degree 20 what is left out beside a magnet is 1e-6 of the force."""
    floater, degree = BODIES[name], 20
    sources, unit = floater_sources(floater), floater.radius
    slopes, turns = matrices(degree)
    for place, turn in zip(PLACES[:5], TURNS[:5], strict=True):
        distance = float(CUBE.body.distance(place))
        field = field_coefficients(lambda p: TABLE.evaluate(p)[0], place, 0.5 * distance, degree, unit)
        moments = sources.turned(turn).multipoles(degree, unit)
        force = -np.einsum("k,akl,l->a", field, slopes, moments) / unit
        torque = -np.einsum("k,akl,l->a", field, turns, moments)
        known = force_and_torque(sources, TABLE, place[None], turn[None])
        assert np.linalg.norm(force - known[0][0]) < 1e-6 * np.linalg.norm(force)
        assert np.linalg.norm(torque - known[1][0]) < 1e-6 * np.linalg.norm(torque)


def test_derivatives_of_force_and_torque_are_those_of_small_steps():
    sources, step = floater_sources(BODIES["composite"], degree=6), 1e-6
    place, turn = PLACES[:1], TURNS[:1]
    slopes = slopes_of(sources, TABLE, place, turn)[1][0]

    def at(change):
        there = Rotation.from_rotvec(change[3:]).as_matrix() @ turn[0]
        return slopes_of(sources, TABLE, place + change[:3], there[None])[0][0]

    for k, way in enumerate(step * np.eye(6)):
        found = (at(way) - at(-way)) / (2 * step)
        assert np.abs(found - slopes[:, k]).max() < 1e-6 * np.abs(slopes[:, k]).max()


def test_turns_of_the_harmonics_are_rotations():
    """Antisymmetric to the last bit, and of the sizes' mean squares over places all around: 1e-4 of 4000 of them."""
    assert np.array_equal(turns(6), -turns(6).swapaxes(1, 2))
    unit = sizes(6)
    assert turns(6) == pytest.approx(matrices(6)[1] * unit / unit[:, None], abs=1e-12)
    mean = np.sqrt(np.mean(harmonics(6, even_directions(4000))[0] ** 2, axis=0))
    assert unit == pytest.approx(mean, rel=1e-4)


def test_matrices_of_the_harmonics():
    """∂R = D R, (e × r)·∇R = G R, and Σ A R(r + ξ), whose next term is of the fourth power of ξ."""
    points = RANDOM.normal(size=(6, 3))
    values, gradient = harmonics(6, points)
    slopes, turns = matrices(6)
    assert np.einsum("akl,nl->nka", slopes, values) == pytest.approx(gradient, abs=1e-11 * np.abs(gradient).max())
    turned = np.stack([np.einsum("ni,nki->nk", np.cross(axis, points), gradient) for axis in np.eye(3)])
    assert np.einsum("akl,nl->ank", turns, values) == pytest.approx(turned, abs=1e-11 * np.abs(turned).max())
    way = 1e-3 * RANDOM.normal(size=(6, 3))
    there = harmonics(6, points + way)[0]
    for highest, allowed in ((6, 3e-9), (3, 1e-11)):
        field = np.where(shells(6) <= highest, RANDOM.normal(size=len(shells(6))), 0.0)
        known = np.einsum("kn,in,ik->i", shifted(field, 6, 3), harmonics(3, way)[0], values)
        assert there @ field == pytest.approx(known, abs=allowed * np.abs(there @ field).max())
