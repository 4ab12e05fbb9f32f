"""One rotor for the article's three flights of "δx = 1 mm": the scene of docs/learned.md does what the page says."""

from dataclasses import replace

import pytest
from places import ROOT

from spinlev.dynamics.branches import at_frequency, levitating_ranges
from spinlev.dynamics.motion import Scales
from spinlev.dynamics.slow_drift import drift, lasting_frequencies
from spinlev.geometry.scenes import Drag, load_scene
from spinlev.studies.article import levitation_of

SCENE = ROOT / "docs" / "examples" / "three_flights.toml"
E_FOLDS = 5.5
"""From 12 µm of motion at release to 3 mm."""


@pytest.mark.slow
def test_it_falls_at_115_stays_at_140_and_is_lost_in_oscillations_at_150_hz():
    """Averaged flights with every current and real air; ends of lasting flights to 0.5 Hz."""
    scene = load_scene(SCENE)
    still = tuple(replace(magnet, conductivity=None) for magnet in scene.rotor)
    bare = replace(scene, rotor=still, drag=Drag(0.0, 0.0), floater=replace(scene.floater, conductivity=None))
    alone, whole = levitation_of(bare, "cuboid"), levitation_of(scene, "cuboid")
    stable = levitating_ranges(bare, alone.table, alone.rates)[0]
    assert stable.low.parameter == pytest.approx(113.5, abs=0.1)
    middle = stable.near(140.0)
    lasts = lasting_frequencies(
        scene, whole.interaction, whole.rates, middle.state, middle.parameter, e_folds=E_FOLDS
    )  # fmt: skip
    assert (lasts.low, lasts.high) == pytest.approx((130.4, 146.8), abs=0.6)
    ends = {}
    for frequency in (115.0, 140.0, 150.0):
        there = replace(scene, frequency=frequency)
        point = at_frequency(bare, alone.rates, stable.near(frequency), frequency)
        start = Scales.of(there).unpack(point.state)
        flight = drift(there, whole.interaction, 0.0, 250.0, whole.rates, start, e_folds=E_FOLDS)
        ends[frequency] = flight.ended_by, flight.levitated_s
    assert [end for end, _ in ends.values()] == ["fold", "duration", "instability"]
    assert ends[115.0][1] == pytest.approx(20.6, abs=0.2)
    assert ends[150.0][1] == pytest.approx(217.0, abs=2.0)
