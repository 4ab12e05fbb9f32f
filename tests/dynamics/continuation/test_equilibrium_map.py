"""Maps of equilibria against searches that know nothing of their neighbours."""

from dataclasses import replace

import numpy as np
import pytest
from article import PERMEABLE

from spinlev.dynamics.continuation.map import equilibrium_map, family_grid
from spinlev.dynamics.continuation.rotor_family import rotor_family
from spinlev.dynamics.equilibria.curves import fixed_points
from spinlev.dynamics.equilibria.equilibrium import EquilibriumError
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Parameter
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import Magnet, horizontal, tilt, vertical
from spinlev.geometry.scene.contents import Drag, Scene
from spinlev.geometry.scene.floater import Floater, FloaterPart
from spinlev.geometry.shapes import Box

SHAPE = (10e-3, 1.305, 1.05)
ROTORS = {
    "horizontal": (horizontal(2e-3, *SHAPE), np.linspace(1e-3, 4e-3, 9)),
    "vertical": (vertical(14e-3, *SHAPE), np.linspace(10e-3, 18e-3, 9)),
    "tilt": (tilt(np.radians(10.0), *SHAPE), np.radians(np.linspace(5.0, 20.0, 9))),
}
FREQUENCIES = np.linspace(60.0, 180.0, 13)


def scene_of(name):
    return Scene(110.0, ROTORS[name][0], PERMEABLE, Drag(0.0, 0.0))


@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("horizontal", "dipole"),
        *(pytest.param(name, "dipole", marks=pytest.mark.slow) for name in ("vertical", "tilt")),
        *(pytest.param(name, "cuboid", marks=pytest.mark.slow) for name in ROTORS),
        pytest.param("horizontal", "fem", marks=pytest.mark.slow),
    ],
)
@pytest.mark.slow
def test_map_equals_searches_at_random_points(name, model):
    """All equilibria, their places to 1e-9 m, growth and stability, of a table made for the point's own rotor."""
    family, measures = rotor_family(scene_of(name), name, model, 1e-4, interaction="rigid"), ROTORS[name][1]
    spacing = 8 if name == "horizontal" else 3
    found, rng = equilibrium_map(family, FREQUENCIES, measures, spacing=spacing), np.random.default_rng(1)
    assert found.number[0].sum() == len(found.row)
    for row, column in rng.integers((len(FREQUENCIES), len(measures)), size=(4, 2)):
        scene = family.at(FREQUENCIES[row], measures[column])
        expected = find_equilibria(scene, rotor_table(scene.rotor, model, 1e-4))
        here = np.flatnonzero((found.row == row) & (found.column == column))
        assert len(here) == len(expected)
        assert found.number[1][row, column] == sum(e.stable for e in expected)
        for e in expected:
            apart = np.linalg.norm(found.position[here] - e.position, axis=1)
            apart += np.linalg.norm(found.moment[here] - e.state.moment, axis=1) * PERMEABLE.radius
            same = here[np.argmin(apart)]
            assert apart.min() < 1e-9
            assert found.stable[same] == e.stable
            tolerance = 1e-6 + 3 * (e.growth_error_per_s + found.errors[same])
            assert found.growth_per_s[same] == pytest.approx(e.growth_per_s, abs=tolerance)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["dipole", "cuboid"])
@pytest.mark.parametrize("name", ["horizontal", "vertical"])
def test_map_misses_nothing_that_a_search_finds(name, model):
    """At thirty random points; sheets that leave the range, such as z > 0, and come back are followed outside it."""
    family, measures = rotor_family(scene_of(name), name, model, 1e-4), ROTORS[name][1]
    grid = family_grid(family, FREQUENCIES, measures, 0.0)
    found = equilibrium_map(family, FREQUENCIES, measures, spacing=3)
    places = np.concatenate([found.position / PERMEABLE.radius, found.moment], axis=1)
    for point in np.random.default_rng(5).choice(len(grid), 30, replace=False):
        here = places[found.row * len(measures) + found.column == point]
        for place in fixed_points(grid.alone(int(point)), grid.range(int(point)))[1]:
            assert np.linalg.norm(here - place, axis=1).min() < 1e-6


@pytest.mark.parametrize("name", ROTORS)
def test_a_moved_rotor_has_the_field_of_its_own_table(name):
    """Rates at random states: the field with a runtime measure, and a table made for that measure; round-off."""
    family = rotor_family(scene_of(name), name, "cuboid")
    measure = ROTORS[name][1][3]
    scene = family.at(110.0, measure)
    values = family.values(110.0, measure)
    assert values[0, Parameter.MEASURE] == measure
    states = np.random.default_rng(0).normal(size=(5, 12)) * 0.3 + np.eye(12)[2] * -4.0
    expected = Rates(rotor_table(scene.rotor, "cuboid"))(states, values[0])
    for ours, theirs in zip(family.rates(states, np.repeat(values, 5, axis=0)), expected, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-13 * np.abs(theirs).max())


@pytest.mark.slow
def test_sheets_are_found_around_their_folds():
    """With one search in a corner of the map, far beyond the folds: the same as with searches all over it."""
    family, measures = rotor_family(scene_of("horizontal"), "horizontal", "dipole"), ROTORS["horizontal"][1]
    frequencies = FREQUENCIES[2:]
    one = equilibrium_map(family, frequencies, measures, spacing=100)
    many = equilibrium_map(family, frequencies, measures, spacing=4)
    assert one.searches == 4
    assert many.searches > 8
    np.testing.assert_array_equal(one.number, many.number)


@pytest.mark.slow
def test_a_cube_has_the_map_of_its_mean():
    """Where it levitates by its multipoles about the moment: 3 µm from where all its charges have it."""
    body = Box((10e-3,) * 3)
    cube = Floater(body.circumradius, 1.305, 1.0, 7500.0, None, body)
    scene = replace(scene_of("horizontal"), floater=cube)
    family = rotor_family(scene, "horizontal", "cuboid", interaction="rigid")
    found = equilibrium_map(family, [105.0, 110.0], [2e-3])
    assert found.stable.sum() == 2
    for row, place in zip(found.row[found.stable], found.position[found.stable], strict=True):
        at = replace(scene, frequency=float(found.frequencies[row]))
        (true,) = (e for e in find_equilibria(at, rotor_table(at.rotor, "cuboid")) if e.stable)
        assert 0 < np.linalg.norm(place - true.position) < 1e-5


def test_what_has_no_map_says_so():
    body = Box((4e-3, 6e-3, 10e-3))
    oblique = FloaterPart(Magnet(body, 1.3 * np.array([0.0, 0.6, 0.8])), 7500.0)
    with pytest.raises(InputError, match="its moment along a principal axis"):
        rotor_family(replace(scene_of("horizontal"), floater=Floater.composed([oblique])), "horizontal", "dipole")
    family = rotor_family(scene_of("horizontal"), "horizontal", "dipole")
    with pytest.raises(EquilibriumError, match="only where the rotor turns"):
        equilibrium_map(family, [0.0, 10.0], [1e-3])
    with pytest.raises(ValueError, match="configuration must be one of"):
        rotor_family(scene_of("horizontal"), "vertical", "dipole")
    with pytest.raises(InputError, match="model must be dipole or cuboid for a family of rotors whose magnets move"):
        rotor_family(scene_of("vertical"), "vertical", "fem")
