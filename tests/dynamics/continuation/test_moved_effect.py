"""Effects of a rotor that moves with a runtime parameter, against those of a table made for the moved rotor."""

from dataclasses import replace

import numpy as np
import pytest
from article import PERMEABLE

from spinlev.dynamics.continuation.map import equilibrium_map
from spinlev.dynamics.continuation.rotor_family import Move, MovedEffect, rotor_family
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.equations import equations_of_motion, parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.rotor_effects import Mutual, RotorCurrents
from spinlev.dynamics.motion.state import Parameter, Scales
from spinlev.fem.mutual.making import cached_mutual_table
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor_metal import ball_losses, pieces_of
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import Conductor, horizontal, tilt, vertical
from spinlev.geometry.scene.contents import Drag, Scene

SHAPE = (10e-3, 1.305, 1.05)
MOVES = [(horizontal, 2e-3, Move((1.0, 0.0, 0.0))), (tilt, np.radians(12.0), Move(turning=True))]


def scene_of(rotor):
    return Scene(110.0, rotor, PERMEABLE, Drag(0.0, 0.0))


def conducting(rotor):
    return tuple(replace(magnet, conductivity=6.7e5) for magnet in rotor)


def states(number):
    """Scaled states some radii below the rotor, of any motion."""
    generator = np.random.default_rng(3)
    found = generator.normal(size=(number, 12)) * 0.3 - 3.4 * np.eye(12)[2]
    found[:, 6:9] /= np.linalg.norm(found[:, 6:9], axis=1)[:, None]
    return found


@pytest.mark.parametrize(("make", "measure", "move"), MOVES)
@pytest.mark.slow
def test_a_moved_effect_is_that_of_the_moved_rotor(make, measure, move):
    """Rates and derivatives, as expressions and about a pose, of currents and answers: the same to round-off."""
    cube, there = (tuple(replace(m, transverse_permeability=1.05) for m in make(x, *SHAPE)) for x in (0.0, measure))
    scene = scene_of(there)
    kinds = {
        "currents": lambda rotor: RotorCurrents(ball_losses(pieces_of(conducting(rotor), ()), degree=2)),
        "answers": lambda rotor: Mutual(cached_mutual_table(rotor, PERMEABLE, print)[0], PERMEABLE.moment),
    }
    field = rotor_table(there, "dipole")
    values = parameters(scene, Scales.of(scene))
    values[Parameter.MEASURE] = measure
    for name, effect in kinds.items():
        moved = MovedEffect(effect(cube), move, name)
        ours = Rates(Interaction(field, (moved,)))(states(4), values)
        theirs = Rates(Interaction(field, (effect(there),)))(states(4), values)
        bare = Rates(field)(states(4), values)
        for mine, other, rest in zip(ours, theirs, bare, strict=True):
            assert np.abs(other - rest).max() > 0
            np.testing.assert_allclose(mine, other, atol=1e-9 * np.abs(other - rest).max())


def test_its_power_is_that_of_the_moved_rotor():
    """As an expression, power and all: turned vectors have the same products."""
    import heyoka as hy

    make, measure, move = MOVES[1]
    cube, there = (conducting(make(x, *SHAPE)) for x in (0.0, measure))
    scene, found = scene_of(there), []
    for effect in (
        MovedEffect(RotorCurrents(ball_losses(pieces_of(cube, ()), degree=2)), move, "moved"),
        RotorCurrents(ball_losses(pieces_of(there, ()), degree=2)),
    ):
        equations = equations_of_motion(Interaction(rotor_table(there, "dipole"), (effect,)))
        power = hy.cfunc([equations.power, *equations.rates], list(equations.variables), compact_mode=True, opt_level=0)
        values = parameters(scene, Scales.of(scene))
        values[Parameter.MEASURE] = measure
        found.append(power(states(1)[0], pars=values[: power.nparams]))
    np.testing.assert_allclose(*found, rtol=1e-9)
    assert found[0][0] < 0


@pytest.mark.slow
def test_a_map_has_mutual_magnetisation():
    """Of a rotor between the map's own: places to 1e-9 m of a search with the tables of that rotor."""
    family = rotor_family(scene_of(tilt(0.0, *SHAPE)), "tilt", "cuboid", interaction="mutual")
    frequencies, measures = np.array([120.0, 125.0]), np.radians([9.5, 10.0])
    found = equilibrium_map(family, frequencies, measures)
    scene = family.at(120.0, measures[1])
    answers = Mutual(cached_mutual_table(scene.rotor, PERMEABLE, print)[0], PERMEABLE.moment)
    field = rotor_table(scene.rotor, "cuboid")
    expected, rigid = find_equilibria(scene, Interaction(field, (answers,))), find_equilibria(scene, field)
    here = (found.row == 0) & (found.column == 1)
    apart = [np.linalg.norm(found.position[here] - e.position, axis=1).min() for e in expected]
    assert here.sum() == len(expected)
    assert max(apart) < 1e-9
    assert abs(expected[0].position[2] - rigid[0].position[2]) > 3e-5


def test_what_no_table_holds_for_says_so():
    stack = scene_of(vertical(14e-3, *SHAPE))
    with pytest.raises(InputError, match="rigid or auto for a family of rotors whose magnets move against each other"):
        rotor_family(stack, "vertical", "cuboid", interaction="mutual")
    ring = Conductor(horizontal(0.0, *SHAPE)[0].box, 1e6)
    with pytest.raises(InputError, match="conductors must be left out of a family"):
        rotor_family(replace(stack, conductors=(ring,)), "vertical", "cuboid")
    fast = scene_of(tuple(replace(m, conductivity=6e7) for m in horizontal(0.0, *SHAPE)))
    with pytest.raises(InputError, match="must leave its skin depth large"):
        rotor_family(fast, "horizontal", "dipole")
    copper = scene_of(horizontal(0.0, *SHAPE))
    copper = replace(copper, frequency=50.0, floater=replace(copper.floater, conductivity=5.8e7))
    family = rotor_family(copper, "horizontal", "dipole")
    with pytest.raises(InputError, match=r"floater.conductivity_S_m must leave its skin depth large"):
        family.values([50.0, 400.0], 1e-3)
