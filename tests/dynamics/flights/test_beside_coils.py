"""Coils beside a rotor: force and equilibria against magpylib, motion against SciPy's, energy, and what is refused."""

import heyoka as hy
import magpylib
import numpy as np
import pytest
from article import BALL
from scipy.integrate import solve_ivp

import spinlev as sl
from spinlev.dynamics.equilibria.balance import EVERY, Balance, solve
from spinlev.dynamics.flights.flight import Flight, initial_state, simulate
from spinlev.dynamics.motion.body_shape import HIGHEST
from spinlev.dynamics.motion.coils import COILS as COILS_OFF
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.floater_effects import FLOATER_SHAPE
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.closed_forms.coil import CoilField
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.floater import floater_sources, shares
from spinlev.geometry.common import MU_0
from spinlev.geometry.shapes import Box
from spinlev.studies.effects import listed_effects
from spinlev.studies.levitation import Levitation

ROTOR = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305, recoil_permeability=1.0)
THIN = {"radius_mm": 30.0, "width_mm": 0.05, "height_mm": 0.05, "turns": 100.0, "center_mm": [0.0, 0.0, -40.0]}
START = {"position_mm": [0.5, 0.3, -19.0], "velocity_mm_s": [3.0, -2.0, 5.0], "moment": [0.3, 0.1, -1.0],
         "spin_hz": [0.0, 0.0, 30.0]}  # fmt: skip


def scene(*coils, **more):
    floater = {**BALL, "recoil_permeability": 1.0, **more.pop("floater", {})}
    keys = {"frequency_hz": 130.0, "rotor": ROTOR, "drag": {"linear_N_s_m": 0.0, "angular_N_m_s": 0.0}, **more}
    return sl.scene(floater=floater, coils=[{**THIN, **coil} for coil in coils], **keys)


def by_magpylib(given, place, time):
    """B (n, 3) T of the rotor's dipole and of thin coils at places (n, 3) m of the laboratory at a time, s."""
    magnet, angle = given.rotor[0], float(given.angle(time))
    moment = magnet.polarization_in_rotor * magnet.body.volume / MU_0
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    parts = [magpylib.misc.Dipole(moment=turn @ moment)]
    parts += [
        magpylib.current.Circle(
            diameter=2 * coil.radius, current=coil.turns * float(coil.amperes(time)), position=coil.center
        )
        for coil in given.coils
    ]
    return magpylib.getB(parts, place, sumup=True)


def force_and_field(given, place, moment, time):
    """Force (3,) N on a moment (3,) A m² at a place (3,) m, by central differences, and B there (3,) T."""
    step = 1e-4
    ends = by_magpylib(
        given, np.array([place, *(place + s * step * e for e in np.eye(3) for s in (2, 1, -1, -2))]), time
    )
    slopes = np.tensordot([-1, 8, -8, 1], ends[1:].reshape(3, 4, 3), (0, 1)) / (12 * step)
    return slopes @ moment, ends[0]


def test_forces_balance_at_an_equilibrium_by_magpylib():
    """Also the torque: ωẑ × L = m × B of a floater whose moment turns with the rotor."""
    given = scene({"current_A": 0.5})
    table, omega, scales = rotor_table(given.rotor, "dipole"), given.angular_velocity, Scales.of(given)
    balance = Balance(Rates(with_effects(given, table)), parameters(given, scales, frozen_spin=True), 0.0)
    near = np.array([[0.5e-3, 0.0, -19e-3]]) / scales.length, np.array([[0.2, 0.0, 0.98]])
    places, moments, steps = solve(balance, *near, EVERY)
    assert steps.max() < 1e-10
    place, moment = places[0] * scales.length, moments[0]
    assert place[2] == pytest.approx(-19.154e-3, abs=1e-6)  # 0.23 mm less without the coil
    force, field = force_and_field(given, place, given.floater.moment * moment, 0.0)
    weight = given.floater.mass * 9.81
    expected = given.floater.mass * omega**2 * np.array([-place[0], -place[1], 0.0]) + [0.0, 0.0, weight]
    assert force == pytest.approx(expected, abs=1e-6 * weight)
    momentum = given.floater.inertia * omega * (np.eye(3)[2] - moment[2] * moment)
    torque = np.cross(given.floater.moment * moment, field)
    assert torque == pytest.approx(np.cross([0.0, 0.0, omega], momentum), abs=1e-6 * np.linalg.norm(momentum) * omega)


COILS = {
    "off the axis, a sine": {"current_A": 1.0, "frequency_hz": 70.0, "phase_deg": 40.0, "center_mm": [9.0, 5.0, -40.0]},
    "on the axis, a table": {"current_A": [[0.001, 0.0], [0.004, 1.5], [0.006, -1.0]]},
}


@pytest.mark.parametrize("name", COILS)
def test_motion_is_that_of_scipy_in_the_laboratory(name):
    """Beside a steady coil about the axis; the energy balance closes."""
    given = scene({"current_A": 0.5}, COILS[name], start=START)
    until, floater = 8e-3, given.floater

    def rates(time, state):
        place, velocity, moment, spin = state.reshape(4, 3)
        force, field = force_and_field(given, place, floater.moment * moment, time)
        turn = floater.moment * np.cross(moment, field) / floater.inertia
        return np.concatenate([velocity, force / floater.mass + given.gravity, np.cross(spin, moment), turn])

    begin = given.start
    state, last = np.concatenate([begin.position, begin.velocity, begin.moment, begin.spin]), 0.0
    for end in [corner for coil in given.coils for corner in coil.corners] + [until]:
        state = solve_ivp(rates, (last, end), state, "DOP853", rtol=1e-9, atol=1e-10).y[:, -1]
        last = end
    flight = simulate(given, rotor_table(given.rotor, "dipole"), until)
    assert flight.lab.position[-1] == pytest.approx(state[:3], abs=1e-9)
    assert flight.lab.moment[-1] == pytest.approx(state[6:9], abs=1e-6)
    assert flight.energy_error < 1e-10


@pytest.mark.slow
def test_a_floater_stays_at_its_equilibrium_and_swings_about_it_as_its_axial_mode():
    given = scene({"current_A": 0.5}, start={"offset_mm": [0.0, 0.0, 0.01]})
    known = Levitation(given, sl.Models("dipole"))
    flight = known.flight(0.5)
    height = flight.lab.position[:, 2] - flight.lab.position[:, 2].mean()
    assert np.abs(height).max() < 1.5e-5
    assert flight.energy_error < 1e-12
    crossed = np.flatnonzero((height[:-1] < 0) & (height[1:] >= 0))
    times = flight.time[crossed] - height[crossed] * np.diff(flight.time)[crossed] / np.diff(height)[crossed]
    (axial,) = (mode for mode in known.equilibria[0].modes if mode.name == "bounce")
    assert len(times) / (times[-1] - times[0]) * (1 - 1 / len(times)) == pytest.approx(axial.frequency_hz, rel=1e-2)


def test_a_floater_of_any_shape_feels_the_coil_all_over():
    """Force of a coil on a cylinder: that on its polarisation, by Gauss's rule, in the field of the closed form."""
    body = {"shape": "cylinder", "diameter_mm": 10.0, "height_mm": 14.0}
    coil = {"current_A": 2.0, "width_mm": 3.0, "height_mm": 4.0, "center_mm": [0.0, 0.0, -34.0]}
    given, alone = (scene({**coil, "current_A": current}, floater=body) for current in (2.0, 0.0))
    table, scales, moment = rotor_table(given.rotor, "dipole"), Scales.of(given), np.array([0.28, 0.0, 0.96])
    place = np.array([2e-3, 1e-3, -24e-3])
    state = np.concatenate([place / scales.length, np.zeros(3), moment, np.zeros(3)])[None]
    found, without = (
        Rates(with_effects(one, table))(state, parameters(one, scales))[0][0, 3:6] for one in (given, alone)
    )
    force = (found - without) * given.floater.mass * scales.length / scales.time**2
    (along, weights), (radial, shares) = np.polynomial.legendre.leggauss(6), np.polynomial.legendre.leggauss(5)
    angles = 2 * np.pi * np.arange(10) / 10
    out, share = 5e-3 * np.sqrt((radial + 1) / 2), shares / 2  # of the area
    local = np.array([[r * np.cos(a), r * np.sin(a), 7e-3 * h] for r in out for a in angles for h in along])
    every = np.array([s / 10 * w / 2 for s in share for _ in angles for w in weights])
    points = place + local @ given.floater.axes(moment).T
    known, step = CoilField(given.coils, [2.0]), 1e-4
    slopes = [
        (known.flux_density(points + step * e) - known.flux_density(points - step * e)) @ moment / (2 * step)
        for e in np.eye(3)
    ]
    expected = given.floater.moment * np.array(slopes) @ every
    assert force == pytest.approx(expected, rel=1e-4, abs=1e-4 * np.linalg.norm(expected))


def all_over(body):
    """Places (n, 3) m in a body's own axes, of a rule of Gauss, and their shares (n,)."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    if isinstance(body, Box):
        grid = np.stack(np.meshgrid(*[nodes] * 3, indexing="ij"), -1).reshape(-1, 3) * body.size / 2
        return grid, np.einsum("i,j,k->ijk", *[weights / 2] * 3).ravel()
    angles = 2 * np.pi * np.arange(12) / 12
    out = body.radius * np.sqrt((nodes + 1) / 2)
    places = [[r * np.cos(a), r * np.sin(a), body.height / 2 * h] for r in out for a in angles for h in nodes]
    return np.array(places), np.array([s / 24 * w / 2 for s in weights for _ in angles for w in weights])


SHAPES = {
    "cube": {"shape": "cuboid", "size_mm": [10.0] * 3},
    "disc": {"shape": "cylinder", "diameter_mm": 14.0, "height_mm": 5.0},
}


@pytest.mark.parametrize("name", ["cube", pytest.param("disc", marks=pytest.mark.slow)])
def test_a_coil_off_the_axis_acts_on_the_dipole_of_a_body(name):
    """Against its force on the polarisation all over the body: within what results say; and energy is balanced."""
    off = {"current_A": 2.0, "center_mm": [9.0, 5.0, -40.0]}
    begin = {"position_mm": [2.0, 1.0, -19.0], "moment": [0.28, 0.1, 0.95]}
    body = {key: BALL[key] for key in ("remanence_T", "density_kg_m3")} | SHAPES[name]
    found = []
    for current in (2.0, 0.0):
        given = scene({**off, "current_A": current}, floater={"diameter_mm": None, **body}, start=begin)
        flight = Flight(given, rotor_table(given.rotor, "dipole"), 0.01, in_balls=False)
        course, equations = flight.begin(initial_state(given, flight.whole)[0], 0.01), flight.equations(0)[0]
        function = hy.cfunc(list(equations.rates[3:6]), list(equations.variables), compact_mode=True, opt_level=0)
        found.append(function(course.state[:-1], pars=course.values[: function.nparams], time=0.0))
    force = (found[0] - found[1]) * given.floater.mass * flight.scales.length / flight.scales.time**2
    state = initial_state(given, flight.whole)[0]
    local, every = all_over(given.floater.bodies[0])
    points = state.position + local @ given.floater.axes(state.orientation).T
    known, step = CoilField(given.coils, [2.0]), 1e-4
    slopes = [
        (known.flux_density(points + step * e) - known.flux_density(points - step * e)) @ state.moment / (2 * step)
        for e in np.eye(3)
    ]
    expected = given.floater.moment * np.array(slopes) @ every
    apart = np.linalg.norm(force - expected) / np.linalg.norm(expected)
    said = shares(given.floater, floater_sources(given.floater), HIGHEST).sum()
    print(f"\n{name}: {apart:.2%} of the coil's force, stated up to {said:.1%}")
    assert apart < said
    sine = scene({**off, "frequency_hz": 70.0}, floater={"diameter_mm": None, **body}, start=begin)
    assert simulate(sine, rotor_table(sine.rotor, "dipole"), 0.02).energy_error < 1e-10
    (effect,) = (e for e in listed_effects(Levitation(sine, sl.Models("dipole")), ()) if e.name == FLOATER_SHAPE)
    assert COILS_OFF in effect.why


def test_a_coil_is_an_obstacle_with_a_hole():
    """Dropped through it the floater touches nothing; dropped on the winding it does, where the closed form says."""
    wide = {"current_A": 0.0, "width_mm": 4.0, "height_mm": 4.0}
    begin = {"position_mm": [0.0, 0.0, -33.0], "velocity_mm_s": [0.0, 0.0, -600.0]}
    table, ends = None, []
    for across in (0.0, 24.0):
        given = scene(wide, start={**begin, "position_mm": [across, 0.0, -25.0]})
        table = table or rotor_table(given.rotor, "dipole")
        flight = simulate(given, table, 0.03)
        ends.append((flight.ended_by, float(given.coils[0].body.distance(flight.lab.position[-1:])[0])))
    assert ends[0][0] == "duration"
    assert ends[1][0] == "contact"
    assert ends[1][1] == pytest.approx(6.35e-3, abs=2e-5)


WRONG = {
    "a rotor that moves": ({"drive": [{"in_s": 1.0, "center_mm": [0, 0, 1]}]}, {}, "drive must have no center_mm"),
    "a plate that is lowered": (
        {"plate": {"size_mm": [100, 100, 5], "center_mm": [0, 0, -60], "conductivity_S_m": 3e7,
                   "lowering": {"start_s": 0.0, "speed_mm_s": 1.0, "distance_mm": 1.0}}}, {}, "lowering must be",
    ),
    "a sine over a plate": (
        {"plate": {"size_mm": [100, 100, 5], "center_mm": [0, 0, -60], "conductivity_S_m": 3e7}},
        {"frequency_hz": 50.0}, "plate must be left out beside",
    ),
    "a sine on a conductor": ({"floater": {"conductivity_S_m": 6e5}}, {"frequency_hz": 50.0}, "no conductivity_S_m"),
    "a winding in the rotor": ({}, {"center_mm": [0, 0, 0], "radius_mm": 5.0}, "must stay clear of all bodies"),
    "a start in the winding": ({"start": {"position_mm": [30, 0, -40]}}, {}, r"overlaps coils\[0\]"),
    "a table with a frequency": ({}, {"current_A": [[0, 0], [1, 1]], "frequency_hz": 5.0}, "must be a number beside"),
}  # fmt: skip


SLOW = {"a winding in the rotor"}  # how deep is searched over a turn


@pytest.mark.parametrize("name", [pytest.param(k, marks=[pytest.mark.slow] if k in SLOW else []) for k in WRONG])
def test_what_is_not_computed_is_refused(name):
    more, coil, said = WRONG[name]
    with pytest.raises(sl.InputError, match=said):
        scene({"current_A": 1.0, **coil}, **more)


@pytest.mark.parametrize(
    ("coil", "said"), [({"frequency_hz": 50.0}, "changes"), ({"center_mm": [1, 0, -40]}, "1 mm off")]
)
def test_a_field_that_does_not_stand_still_has_no_equilibria(coil, said):
    with pytest.raises(sl.InputError, match=said):
        sl.equilibria(scene({"current_A": 1.0, **coil}), model="dipole")
