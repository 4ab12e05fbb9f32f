"""The fields of a plate's currents in a ball: against the table everywhere in it, and in the equations of motion."""

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
from article import FLOATER, MAGNETS, RADIUS

from spinlev.dynamics.flights.plate_balls import SHARE, PlateBall, PlateBalls
from spinlev.dynamics.flights.plate_formula import PlateInBall, WholePlate
from spinlev.dynamics.flights.plate_harmonics import local_harmonics
from spinlev.dynamics.motion.equations import equations_of_motion, parameters
from spinlev.dynamics.motion.plate import PlateMemory, seen_by_plate
from spinlev.dynamics.motion.state import Parameter, Scales, State
from spinlev.fem.harmonics.local import sphere_fit
from spinlev.fem.plate.region import Region
from spinlev.fem.plate.slab_network import slab_and_rotor_table
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.scene.contents import Drag, Lowering, Plate, Scene
from spinlev.geometry.shapes import Box

PLATE = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.047)), 3.5e7, Lowering(0.05, 0.02, 4e-3))
SCENE = Scene(110.0, MAGNETS, FLOATER, Drag(0.0, 0.0), plate=PLATE)
REGION = Region(np.array([-3e-3, -3e-3, 0.024]), np.array([3e-3, 3e-3, 0.037]))
TABLE = rotor_table(MAGNETS, "dipole")
FIRST = len(Parameter)


@pytest.fixture(scope="module")
def memory():
    return PlateMemory(PLATE, *slab_and_rotor_table(PLATE, TABLE, REGION, rtol=1e-2), "slab")


@pytest.fixture(scope="module")
def balls(memory):
    return PlateBalls(memory, RADIUS)


@pytest.fixture(scope="module")
def fine():
    """Balls of a finer network, of which a floater in one place hears only a part."""
    return PlateBalls(PlateMemory(PLATE, *slab_and_rotor_table(PLATE, TABLE, REGION, rtol=1e-3), "slab"), RADIUS)


def with_key(values):
    """Runtime parameters with room for a ball's key at their end."""
    return np.concatenate([values, np.zeros(5)])


def hanging(place, scene=SCENE):
    """Scaled state of a floater that turns with the rotor at a place (3,) m."""
    turning = np.array([0.0, 0.0, scene.angular_velocity])
    state = State(np.array(place), np.cross(turning, place), np.array([0.1, 0.0, 0.995]), turning)
    return np.append(Scales.of(scene).pack(state), 0.0)


VALUES = with_key(parameters(SCENE, Scales.of(SCENE)))
STATE = hanging((0.5e-3, 0.2e-3, -19.6e-3))


@pytest.mark.parametrize("degree", [4, 7])
def test_heard_and_felt_are_a_harmonic_and_its_derivatives(degree):
    """Field by differences of what a source hears, gradient by differences of the field: 1e-8."""
    known = local_harmonics(degree)
    x, source = hy.make_vars("x", "y", "z"), hy.make_vars("u", "v", "w")
    strengths = np.random.default_rng(0).normal(size=known.count)
    basis, given = known.basis(x), [hy.expression(float(s)) for s in strengths]
    slope = known.gradient(basis, given)
    outputs = [*known.heard(basis, source), *known.field(basis, given), *slope.values()]
    function = hy.cfunc(outputs, [*x, *source], compact_mode=True, opt_level=0)
    place, step = np.array([0.3, -0.4, 0.5]), 1e-5

    def at(point, direction):
        return function(np.array([*point, *direction]))

    units = np.eye(3)
    heard = np.array([at(place, unit)[: known.count] for unit in units])
    field = at(place, units[0])[known.count : known.count + 3]
    np.testing.assert_allclose(heard @ strengths, field, rtol=1e-12, atol=1e-12)
    ahead, behind = ([at(place + s * unit, units[0])[known.count :][:3] for unit in units] for s in (step, -step))
    matrix = (np.array(ahead) - np.array(behind)) / (2 * step)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-8)
    assert abs(np.trace(matrix)) < 1e-8
    for (i, j), value in zip(slope, at(place, units[0])[known.count + 3 :], strict=True):
        assert value == pytest.approx(matrix[i, j], abs=1e-8)


@pytest.mark.parametrize("place", [(0.5e-3, 0.2e-3, -19.6e-3), (2.9e-3, 1.0e-3, -18.0e-3), (0.0, 0.0, -22e-3)])
def test_a_ball_misses_no_more_of_reaction_tensors_than_a_tenth_of_what_the_table_does(balls, memory, place):
    """At 200 places inside, against the table's own multipoles, at three frequencies."""
    ball = balls.around(0.0, hanging(place), VALUES)
    points = np.random.default_rng(1).normal(size=(200, 3))
    points *= (np.random.default_rng(2).uniform(size=200) / np.linalg.norm(points, axis=1))[:, None]
    known, (weights, said) = local_harmonics(ball.degree), balls._expanded(ball)
    assert said <= SHARE * memory.table.errors.total
    x = hy.make_vars("x", "y", "z")
    basis = known.basis(x)
    ones = [known.field(basis, [hy.expression(float(w)) for w in row]) for row in weights]
    fields = hy.cfunc([f for one in ones for f in one], x, compact_mode=True, opt_level=0)(
        np.ascontiguousarray(points.T)
    )
    near = np.moveaxis(fields.reshape(len(weights), 3, -1), -1, 0)
    exact = np.einsum(
        "nka,ik->nia", memory.table.multipoles.fields(ball.center + ball.radius * points), memory.table.weights
    )
    for frequency in (1.0, 20.0, 200.0):
        response = 1 / (memory.table.rates + 2j * np.pi * frequency)
        told, right = (np.einsum("i,nia,nib->nab", response, b, b) for b in (near, exact))
        assert np.abs(told - right).max() < 2 * said * np.abs(right).max()


def test_about_the_middle_of_a_plate_each_state_has_few_harmonics(balls, memory):
    """Over a slab, those of one order and one parity; none that is left out has a weight beyond round-off."""
    ball = PlateBall(np.array([0.0, 0.0, 0.0274]), 2e-3, 5)
    kind, _ = balls.told(ball, FIRST, VALUES)
    weights, present = balls._expanded(ball)[0], balls._present(ball)
    assert kind.pattern.sum() < kind.pattern.size / 6
    assert np.abs(weights[~present]).max() < 1e-9 * np.abs(weights[:, :3]).max()
    told = balls.fewer(ball).directions.T @ weights
    assert np.abs(told[~kind.pattern]).max() < 1e-9 * np.abs(weights[:, :3]).max()


@pytest.mark.parametrize("place", [(0.5e-3, 0.2e-3, -19.6e-3), (2.9e-3, 1.0e-3, -18.0e-3), (0.0, 0.0, -22e-3)])
def test_fewer_states_miss_no_more_of_reaction_tensors_than_a_tenth_of_what_the_table_does(fine, place):
    """Inside the ball, at 25 frequencies, most of which the choice does not look at; against all states' harmonics."""
    ball, memory = fine.around(0.0, hanging(place), VALUES), fine.memory
    fewer, weights = fine.fewer(ball), fine._expanded(ball)[0]
    assert len(fewer.rates) < len(weights)
    np.testing.assert_allclose(fewer.directions.T @ fewer.directions, np.eye(len(fewer.rates)), atol=1e-12)
    known, x = local_harmonics(ball.degree), hy.make_vars("x", "y", "z")
    basis, units = (
        known.basis(x),
        [[hy.expression(float(k == j)) for k in range(known.count)] for j in range(known.count)],
    )
    functions = hy.cfunc([f for unit in units for f in known.field(basis, unit)], x, compact_mode=True)
    points = np.random.default_rng(5).uniform(-1, 1, size=(60, 3))
    points = points[np.linalg.norm(points, axis=1) < 1]
    fields = functions(np.ascontiguousarray(points.T)).reshape(known.count, 3, -1)
    for omega in 2 * np.pi * np.geomspace(*memory.table.frequencies, 25):
        exact, told = (
            np.einsum("i,ik,kan,il,lbn->nab", 1j * omega / (rates + 1j * omega), w, fields, w, fields, optimize=True)
            for rates, w in ((memory.table.rates, weights), (fewer.rates, fewer.weights))
        )
        assert np.abs(told - exact).max() < 1.2 * SHARE * memory.table.errors.total * np.abs(exact).max()


def test_fewer_states_are_passive_and_silent_towards_a_floater_at_rest(fine):
    """All rates within those of the plate; signals of a floater at rest leave no currents."""
    ball, memory = fine.around(0.0, STATE, VALUES), fine.memory
    fewer, reduction = fine.fewer(ball), fine.reduction(ball, VALUES)
    slowest, fastest = memory.table.rates.min(), memory.table.rates.max()
    assert np.all((slowest * (1 - 1e-9) < fewer.rates) & (fewer.rates < fastest * (1 + 1e-9)))
    resting = np.concatenate([STATE[:12], reduction.signals(0.3, STATE), [0.0]])
    own = reduction.own(resting)
    kind, numbers = fine.told(ball, FIRST, VALUES)
    rates = rates_of(PlateInBall(memory, kind, FIRST), numbers, own[:-1], 0.3)[12:-2]
    moving = np.abs(VALUES[Parameter.TIME] * fewer.rates * own[12:-1]).max()
    assert np.abs(rates).max() < SHARE * memory.table.errors.total * moving


def test_from_all_states_to_fewer_and_back(fine):
    """What the ball tells comes back to round-off, and so do all states of a floater at rest."""
    ball = fine.around(0.0, STATE, VALUES)
    reduction = fine.reduction(ball, VALUES)
    own = np.concatenate([STATE[:12], np.random.default_rng(4).normal(size=reduction.directions.shape[1]), [0.7]])
    np.testing.assert_allclose(reduction.own(reduction.whole(0.4, own)), own, rtol=0, atol=1e-12)
    resting = np.concatenate([STATE[:12], reduction.signals(0.4, STATE), [0.7]])
    np.testing.assert_allclose(reduction.whole(0.4, reduction.own(resting)), resting, rtol=0, atol=1e-12)


def test_there_is_no_ball_for_a_moving_plate_or_a_flight_across_it(balls):
    moving, flung = VALUES.copy(), STATE.copy()
    moving[Parameter.PLATE_SPEED] = 1e-3
    flung[3] += 5.0
    assert balls.around(0.0, STATE, moving) is None
    assert balls.around(0.0, flung, VALUES) is None
    assert balls.holds(0.0, STATE, moving)


def test_a_floater_that_leaves_its_ball_gets_a_wider_one_of_the_same_kind(balls):
    ball, values = balls.around(0.0, STATE, VALUES), VALUES.copy()
    values[-5:] = ball.key
    assert balls.holds(0.0, STATE, values)
    away = STATE.copy()
    away[2] += ball.radius / RADIUS * 1.1
    assert not balls.holds(0.0, away, values)
    following = balls.around(0.0, away, values)
    values[-5:] = following.key
    assert following.radius > ball.radius
    assert balls.holds(0.0, away, values)
    again = away.copy()
    again[2] += following.radius / RADIUS * 1.1
    assert balls.told(balls.around(0.0, again, values), FIRST, values)[0] == balls.told(following, FIRST, values)[0]


def rates_of(formula, numbers, states, time, values=VALUES):
    """Rates (n, states) of all states, and the sum of the Jacobi integral's terms less what is spent."""
    equations = equations_of_motion(TABLE, plate=formula)
    outputs = [*equations.rates, hy.sum(list(equations.jacobi)), equations.power]
    function = hy.cfunc(outputs, list(equations.variables), compact_mode=True, opt_level=0)
    pars = np.concatenate([values[: formula.first], numbers])[: function.nparams]
    return function(states, pars=pars, time=time)


@pytest.mark.parametrize("depth", [0.0, 4e-3])
def test_the_plate_acts_in_a_ball_as_by_its_table(balls, memory, depth):
    """All rates of floater and plate, at rest above and below its way: within a fifth of the table's error.

    Currents are those that the ball tells; the plate's states are compared as these are.
    """
    values = VALUES.copy()
    values[Parameter.PLATE_DEPTH] = depth / RADIUS
    ball = balls.around(0.7, STATE, values)
    kind, numbers = balls.told(ball, FIRST, values)
    whole = WholePlate(memory)
    rng = np.random.default_rng(3)
    reduction = balls.reduction(ball, values)
    own = np.concatenate([STATE[:-1], 1e-3 * rng.normal(size=reduction.directions.shape[1]), [0.0]])
    states = reduction.whole(0.7, own)[:-1]
    told = rates_of(PlateInBall(memory, kind, FIRST), numbers, own[:-1], 0.7, values)
    right = rates_of(whole, whole.numbers(values), states, 0.7, values)
    still = memory.table.weights * 0.0
    none = replace(memory, table=replace(memory.table, weights=still))
    free = rates_of(WholePlate(none), WholePlate(none).numbers(values), states, 0.7, values)
    plate = np.abs(right[3:12] - free[3:12])
    assert np.abs(told[3:12] - right[3:12]).max() < 2 * SHARE * memory.table.errors.total * plate.max()
    currents = right[12:-2] @ reduction.directions
    assert np.abs(told[12:-2] - currents).max() < 2 * SHARE * memory.table.errors.total * np.abs(currents).max()


def test_one_code_serves_all_frequencies_floaters_and_balls_of_a_kind(balls, memory):
    """Equations in a ball are the same expressions at another rate, for a lighter floater and at another height."""
    faster = replace(SCENE, frequency=112.0, floater=replace(SCENE.floater, density=7000.0))
    others = with_key(parameters(faster, Scales.of(faster)))
    ball, other = (balls.around(0.0, s, v) for s, v in ((STATE, VALUES), (hanging((4e-4, 0, -20e-3), faster), others)))
    kinds = [balls.told(ball, FIRST, VALUES)[0], balls.told(other, FIRST, others)[0]]
    assert kinds[0] == kinds[1]
    assert not np.array_equal(ball.key, other.key)
    found = [equations_of_motion(TABLE, plate=PlateInBall(memory, kind, FIRST)) for kind in kinds]
    assert found[0].rates == found[1].rates
    whole = WholePlate(memory)
    assert not np.array_equal(whole.numbers(VALUES), whole.numbers(others))


def test_the_place_of_a_ball_is_that_of_the_plates_own_frame(balls, memory):
    """Seen from a plate that has gone down, at an angle of the rotor: what expressions and the choice say."""
    values, time = VALUES.copy(), 2.1
    values[Parameter.PLATE_DEPTH] = 0.3
    formula = WholePlate(memory, FIRST)
    x = hy.make_vars("x", "y", "z")
    function = hy.cfunc(seen_by_plate(formula, x), x)
    found = function(STATE[:3], pars=values[: function.nparams], time=time)
    np.testing.assert_allclose(found, balls._place(STATE[:3], time, values), atol=1e-15)


def test_weights_are_those_of_an_exact_harmonic():
    """A field that is one of the functions has one weight, to round-off."""
    known, fitting = local_harmonics(5), sphere_fit(5)
    single = np.eye(known.count)[[2, 11, 30]]
    field, _ = known.values(single)
    assert field.shape == (3, len(fitting.normals), 3)
    scaled = known.weights(field) * known.sizes[1:]
    np.testing.assert_allclose(scaled, single * known.sizes[1:], atol=1e-13)
