"""The study of the plate's damping: laws of weak currents, and its figure and sentences from its dataset alone."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from spinlev.dynamics.continuation.frequencies import reference_state, stable_range
from spinlev.dynamics.motion.rates import Rates
from spinlev.fem.rotor.choice import rotor_table
from spinlev.studies.catalogue.article import over_plate, rotor_scene
from spinlev.studies.catalogue.entries import CATALOGUE
from spinlev.studies.catalogue.plates import ROTORS, RTOL, PlateCase, cases, plate_damping, without_plate

STUDY = CATALOGUE["plate-damping"]
WEAK = 2e4
"""Conductivity at which the skin depth, 0.3 m at 130 Hz, is far beyond the distances, S/m."""


@pytest.fixture(scope="module")
def weak():
    """A poor conductor below and beside the floater, and one of twice its conductivity below."""
    below = PlateCase("below", 0.018, conductivity=WEAK)
    poor = [below, replace(below, conductivity=2 * WEAK), PlateCase("beside", 0.018, upright=True, conductivity=WEAK)]
    rotors = [replace(case, sweep=sweep, value=10.0) for case, sweep in zip(poor[::2], ROTORS, strict=True)]
    return STUDY.gather([plate_damping(asdict(case)) for case in (*poor, *rotors)])


@pytest.mark.slow
def test_weak_currents_act_in_proportion_to_the_conductivity(weak):
    """To first order in σ: damping, torque and loss double with it."""
    one, two = weak.isel(case=0), weak.isel(case=1)
    added = [(each["growth"] - each["growth_without"]).values for each in (one, two)]
    assert np.all(added[0] < 0)
    np.testing.assert_allclose(added[1] / added[0], 2.0, rtol=0.02)
    for name in ("torque", "loss"):
        values = [abs(each[name]).max().item() for each in (one, two)]
        assert values[1] / values[0] == pytest.approx(2.0, rel=0.02)


@pytest.mark.slow
def test_a_part_of_the_range_is_a_frequency_of_stable_levitation():
    """Half way between the ends, which the closed form knows to some per cent; weak currents damp more than air."""
    scene = rotor_scene("tilt", 10.0)
    rough = stable_range(scene, Rates(rotor_table(scene.rotor, "cuboid")), *reference_state(scene))
    row = plate_damping(asdict(PlateCase("frequency", 0.5, conductivity=WEAK, part=0.5))).isel(case=0)
    middle = (rough.low.parameter + rough.high.parameter) / 2
    assert float(row["rotor_frequency"]) == pytest.approx(middle, rel=0.05)
    assert np.all(row["growth_without"] < 0)
    assert np.all(row["growth"] < row["growth_without"])


@pytest.mark.slow
def test_the_sentence_and_figure_come_from_the_dataset_alone(weak):
    lines = STUDY.report(weak)
    worst = weak["growth"].max("mode").values
    assert lines[-1].startswith("The plate ")
    assert f"below the floater to {worst[3]:+.4f} " in lines[-1]
    assert {name: len(draw(weak).axes) for name, draw in STUDY.figures.items()} == {
        "plate-damping-distance": 2,
        "plate-damping-material": 3,
        "plate-damping-rotors": 1,
        "plate-damping-means": 4,
    }


def test_every_rotor_that_levitated_has_a_plate_below_and_beside():
    found = [(case.sweep, case.configuration, case.measure) for case in cases(quick=False) if case.sweep in ROTORS]
    assert len(set(found)) == len(found) == 24


@pytest.mark.slow
def test_an_equilibrium_that_a_plate_beside_pushes_far_is_known():
    """Out of the table about where it was without the plate, by more than three millimetres in the laboratory."""
    case = PlateCase(ROTORS[1], 12.0, upright=True, part=0.5, configuration="vertical", measure=12.0)
    alone, start = without_plate(case.configuration, case.measure, case.part, case.complete)
    there, found, error = over_plate(alone, start, case.plate(start.position), "slab", RTOL)
    assert there.plate is not None
    assert np.all(there.plate.in_range(found.laboratory_turn.position, np.zeros(1)))
    moved = found.laboratory_turn.position.mean(axis=0) - start.laboratory_turn.position.mean(axis=0)
    assert np.linalg.norm(moved) > 3e-3
    assert error < 2 * RTOL
