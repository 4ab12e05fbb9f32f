"""What effects are said to change of an equilibrium, against the equilibrium with and without them."""

from dataclasses import replace

import numpy as np
import pytest
from article import PERMEABLE

from spinlev.dynamics.equilibria.equilibrium import LOCKED
from spinlev.dynamics.equilibria.perturbed import growth_by_floater, growth_by_rotor, shift_by_mutual
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.rotor_effects import Mutual, RotorCurrents, rough_force
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.mutual.making import cached_mutual_table
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor_metal import ball_losses, pieces_of
from spinlev.geometry.magnets import Magnet, horizontal
from spinlev.geometry.scene.contents import Drag, Scene
from spinlev.geometry.shapes import Cylinder

SCENE = Scene(150.0, horizontal(1.5e-3, 10e-3, 1.305, 1.05), PERMEABLE, Drag(0.0, 0.0))
CONDUCTING = replace(SCENE, floater=replace(PERMEABLE, conductivity=6.7e5))
UNEVEN = replace(PERMEABLE, moments_of_inertia=tuple(PERMEABLE.inertia * np.array([1.0, 0.65, 1.25])))
LOSSES = ball_losses(pieces_of([replace(magnet, conductivity=6.7e5) for magnet in SCENE.rotor], ()))


@pytest.fixture(scope="module")
def table():
    return rotor_table(SCENE.rotor, "cuboid")


@pytest.fixture(scope="module")
def alone(table):
    return find_equilibria(SCENE, table)[0]


@pytest.fixture(scope="module")
def locked(table):
    """Of a sphere with three moments of inertia, at rest in the rotor's frame."""
    return nearest_locked(replace(SCENE, floater=UNEVEN), table)


def nearest_locked(scene, table):
    return min((e for e in find_equilibria(scene, table) if e.kind == LOCKED), key=lambda e: e.distance)


def with_rates(equilibrium, scene, rates):
    """The same place, with the Jacobian of other equations of motion there."""
    state, values = Scales.of(scene).pack(equilibrium.state), parameters(scene, Scales.of(scene), frozen_spin=True)
    return replace(equilibrium, jacobian=rates(state[None], values)[1][0])


@pytest.mark.slow
def test_shift_by_mutual_magnetisation(table, alone, locked):
    """To first order, 0.05 mm to a part in fifty; the rough force without the table to a factor of two."""
    answers = cached_mutual_table(SCENE.rotor, PERMEABLE, print)[0]
    effect = Mutual(answers, PERMEABLE.moment)
    there = find_equilibria(SCENE, Interaction(table, (effect,)))[0]
    moved = np.linalg.norm(there.position - alone.position)
    assert shift_by_mutual(SCENE, table, alone, answers) == pytest.approx(moved, rel=0.02)
    assert shift_by_mutual(SCENE, table, alone, None) == pytest.approx(moved, rel=1.0)
    scene = replace(SCENE, floater=UNEVEN)
    moved = np.linalg.norm(nearest_locked(scene, Interaction(table, (effect,))).position - locked.position)
    assert shift_by_mutual(scene, table, locked, answers) == pytest.approx(moved, rel=0.05)
    for depth in (15e-3, 20e-3, 30e-3):
        place, direction = np.array([[1e-3, 0.0, -depth]]), np.array([[0.2, 0.0, 0.98]])
        direction /= np.linalg.norm(direction)
        force = effect.wrench(place, direction, *table.evaluate(place))[0][0]
        rough = rough_force(SCENE.rotor, PERMEABLE, table, place[0], direction[0])
        assert 0.5 < np.linalg.norm(rough) / np.linalg.norm(force) < 2


def test_no_dipole_stands_for_a_ring_about_the_floater():
    """In its hole the shift was said to be 2e12 mm."""
    ring = Magnet(Cylinder(7e-3, 8e-3, inner_radius=3e-3), (1.2, 0.0, 0.2), 1.05)
    table, floater = rotor_table((ring,), "cuboid"), replace(PERMEABLE, radius=2.5e-3)
    inside, below = (rough_force((ring,), floater, table, np.array([0.0, 0.0, -z]), np.eye(3)[2]) for z in (7e-6, 7e-3))
    assert np.isnan(inside).all()
    assert 1e-4 < np.linalg.norm(below) < 1.0
    # a disc that lies on a cube is nearer to its centre than the sphere about it could be
    cube, disc = SCENE.rotor, replace(PERMEABLE, radius=7.2e-3, body=Cylinder(6.5e-3, 6e-3))
    place = cube[0].body.center - np.array([0.0, 0.0, 8.5e-3])
    assert np.isfinite(rough_force(cube, disc, rotor_table(cube, "cuboid"), place, np.eye(3)[2])).all()


def test_growth_by_the_currents_of_the_floater(table, alone):
    """By the eigenvalues of the motion with them; from the motion with and without them the same."""
    whole = with_effects(CONDUCTING, table)
    there = find_equilibria(CONDUCTING, whole)[0]
    said = growth_by_floater(CONDUCTING, table, alone, False)
    same = with_rates(alone, CONDUCTING, Rates(whole))
    assert growth_by_floater(CONDUCTING, table, same, True) == pytest.approx(said, rel=1e-9)
    assert growth_by_floater(CONDUCTING, table, there, True) == pytest.approx(said, rel=1e-3)
    assert 0.01 < said < 0.1
    assert said == pytest.approx(there.growth_per_s - alone.growth_per_s, rel=0.02)


@pytest.mark.slow
def test_growth_of_a_locked_body_by_the_currents_of_the_rotor(table, locked):
    scene = replace(SCENE, floater=UNEVEN)
    there = nearest_locked(scene, Interaction(table, (RotorCurrents(LOSSES),)))
    said = growth_by_rotor(scene, locked, LOSSES, False)
    assert said == pytest.approx(there.growth_per_s - locked.growth_per_s, rel=0.02)
    assert growth_by_rotor(scene, there, LOSSES, True) == pytest.approx(said, rel=1e-3)


def test_growth_by_the_currents_of_the_rotor(table, alone):
    """By the eigenvalues of the motion with them; from the motion with and without them the same."""
    whole = Interaction(table, (RotorCurrents(LOSSES),))
    there = find_equilibria(SCENE, whole)[0]
    said = growth_by_rotor(SCENE, alone, LOSSES, False)
    assert 0.01 < said < 0.1
    same = with_rates(alone, SCENE, Rates(whole))
    assert growth_by_rotor(SCENE, same, LOSSES, True) == pytest.approx(said, rel=1e-9)
    assert growth_by_rotor(SCENE, there, LOSSES, True) == pytest.approx(said, rel=1e-3)
    assert said == pytest.approx(there.growth_per_s - alone.growth_per_s, rel=0.02)
