"""Two bounces in the time of one precession: a small oscillation grows although no small motion is unstable."""

from dataclasses import replace

import numpy as np
import pytest

import spinlev as sl
from spinlev.dynamics.flights.trajectory import flight_kind
from spinlev.studies.catalogue.article import rotor_scene
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation

SCENE = sl.scene(
    frequency_hz=150.0,
    rotor=sl.horizontal(displacement_mm=2.0, edge_mm=10.0, remanence_T=1.305),
    floater=sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0),
    drag={"linear_N_s_m": 0.0, "angular_N_m_s": 0.0},
)


@pytest.mark.slow  # 40 s
def test_two_bounces_in_one_precession_lose_the_floater():
    """Without any loss, from 0.02 mm off a stable equilibrium: lost at the resonance, up beside it."""
    scene, first = replace(SCENE, start=replace(SCENE.start, offset=np.array([0.0, 0.0, 0.02e-3]))), None
    for spin, resonant in ((0.38, False), (0.423, True), (0.47, False)):
        levitation = Levitation(scene, Models("fem", "none", interaction="mutual"), spin)
        if first is not None:
            levitation.share(first)
        first = first or levitation
        stable = levitation.equilibria[0]
        modes = {mode.name: mode.frequency_hz for mode in stable.modes}
        assert stable.stable
        assert (abs(2 * modes["bounce"] - modes["precession"]) < 0.1) == resonant
        flight = levitation.flight(10.0)
        assert flight.ended_by == ("lost" if resonant else "duration")
        assert (flight_kind(flight) == "oscillating loss") == resonant


@pytest.mark.slow  # 60 s
@pytest.mark.parametrize(
    ("configuration", "measure", "spin", "frequency"),
    [
        ("horizontal", 2.0, 0.0, 151.0),
        ("horizontal", 3.0, 0.0, 87.0),
        ("horizontal", 4.0, 0.0, 63.0),
        ("tilt", 15.0, 0.0, 115.0),
        ("tilt", 20.0, 0.0, 53.0),
        ("horizontal", 2.0, 0.2, 153.0),
        ("horizontal", 3.0, 0.2, 91.0),
        ("tilt", 15.0, 0.2, 98.0),
        ("tilt", 20.0, 0.2, 57.0),
    ],
)
def test_where_two_bounces_take_as_long_as_a_precession(configuration, measure, spin, frequency):
    """The table of docs/learned.md: within 1 Hz the precession comes down to twice the bounce."""
    scene, ratios = rotor_scene(configuration, measure, permeability=1.0, drag=False), []
    for beside in (-1.0, 1.0):
        levitation = Levitation(
            replace(scene, frequency=frequency + beside), Models("cuboid", "none", interaction="rigid"), spin
        )
        stable = levitation.equilibria[0]
        assert stable.stable
        modes = {mode.name: mode.frequency_hz for mode in stable.modes}
        ratios.append(modes["precession"] / modes["bounce"])
    assert ratios[0] > 2 > ratios[1]
