"""Balls of a body that is not round, about an equilibrium: mirrored, centred, cheap; and numbers in its code."""

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
from article import NO_DRAG, SCENE
from places import SCENES

from spinlev.dynamics.flights import balls as balls_module
from spinlev.dynamics.flights.flight import Flight, initial_state, integrate, simulate
from spinlev.dynamics.motion import floater_effects
from spinlev.dynamics.motion.body_shape import BodyShape, InducedShape
from spinlev.dynamics.motion.effect import SMALLEST, Interaction
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.equations import equations_of_motion
from spinlev.fem.harmonics.interior import Ball, BallField
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import tilt
from spinlev.geometry.scene.contents import AbsoluteStart
from spinlev.geometry.scene.files import load_scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box, rotation_matrix
from spinlev.geometry.solids import moved
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation

CUBE = Floater(0.01 * 3**0.5 / 2, 1.3, 1.0, 7500.0, None, Box((0.01,) * 3))
ROTOR = tilt(np.radians(10.0), Box((0.01,) * 3), 1.305, 1.0)
TABLE = rotor_table(ROTOR, "cuboid")
SPHERE = replace(SCENE, frequency=130.0, rotor=ROTOR)
LEVITATING = replace(SPHERE, floater=CUBE)
PLACE = np.array([0.5e-3, 0.0, -18e-3])


@pytest.fixture(scope="module")
def start():
    known = Levitation(LEVITATING, Models("cuboid", "none", interaction="rigid")).equilibria
    return initial_state(LEVITATING, TABLE, known)[0]


def in_balls(scene, table, duration):
    return Flight(scene, table, duration, in_balls=True)


def first_ball(scene, table, state):
    """Its number, and its centre (3,) m and radius m."""
    flight = in_balls(scene, table, 1.0)
    values = flight.begin(state, 1.0, offset=flight.offset).values
    first = balls_module.DEGREE + 1
    return flight.degree(values), values[first : first + 3], 1 / values[first + 3]


def test_a_mirrored_ball_is_the_whole_field_in_the_rotors_mirror_plane():
    """The article's cube is its own mirror image in y; beside that plane the field is not, and the error says so."""
    plain, mirrored = BallField(0, SMALLEST), BallField(0, SMALLEST, True)
    ball = Ball(PLACE, 0.5e-3)
    whole, half = (formula.fit(TABLE.evaluate, ball) for formula in (plain, mirrored))
    assert half[0] == pytest.approx(whole[0], abs=1e-12 * np.abs(whole[0]).max())
    position = hy.make_vars("x", "y", "z")
    written = [sum(len(e) for e in formula.expressions(position)[0]) for formula in (plain, mirrored)]
    assert written[1] < 0.6 * written[0]
    beside = Ball(PLACE + np.array([0.0, 0.5e-3, 0.0]), 0.5e-3)
    assert mirrored.fit(TABLE.evaluate, beside)[1] > 100 * plain.fit(TABLE.evaluate, beside)[1]


def test_a_cube_begins_in_a_mirrored_ball_about_the_middle_of_its_way(start):
    """Or in a plain one, where the rotor's mirror plane is turned; from an equilibrium alone is one so small."""
    number, center, radius = first_ball(LEVITATING, TABLE, start)
    assert number == -SMALLEST
    flown = integrate(in_balls(LEVITATING, TABLE, 0.12), start, 0.12)
    middle = flown.rotor.position.mean(axis=0)
    assert np.linalg.norm(middle - center) < 1.5 * balls_module.FINE * CUBE.radius
    assert np.linalg.norm(middle - start.position) > balls_module.FINE * CUBE.radius
    assert np.linalg.norm(flown.rotor.position - center, axis=1).max() < radius
    turn = rotation_matrix((0.0, 0.0, 30.0))
    turned = tuple(replace(m, body=moved(m.body, turn @ m.body.center, turn @ m.body.rotation)) for m in ROTOR)
    scene, table = replace(LEVITATING, rotor=turned), rotor_table(turned, "cuboid")
    vectors = (vector @ turn.T for vector in start.vectors)
    aside = type(start)(*vectors, axes=turn @ start.axes)
    number, there, _ = first_ball(scene, table, aside)
    assert number == SMALLEST
    assert there == pytest.approx(turn @ center, abs=2 * balls_module.FINE * CUBE.radius)
    told = AbsoluteStart(start.position, start.velocity, start.moment, start.spin, start.axes[:, 0])
    assert first_ball(replace(LEVITATING, start=told), TABLE, start)[0] == 6


def test_a_cube_moves_in_small_balls_as_in_a_large_one(start, monkeypatch):
    """5 µm in a tenth of a second of swinging by 0.4 mm, and a mean distance to 1 µm in a second.

    What a flight leaves out of the multipoles anyway is 100 µm in a second, and 25 µm in the mean.
    """
    found = []
    for kinds in (balls_module.OF_BODIES, balls_module.OF_BODIES[-1:]):
        monkeypatch.setattr(balls_module, "OF_BODIES", kinds)
        flown = integrate(in_balls(LEVITATING, TABLE, 1.0), start, 1.0)
        assert flown.field_changes.count == 0
        found.append(flown.rotor.position)
    apart = np.linalg.norm(found[0] - found[1], axis=1)
    print(f"\napart {1e6 * apart[: len(apart) // 10].max():.1f} µm in 0.1 s, {1e6 * apart.max():.1f} µm in 1 s")
    assert apart[: len(apart) // 10].max() < 5e-6
    means = [np.linalg.norm(place, axis=1).mean() for place in found]
    assert means[0] == pytest.approx(means[1], abs=1e-6)


def test_a_cube_keeps_its_energy(start):
    """1e-13 in a second is 1e-12 in ten, as the drift is steady: 5e-14 here, and 1.2e-13 by steps of order 16."""
    flown = integrate(in_balls(LEVITATING, TABLE, 1.0), start, 1.0)
    print(f"\nenergy balance {flown.energy_error:.1e} in 130 turns")
    assert flown.energy_error < 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("effects", ["rigid", "mutual"])
@pytest.mark.parametrize("name", ["horizontal", "explicit-magnets", "tilt-over-plate", "vertical-24h"])
def test_a_cube_keeps_its_energy_for_ten_seconds(name, effects):
    """1e-12, without plate and drag, of a cube of the sphere's volume by finite elements."""
    scene = replace(load_scene(SCENES / f"{name}.toml"), plate=None, drag=NO_DRAG)
    box = Box((scene.floater.volume ** (1 / 3),) * 3)
    scene = replace(scene, floater=replace(scene.floater, radius=box.circumradius, body=box))
    levitation = Levitation(scene, Models("fem", "none", interaction=effects))
    flown = simulate(scene, levitation.interaction, 10.0, levitation.equilibria)
    print(f"\n{name}, {effects}: energy balance {flown.energy_error:.1e} in {flown.steps} steps")
    assert flown.ended_by == "duration"
    assert flown.energy_error < 1e-12


def test_a_cube_costs_what_its_steps_cost(start):
    """A step has 0.81 of the operations of a sphere's in balls, and a turn 2.3 times its steps at most."""
    ball = initial_state(SPHERE, TABLE)[0]
    flights = in_balls(LEVITATING, TABLE, 0.05), in_balls(SPHERE, TABLE, 0.05)
    flown = [integrate(flight, begun, 0.05) for flight, begun in zip(flights, (start, ball), strict=True)]
    cube, sphere = (len(next(iter(flight.parts.values())).integrator.decomposition) for flight in flights)
    print(f"\noperations: cube {cube}, sphere {sphere}; steps: {flown[0].steps}, {flown[1].steps}")
    assert cube < 0.85 * sphere
    assert flown[0].steps < 2.3 * flown[1].steps


def test_numbers_in_the_code_are_the_parameters(start):
    """A cube's rates with its numbers written in, and with all of them as runtime parameters: round-off."""
    flight = in_balls(LEVITATING, TABLE, 1.0)
    course = flight.begin(start, 1.0, offset=flight.offset)
    number = flight.degree(course.values)
    whole = balls_module.in_ball(flight.whole, BallField(balls_module.DEGREE + 1, abs(number), number < 0))
    found = []
    written = equations_of_motion(whole, first=flight.first, frame=flight.scales.frame)
    for equations in (flight.equations(number)[0], written):
        function = hy.cfunc([*equations.rates, *equations.jacobi, equations.power], equations.variables, opt_level=0)
        found.append(function(course.state[:-1], pars=course.values[: function.nparams]))
    assert found[0] == pytest.approx(found[1], rel=1e-12, abs=1e-13)


def test_what_is_induced_alike_in_all_directions_turns_nothing(monkeypatch):
    """As a moment in the field, or turned into the body and back."""
    effect, found = InducedShape(2e-6 * np.eye(3)), []
    values = in_balls(LEVITATING, TABLE, 1.0).values
    for allowed in (floater_effects.EVEN, -1.0):
        monkeypatch.setattr(floater_effects, "EVEN", allowed)
        equations = equations_of_motion(Interaction(TABLE, (effect,), turning=True))
        function = hy.cfunc([*equations.rates, equations.jacobi[-1]], equations.variables, opt_level=0)
        state = np.concatenate([PLACE / CUBE.radius, [0.1, -0.2, 0.3], [0.5, -0.5, 0.1, 0.7], [0.2, 0.3, -0.4]])
        state[6:10] /= np.linalg.norm(state[6:10])
        found.append(function(state, pars=values[: function.nparams]))
    assert found[0] == pytest.approx(found[1], rel=1e-13, abs=1e-14)
    assert found[0][-1]


def test_what_the_floaters_dipole_misses_is_a_dipole_along_its_axes():
    """A cube with a moment that is a hundredth stronger, and turned by as much: force and torque on it, and energy."""
    start = AbsoluteStart(PLACE - [0.0, 0.0, 2e-3], np.zeros(3), np.array([-0.2, 0.1, 1.0]), np.zeros(3))
    scene = replace(LEVITATING, start=start)
    shape = next(e for e in with_effects(scene, TABLE).effects if isinstance(e, BodyShape))
    missed = 0.01 * CUBE.moment * np.array([1.0, 0.0, 1.0])
    sources = replace(
        shape.sources,
        places=np.concatenate([shape.sources.places, np.zeros((1, 3))]),
        moments=np.concatenate([shape.sources.moments, missed[None]]),
    )
    found = []
    for one in (shape, replace(shape, sources=sources)):
        flight = Flight(scene, Interaction(TABLE, (one,), turning=True), 0.1)
        state = initial_state(scene, TABLE)[0]
        course = flight.begin(state, 0.1)
        equations, scales = flight.equations(flight.degree(course.values))[0], flight.scales
        function = hy.cfunc(
            list(equations.rates[: scales.size]), list(equations.variables), compact_mode=True, opt_level=0
        )
        rates = function(course.state[:-1], pars=course.values[: function.nparams])
        turned = scales.unpack(np.append(course.state[: scales.size - 3], rates[-3:])).spin * scales.time  # from rest
        found.append(np.concatenate([CUBE.mass * rates[3:6], CUBE.inertia / CUBE.radius * turned]))
        assert one.rest == pytest.approx(missed if one is not shape else np.zeros(3), abs=1e-12)
    moment = state.axes @ missed
    field, gradient = (part[0] for part in TABLE.evaluate(state.position[None]))
    known = np.concatenate([moment @ gradient, np.cross(moment, field) / CUBE.radius])
    unit = np.repeat([scales.length, 1.0], 3) / scales.time**2
    # the gradient of a ball errs by 1e-5
    assert unit * (found[1] - found[0]) == pytest.approx(known, abs=1e-4 * np.linalg.norm(known))
    flown = simulate(scene, Interaction(TABLE, (replace(shape, sources=sources),), turning=True), 0.03)
    assert flown.energy_error < 1e-12
