"""What the console says of an equilibrium and a flight: digits, verdicts, and what is not said."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from places import SCENES

from spinlev.dynamics.motion import State
from spinlev.dynamics.steady import Equilibrium
from spinlev.geometry.scenes import load_scene
from spinlev.studies.one_scene import Levitation
from spinlev.studies.one_scene.answers import kind_of_flight
from spinlev.studies.one_scene.words import bracketed, equilibria_words, flight_words, headline
from spinlev.studies.terminal import Models


def equilibrium(stable=True, growth=-2.87, error=2e-6, currents=None, without=None):
    state = State(np.array([4e-4, 0.0, -0.0172138]), np.zeros(3), np.array([0.17, 0.0, 0.985]), np.zeros(3))
    return Equilibrium(state, 0.0, 0.0, error, stable, growth, 1e-9, np.array([5.0]), (), None, currents, without)


@pytest.fixture(scope="module")
def levitation():
    return Levitation(replace(load_scene(SCENES / "tilt-over-plate.toml"), plate=None), Models("cuboid", "none"))


@pytest.mark.parametrize(
    ("value", "error", "said"),
    [(17.2138, 2e-6, "17.21(1)"), (17.2138, 0.023, "17.21(3)"), (-2.871, 0.12, "-2.9(2)"), (1234.5, 40.0, "1234(40)")],
)
def test_a_number_with_its_uncertainty(value, error, said):
    assert bracketed(value, error) == said


def test_the_plate_is_named_where_it_damps(levitation):
    alone = equilibrium(growth=-1e-4)
    damped = equilibrium(currents=np.zeros((1, 3)), without=alone)
    assert headline(levitation, [alone]).endswith("damped at 0.0001 /s by the air.")
    assert headline(levitation, [damped]) == (
        "Floats 17.21(1) mm below the rotor, tilted 9.8°; stable, slowest motion (a small motion) damped at 2.9 /s by "
        "the plate."
    )


def test_rows_that_mean_nothing_are_not_printed(levitation):
    rough = equilibrium(error=0.12)
    assert len(equilibria_words(levitation, [equilibrium(), rough])) == 3  # headline, head of the table, one row
    assert headline(levitation, [rough]).startswith("Nothing floats")


def test_a_flight_from_an_unstable_equilibrium_is_never_called_stable():
    start = equilibrium(stable=False, growth=0.09)
    unstable = SimpleNamespace(absolute=False, stability=start)
    time = np.linspace(0, 1.0, 400)
    resting = np.tile(start.position, (400, 1))
    places = SimpleNamespace(position=resting)
    flight = SimpleNamespace(
        time=time, lab=places, rotor=places, ended_by="duration", levitated_s=1.0, left_plate_table=False
    )
    assert kind_of_flight(unstable, flight) == "growing oscillation"
    assert flight_words(unstable, flight) == "Flew 1 s, still up; the oscillation grows (e-fold in 11 s)."
    at_rest = SimpleNamespace(absolute=False, stability=equilibrium())
    assert kind_of_flight(at_rest, flight) == "stable"
    assert "stable" not in headline(unstable, [start]).replace("unstable", "")
