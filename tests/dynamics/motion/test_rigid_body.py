"""Bodies that are not round: free and heavy tops by elliptic functions, energy, spheres as such bodies, contact."""

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
from article import NO_DRAG, SCENE
from scipy.special import ellipj, ellipk

from spinlev.dynamics.equilibria.equilibrium import AVERAGED, LOCKED
from spinlev.dynamics.equilibria.search import survey, with_plate
from spinlev.dynamics.flights.flight import Flight, initial_state, integrate, simulate
from spinlev.dynamics.motion.body_shape import BodyShape
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.equations import equations_of_motion, parameters
from spinlev.dynamics.motion.events import rotor_gap
from spinlev.dynamics.motion.plate import PlateMemory
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Parameter, Scales, State, matrices_of, quaternions_of
from spinlev.fem.harmonics.interior import shells, sizes
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.floater import force_and_torque
from spinlev.geometry.common import MU_0
from spinlev.geometry.magnets import Magnet, tilt
from spinlev.geometry.scene.contents import AbsoluteStart, Plate
from spinlev.geometry.scene.floater import Floater, FloaterPart
from spinlev.geometry.shapes import Box, Cylinder, rotation_matrix
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation

CUBE = Floater(0.01 * 3**0.5 / 2, 1.3, 1.0, 7500.0, None, Box((0.01,) * 3))
BRICK = Floater(float(np.linalg.norm([9e-3, 12e-3, 6e-3]) / 2), 1.3, 1.0, 7500.0, None, Box((9e-3, 12e-3, 6e-3)))
ROTOR = tilt(np.radians(10.0), Box((0.01,) * 3), 1.305, 1.0)
TABLE = rotor_table(ROTOR, "cuboid")
LEVITATING = replace(SCENE, frequency=130.0, rotor=ROTOR, floater=CUBE)


class Uniform:
    """A field along z, T."""

    def __init__(self, strength):
        self.strength = strength

    def expressions(self, position):
        zero = hy.expression(0.0)
        return [zero, zero, hy.expression(self.strength)], [[zero] * 3] * 3


def top(inertia, field=0.0, torque=1.0):
    """The equations of a body in a field, in a frame at rest: its integrator."""
    equations = equations_of_motion(Interaction(Uniform(field), turning=True))
    values = np.zeros(len(Parameter))
    values[[Parameter.LENGTH, Parameter.INERTIA, Parameter.TIME, Parameter.POINTING_Z]] = 1.0
    values[Parameter.TORQUE] = torque
    values[Parameter.INERTIA_X : Parameter.INERTIA_Z + 1] = inertia
    system = list(zip(equations.variables, equations.rates, strict=True))
    integrator = hy.taylor_adaptive(system, np.zeros(13), tol=1e-17, compact_mode=True)
    integrator.pars[:] = values[: len(integrator.pars)]
    return integrator


def test_a_free_body_turns_as_jacobis_functions_say():
    """Euler's equations for 1000 turns (L. D. Landau, E. M. Lifshitz, Mechanics, section 37), and L stays as it is."""
    inertia, spin = np.array([1.0, 1.7, 2.3]), np.array([0.3, 0.0, 1.1])
    integrator = top(inertia)
    quaternion = np.array([0.5, 0.5, -0.5, 0.5])
    integrator.state[6:] = np.concatenate([quaternion, spin])
    twice_energy, square = inertia @ spin**2, (inertia * spin) @ (inertia * spin)
    a, b, c = inertia
    amplitudes = np.sqrt(
        [
            (twice_energy * c - square) / (a * (c - a)),
            (twice_energy * c - square) / (b * (c - b)),
            (square - twice_energy * a) / (c * (c - a)),
        ]
    )
    rate = np.sqrt((c - b) * (square - twice_energy * a) / (a * b * c))
    modulus = (b - a) * (twice_energy * c - square) / ((c - b) * (square - twice_energy * a))
    assert 0 < modulus < 1
    times = np.linspace(0.0, 1000 * 2 * np.pi / 1.1, 300)
    states = integrator.propagate_grid(times)[-1]
    quarter = ellipk(modulus)
    sn, cn, dn, _ = ellipj(np.mod(rate * times, 4 * quarter), modulus)
    known = amplitudes * np.stack([cn, sn, dn], axis=1)
    assert states[:, 10:] == pytest.approx(known, abs=1e-10)
    momenta = np.einsum("nij,nj->ni", matrices_of(states[:, 6:10]), inertia * states[:, 10:])
    assert momenta == pytest.approx(np.broadcast_to(momenta[0], momenta.shape), abs=1e-10)


def test_a_heavy_symmetric_top_nods_with_its_period():
    """u = cos θ obeys u̇² = (α - βu)(1 - u²) - (b - au)² (H. Goldstein, Classical Mechanics, section 5.7)."""
    across, along, strength = 1.0, 0.6, 1.3
    integrator = top([across, across, along], -1.0, strength)  # the moment falls as a weight does
    angle, spin = 0.9, np.array([0.0, 0.0, 3.1])  # it begins at the highest point
    integrator.state[6:] = [np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0, *spin]
    axes = matrices_of(integrator.state[6:10])
    start = axes[2, 2]
    a = along * spin[2] / across
    b = (axes[2] @ (np.array([across, across, along]) * spin)) / across
    beta = 2 * strength / across
    alpha = beta * start
    cubic = np.polynomial.Polynomial([alpha, -beta]) * np.polynomial.Polynomial([1, 0, -1])
    cubic -= np.polynomial.Polynomial([b, -a]) ** 2
    low, high, beyond = np.sort(cubic.roots().real)
    period = 4 / np.sqrt(beta * (beyond - low)) * ellipk((high - low) / (beyond - low))
    states = integrator.propagate_grid(period * np.array([0.0, 0.5, 1.0, 100.0, 100.5]))[-1]
    heights = matrices_of(states[:, 6:10])[:, 2, 2]
    assert heights == pytest.approx([high, low, high, high, low], abs=1e-10)


class Turning(Floater):
    """A sphere that is taken as a body that is not round."""

    round = False


def test_a_sphere_is_a_special_case():
    """Twenty turns of a sphere by the equations of any body, and of one that is even: 1e-12 of its motion."""
    start = AbsoluteStart(
        np.array([1e-3, 0.0, -19e-3]), np.zeros(3), np.array([0.3, -0.1, 0.9]), np.array([20.0, 5.0, 40.0])
    )
    sphere = replace(LEVITATING, floater=replace(CUBE, body=None, radius=6.35e-3), start=start)
    fields = {name: getattr(sphere.floater, name) for name in sphere.floater.__dataclass_fields__}
    found = []
    turning = replace(sphere, floater=Turning(**fields))
    for scene, scales in ((sphere, None), (turning, None), (turning, Scales.of(turning))):
        flight = Flight(scene, TABLE, 0.1, in_balls=False, scales=scales)
        course = flight.begin(initial_state(scene, TABLE)[0], 0.1, None, flight.interval(0.1))
        part = flight.part(0)
        part.integrator.pars[:], part.integrator.state[:] = course.values[: len(part.integrator.pars)], course.state
        part.integrator.propagate_until(20 * 2 * np.pi)
        state = flight.scales.unpack(part.integrator.state[: flight.scales.size])
        found.append(np.concatenate([state.position / 6.35e-3, state.moment, state.spin / scene.angular_velocity]))
    assert np.array(found[1:]) == pytest.approx(np.array([found[0]] * 2), abs=1e-12)


@pytest.mark.parametrize("floater", [CUBE, BRICK], ids=["cube", "brick"])
def test_energy_is_kept(floater):
    scene = replace(LEVITATING, floater=floater)
    start = AbsoluteStart(
        np.array([0.0, 0.0, -25e-3]), np.zeros(3), np.array([-0.2, 0.0, 1.0]), np.array([10.0, -30.0, 50.0])
    )
    flown = simulate(replace(scene, start=start), TABLE, 0.03)
    assert flown.energy_error < 1e-12
    assert flown.lab.axes.shape == (len(flown.time), 3, 3)


def test_multipoles_in_a_ball_do_what_the_body_feels():
    """Force and torque of a flight's equations against dipoles all over the body: as well as it says."""
    start = AbsoluteStart(np.array([1e-3, 0.0, -20e-3]), np.zeros(3), np.array([-0.2, 0.1, 1.0]), np.zeros(3))
    scene = replace(LEVITATING, start=start)
    flight = Flight(scene, TABLE, 0.1, in_balls=True)
    state = initial_state(scene, TABLE)[0]
    course = flight.begin(state, 0.1)
    equations = flight.equations(flight.degree(course.values))[0]
    scales, place = flight.scales, course.state[:3]
    function = hy.cfunc(list(equations.rates[: scales.size]), list(equations.variables), compact_mode=True, opt_level=0)
    rates = function(course.state[:-1], pars=course.values[: function.nparams])
    turned = scales.unpack(np.append(course.state[: scales.size - 3], rates[-3:])).spin * scales.time  # from rest
    shape = next(effect for effect in flight.whole.effects if isinstance(effect, BodyShape))
    wrench = shape.wrench(TABLE, state.position[None], state.axes[None])[0][0]
    field, gradient = (part[0] for part in TABLE.evaluate(state.position[None]))
    moment = CUBE.moment * state.moment
    force, torque = wrench[:3] + moment @ gradient, wrench[3:] + np.cross(moment, field)
    rate = course.values[Parameter.RATE]
    push = (
        CUBE.mass
        * scales.length
        / scales.time**2
        * (rates[3:6] + rate * np.array([-course.state[4], course.state[3], 0.0]))
        - CUBE.mass * scene.gravity
    )
    assert np.linalg.norm(push - force) < 2 * shape.truncation * np.linalg.norm(force)
    assert np.linalg.norm(CUBE.inertia / scales.time**2 * turned - torque) < 2 * shape.truncation * np.linalg.norm(
        torque
    )
    assert place.any()


@pytest.mark.parametrize("in_balls", [pytest.param(True, marks=pytest.mark.slow), False])
def test_a_cube_moves_the_same_by_its_quaternion(in_balls):
    """Ten turns of a cube magnetised along its diagonal, with air, by two directions and by a quaternion: 1e-10."""
    magnet = Magnet(CUBE.body, np.full(3, 1.3 / 3**0.5))
    start = AbsoluteStart(
        np.array([1e-3, 0.0, -20e-3]), np.zeros(3), np.array([-0.2, 0.1, 1.0]), np.array([20.0, 5.0, -40.0])
    )
    air = replace(SCENE.drag, linear=1e-3, angular=1e-7)
    cube = Floater.composed([FloaterPart(magnet, 7500.0)])
    scene, found = replace(LEVITATING, floater=cube, start=start, drag=air), []
    for scales in (None, Scales.of(scene)):
        flight = Flight(scene, TABLE, 0.08, tolerance=1e-18, in_balls=in_balls, scales=scales)
        end = integrate(flight, initial_state(scene, TABLE)[0], 0.08).rotor[-1]
        found.append(np.concatenate([end.position / CUBE.radius, end.axes.ravel(), end.spin / scene.angular_velocity]))
    assert found[0] == pytest.approx(found[1], abs=1e-10)


SWINGING = AbsoluteStart(
    np.array([0.6e-3, 0.0, -18.0e-3]), np.array([0.0, 0.49, 0.0]), np.array([-0.2, 0.0, 1.0]), np.zeros(3)
)


def test_energy_is_continuous_from_ball_to_ball():
    """Of a cube that passes many balls: what they miss of its multipoles is 3e-6 of the energy at each change."""
    flight = Flight(LEVITATING, TABLE, 0.05, in_balls=True)
    flown = integrate(flight, initial_state(replace(LEVITATING, start=SWINGING), TABLE)[0], 0.05)
    changes = flown.field_changes
    assert changes.count > 8
    assert changes.total < 3e-6 * changes.count
    assert flown.energy_error < 1e-11


@pytest.mark.parametrize("floater", [CUBE, BRICK], ids=["cube", "brick"])
def test_few_dipoles_have_the_multipoles_of_trajectories(floater):
    """Those kept, and no others up to their highest degree; of further ones a fiftieth of what they would be."""
    shape = BodyShape.of(floater, TABLE, [magnet.body for magnet in ROTOR])
    found = shape.poles.multipoles(9, floater.radius) / sizes(9)
    degrees, top = shells(9), shells(7)[shape.kept].max()
    wanted = np.zeros(len(degrees))
    wanted[shape.kept] = (shape.moments / sizes(7))[shape.kept]
    size = np.abs(wanted).max()
    assert found[degrees <= top] == pytest.approx(wanted[degrees <= top], abs=1e-9 * size)
    assert np.abs(found[degrees == top + 1]).max() < 1e-9 * size or top % 2 == 0
    assert np.abs(found[degrees == top + 2]).max() < 0.2 * size
    assert len(shape.poles.places) < 30


def charged_faces(floater, axes, place, count=24):
    """Force (3,) N by charges at Gauss's points of the two faces that the remanence leaves, along z here."""
    (x, weights), body, total = np.polynomial.legendre.leggauss(count), floater.body, np.zeros(3)
    if isinstance(body, Box):
        first, second = body.half_edges[0] * x[:, None], body.half_edges[1] * x
        areas = np.prod(body.half_edges[:2]) * np.outer(weights, weights)
    else:
        angle, radius = 2 * np.pi * np.arange(3 * count) / (3 * count), body.radius * (x[:, None] + 1) / 2
        first, second = radius * np.cos(angle), radius * np.sin(angle)
        areas = body.radius / 2 * weights[:, None] * radius * 2 * np.pi / len(angle) * np.ones_like(angle)
    for side in (-1, 1):
        own = np.stack(np.broadcast_arrays(first, second, side * body.half_edges[2]), axis=-1).reshape(-1, 3)
        total += side * floater.remanence / MU_0 * areas.ravel() @ TABLE.evaluate(place + own @ axes.T)[0]
    return total


@pytest.mark.parametrize("shape", ["mean of a cube", "disc"])
def test_dipoles_all_over_a_body_state_what_they_miss(shape):
    """Against the charges on its faces, of the mean over forty turns: force to a quarter of what is said, not less."""
    disc = Cylinder(8e-3, 4e-3)
    floater = CUBE if shape != "disc" else Floater(disc.circumradius, 1.3, 1.0, 7500.0, None, disc)
    place, moment = np.array([1e-3, 0.5e-3, -17e-3]), np.array([0.3, 0.1, 0.95])
    moment /= np.linalg.norm(moment)
    acting = floater.averaged if shape != "disc" else floater
    body = BodyShape.of(acting, TABLE, [magnet.body for magnet in ROTOR])
    axes, turns = acting.axes(moment), 360 / 40 * np.arange(40) if shape != "disc" else (0.0,)
    force = force_and_torque(body.sources, TABLE, place[None], axes[None])[0][0]
    true = np.mean([charged_faces(floater, axes @ rotation_matrix((0, 0, turn)), place) for turn in turns], axis=0)
    missed = body.missed(TABLE, place[None], axes[None])[0, 1] * acting.moment
    assert np.linalg.norm(force - true) == pytest.approx(missed, rel=0.25)
    assert 1e-9 < missed / np.linalg.norm(true) < 1e-2


def test_a_body_beside_a_magnet_has_a_finite_error():
    """Part of it is where the expansions of finite elements do not reach, which are summed all the same."""
    table = rotor_table(ROTOR, "moments")
    place, body = np.array([0.0, -10.5e-3, 0.0]), BodyShape.of(CUBE, TABLE, [magnet.body for magnet in ROTOR])
    assert not table.in_range(place + body.finer.places).all()
    assert np.isfinite(body.missed(table, place[None], np.eye(3)[None])).all()


@pytest.fixture(scope="module")
def found():
    return Levitation(LEVITATING, Models("cuboid", "none", interaction="rigid")).equilibria


def test_equilibria_are_told_apart_and_a_stable_one_stays(found):
    """The mean over the cube's own turn levitates; the cube itself stays there, turning."""
    assert {one.kind for one in found} == {AVERAGED, LOCKED}
    first = found[0]
    assert first.stable
    assert first.kind == AVERAGED
    assert all(one.residual < 1e-9 for one in found)
    flown = simulate(LEVITATING, TABLE, 0.3, found)
    assert flown.ended_by == "duration"
    distance = np.linalg.norm(flown.lab.position, axis=1)
    assert abs(distance.mean() - first.distance) < 0.1e-3
    assert np.ptp(distance) < 0.6e-3


def test_a_mean_is_searched_by_its_multipoles(found, monkeypatch):
    """Of the cube's mean as a floater, as in comparisons: the same equilibria, with few looks at all its dipoles.

    It looked at 14 thousand poses when the search itself had them, and at 73 now.
    """
    looks, numbers = [], BodyShape.numbers
    monkeypatch.setattr(BodyShape, "numbers", lambda *args: [looks.append(len(args[2].position)), numbers(*args)][1])
    means = survey(replace(LEVITATING, floater=CUBE.averaged), TABLE).equilibria
    assert sum(looks) < 500
    for one, other in zip(means, [one for one in found if one.kind == AVERAGED], strict=True):
        assert one.position == pytest.approx(other.position, abs=1e-12)
        assert one.growth_per_s == pytest.approx(other.growth_per_s, abs=1e-8)
        assert one.residual < 1e-9


@pytest.mark.slow
def test_a_locked_equilibrium_is_at_rest_in_the_rotors_frame(found):
    locked = next(one for one in found if one.kind == LOCKED)
    scales, whole = Scales.of(LEVITATING), with_effects(LEVITATING, TABLE)
    assert locked.state.spin == pytest.approx([0.0, 0.0, LEVITATING.angular_velocity])
    flight = Flight(LEVITATING, whole, 0.05)
    flown = integrate(flight, locked.state, 0.05)
    moved = np.linalg.norm(flown.rotor.position - locked.position, axis=1)
    growth = np.exp(locked.growth_per_s * flown.time[-1])
    # what the flight's multipoles miss of the force is where it starts from
    assert moved.max() < 1e-5 * growth
    assert scales.unpack(scales.pack(locked.state)).axes == pytest.approx(locked.state.axes, abs=1e-14)


@pytest.mark.slow
def test_a_locked_body_with_an_oblique_moment_says_how_far_off_a_closed_form_is():
    """The rotor's permeability is left out; by the body's own axis, which was taken, 0.07 mm were said of 0.18."""
    rotor = tilt(np.radians(10.0), Box((0.01,) * 3), 1.305, 1.05)
    magnet = Magnet(Box((12e-3, 9e-3, 8e-3)), (0.0, 0.78, 1.04))
    scene = replace(LEVITATING, frequency=110.0, rotor=rotor, floater=Floater.composed([FloaterPart(magnet, 7500.0)]))
    rough, known = (survey(scene, rotor_table(rotor, *how)).equilibria for how in (("cuboid",), ("surface", 1e-5)))
    assert [one.kind for one in rough] == [one.kind for one in known] == [LOCKED] * len(rough)
    for one, other in zip(rough, known, strict=True):
        missed = np.linalg.norm(one.position - other.position)
        assert 1e-4 < missed < one.position_error < 3 * missed


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "kick", "foldings"), [(LOCKED, 1e-9, 10.0), (AVERAGED, 1e-6, 8.0)])
def test_an_unstable_equilibrium_of_either_kind_grows_as_it_says(found, kind, kick, foldings):
    """Of the cube's trajectories from above and below along the axis: the difference of their heights."""
    known = next(one for one in found if one.kind == kind and one.growth_per_s > 5)
    assert [mode.name for mode in known.modes if mode.growth_per_s == known.growth_per_s] == ["bounce"]
    seconds, state = foldings / known.growth_per_s, known.state
    axes = CUBE.axes(state.moment) if state.axes is None else state.axes
    flight, ends = Flight(LEVITATING, TABLE, seconds, in_balls=False if kind == LOCKED else None), []
    for sign in (1.0, -1.0):
        begun = replace(state, position=state.position + sign * kick * np.eye(3)[2], axes=axes)
        ends.append(integrate(flight, begun, seconds))
    apart = np.abs(ends[0].lab.position[:, 2] - ends[1].lab.position[:, 2])
    late = ends[0].time > seconds / 2
    slope = np.polyfit(ends[0].time[late], np.log(apart[late]), 1)[0]
    print(f"\n{kind}, {1e3 * known.distance:.1f} mm: {known.growth_per_s:.2f} /s, simulated {slope:.2f} /s")
    assert slope == pytest.approx(known.growth_per_s, rel=1e-2)


@pytest.mark.slow
def test_a_locked_cube_over_a_plate_stays_on_its_motion():
    """Of the true shape, over a slab that leans by 5° and so shakes it once a turn: 0.5 µm in eight turns."""
    box = Box((0.3, 0.3, 0.03), (0.0, 0.0, -0.0745), rotation_matrix((0.0, 5.0, 0.0)))
    scene = replace(LEVITATING, plate=Plate(box, 3.5e7))
    corners = box.to_body(np.array([0.0, 0.0, -0.0455]) + 4e-3 * np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]))
    region = Region(corners.min(axis=0) - 5e-4, corners.max(axis=0) + 5e-4)
    memory = PlateMemory(
        scene.plate, *PlateAround(scene.plate, TABLE, region, (5.0, 300.0), 1e-2, slab=True).tables(), "slab"
    )
    rates = Rates(with_effects(scene, TABLE))
    known = survey(scene, TABLE, rates=rates)
    locked = next(one for one in known.equilibria if one.kind == LOCKED)
    (found,) = with_plate(scene, TABLE, replace(known, equilibria=(locked,)), memory, rates).equilibria
    assert found.currents is not None
    assert np.linalg.norm(found.position - locked.position) > 1e-4
    assert np.ptp(found.turn.position[:, 2]) > 1e-7
    flown = integrate(Flight(scene, TABLE, 0.1, memory=memory), found.start, 8 / 130.0, currents=found.currents[0])
    turns = flown.rotor.position[::125]
    assert len(turns) == 9
    assert np.linalg.norm(turns - found.start.position, axis=1).max() < 5e-7


def test_contact_is_that_of_the_true_surface():
    """A cube under a cube of 10 mm: face to face, and on an edge."""
    scene = replace(SCENE, floater=CUBE)
    edge = np.array([[1.0, 0.0, 0.0], [0.0, 0.5**0.5, -(0.5**0.5)], [0.0, 0.5**0.5, 0.5**0.5]])
    place = np.array([2e-3, 0.0, -12e-3])
    assert rotor_gap(scene, place, np.eye(3)) == pytest.approx(2e-3, abs=1e-9)
    assert rotor_gap(scene, place, edge) == pytest.approx(7e-3 - 0.01 / 2**0.5, abs=1e-9)


def test_quaternions_are_those_of_rotations():
    quaternions = np.random.default_rng(2).normal(size=(50, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    axes = matrices_of(quaternions)
    assert axes @ axes.swapaxes(1, 2) == pytest.approx(np.broadcast_to(np.eye(3), axes.shape), abs=1e-14)
    again = quaternions_of(axes)
    assert np.abs(np.sum(again * quaternions, axis=1)) == pytest.approx(np.ones(50), abs=1e-13)
    state = State(np.zeros(3), np.zeros(3), np.eye(3)[2], np.ones(3), axes[0])
    assert state.to_lab(0.7).to_rotor(0.7).axes == pytest.approx(axes[0], abs=1e-14)


def test_drag_and_inertia_of_the_parameters():
    values = parameters(replace(LEVITATING, floater=BRICK, drag=NO_DRAG), Scales.of(LEVITATING))
    ratios = values[Parameter.INERTIA_X : Parameter.INERTIA_Z + 1]
    assert ratios * BRICK.inertia == pytest.approx(BRICK.mass / 12 * np.array([180, 117, 225]) * 1e-6)
