"""Where flights last, against single averaged flights beside the ends."""

from dataclasses import replace

import pytest
from article import RADIUS

from spinlev.dynamics.continuation.slow_drift import drift, lasting_frequencies
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import vertical
from spinlev.geometry.scene.contents import Drag, Scene
from spinlev.geometry.scene.floater import Floater

SCENE = Scene(
    75.0,
    vertical(14e-3, 10e-3, 1.305, 1.0),
    Floater(RADIUS, 1.305, 1.0, 7500.0, 6.7e5),
    replace(Drag.stokes(RADIUS), air=True),
)
TABLE = rotor_table(SCENE.rotor, "dipole")


@pytest.fixture(scope="module")
def rates():
    return Rates(with_effects(SCENE, TABLE))


def start_of(rates):
    found = min(find_equilibria(SCENE, TABLE, rates=rates), key=lambda e: e.growth_per_s)
    return Scales.of(SCENE).pack(found.state)


@pytest.mark.slow
def test_flights_last_within_the_ends_and_not_beyond(rates):
    """Searches that know no branch, one resolution within each end and two beyond it."""
    found = lasting_frequencies(SCENE, TABLE, rates, start_of(rates), SCENE.frequency)
    assert found.ended_by == "instability"

    def lasts(frequency):
        flight = drift(replace(SCENE, frequency=frequency), TABLE, rates=rates)
        return flight.ended_by in ("duration", "balance")

    assert lasts(found.low)
    assert lasts(found.high)
    assert not lasts(found.low - 0.5)
    assert not lasts(found.high + 0.5)


@pytest.mark.slow
def test_where_nothing_lasts_there_is_no_interval(rates):
    """A disturbance that may not grow at all."""
    found = lasting_frequencies(SCENE, TABLE, rates, start_of(rates), SCENE.frequency, duration=2500.0, e_folds=1e-6)
    assert found.ended_by == ""
    assert not found.high > 0
