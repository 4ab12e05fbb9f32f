"""Searches at the points of a map: side by side, with few starts and long steps they find what careful ones find."""

import numpy as np
import pytest
from article import PERMEABLE, moved_rotors

from spinlev.dynamics.continuation import map as filling
from spinlev.dynamics.continuation.map import equilibrium_map, map_grid
from spinlev.dynamics.equilibria.balance import EVERY
from spinlev.dynamics.equilibria.curves import newton_search

ENDS = {"horizontal": (0.6e-3, 5e-3), "vertical": (10e-3, 20e-3), "tilt": (np.radians(3.0), np.radians(25.0))}
CASES = [(name, model) for model in ("dipole", "cuboid") for name in ENDS]


def map_of(name, side, model="dipole"):
    """Scenes, fields and frequencies of a map of side × side points."""
    return *moved_rotors(name, np.linspace(*ENDS[name], side), model, rtol=3e-6), np.linspace(20.0, 300.0, side)


def grid_of(name, side, model="dipole"):
    """Its points."""
    return map_grid(*map_of(name, side, model), 0.0)


def found_by(grid, points, random=None, reach=filling.REACH, far=filling.FAR):
    """Points (k,) and places (k, 6) that one call finds at several points of a grid."""
    every = [(point, grid.range(point).starts()) for point in points]
    some = [
        (p, s if random is None else s[random.choice(len(s), len(s) // filling.PART, replace=False)]) for p, s in every
    ]
    starts = [(np.full(len(chosen), point), chosen) for point, chosen in some]
    starts = (np.concatenate(part) for part in zip(*starts, strict=True))
    return newton_search(grid.balance, grid.holds, *starts, EVERY, filling.MARGIN, reach, far)


def missed(expected, found):
    """How many of the expected places are not among those found at their point, to 1e-9: round-off near a fold."""
    (points, places), (point, near) = expected, found
    return sum(
        np.linalg.norm(near[point == k] - place, axis=1).min(initial=np.inf) > 1e-9
        for k, place in zip(points, places, strict=True)
    )


def test_searches_side_by_side_find_what_each_finds_alone():
    """The same to the round-off of machine code that takes its points in groups, and in the same order."""
    grid, points = grid_of("horizontal", 3), [0, 4, 8]
    point, places = found_by(grid, points, np.random.default_rng(0))
    random = np.random.default_rng(0)
    alone = [found_by(grid, [k], random) for k in points]
    np.testing.assert_array_equal(point, np.concatenate([part[0] for part in alone]))
    np.testing.assert_allclose(places, np.concatenate([part[1] for part in alone]), atol=1e-10)
    assert set(point) == set(points)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "model"), CASES)
def test_long_steps_miss_nothing_that_short_ones_find(name, model):
    """From all starts at sixteen points of a map."""
    grid = grid_of(name, 4, model)
    long, short = (found_by(grid, range(16), None, *steps) for steps in ((filling.REACH, filling.FAR), (0.3, np.inf)))
    assert len(short[0]) > 2 * len(grid)
    assert missed(short, long) == 0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "model"), CASES)
def test_an_eighth_of_the_starts_misses_one_in_a_hundred_at_most(name, model):
    """Of five draws at sixteen points (none to three in a thousand); a map has the sheet at the points beside it."""
    grid = grid_of(name, 4, model)
    every = found_by(grid, range(16))
    some = [found_by(grid, range(16), np.random.default_rng(seed)) for seed in range(5)]
    assert sum(missed(every, draw) for draw in some) <= 0.01 * 5 * len(every[0])


@pytest.mark.parametrize(
    ("name", "model", "side"),
    [("horizontal", "dipole", 12), *((*case, 30) for case in CASES)],
)
@pytest.mark.slow
def test_a_map_has_every_equilibrium_that_whole_searches_by_short_steps_find(name, model, side, monkeypatch):
    """At 144 or 900 points each: the same numbers, at the same places."""
    quick = equilibrium_map(*map_of(name, side, model))
    for constant, careful in {"WHOLE": 1, "REACH": 0.3, "FAR": np.inf}.items():
        monkeypatch.setattr(filling, constant, careful)
    whole = equilibrium_map(*map_of(name, side, model))
    np.testing.assert_array_equal(quick.number, whole.number)
    quickly, wholly = (
        (found.row * side + found.column, np.concatenate([found.position, found.moment * PERMEABLE.radius], axis=1))
        for found in (quick, whole)
    )
    assert missed(wholly, quickly) == 0
