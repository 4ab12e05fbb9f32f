"""Kinds of flight: distances whose kind is plain, and one real flight of each kind."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, RADIUS

from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.flights.flight import Flight, integrate
from spinlev.dynamics.flights.trajectory import (
    DRIFTING,
    GROWING,
    LINEAR_FALL,
    LOST_AT_ONCE,
    OSCILLATING_LOSS,
    STABLE,
    Trajectory,
    flight_kind,
)
from spinlev.dynamics.motion.state import State
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import vertical
from spinlev.geometry.scene.contents import Drag, Scene

TIME = np.linspace(0, 20, 5000)
VERTICAL = Scene(80.0, vertical(14e-3, 10e-3, 1.305, 1.0), FLOATER, Drag.stokes(RADIUS))


def flown(distance, ended_by, time=TIME):
    position = np.stack([0 * distance, 0 * distance, -distance], axis=1)  # on the axis: the same in both frames
    state, rate = State(position, position, position, position), np.full(len(time), 600.0)
    return Trajectory(time, state, 600.0 * time, rate, ended_by, 0.0, 1.0, 1, 0.0)


WAVE = np.sin(60 * TIME)
LATE = (2e-5 + 9e-4 * np.exp(4 * (TIME - 20))) * np.sin(180 * TIME)
"""An oscillation of 29 Hz that grows to 0.9 mm within the last second; the floater has sunk by 2 mm before."""


@pytest.mark.parametrize(
    ("distance", "ended_by", "kind"),
    [
        (0.02 + 1e-4 * WAVE, "duration", STABLE),
        (0.02 + 1e-4 * WAVE * np.exp(-0.3 * TIME), "duration", STABLE),
        (0.02 + 1e-4 * np.exp(-TIME), "duration", STABLE),  # it has settled
        (0.02 + 1e-4 * WAVE + 1e-5 * TIME, "duration", DRIFTING),
        (0.02 - 1e-5 * TIME, "duration", DRIFTING),
        (0.02 + 1e-6 * np.exp(0.3 * TIME) * WAVE, "duration", GROWING),
        (0.02 + 1e-4 * WAVE + 2e-4 * TIME, "lost", LINEAR_FALL),
        (0.02 + 1e-6 * np.exp(0.4 * TIME) * WAVE, "contact", OSCILLATING_LOSS),
        (0.02 + 1e-6 * np.exp(0.4 * TIME) * WAVE + 1e-5 * TIME, "lost", OSCILLATING_LOSS),
        (0.02 + 1e-4 * TIME + LATE, "lost", OSCILLATING_LOSS),
        (0.02 + 1e-4 * TIME + 5e-3 * np.exp(8 * (TIME - 20)) + 1e-4 * WAVE, "lost", LINEAR_FALL),  # round a fold
    ],
)
def test_plain_cases(distance, ended_by, kind):
    assert flight_kind(flown(distance, ended_by)) == kind


def test_a_fall_from_the_hand_is_no_flight():
    time = np.linspace(0, 0.1, 1000)
    assert flight_kind(flown(0.04 + 4.9 * time**2, "lost", time)) == LOST_AT_ONCE


@pytest.mark.parametrize(
    ("frequency", "conductivity", "duration", "kind"),
    [
        (80.0, None, 10.0, STABLE),
        (66.0, 6.7e7, 60.0, LINEAR_FALL),
        (66.0, 6.7e7, 4.0, DRIFTING),
        (100.0, None, 10.0, OSCILLATING_LOSS),
        (86.0, None, 1.2, GROWING),
    ],
)
def test_one_real_flight_of_each_kind(frequency, conductivity, duration, kind):
    """Point dipoles, vertical 14 mm, 1 µm beside the equilibrium at s = 0; two with slow torques 100 times as large."""
    floater = replace(FLOATER, conductivity=conductivity)
    scene = replace(VERTICAL, frequency=frequency, floater=floater)
    if conductivity:
        scene = replace(scene, drag=Drag(scene.drag.linear, 100 * scene.drag.angular))
    table = rotor_table(scene.rotor, "dipole")
    start = min(find_equilibria(scene, table), key=lambda e: e.growth_per_s).state
    start = replace(start, position=start.position + np.array([0.0, 0.0, 1e-6]))
    flight = integrate(Flight(scene, table, duration, compact=True), start, duration)
    assert flight_kind(flight) == kind
