"""Kinds of flight: heights whose kind is plain."""

import numpy as np
import pytest

from spinlev.dynamics import flight_kind
from spinlev.dynamics.flight_kind import LINEAR_FALL, OSCILLATING_LOSS, STABLE
from spinlev.dynamics.state import State
from spinlev.dynamics.trajectory import Trajectory

TIME = np.linspace(0, 20, 5000)


def flown(distance, ended_by):
    position = np.stack([0 * distance, 0 * distance, -distance], axis=1)
    return Trajectory(TIME, State(position, position, position, position), 600.0, ended_by, 0.0, 1.0, 1, 0.0)


@pytest.mark.parametrize(
    ("distance", "ended_by", "kind"),
    [
        (0.02 + 1e-4 * np.sin(60 * TIME), "duration", STABLE),
        (0.02 + 1e-4 * np.sin(60 * TIME) + 2e-4 * TIME, "lost", LINEAR_FALL),
        (0.02 + 1e-6 * np.exp(0.4 * TIME) * np.sin(60 * TIME), "contact", OSCILLATING_LOSS),
        (0.02 + 1e-6 * np.exp(0.4 * TIME) * np.sin(60 * TIME) + 1e-5 * TIME, "lost", OSCILLATING_LOSS),
    ],
)
def test_plain_cases(distance, ended_by, kind):
    assert flight_kind(flown(distance, ended_by)) == kind
