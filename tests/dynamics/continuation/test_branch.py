"""Branches of equilibria against known numbers, surveys that know nothing of them, and themselves."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER

from spinlev.dynamics.continuation.branch import OSCILLATORY, Family, follow_branch, frequencies, spins
from spinlev.dynamics.equilibria.equilibrium import FOLD, EquilibriumError
from spinlev.dynamics.equilibria.path import Steps
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import horizontal, vertical
from spinlev.geometry.scene.contents import Drag, Scene

HORIZONTAL = Scene(118.0, horizontal(1.7e-3, 10e-3, 1.305, 1.0), FLOATER, Drag(0.0, 0.0))
VERTICAL = Scene(60.0, vertical(14e-3, 10e-3, 1.305, 1.0), FLOATER, Drag(0.0, 0.0))
TABLES = {id(scene): rotor_table(scene.rotor, "dipole") for scene in (HORIZONTAL, VERTICAL)}


@pytest.fixture(scope="module")
def compiled():
    return {key: Rates(table) for key, table in TABLES.items()}


def nearest(scene, table, rates, spin):
    return min(find_equilibria(scene, table, spin, rates=rates), key=lambda e: e.growth_per_s)


def followed(compiled, base, spin, end, problem=None, parameter=None, unit=1.0, steps=None, frequency=None):
    """Branch from the stable equilibrium at body spin `spin`, in the spin itself unless another problem is given."""
    scene = replace(base, frequency=frequency or base.frequency)
    rates = compiled[id(base)]
    start = Scales.of(scene).pack(nearest(scene, TABLES[id(base)], rates, spin).state)
    family = Family(rates, problem or spins(scene), unit)
    return follow_branch(family, start, spin if parameter is None else parameter, end, steps)


@pytest.mark.parametrize(
    ("base", "known", "none_from"),
    [(HORIZONTAL, {-0.2: 19.0, 0.0: 20.1, 0.2: 22.1}, 0.4), (VERTICAL, {-0.2: 31.6, -0.1: 33.3}, -0.05)],
    ids=["horizontal", "vertical"],
)
def test_distance_follows_spin_as_known(compiled, base, known, none_from):
    """Distances of PHYSICS.md, found there by other means, to their last digit; beyond the fold there is nothing."""
    first, *others = known
    for end in others:
        points = followed(compiled, base, first, end)
        assert points[-1].spin == end
        assert 1e3 * points[0].distance == pytest.approx(known[first], abs=0.08)
        assert 1e3 * points[-1].distance == pytest.approx(known[end], abs=0.08)
    (fold,) = [p for p in followed(compiled, base, first, 1.0) if p.kind == FOLD]
    assert max(known) < fold.spin < none_from


def test_a_fold_is_where_a_survey_loses_two_equilibria(compiled):
    """On one side the pair is apart by the root law, on the other it is gone."""
    (fold,) = [p for p in followed(compiled, HORIZONTAL, 0.0, 1.0) if p.kind == FOLD]
    rates, table = compiled[id(HORIZONTAL)], TABLES[id(HORIZONTAL)]

    def near(gap):
        found = find_equilibria(HORIZONTAL, table, fold.spin - gap, rates=rates)
        return sorted(e.distance for e in found if abs(e.distance - fold.distance) < 2e-3)

    wide, close = near(1e-3), near(1e-5)
    assert near(-1e-5) == []
    assert (wide[1] - wide[0]) / (close[1] - close[0]) == pytest.approx(10.0, rel=0.02)


@pytest.mark.parametrize("gap", [1e-2, pytest.param(1e-3, marks=pytest.mark.slow), 1e-5])
def test_an_end_just_before_a_fold_is_not_stepped_over(compiled, gap):
    """One long step leads past the end and back round the fold; the branch ends where it was told to, before that."""
    (fold,) = [p for p in followed(compiled, HORIZONTAL, 0.0, 1.0) if p.kind == FOLD]
    points = followed(compiled, HORIZONTAL, 0.0, fold.spin - gap, steps=Steps(longest=0.4, turn=0.6))
    assert points[-1].spin == fold.spin - gap
    assert FOLD not in {point.kind for point in points}
    assert points[-1].distance < fold.distance


def test_fold_is_located_to_round_off(compiled):
    """The same fold, met in spin and in frequency and with other steps, is the same point."""
    (in_spin,) = [p for p in followed(compiled, HORIZONTAL, 0.0, 1.0) if p.kind == FOLD]
    short = followed(compiled, HORIZONTAL, 0.0, 1.0, steps=Steps(longest=0.017))
    assert next(p for p in short if p.kind == FOLD).spin == pytest.approx(in_spin.spin, abs=1e-12)
    down = followed(
        compiled, HORIZONTAL, in_spin.spin - 0.1, 60.0, frequencies(HORIZONTAL, in_spin.spin - 0.1), 118.0, 50.0
    )
    fold = next(p for p in down if p.kind == FOLD)
    there = followed(compiled, HORIZONTAL, in_spin.spin - 0.11, 1.0, frequency=fold.parameter)
    assert next(p for p in there if p.kind == FOLD).spin == pytest.approx(in_spin.spin - 0.1, abs=1e-10)


@pytest.mark.parametrize(
    ("make", "begin", "end", "unit"),
    [
        (lambda value: replace(HORIZONTAL, frequency=value), 118.0, 131.0, 50.0),
        (lambda value: replace(HORIZONTAL, gravity=np.array([0.0, 0.0, -value])), 9.81, 3.0, 5.0),
        (lambda value: replace(HORIZONTAL, floater=replace(FLOATER, remanence=value)), 1.305, 1.27, 0.5),
    ],
    ids=["frequency", "gravity", "remanence"],
)
def test_any_parameter_of_the_scene_ends_at_the_survey_s_equilibrium(compiled, make, begin, end, unit):
    def problem(value):
        scene = make(value)
        return parameters(scene, Scales.of(scene), frozen_spin=True), 0.0

    last = followed(compiled, HORIZONTAL, 0.0, end, problem, begin, unit)[-1]
    expected = nearest(make(end), TABLES[id(HORIZONTAL)], compiled[id(HORIZONTAL)], 0.0)
    np.testing.assert_allclose(last.position, expected.position, atol=1e-13)
    assert last.motion.stable == expected.stable


@pytest.mark.slow
def test_oscillatory_loss_of_stability_between_80_and_100_hz(compiled):
    """PHYSICS.md: stable at 80 Hz, unstable from about 100 Hz; the survey finds the change at the same frequency."""
    scene = replace(VERTICAL, frequency=80.0)
    points = followed(compiled, VERTICAL, 0.0, 100.0, frequencies(scene), 80.0, 50.0, frequency=80.0)
    change = next(p for p in points if p.kind)
    assert change.kind == OSCILLATORY
    assert 80.0 < change.parameter < 100.0
    assert change.leading_hz > 1.0
    for offset, stable in ((-0.02, True), (0.02, False)):
        beside = replace(scene, frequency=change.parameter + offset)
        assert nearest(beside, TABLES[id(VERTICAL)], compiled[id(VERTICAL)], 0.0).stable is stable


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "end"), [(FOLD, 60.0), (OSCILLATORY, 250.0)])
def test_a_marked_frequency_is_where_a_search_finds_the_change(compiled, kind, end):
    """To 1e-6 of the frequency: on one side a stable equilibrium, on the other none or an unstable one."""
    points = followed(compiled, HORIZONTAL, 0.0, end, frequencies(HORIZONTAL), 118.0, 50.0)
    mark = next(p for p in points if p.kind == kind)

    def beside(factor):
        scene = replace(HORIZONTAL, frequency=mark.parameter * factor)
        found = find_equilibria(scene, TABLES[id(HORIZONTAL)], rates=compiled[id(HORIZONTAL)])
        return [e.stable for e in found if np.linalg.norm(e.position - mark.position) < 0.05 * FLOATER.radius]

    with_stable, without = (1 + 1e-6, 1 - 1e-6) if kind == FOLD else (1 - 1e-6, 1 + 1e-6)
    assert any(beside(with_stable))
    assert beside(without) == ([] if kind == FOLD else [False])


def test_no_equilibrium_to_start_from(compiled):
    start = np.zeros(12)
    start[2], start[8] = -40.0, 1.0
    with pytest.raises(EquilibriumError, match="near an equilibrium"):
        follow_branch(Family(compiled[id(VERTICAL)], spins(VERTICAL)), start, 0.5, 1.0)
