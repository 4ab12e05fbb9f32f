"""Curves of folds and of losses of stability against the stability that a search finds beside them."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, SCENE

from spinlev.dynamics.continuation.boundary import COLLISION, CROSSING, Plane, follow_boundary
from spinlev.dynamics.continuation.engine import OSCILLATORY, Family, follow_branch
from spinlev.dynamics.equilibria.equilibrium import FOLD, EquilibriumError
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.maps.family import rotor_family
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.scene.contents import Drag

LOWER, UPPER, UNITS = np.array([50.0, 1e-3]), np.array([250.0, 6e-3]), np.array([50.0, 2e-3])


@pytest.fixture(scope="module")
def family():
    return rotor_family(SCENE, "horizontal", "dipole")


@pytest.fixture(scope="module")
def stable():
    return next(e for e in find_equilibria(SCENE, rotor_table(SCENE.rotor, "dipole")) if e.stable)


def marked(family, stable, kind, end, scene=SCENE):
    """The first change of its kind on the branch from the scene's stable equilibrium, in frequency."""
    start, problem = Scales.of(scene).pack(stable.state), family.frequencies(2e-3)
    return next(p for p in follow_branch(Family(family.rates, problem, 50.0), start, 110.0, end) if p.kind == kind)


def beside(family, point, factor):
    """Equilibria by a search near a boundary's point, at its frequency times a factor."""
    scene = family.at(point.place[0] * factor, point.place[1])
    found = find_equilibria(scene, rotor_table(scene.rotor, "dipole"))
    return [e for e in found if np.linalg.norm(e.position / FLOATER.radius - point.position) < 0.05]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "end"), [(FOLD, 60.0), (OSCILLATORY, 250.0)])
def test_boundary_is_where_a_search_finds_the_change(family, stable, kind, end):
    """To 1e-6 of the frequency: on one side a stable equilibrium, on the other none or an unstable one."""
    plane = Plane(family.rates, family.values, 0.0, UNITS, LOWER, UPPER)
    start = marked(family, stable, kind, end)
    points = follow_boundary(plane, start, np.array([start.parameter, 2e-3]))
    places = np.array([point.place for point in points])
    assert np.ptp(places[:, 0]) > 60.0  # it is a curve, not a point
    assert np.ptp(places[:, 1]) > 1e-3
    for point in points[:: len(points) - 1]:
        known, unknown = (1 + 1e-6, 1 - 1e-6) if kind == FOLD else (1 - 1e-6, 1 + 1e-6)  # which side is stable
        assert any(e.stable for e in beside(family, point, known))
        others = beside(family, point, unknown)
        assert others == [] if kind == FOLD else [e.stable for e in others] == [False]


def test_a_fold_is_the_same_in_either_parameter(family, stable):
    """The curve from a fold in frequency passes through a fold in displacement, found on its own: 1e-9."""
    plane = Plane(family.rates, family.values, 0.0, UNITS, LOWER, UPPER)
    start = marked(family, stable, FOLD, 60.0)
    curve = follow_boundary(plane, start, np.array([start.parameter, 2e-3]))
    in_measure = Family(family.rates, family.measures(110.0), 2e-3)
    branch = follow_branch(in_measure, Scales.of(SCENE).pack(stable.state), 2e-3, 1e-3)
    fold = next(p for p in branch if p.kind == FOLD)
    again = follow_boundary(plane, fold, np.array([110.0, fold.parameter]))
    for point in curve[:: len(curve) // 3]:
        places = np.array([other.place / UNITS for other in again])
        near = np.argsort(np.linalg.norm(places - point.place / UNITS, axis=1))[:2]
        way = places[near[1]] - places[near[0]]
        off = point.place / UNITS - places[near[0]]
        assert abs(off[0] * way[1] - off[1] * way[0]) / np.linalg.norm(way) < 2e-3  # the chord's distance from the arc
    assert again[0].angular_frequency == 0


@pytest.mark.slow
def test_with_drag_the_crossing_is_where_growth_changes_its_sign(stable):
    """Strong linear drag: growth is within 1e-6 of zero in units of the rotor's rate, and changes its sign there."""
    scene = replace(SCENE, drag=Drag(3e-2, 1e-7))
    family = rotor_family(scene, "horizontal", "dipole")
    plane = Plane(family.rates, family.values, 0.0, UNITS, LOWER, UPPER)
    known = min(find_equilibria(scene, rotor_table(scene.rotor, "dipole")), key=lambda e: e.growth_per_s)
    start, problem = Scales.of(scene).pack(known.state), family.frequencies(2e-3)
    branch = follow_branch(Family(family.rates, problem, 50.0), start, 110.0, 250.0)
    change = next(p for p in branch if p.kind == OSCILLATORY)
    points = follow_boundary(plane, change, np.array([change.parameter, 2e-3]))
    assert np.ptp([point.place[0] for point in points]) > 20.0
    for point in points[:: len(points) - 1]:
        below, above = (beside(family, point, 1 + s) for s in (-1e-6, 1e-6))
        assert below[0].growth_per_s * above[0].growth_per_s < 0
    with pytest.raises(EquilibriumError, match=COLLISION):
        follow_boundary(plane, branch[0], np.array([110.0, 2e-3]), COLLISION)
    assert CROSSING != COLLISION
