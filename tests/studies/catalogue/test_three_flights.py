"""One rotor for the article's three flights of "δx = 1 mm": the scene of docs/learned.md does what the page says."""

from dataclasses import replace

import numpy as np
import pytest
from places import ROOT

from spinlev.dynamics.continuation.frequencies import at_frequency, levitating_ranges
from spinlev.dynamics.continuation.slow_drift import drift, lasting_frequencies
from spinlev.dynamics.motion.state import Scales
from spinlev.geometry.scene.contents import Drag
from spinlev.geometry.scene.files import load_scene
from spinlev.studies.catalogue.article import levitation_of
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation

SCENE = ROOT / "docs" / "examples" / "three_flights.toml"
E_FOLDS = np.log(3e-3 / 50e-6)
"""From 50 µm of motion at release to that with which a floater is lost."""


@pytest.mark.slow
def test_it_falls_at_115_stays_at_140_and_is_lost_in_oscillations_at_150_hz():
    """Averaged flights with every current and real air; ends of lasting flights to 0.5 Hz."""
    scene = load_scene(SCENE)
    still = tuple(replace(magnet, conductivity=None) for magnet in scene.rotor)
    floater = replace(scene.floater, conductivity=None)
    bare = replace(scene, rotor=still, conductors=(), drag=Drag(0.0, 0.0), floater=floater)
    alone, whole = levitation_of(bare, "cuboid"), levitation_of(scene, "cuboid")
    stable = levitating_ranges(bare, alone.table, alone.rates)[0]
    assert stable.low.parameter == pytest.approx(102.4, abs=0.1)
    middle = stable.near(140.0)
    lasts = lasting_frequencies(
        scene, whole.interaction, whole.rates, middle.state, middle.parameter, e_folds=E_FOLDS
    )  # fmt: skip
    assert (lasts.low, lasts.high) == pytest.approx((116.9, 148.6), abs=0.6)
    ends = {}
    for frequency in (115.0, 140.0, 150.0):
        there = replace(scene, frequency=frequency)
        point = at_frequency(bare, alone.rates, stable.near(frequency), frequency)
        start = Scales.of(there).unpack(point.state)
        flight = drift(there, whole.interaction, 0.0, 250.0, whole.rates, start, e_folds=E_FOLDS)
        ends[frequency] = flight.ended_by, flight.levitated_s
    assert [end for end, _ in ends.values()] == ["fold", "duration", "instability"]
    assert ends[115.0][1] == pytest.approx(179.5, abs=0.5)
    assert ends[150.0][1] == pytest.approx(238.4, abs=2.0)


@pytest.mark.slow
def test_no_two_bounces_take_as_long_as_a_precession_at_150_hz():
    """Whatever the body's spin, the precession is much faster, and what begins 0.1 mm off stays up."""
    scene, first, ratios = load_scene(SCENE), None, []
    scene = replace(scene, frequency=150.0, start=replace(scene.start, offset=np.array([0.0, 0.0, 1e-4])))
    for spin in np.arange(0.0, 0.251, 0.05):
        levitation = Levitation(scene, Models("cuboid", "none", interaction="rigid"), float(spin))
        if first is not None:
            levitation.share(first)
        first = first or levitation
        modes = {mode.name: mode.frequency_hz for mode in levitation.equilibria[0].modes}
        ratios.append(modes["precession"] / modes["bounce"])
        assert levitation.flight(10.0).ended_by == "duration"
    print("precession over bounce:", np.round(ratios, 2).tolist())
    assert min(ratios) > 4
