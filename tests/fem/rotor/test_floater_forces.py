"""Force and torque on floaters that are no spheres: against magpylib's field on their charges, and its own forces."""

import magpylib as magpy
import netgen.occ as occ
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spinlev.fem.harmonics.expansion import MultipoleExpansion
from spinlev.fem.rotor import floater as of_floater
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.floater import FloaterSources, _charges, floater_sources, force_and_torque
from spinlev.geometry.common import MU_0
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.scene.floater import Floater, FloaterPart
from spinlev.geometry.shapes import Box, Cylinder
from spinlev.geometry.step_file import read_part

CUBE = Magnet(Box((0.01,) * 3, (2e-3, 0.0, 0.0)), (1.3, 0.0, 0.0))
SOURCE = magpy.magnet.Cuboid(dimension=(0.01,) * 3, position=(2e-3, 0, 0), polarization=(1.3, 0, 0))
BODIES = [Box((8e-3, 10e-3, 6e-3)), Cylinder(5e-3, 6e-3)]
PLACES = np.array([[1e-3, 2e-3, -15e-3], [0.0, 0.0, -20e-3], [12e-3, -3e-3, -14e-3]])
GAUSS = 24


def floater(body, permeability=1.0):
    return Floater(body.circumradius, 1.3, permeability, 7500.0, None, body)


def turned(count):
    return Rotation.random(count, random_state=3).as_matrix()


def end_faces(body):
    """Points and areas of the face at +z; charges sit on both ends alone, as the remanence is along z."""
    t, w = np.polynomial.legendre.leggauss(GAUSS)
    if isinstance(body, Box):
        x, y = np.meshgrid(t * body.size[0] / 2, t * body.size[1] / 2, indexing="ij")
        areas = np.outer(w, w) * body.size[0] * body.size[1] / 4
    else:
        radius, angle = body.radius * np.sqrt((t + 1) / 2), 2 * np.pi * np.arange(2 * GAUSS) / (2 * GAUSS)
        x, y = np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))
        areas = np.repeat((w / 2 * np.pi * body.radius**2)[:, None] / (2 * GAUSS), 2 * GAUSS, axis=1)
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, body.size[2] / 2)], axis=1), areas.ravel()


def by_charges(body, place, turn):
    face, areas = end_faces(body)
    arms = np.concatenate([face, face * [1, 1, -1]]) @ turn.T
    charges = np.concatenate([areas, -areas]) * 1.3 / MU_0
    pulls = charges[:, None] * SOURCE.getB(place + arms)
    return pulls.sum(axis=0), np.cross(arms, pulls).sum(axis=0)


@pytest.mark.parametrize("body", BODIES, ids=["cuboid", "cylinder"])
def test_a_rigid_floater_feels_what_magpylibs_field_does_to_its_charges(body):
    """Another formula (charges on the ends, not dipoles inside) in another program's field: 3e-8."""
    turns = turned(len(PLACES))
    force, torque = force_and_torque(floater_sources(floater(body)), rotor_table((CUBE,), "cuboid"), PLACES, turns)
    for k, (place, turn) in enumerate(zip(PLACES, turns, strict=True)):
        known = by_charges(body, place, turn)
        assert np.linalg.norm(force[k] - known[0]) < 3e-8 * np.linalg.norm(known[0])
        assert np.linalg.norm(torque[k] - known[1]) < 3e-8 * np.linalg.norm(known[1])


@pytest.mark.parametrize(
    "body",
    [
        Cylinder(6e-3, 8e-3),
        pytest.param(Cylinder(6e-3, 8e-3, inner_radius=0.5e-3), marks=pytest.mark.slow),
        Box((8e-3, 10e-3, 9e-3)),
    ],
    ids=["cylinder", "ring", "cuboid"],
)
def test_charges_on_a_permeable_floater_and_elements_in_it_are_pulled_alike(body, monkeypatch):
    """Compact floaters have charges, others elements; both reach 1e-5 of the field beside them, and so of the force."""
    turns, table = turned(len(PLACES)), rotor_table((CUBE,), "cuboid")
    charged = force_and_torque(floater_sources(floater(body, 1.05)), table, PLACES, turns)
    monkeypatch.setattr(of_floater, "COMPACT", 9.0)
    for one, other in zip(
        force_and_torque(floater_sources(floater(body, 1.05)), table, PLACES, turns), charged, strict=True
    ):
        assert 0 < np.linalg.norm(one - other) < 1e-5 * np.linalg.norm(one)


@pytest.mark.slow
def test_a_part_of_a_step_file_is_pulled_as_the_cuboids_that_it_is_made_of(tmp_path):
    """An L by elements to 1e-3 of its field, which is stated, against two cuboids by charges on their faces."""
    corner, other = occ.Box(occ.Pnt(0, 0, -5), occ.Pnt(5, 5, 5)), Box((5e-3, 5e-3, 10e-3), (2.5e-3, -2.5e-3, 0.0))
    (occ.Box(occ.Pnt(-5, -5, -5), occ.Pnt(5, 5, 5)) - corner).WriteStep(str(tmp_path / "ell.step"))
    part = read_part(tmp_path / "ell.step")
    along = np.array([0.0, 0.0, 1.3])
    bodies = [part], [Box((5e-3, 10e-3, 10e-3), (-2.5e-3, 0.0, 0.0)), other]
    table, turns, found = rotor_table((CUBE,), "cuboid"), turned(len(PLACES)), []
    for group in bodies:
        floater = Floater.composed([FloaterPart(Magnet(body, along, 1.05), 7500.0) for body in group])
        sources = floater_sources(floater)
        axes = turns @ floater.file_axes.T
        found.append((sources, axes, force_and_torque(sources, table, PLACES, axes)))
    (sources, axes, known), (_, _, exact) = found
    for one, other, error in zip(known, exact, sources.unsure(table, PLACES, axes), strict=True):
        missed = np.linalg.norm(one - other, axis=1)
        print(missed / error)
        assert (missed > 0).all()
        assert (missed < error).all()


@pytest.mark.parametrize(
    ("body", "target"),
    [
        (BODIES[0], magpy.magnet.Cuboid(dimension=BODIES[0].size, polarization=(0, 0, 1.3))),
        (BODIES[1], magpy.magnet.Cylinder(dimension=(10e-3, 6e-3), polarization=(0, 0, 1.3))),
    ],
    ids=["cuboid", "cylinder"],
)
def test_force_and_torque_are_magpylibs(body, target):
    """Its sums over 3000 cells are 1e-4 off; 20000 are ten times nearer."""
    place, turn = PLACES[0], turned(1)[0]
    force, torque = force_and_torque(
        floater_sources(floater(body)), rotor_table((CUBE,), "cuboid"), place[None], turn[None]
    )
    target.position, target.orientation = place, Rotation.from_matrix(turn)
    known = magpy.getFT(SOURCE, target, pivot="centroid", meshing=3000)
    assert np.linalg.norm(force[0] - known[0]) < 1e-4 * np.linalg.norm(force[0])
    assert np.linalg.norm(torque[0] - known[1]) < 1e-4 * np.linalg.norm(torque[0])


def test_a_sphere_is_its_dipole():
    ball = Floater(6.35e-3, 1.3, 1.05, 7500.0)
    table, turn = rotor_table((CUBE,), "cuboid"), turned(3)
    force, torque = force_and_torque(floater_sources(ball), table, PLACES, turn)
    field, gradient = table.evaluate(PLACES)
    moment = ball.moment * turn[:, :, 2]
    assert force == pytest.approx(np.einsum("ni,nij->nj", moment, gradient), rel=1e-12)
    assert torque == pytest.approx(np.cross(moment, field), rel=1e-12)


def test_charges_on_a_sphere_have_the_multipoles_of_an_expansion():
    random = np.random.default_rng(4)
    coefficients = np.tril(random.normal(size=(6, 6)) + 1j * random.normal(size=(6, 6)))
    coefficients[:, 0] = coefficients[:, 0].real
    coefficients[0] = 0.0
    expansion = MultipoleExpansion(np.array([1e-3, 0.0, 2e-3]), 6e-3, coefficients)
    places, charges = _charges(expansion, 3e-3)
    points = random.normal(size=(20, 3))
    points = expansion.center + 0.05 * points / np.linalg.norm(points, axis=1)[:, None]
    away = points[:, None] - places
    field = MU_0 / (4 * np.pi) * np.einsum("k,nki,nk->ni", charges, away, np.linalg.norm(away, axis=2) ** -3)
    assert field == pytest.approx(expansion.evaluate(points)[0], rel=1e-9, abs=1e-9 * np.abs(field).max())


def test_zonal_moments_of_a_cylinder():
    """Q_3 = 3 m (h²/12 - R²/4), and even degrees vanish."""
    body = BODIES[1]
    found = floater_sources(floater(body)).axial_moments(4)
    moment = 1.3 * body.volume / MU_0
    assert found[0] == pytest.approx(moment)
    assert found[2] == pytest.approx(3 * moment * (body.height**2 / 12 - body.radius**2 / 4))
    assert np.abs(found[[1, 3]]).max() < 1e-12 * abs(found[2])


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES, ids=["cuboid", "cylinder"])
def test_a_permeable_floater_pulls_the_rotor_as_the_rotor_pulls_it(body):
    """μr = 1.05: minus the force of the floater's own field by finite elements on the rigid cube's dipoles: 3e-5."""
    held = floater(body, 1.05)
    place, turn = PLACES[0], turned(1)[0]
    force, _ = force_and_torque(floater_sources(held), rotor_table((CUBE,), "cuboid"), place[None], turn[None])
    field = rotor_table((held.parts[0].magnet,), "fem", 5e-6, 4e-3)
    cube = Floater(CUBE.body.circumradius, 1.3, 1.0, 7500.0, None, Box((0.01,) * 3))
    # the cube, polarised along its z, as seen from the floater's axes
    axes = turn.T @ np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    seen = turn.T @ (CUBE.body.center - place)
    back, _ = force_and_torque(floater_sources(cube), field, seen[None], axes[None])
    apart = np.linalg.norm(turn @ back[0] + force[0]) / np.linalg.norm(force)
    rigid, _ = force_and_torque(floater_sources(floater(body)), rotor_table((CUBE,), "cuboid"), place[None], turn[None])
    worth = np.linalg.norm(rigid - force) / np.linalg.norm(force)
    print(f"reaction on the rotor: {apart:.1e} apart; μr is worth {worth:.1e}")
    assert apart < 3e-5
    assert worth > 1e-2


def test_sources_are_those_that_are_given():
    alone = FloaterSources(np.zeros((1, 3)), np.array([[0.0, 0.0, 2.0]]), np.zeros((0, 3)), np.zeros(0))
    assert alone.axial_moments(3) == pytest.approx([2.0, 0.0, 0.0])
