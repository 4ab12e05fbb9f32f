"""What the console says of an equilibrium and a flight: digits, verdicts, and what is not said."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from places import SCENES

from spinlev.dynamics.equilibria.equilibrium import (
    FOLD,
    IN_ROTOR,
    NOT_CONVERGED,
    PAST_TABLE,
    Equilibrium,
    LeftOut,
    Survey,
)
from spinlev.dynamics.equilibria.search import free_of_bodies
from spinlev.dynamics.motion.state import State
from spinlev.geometry.magnets import Conductor
from spinlev.geometry.scene.files import load_scene
from spinlev.geometry.shapes import Box
from spinlev.studies.cli.options import Models
from spinlev.studies.compare import compared_models
from spinlev.studies.effects import ListedEffect, would_end
from spinlev.studies.levitation import Levitation
from spinlev.studies.result import Result
from spinlev.studies.words import (
    bracketed,
    comparison_words,
    equilibria_rows,
    equilibria_words,
    flight_words,
    headline,
    kind_of_flight,
    left_out_words,
)


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
    assert headline(levitation, [alone]).endswith("decays at 0.0001 s⁻¹ by air drag.")
    assert headline(levitation, [damped]) == (
        "Stable levitation 17.21(1) mm below the rotor's centre, polar angle 9.8°. Least stable mode: unnamed, decays "
        "at 2.9 s⁻¹ by eddy currents in the plate."
    )


def test_stable_is_said_in_one_way(levitation):
    """The article's criterion, 250 s, parts marginal equilibria from unstable ones; row, sentence and number agree."""
    for growth, kind, said in ((2.2e-5, "marginal", "Marginally unstable"), (0.01, "unstable", "Unstable")):
        found = equilibrium(stable=False, growth=growth)
        assert found.stability == kind
        assert equilibria_rows(levitation, [found])[1][-1] == said.lower()
        assert headline(levitation, [found]).startswith(f"{said} 17.21(1) mm below")
    assert headline(levitation, [equilibrium(stable=False, growth=2.2e-5)]).endswith("e-folding time of 12.6 h.")


def test_a_floater_beside_the_rotor_is_not_said_to_be_below(levitation):
    beside = State(np.array([0.013, 0.0, -1.2e-4]), np.zeros(3), np.array([1.0, 0.0, 0.0]), np.zeros(3))
    said = headline(levitation, [replace(equilibrium(), state=beside)])
    assert said.startswith(
        "Stable levitation 0.120(2) mm along the axis from the rotor's centre, lateral offset 13.00(1) mm"
    )


def test_rows_that_mean_nothing_are_not_printed(levitation):
    rough = equilibrium(error=0.12)
    lines = equilibria_words(levitation, Survey((equilibrium(), rough), ()))
    assert len(lines) == 3  # headline, head of the table, one row
    assert headline(levitation, [rough]).startswith("No levitation")


def test_places_where_the_floater_would_overlap_the_plate_are_no_equilibria(levitation):
    """The article's scene: of three fixed points two are in the aluminium, or so near that the sphere cuts its face."""
    scene = load_scene(SCENES / "tilt-over-plate.toml")
    over = Levitation(scene, Models("cuboid", "none"))
    over.share(levitation)
    assert scene.plate is not None
    top, bottom = scene.plate.box.corners[:, 2].max(), scene.plate.box.corners[:, 2].min()
    heights = [e.position[2] for e in levitation.equilibria]
    free = [z for z in heights if z - scene.floater.radius > top or z + scene.floater.radius < bottom]
    assert 0 < len(free) < len(heights)
    assert [e.position[2] for e in over.equilibria] == free
    answer, lines = Result(over, over.survey).summary, equilibria_words(over, over.survey)
    assert [one["why"] for one in answer["left_out"]] == ["in the plate"] * (len(heights) - len(free))
    assert len(answer["equilibria"]) == len(free)
    (said,) = (line for line in lines if line.startswith("Left out: 2 solutions at 3"))
    assert said.endswith("where the floater would overlap the plate.")
    assert len(lines) == 1 + 1 + len(free) + 1


def test_places_in_metal_that_turns_with_the_rotor_are_none_either(levitation):
    """A shaft from 40 mm on: of three fixed points, at 19, 34 and 45 mm, the floater touches it in two."""
    shaft = Conductor(Box(np.array([0.01, 0.01, 0.06]), np.array([0.0, 0.0, -0.07])), 1e6)
    found = free_of_bodies(replace(levitation.scene, conductors=(shaft,)), levitation.without_plate)
    known = levitation.without_plate.equilibria
    assert found.equilibria == tuple(e for e in known if e.distance < 0.033)
    assert [one.why for one in found.left_out] == [IN_ROTOR] * (len(known) - len(found.equilibria))
    assert found.left_out


def test_what_could_not_be_computed_is_told(levitation):
    """And never that there is nothing."""
    lost = [LeftOut(equilibrium(), why, 0.4) for why in (FOLD, NOT_CONVERGED, PAST_TABLE)]
    assert headline(levitation, [], lost[:1]) == "No levitation at 130 Hz: no solution is an equilibrium."
    assert headline(levitation, [], lost).endswith("but not all could be computed.")
    fold, unknown, past = left_out_words(levitation, lost)
    assert "17.21(1) mm" in fold
    assert "ends at 40.0% of it" in fold
    assert "there may be an equilibrium" in unknown
    assert "beyond the range of the plate's precomputed field" in past


@pytest.mark.parametrize(
    ("apart", "error", "said"),
    [
        (-0.098, 1e-3, "18.83 mm, 0.098(1) mm less than with finite elements."),
        (0.0981, 1e-3, "18.83 mm, 0.098(1) mm more than with finite elements."),
        (3e-12, 2e-12, "18.83 mm, no difference beyond its error of 1e-06 mm."),
        (1e-3, 2e-3, "18.83 mm, no difference beyond its error of 2e-03 mm."),
        (0.0, 0.0, "18.83 mm, no difference beyond its error of 1e-06 mm."),
    ],
)
def test_a_difference_below_its_error_is_none(apart, error, said):
    compared = {"true_model": "fem", "dipole_distance_mm": 18.83, "difference_mm": apart, "difference_error_mm": error}
    compared |= {"dipole_stability": "stable", "true_stability": "stable", "true_moment_distance_mm": None}
    compared |= {"true_distance_mm": 18.83 - apart}
    (line,) = comparison_words(compared)
    assert line == f"Point-dipole model, same conditions: levitation distance {said}"
    if "than with" in said:
        (line,) = comparison_words(compared | {"true_moment_distance_mm": 18.7352})
        assert line.endswith(" than with finite elements; with the magnets' true moments 18.74 mm.")


def test_the_dipole_is_compared_whatever_its_stability():
    """With its equilibrium that is nearest to where finite elements have the floater levitate."""
    near, far = equilibrium(stable=False, growth=0.1), equilibrium(stable=False, growth=0.2)
    far = replace(far, state=State(far.position - [0.0, 0.0, 0.02], np.zeros(3), far.state.moment, np.zeros(3)))
    found = compared_models(Survey((far, near), ()), Survey((near,), ()), Survey((equilibrium(),), ()), "fem")
    assert (found["dipole_stability"], found["true_stability"], found["difference_mm"]) == ("unstable", "stable", 0.0)
    (line,) = comparison_words(found)
    assert "levitation distance 17.21 mm (unstable), no difference" in line


def test_the_comparison_says_which_model_has_no_equilibrium():
    nothing, one = Survey((), ()), Survey((equilibrium(),), ())
    assert compared_models(nothing, nothing, nothing, "fem") is None
    (line,) = comparison_words(compared_models(nothing, nothing, one, "fem"))
    assert line == "Point-dipole model, same conditions: no equilibrium; with finite elements 17.21 mm (stable)."
    (line,) = comparison_words(compared_models(one, nothing, nothing, "fem"), plate=True)
    assert line.endswith("17.21 mm (stable), where there is no equilibrium with finite elements.")
    assert "same conditions without the plate" in line


def beginning(start):
    """A levitation whose trajectories begin at an equilibrium."""
    found = SimpleNamespace(absolute=False, stability=start)
    found.quiet = found
    return found


def test_a_flight_from_an_unstable_equilibrium_is_never_called_stable():
    start = equilibrium(stable=False, growth=0.09)
    unstable = beginning(start)
    time = np.linspace(0, 1.0, 400)
    resting = np.tile(start.position, (400, 1))
    places = SimpleNamespace(position=resting)
    flight = SimpleNamespace(
        time=time, lab=places, rotor=places, ended_by="duration", levitated_s=1.0, left_plate_table=False, given=None
    )
    assert kind_of_flight(unstable, flight) == "growing oscillation"
    assert (
        flight_words(unstable, flight)
        == "Simulated 1 s: still levitating, with a growing oscillation (e-folding time 11.1 s)."
    )
    at_rest = beginning(equilibrium())
    assert kind_of_flight(at_rest, flight) == "stable"
    assert "stable" not in headline(unstable, [start]).lower().replace("unstable", "")


def test_neglected_currents_that_would_end_levitation_are_said():
    """0.015 + 0.016 1/s on a mode that decays at 5e-5 1/s: e-folding in 32 s; at 2.8 1/s, over a plate, nothing."""
    added = [ListedEffect(name, False, 0.0, growth, "") for name, growth in (("rotor", 0.015), ("floater", 0.016))]
    (line,) = would_end(equilibrium(growth=-4.6e-5), added)
    assert line == "With the neglected eddy currents it would be unstable, with an e-folding time of about 32.3 s."
    assert would_end(equilibrium(growth=-2.8), added) == []
    assert would_end(None, added) == []
    assert would_end(equilibrium(growth=-4.6e-5), [replace(one, included=True) for one in added]) == []
