"""Mutual magnetisation in the motion: known numbers of the default scene, derivatives, the ledger."""

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
from article import PERMEABLE, PERMEABLE_MAGNETS
from scipy.optimize import brentq
from second_opinions.both_bodies import added_to_body
from second_opinions.magnet_elements import element_ladder

from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.flights.balls import LARGE, SMALL, Balls, in_ball
from spinlev.dynamics.flights.batch import simulate_together
from spinlev.dynamics.flights.flight import Flight, displaced, integrate
from spinlev.dynamics.motion.body_shape import response_error
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.effects import mutual_choice, with_effects
from spinlev.dynamics.motion.equations import equations_of_motion, parameters
from spinlev.dynamics.motion.events import rotor_gap
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.rotor_effects import Mutual
from spinlev.dynamics.motion.state import Parameter, Scales, State
from spinlev.fem.mutual.making import cached_mutual_table
from spinlev.fem.mutual.response import Wrench, two_body
from spinlev.fem.rotor.choice import cached_rotor_table, rotor_table
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import Magnet, horizontal, tilt, vertical
from spinlev.geometry.scene.contents import Drag, Scene
from spinlev.geometry.shapes import Box, Cylinder
from spinlev.geometry.solids import moved

SCENE = Scene(110.0, PERMEABLE_MAGNETS, PERMEABLE, Drag(0.0, 0.0))
SCALES = Scales.of(SCENE)


def interaction(scene):
    table = cached_rotor_table(scene.rotor, "fem", 3e-6, print, scene.floater.radius)[0]
    answers = cached_mutual_table(scene.rotor, scene.floater, print)[0]
    return Interaction(table, (Mutual(answers, scene.floater.moment),))


@pytest.fixture(scope="module")
def mutual():
    return interaction(SCENE)


@pytest.fixture(scope="module")
def start(mutual):
    return find_equilibria(SCENE, mutual)[0]


def test_the_default_rotor_moves_its_floater_as_known(mutual, start):
    """PHYSICS.md, tiles and Newell's tensors: 8.5504 ± 0.001 mN at the rigid equilibrium, and 0.0902 mm higher.

    The table knows the force to 2e-4.
    """
    rigid = find_equilibria(SCENE, mutual.field)[0]
    state, values = SCALES.pack(rigid.state)[None], parameters(SCENE, SCALES)
    change = Rates(mutual)(state, values)[0] - Rates(mutual.field)(state, values)[0]
    force = change[0, 3:6] * PERMEABLE.mass * SCALES.length / SCALES.time**2
    print(f"force {force[2] * 1e3:.5f} mN, {1e3 * (start.position[2] - rigid.position[2]):.5f} mm higher")
    assert force[2] * 1e3 == pytest.approx(8.5504, abs=0.001)
    assert start.position[2] - rigid.position[2] == pytest.approx(0.0902e-3, abs=0.0001e-3)
    assert start.position_error < 2e-7


def test_rates_and_their_derivatives_agree(mutual, start):
    """What stands for the table about a pose has its second derivatives: against differences of the rates."""
    rates, values, state = Rates(mutual), parameters(SCENE, SCALES), SCALES.pack(start.state)
    slope, step = rates(state[None], values)[1][0], 1e-6
    for k in (0, 1, 2, 6, 7, 8):
        ends = state + step * np.array([1, -1])[:, None] * np.eye(12)[k]
        found = rates(ends, values)[0]
        np.testing.assert_allclose((found[0] - found[1]) / (2 * step), slope[:, k], atol=1e-8 * np.abs(slope).max())


def test_rough_rates_leave_out_all_answers_but_the_uniform_one(mutual, start):
    """A search begins with them: they are the rates with a table whose points answer nothing."""
    table = mutual.effects[0].table
    nothing = [{name: 0 * getattr(g, name) for name in ("strengths", "degrees", "returned")} for g in table.grids]
    grids = [replace(grid, **zeros) for grid, zeros in zip(table.grids, nothing, strict=True)]
    silent = replace(
        table, grids=tuple(grids), coupling=0 * table.coupling, pairs=0 * table.pairs, mixed=0 * table.mixed
    )
    state, values, rates = SCALES.pack(start.state)[None], parameters(SCENE, SCALES), Rates(mutual)
    rough = rates.rough(state, values)
    for part, known in zip(
        rough, Rates(replace(mutual, effects=(Mutual(silent, PERMEABLE.moment),)))(state, values), strict=True
    ):
        np.testing.assert_allclose(part, known, rtol=1e-12, atol=1e-12)
    assert np.abs(rough[0] - rates(state, values)[0]).max() > 1e-4


def test_a_small_floater_is_compared_where_the_table_reaches():
    """Two of its radii below a large magnet a table of finite elements does not know the field."""
    cube = horizontal(0.0, 10e-3, 1.2, 1.05)
    table, reach = rotor_table(cube, "cuboid"), 5e-3 + 4e-3

    class Far:
        model = "fem"

        def in_range(self, points):
            return np.asarray(points)[:, 2] < -reach

        def evaluate(self, points):
            assert self.in_range(points).all()
            return table.evaluate(points)

    small = replace(SCENE, rotor=cube, floater=replace(PERMEABLE, radius=1.5e-3))
    included, why = mutual_choice(small, Far(), "auto", 1e-6)
    assert included
    assert "of the force near the rotor" in why
    tiny = replace(small, floater=replace(PERMEABLE, radius=0.5e-3))
    included, why = mutual_choice(tiny, Far(), "auto", 1e-6)
    assert not included
    assert "so small a floater needs 4096 points in the magnets" in why
    with pytest.raises(InputError, match="for a floater so small beside its magnets"):
        mutual_choice(replace(tiny, floater=replace(PERMEABLE, radius=1e-6)), Far(), "mutual", 1e-6)


@pytest.mark.parametrize("formula", [SMALL, LARGE])
def test_in_a_ball_force_and_torque_come_from_one_energy(mutual, start, formula):
    """∇J · rates = 0 at any state in the ball, and the rates are those of the table."""
    equations = equations_of_motion(in_ball(mutual, formula))
    slopes = [hy.diff(hy.sum(list(equations.jacobi)), v) for v in equations.variables]
    terms = [a * b for a, b in zip(slopes, equations.rates, strict=True)]
    function = hy.cfunc([*terms, *equations.rates], list(equations.variables), compact_mode=True, opt_level=0)
    numbers, error = Balls(SCENE, mutual).at(formula, 2e-4, 0.1, start.position)
    values = np.concatenate([parameters(SCENE, SCALES), [0.0], numbers])
    states = np.tile(SCALES.pack(start.state), (6, 1))
    generator = np.random.default_rng(2)
    states[:, :3] += 0.02 * generator.normal(size=(6, 3))
    states[:, 3:] += 0.1 * generator.normal(size=(6, 9))
    states[:, 6:9] /= np.linalg.norm(states[:, 6:9], axis=1)[:, None]
    found = function(np.ascontiguousarray(states.T), pars=np.tile(values[: function.nparams, None], 6)).T
    assert np.abs(found[:, :-12].sum(axis=1)).max() < 1e-13 * np.abs(found).max()
    exact = Rates(mutual)(states, parameters(SCENE, SCALES))[0]
    weight = values[Parameter.GRAVITY_Z]
    assert error < 1e-5
    assert np.abs(found[:, -12:] - exact)[:, 3:6].max() < 1e-4 * abs(weight)  # 1e-4 mm at the default bounce
    np.testing.assert_allclose(found[:, -12:], exact, atol=1e-5 * np.abs(exact).max())


def test_a_kicked_floater_keeps_the_jacobi_integral(mutual, start):
    kicked = replace(start.state, velocity=start.state.velocity + np.array([5e-3, 3e-3, 12e-3]))
    flight = integrate(Flight(SCENE, mutual, 1.0, compact=True), kicked, 1.0)
    assert flight.ended_by == "duration"
    assert flight.energy_error < 1e-12
    assert np.ptp(flight.lab.position[:, 2]) > 1e-4


@pytest.mark.slow
def test_a_floater_that_swings_wide_moves_as_by_the_tables_energy(mutual, start):
    """In balls ahead of it, alone and in lanes; the balls' force errs by 1e-5, of which most averages out."""
    flight = Flight(SCENE, mutual, 0.3, compact=True)
    begun = displaced(start.state, np.array([3e-4, 0.0, 0.0]), SCENE.angular_velocity)
    near = integrate(flight, begun, 0.3)
    whole = integrate(Flight(SCENE, mutual, 0.3, compact=True, in_balls=False), begun, 0.3)
    (lane,) = simulate_together([SCENE], mutual, [begun], 0.3)
    assert np.hypot(*near.lab.position[:, :2].T).max() > 2e-3
    assert 0 not in flight.parts
    assert near.field_changes.count > 50
    assert near.energy_error < 1e-12
    assert np.abs(near.lab.position - whole.lab.position).max() < 5e-7
    assert np.abs(near.lab.position - lane.lab.position).max() < 1e-10


def test_a_floater_at_its_equilibrium_stays_there(mutual, start):
    """The search and the flight have the energy in two forms; they part by the error of the ball."""
    flight = integrate(Flight(SCENE, mutual, 0.5, compact=True), start.state, 0.5)
    assert np.ptp(flight.lab.position[:, 2]) < 2e-7


def test_flights_in_lanes_of_which_some_stay_empty_are_those_alone(mutual, start):
    """Three side by side: where nobody flies the equations are asked for all the same, and must be finite."""
    scenes = [replace(SCENE, frequency=frequency) for frequency in (109.0, 110.0, 111.0)]
    begun = replace(start.state, position=start.state.position + np.array([0.0, 0.0, 1e-4]))
    flown = simulate_together(scenes, mutual, [begun] * 3, 0.1)
    for scene, found in zip(scenes, flown, strict=True):
        alone = integrate(Flight(scene, mutual, 0.1, compact=True), begun, 0.1)
        assert np.abs(found.lab.position - alone.lab.position).max() < 1e-10 * 0.02
        assert found.energy_error < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rotor", "frequency", "part"),
    [
        (horizontal(1.5e-3, 10e-3, 1.305, 1.05), 150.0, 1e-3),
        (horizontal(3e-3, 10e-3, 1.305, 1.05), 100.0, 1e-3),
        (tilt(np.radians(10.0), 10e-3, 1.305, 1.05), 120.0, 1e-3),
        (vertical(14e-3, 10e-3, 1.305, 1.05), 75.0, 1e-3),
        (vertical(10e-3, 10e-3, 1.305, 1.05), 60.0, 1e-3),  # touching
    ],
)
def test_equilibria_of_other_rotors_against_both_bodies(rotor, frequency, part):
    """At the equilibrium the magnetostatics of both bodies differ by less than is stated, in force and in place.

    Where floaters levitate, a radius off the rotor and farther, by less than a part of the answers and 1e-4 mm.
    """
    scene = replace(SCENE, frequency=frequency, rotor=rotor)
    whole = interaction(scene)
    found = find_equilibria(scene, whole)[0]
    (fine,) = element_ladder(rotor, (3,))
    both = two_body(fine, PERMEABLE, found.position, found.state.moment, 0, 1e-8)
    added, (field, gradient) = both.total - both.rigid, whole.evaluate(found.position[None])
    force, _ = whole.effects[0].wrench(found.position[None], found.state.moment[None], field, gradient)
    apart, size = np.linalg.norm(force[0] - added.force), np.linalg.norm(added.force)
    stiffness = PERMEABLE.mass * (2 * np.pi * min(found.frequencies_hz)) ** 2  # of the bounce, the softest
    assert apart < whole.effects[0].table.relative_error(found.position)[0][0] * size
    assert apart / stiffness < found.position_error
    if min(magnet.box.distance(found.position) for magnet in rotor) > 2 * PERMEABLE.radius:
        assert apart < part * size
        assert apart / stiffness < 1e-7


def pose(scene, gap, direction, turn, aside):
    """Place (3,) m and axes (3, 3) of a floater whose surface is a gap (m) off the rotor's."""
    cosine, sine = np.cos(turn), np.sin(turn)
    moment = np.array(direction) / np.linalg.norm(direction)
    axes = scene.floater.axes(moment) @ np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    height = brentq(lambda z: rotor_gap(scene, np.array([*aside, z]), axes) - gap, -40e-3, -12e-3)
    return np.array([*aside, height]), axes


def added_in_motion(scene, place, axes):
    """Force and torque by which the equations with mutual magnetisation differ from those without."""
    floater, scales = scene.floater, Scales.of(scene)
    table = cached_rotor_table(scene.rotor, "fem", 1e-5, print, floater.inner_radius)[0]
    answers = cached_mutual_table(scene.rotor, floater.ball, print)[0]
    state = State(place, np.zeros(3), axes[:, 2], np.zeros(3), None if floater.round else axes)
    both, without = (
        Rates(with_effects(scene, one))(scales.pack(state)[None], parameters(scene, scales))[0][0]
        for one in (Interaction(table, (Mutual(answers, floater.moment),)), table)
    )
    change = both - without
    force = change[3:6] * floater.mass * scales.length / scales.time**2
    inertia = floater.inertia if floater.round else floater.principal_inertia
    turned = change[9:12] * inertia if floater.round else axes @ (change[10:13] * inertia)
    return Wrench(force, turned / scales.time**2)


BODIES = {"cube": Box((10e-3,) * 3), "cuboid": Box((9e-3, 12e-3, 6e-3)), "disc": Cylinder(7e-3, 5e-3)}


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
def test_of_other_shapes_mutual_magnetisation_has_the_stated_error(name):
    """Beside the article's cube, against one mesh of both bodies, which knows it to 1e-3: far from, near, nearest.

    The motion has the body's dipole, a sphere of its volume and its own polarizability. What is stated is not more than
    ten times what is found.
    """
    body = BODIES[name]
    floater = replace(PERMEABLE, radius=body.circumradius, body=body)
    scene, stated, missed = replace(SCENE, floater=floater), response_error(floater), []
    for gap, direction, turn, aside in (
        (9e-3, (-0.26, 0.1, 0.96), 0.4, (1e-3, 0.5e-3)),
        (5e-3, (0.9, 0.1, -0.3), 1.1, (1e-3, 0.5e-3)),
        (3e-3, (0.2, 0.3, 0.8), 0.2, (-2e-3, 1e-3)),
    ):
        place, axes = pose(scene, gap, direction, turn, aside)
        magnet = Magnet(moved(body, place, axes), (0.0, 0.0, floater.remanence), floater.recoil_permeability)
        exact = added_to_body(PERMEABLE_MAGNETS, magnet, 0.25)
        size, apart = float(np.linalg.norm(exact.force)), added_in_motion(scene, place, axes) - exact
        missed.append([np.linalg.norm(apart.force) / size, np.linalg.norm(apart.torque) / (size * floater.radius)])
        print(
            f"\n{name}, {1e3 * gap:.0f} mm off: {1e3 * size:.2f} mN added, {missed[-1][0]:.1%} of it missed, and of "
            f"the torque {missed[-1][1]:.1%} of it times the radius; {stated:.1%} stated"
        )
    assert np.max(missed) < stated
    assert np.max(missed) > stated / 10


@pytest.mark.parametrize("name", [*(pytest.param(name, marks=pytest.mark.slow) for name in ("cube", "cuboid")), "disc"])
def test_error_bars_have_what_the_response_misses_of_a_shape(name, mutual):
    """That part of the force that mutual magnetisation adds to a sphere of the body's volume, over the moment."""
    body = BODIES[name]
    scene = replace(SCENE, floater=replace(PERMEABLE, radius=body.circumradius, body=body))
    answers = Mutual(cached_mutual_table(scene.rotor, scene.floater.ball, print)[0], scene.floater.moment)
    known = Interaction(mutual.field, (answers,))
    places = np.array([[1e-3, 2e-3, -18e-3], [0.0, -4e-3, -22e-3]])
    field, gradient = known.evaluate(places)
    change = []
    for axis in 1e-6 * np.eye(3):
        energies = [
            np.array([answers.table.derivatives(places + way * axis, inner)[0] for way in (1, -1)])
            for inner in (m + answers.table.polarizability * field for m in answers.moment * np.eye(3))
        ]
        change.append([(ahead - behind) / 2e-6 for ahead, behind in energies])
    force = np.linalg.norm(change, axis=0).max(axis=0)
    of_field, of_gradient = np.subtract(with_effects(scene, known).relative_error(places), known.relative_error(places))
    stated = response_error(scene.floater) * force / answers.moment
    np.testing.assert_allclose(of_gradient * np.linalg.norm(gradient, axis=(1, 2)), stated, rtol=1e-5)
    np.testing.assert_allclose(of_field * np.linalg.norm(field, axis=1), stated * scene.floater.radius, rtol=1e-5)
