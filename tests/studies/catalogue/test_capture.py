"""The study of capture: launches, shares and their errors, one small point, and what is drawn and said of a result."""

import numpy as np
import pytest

from spinlev.dynamics.flights.batch import ensemble, launched
from spinlev.dynamics.flights.trajectory import DURATION
from spinlev.studies.catalogue.capture import (
    CAPTURED,
    FARTHER,
    LEAN,
    NEARER,
    NO_EQUILIBRIUM,
    SETTLED,
    SIDEWAYS,
    SPIN,
    STUDY as CAPTURE,
    WORDS,
    launches,
    place_of,
    plate_under,
    seed_of,
    share,
    share_text,
)
from spinlev.studies.cli.options import Workers
from spinlev.studies.sweep import swept

POINT = {"configuration": "vertical", "measure": 14.0, "part": 0.5, "batch": 0, "flights": 12, "checked": 0}


@pytest.fixture(scope="module")
def place():
    return place_of("vertical", 14.0, 0.5)


def test_points_are_ten_thousand_launches_of_every_rotor_that_was_tried():
    every, flights = CAPTURE.points(False), {}
    assert {p["shape"] for p in every if "shape" in p} == {"disc", "rod", "cube"}
    points = [p for p in every if "shape" not in p]
    for p in points:
        key = p["configuration"], p["measure"], p["part"]
        flights[key] = flights.get(key, 0) + p["flights"]
    assert len(flights) == (8 + 6 + 9) * 3
    assert set(flights.values()) == {10000}
    first = points[: len(flights)]
    assert len({(p["configuration"], p["measure"], p["part"]) for p in first}) == len(flights)  # equal shares at a stop


def test_shares_have_errors_of_one_standard_deviation():
    """Many trials: √(p (1 - p)/n); none that hit: what Wilson's interval has left, 1/(n + 1)."""
    value, low, high = share(np.arange(10_000) < 3000)
    assert value == 0.3
    assert (high - low) / 2 == pytest.approx(np.sqrt(0.3 * 0.7 / 10_000), rel=1e-3)
    assert share([False] * 10) == pytest.approx((0.0, 0.0, 1 / 11))
    assert np.isnan(share([])).all()
    asked = ((142, 200), (3, 4000), (0, 4000), (0, 10_000))
    assert [share_text(np.arange(trials) < hits) for hits, trials in asked] == [
        "71.0 ± 3.2 %",
        "0.07 ± 0.05 %",
        "0.00 ± 0.01 %",
        "0.000 ± 0.005 %",
    ]


def test_launches_are_within_their_bounds_evenly_and_the_same_for_the_same_seed(place):
    (found, states), (_, again) = (launches(place, 4000, [1, 2]) for _ in range(2))
    for a, b in zip(states.vectors, again.vectors, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(launches(place, 4000, [1, 3])[0]["farther"], found["farther"])
    evenly = (
        (found["farther"] + NEARER) / (FARTHER + NEARER),
        (found["sideways"] / SIDEWAYS) ** 2,
        (1 - np.cos(found["lean"])) / (1 - np.cos(LEAN)),
        (found["spin"] / SPIN + 1) / 2,
    )
    for even in evenly:  # of a uniform variable; five standard deviations of 4000 draws
        assert even.min() >= 0
        assert even.max() <= 1
        assert even.mean() == pytest.approx(0.5, abs=5 / np.sqrt(12 * 4000))
        assert even.std() == pytest.approx(np.sqrt(1 / 12), rel=0.05)
    np.testing.assert_allclose(np.hypot(*states.position.T[:2]), found["sideways"], atol=1e-15)
    np.testing.assert_allclose(np.sum(states.moment**2, axis=1), 1, atol=1e-14)
    along = np.sum(states.spin * states.moment, axis=1) / place.scene.angular_velocity
    np.testing.assert_allclose(along, found["spin"], atol=1e-14)


def test_seeds_differ_from_rotor_to_rotor_and_from_batch_to_batch():
    asked = [("vertical", 14.0, 0.5, 0), ("vertical", 16.0, 0.5, 0), ("tilt", 14.0, 0.5, 0), ("vertical", 14.0, 0.5, 1)]
    assert len({tuple(seed_of(*a)) for a in asked}) == 4


@pytest.mark.parametrize("shape", ["sphere", pytest.param("cube", marks=pytest.mark.slow)])
def test_a_small_point_is_computed_drawn_and_told(shape):
    row = CAPTURE.compute({**POINT, "shape": shape})
    assert set(np.unique(row["outcome"])) <= set(range(4))
    held = (row["outcome"] == CAPTURED).values
    np.testing.assert_array_equal(row["levitated"].values[held], 1.0)
    assert (row["levitated"].values[~held] < 1.0).all()
    assert 2 <= held.sum() <= 11  # the share of 200 flights is 57 %: beyond this is one in thousands
    other = row.assign(batch=row["batch"] + 1)
    shorter = row.isel(flight=slice(0, 4)).assign_coords(measure=("case", [18.0])) if "measure" in row.coords else None
    result = CAPTURE.gather([row, other, *([shorter] if shorter is not None else [])])
    numbers = CAPTURE.numbers(result)["shares"]
    assert numbers[0]["flights"] == 24
    assert numbers[0]["captured"] == pytest.approx(held.mean())
    assert numbers[0]["captured"] + sum(numbers[0][word.replace(" ", "_")] for word in WORDS[1:]) == pytest.approx(1)
    told = CAPTURE.report(result)[1]
    assert f"{row['rotor_frequency'].item():.1f} Hz" in told
    assert ("cube" in told) == (shape == "cube")
    assert numbers[0]["shape"] == shape
    beyond = int(sum(result["left_plate_table"].values.ravel() == 1))
    assert any(line.startswith(f"{beyond} of ") and "plate's table" in line for line in CAPTURE.report(result))
    for draw in CAPTURE.figures.values() if shape == "sphere" else ():  # figures are of spheres
        assert draw(result).axes


def test_a_rotor_without_a_stable_frequency_is_said_not_left_out():
    row = CAPTURE.compute({**POINT, "configuration": "tilt", "measure": 50.0})
    assert (row["outcome"] == NO_EQUILIBRIUM).all()
    assert "100 % no stable frequency" in CAPTURE.report(CAPTURE.gather([row]))[1]
    assert CAPTURE.numbers(CAPTURE.gather([row]))["shares"][0]["frequency_hz"] is None


@pytest.mark.slow
def test_without_the_plates_currents_nothing_is_held(place):
    _, states = launches(place, 200, seed_of("vertical", 14.0, 0.5, 0))
    braked = launched(place.scene, place.field, plate_under(place), states, SETTLED)
    unbraked = ensemble(place.scene, place.field, states, SETTLED)
    held, none = (ended.ended_by == DURATION for ended in (braked, unbraked))
    print(f"\nheld over aluminium {share_text(held)}, over a plate that does not conduct {share_text(none)}")
    assert 0.6 < held.mean() < 0.8
    assert not none.any()


@pytest.mark.slow
def test_the_number_of_workers_does_not_matter(tmp_path):
    points = [{**POINT, "batch": k, "flights": 10, "checked": 1 - k} for k in range(2)]
    one, two = (swept(CAPTURE, points, Workers(workers=n), tmp_path / str(n)) for n in (1, 2))
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, two[name].values)
