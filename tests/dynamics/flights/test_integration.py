"""Flights: conserved quantities, and ends that are known exactly."""

import re
from dataclasses import replace

import numpy as np
import pytest
from article import MAGNETS, RADIUS, SCENE

from spinlev.dynamics.equilibria.equilibrium import EquilibriumError
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.flights.flight import (
    SHORT_TURNS,
    STRAIGHT_TURNS,
    Flight,
    StartError,
    initial_state,
    integrate,
    simulate,
)
from spinlev.dynamics.flights.trajectory import FlightStopped
from spinlev.dynamics.motion.events import clearance
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.scene.contents import AbsoluteStart, Drag, Lowering, Plate
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box

NEUTRAL = Floater(RADIUS, 0.0, 1.0, 7500.0)
DIPOLE = RotorTable("dipole", MAGNETS, (), tuple(uniform_moments(m, 1) for m in MAGNETS))
CUBOID = RotorTable("cuboid", MAGNETS, MAGNETS)


def thrown(position, velocity, scene=SCENE, **changes):
    """The scene with an absolute start, moment up, no spin."""
    start = AbsoluteStart(np.array(position), np.array(velocity), np.array([0.0, 0.0, 1.0]), np.zeros(3))
    return replace(scene, start=start, **changes)


def test_energy_and_unit_length_are_kept_for_ten_seconds():
    flight = simulate(SCENE, CUBOID, 10.0, compact=True)
    assert flight.ended_by == "duration"
    assert flight.levitated_s == pytest.approx(10.0, rel=1e-14)
    assert flight.energy_error <= 1e-12
    assert np.abs(np.linalg.norm(flight.lab.moment, axis=1) - 1).max() <= 1e-12
    assert flight.steps > 0
    assert len(flight.time) <= 20000
    np.testing.assert_allclose(np.diff(flight.time)[:-1], flight.time[1], rtol=1e-9)


@pytest.mark.parametrize(
    "changes",
    [
        {"drag": Drag(2e-3, 1e-7)},
        {"gravity": np.array([0.5, 0.3, -9.7]), "drag": Drag(2e-3, 1e-7)},
        {"frequency": 0.0, "gravity": np.array([0.5, 0.3, -9.7])},
    ],
    ids=["drag", "tilted gravity", "rotor at rest"],
)
def test_energy_ledger_closes(changes):
    flight = simulate(thrown((1e-3, 0.0, -25e-3), (0.1, 0.2, 0.0), **changes), DIPOLE, 0.2, compact=True)
    assert flight.energy_error <= 1e-12


def test_free_fall_is_lost_at_twice_the_distance_of_its_start():
    scene = thrown((0.0, 0.0, -60e-3), (0.0, 0.0, 0.0), floater=NEUTRAL)
    flight = simulate(scene, DIPOLE, 5.0, compact=True)
    assert flight.ended_by == "lost"
    assert flight.levitated_s == pytest.approx(np.sqrt(2 * 60e-3 / 9.81), rel=1e-12)
    assert np.linalg.norm(flight.lab.position[-1]) == pytest.approx(0.12, rel=1e-12)


def test_thrown_at_the_rotor_ends_in_contact():
    flight = simulate(thrown((1e-3, -2e-3, -40e-3), (0.0, 0.0, 3.0)), CUBOID, 1.0, compact=True)
    assert flight.ended_by == "contact"
    gaps = [m.box.distance(flight.rotor.position[-1]) - RADIUS for m in MAGNETS]
    assert abs(min(gaps)) < 1e-9


def test_meets_an_edge_of_the_magnet_at_the_exact_distance():
    """Straight flight along x at a height where an edge of the resting cube is the nearest part of it."""
    height = 5e-3 + RADIUS / 2
    scene = thrown((-40e-3, 0.0, -height), (1.0, 0.0, 0.0), frequency=0.0, floater=NEUTRAL, gravity=np.zeros(3))
    flight = simulate(scene, DIPOLE, 1.0, compact=True)
    edge = 2e-3 - 5e-3
    assert flight.ended_by == "contact"
    assert flight.lab.position[-1, 0] == pytest.approx(edge - RADIUS * np.sqrt(3) / 2, abs=1e-12)


def test_plate_beside_is_met_though_it_turns_in_the_rotors_frame():
    plate = Plate(Box((30e-3, 300e-3, 300e-3), (80e-3, 0.0, 0.0)), 3.5e7)
    scene = thrown((0.0, 1e-3, -30e-3), (0.5, 0.0, 0.0), floater=NEUTRAL, plate=plate, gravity=np.zeros(3))
    flight = simulate(scene, DIPOLE, 1.0, compact=True)
    assert flight.ended_by == "contact"
    assert flight.levitated_s == pytest.approx((65e-3 - RADIUS) / 0.5, rel=1e-12)
    np.testing.assert_allclose(flight.lab.position[-1], [65e-3 - RADIUS, 1e-3, -30e-3], atol=1e-12)


@pytest.mark.parametrize(("start", "speed"), [(0.02, 0.3), (0.02, 3.0), (10.0, 0.3)], ids=["slow", "fast", "later"])
def test_falling_on_a_plate_that_is_lowered(start, speed):
    """Against the roots of the falls' and the plate's quadratic equations."""
    lowering = Lowering(start, speed, 40e-3)
    plate = Plate(Box((0.2, 0.2, 0.03), (0.0, 0.0, -60e-3)), 3.5e7, lowering)
    scene = thrown((0.0, 0.0, -30e-3), (0.0, 0.0, 0.0), floater=NEUTRAL, plate=plate)
    gap = -30e-3 - RADIUS - (-45e-3)
    finish = start + lowering.distance / speed
    pieces = [(gap, 0.0, 0.0, start), (gap - start * speed, speed, start, finish), (gap + 40e-3, 0.0, finish, np.inf)]
    meetings = [(g, v, a, b, (v + np.sqrt(max(v * v + 2 * 9.81 * g, 0.0))) / 9.81) for g, v, a, b in pieces]
    expected = next(t for *_, a, b, t in meetings if a <= t <= b)
    flight = simulate(scene, DIPOLE, 5.0, compact=True)
    assert flight.ended_by == "contact"
    assert flight.levitated_s == pytest.approx(expected, rel=1e-11)
    assert abs(clearance(scene, flight.time[-1:], flight.rotor.position[-1:])[0]) < 1e-12


def test_progress_rises_to_one_and_an_interrupt_keeps_what_is_finished():
    shares = []
    simulate(thrown((0.0, 0.0, -30e-3), (0.0, 0.0, 0.0)), DIPOLE, 0.05, compact=True, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0

    def interrupt(_):
        raise KeyboardInterrupt

    with pytest.raises(FlightStopped, match=r"stopped at 0\.0") as stop:
        simulate(thrown((0.0, 0.0, -30e-3), (0.0, 0.0, 0.0)), DIPOLE, 0.05, compact=True, progress=interrupt)
    flight = stop.value.simulated
    assert flight.ended_by == "stopped"
    assert 0 < flight.levitated_s < 0.05
    assert len(flight.time) > 10


def test_start_is_displaced_from_the_stable_equilibrium_and_at_rest_in_the_rotors_frame():
    state, _ = initial_state(SCENE, DIPOLE)
    np.testing.assert_allclose(state.position[2] * 1e3, -19.8134 + 0.1, atol=1e-4)
    np.testing.assert_allclose(state.velocity, np.cross([0, 0, SCENE.angular_velocity], state.position), rtol=1e-14)


def test_start_inside_the_plate_is_refused():
    plate = Plate(Box((0.1, 0.1, 0.03), (0.0, 0.0, -40e-3)), 3.5e7)
    with pytest.raises(StartError, match="free of the magnets and the plate"):
        simulate(replace(thrown((0.0, 0.0, -24e-3), (0.0, 0.0, 0.0)), plate=plate), DIPOLE, 1.0)
    with pytest.raises(EquilibriumError, match="no stable equilibrium"):  # where it was, the plate is
        simulate(replace(SCENE, plate=plate), DIPOLE, 1.0)


def test_without_a_stable_equilibrium_the_way_out_is_named():
    with pytest.raises(EquilibriumError, match="possible at about") as refused:
        simulate(replace(SCENE, frequency=90.0), DIPOLE, 1.0)
    named = float(re.search(r"at about ([\d.]+) Hz", str(refused.value))[1])
    found = {f: find_equilibria(replace(SCENE, frequency=f), DIPOLE) for f in (named, 90.0 + 0.1 * (named - 90.0))}
    assert [any(e.stable for e in known) for known in found.values()] == [True, False]  # so it is not far inside
    with pytest.raises(StartError, match="duration must be positive"):
        simulate(SCENE, DIPOLE, 0.0)


@pytest.mark.parametrize(
    ("long", "kind"),
    [(1.1 * SHORT_TURNS, (1, True)), pytest.param(2 * STRAIGHT_TURNS, (1, False), marks=pytest.mark.slow)],
)
def test_code_is_as_optimised_as_the_flight_is_long(long, kind):
    """The same flight by loops that are not optimised, and by loops that are or straight code."""
    start, _ = initial_state(SCENE, DIPOLE)
    flown, kinds = [], []
    for turns in (0.9 * SHORT_TURNS, long):
        flight = Flight(SCENE, DIPOLE, turns / SCENE.frequency)
        integrator = flight.part(0).integrator
        kinds.append((integrator.llvm_state.opt_level, integrator.compact_mode))
        flown.append(integrate(flight, start, 0.2).lab.position)
    assert kinds == [(0, True), kind]
    np.testing.assert_allclose(*flown, atol=1e-13)
