"""Maps of equilibria against searches that know nothing of their neighbours."""

from dataclasses import replace

import numpy as np
import pytest
from article import PERMEABLE, moved_rotors

from spinlev.dynamics.continuation.map import equilibrium_map
from spinlev.dynamics.equilibria.curves import fixed_points
from spinlev.dynamics.equilibria.equilibrium import EquilibriumError
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.rotor_effects import Mutual
from spinlev.dynamics.motion.state import Parameter, Scales
from spinlev.fem.mutual.making import cached_mutual_table
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.scene.floater import Floater, FloaterPart
from spinlev.geometry.shapes import Box

MEASURES = {
    "horizontal": np.linspace(1e-3, 4e-3, 9),
    "vertical": np.linspace(10e-3, 18e-3, 9),
    "tilt": np.radians(np.linspace(5.0, 20.0, 9)),
}
FREQUENCIES = np.linspace(60.0, 180.0, 13)


@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("horizontal", "dipole"),
        *(pytest.param(name, "dipole", marks=pytest.mark.slow) for name in ("vertical", "tilt")),
        *(pytest.param(name, "cuboid", marks=pytest.mark.slow) for name in MEASURES),
        pytest.param("horizontal", "fem", marks=pytest.mark.slow),
    ],
)
@pytest.mark.slow
def test_map_equals_searches_at_random_points(name, model):
    """All equilibria, their places to 1e-9 m, growth and stability."""
    scenes, tables = moved_rotors(name, MEASURES[name], model)
    spacing = 8 if name == "horizontal" else 3
    found, rng = equilibrium_map(scenes, tables, FREQUENCIES, spacing=spacing), np.random.default_rng(1)
    assert found.number[0].sum() == len(found.row)
    for row, column in rng.integers(found.number[0].shape, size=(4, 2)):
        expected = find_equilibria(replace(scenes[column], frequency=FREQUENCIES[row]), tables[column])
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
    found = equilibrium_map(*moved_rotors(name, MEASURES[name], model), FREQUENCIES, spacing=3)
    grid, places = found.grid, np.concatenate([found.position / PERMEABLE.radius, found.moment], axis=1)
    for point in np.random.default_rng(5).choice(len(grid), 30, replace=False):
        here = places[found.row * len(MEASURES[name]) + found.column == point]
        for place in fixed_points(grid.alone(int(point)), grid.range(int(point)))[1]:
            assert np.linalg.norm(here - place, axis=1).min() < 1e-6


def test_rows_of_parameters_have_their_own_tables():
    """Rates of one call at random states, where tables and floaters differ: those of each by itself, and between two
    the mean of both fields, to round-off."""
    small = replace(PERMEABLE, radius=5e-3)
    scenes, tables = moved_rotors("tilt", [0.1, 0.2], "cuboid")
    one, other = scenes[0], replace(scenes[1], floater=small)
    each = [Rates(tables[0])]
    each.append(each[0].elsewhere(tables[1]))
    values = np.array([parameters(scene, Scales.of(scene)) for scene in (one, other)])
    values[:, Parameter.TABLE] = 0, 1
    states = np.random.default_rng(0).normal(size=(6, 12)) * 0.3 + np.eye(12)[2] * -4.0
    found = each[0].among(each)(states, values[[0, 1, 1, 0, 1, 0]])
    for k, number in enumerate([0, 1, 1, 0, 1, 0]):
        expected = Rates(tables[number])(states[[k]], values[number])
        for ours, theirs in zip(found, expected, strict=True):
            np.testing.assert_allclose(ours[k], theirs[0], atol=1e-13 * np.abs(theirs).max())
    between = values[[0]]
    between[:, Parameter.NEXT], between[:, Parameter.BETWEEN] = 1, 0.25
    (here,), (there,) = (Rates(table)(states[:1], values[0])[0] for table in tables)
    mixed = each[0].among(each)(states[:1], between)[0][0]
    np.testing.assert_allclose(mixed, 0.75 * here + 0.25 * there, atol=1e-13 * np.abs(here).max())


@pytest.mark.slow
def test_a_map_of_floaters_of_all_sizes_is_that_of_each():
    """A seventh smaller to a seventh larger, of mutual magnetisation: as many equilibria, at the places of searches."""
    sizes = np.linspace(5.5e-3, 7.2e-3, 5)
    (scene,), (table,) = moved_rotors("horizontal", [2e-3], "fem")
    scenes = [replace(scene, floater=replace(PERMEABLE, radius=radius)) for radius in sizes]
    answers = [cached_mutual_table(scene.rotor, one.floater, print)[0] for one in scenes]
    wholes = [
        Interaction(table, (Mutual(one, scene.floater.moment),)) for one, scene in zip(answers, scenes, strict=True)
    ]
    found = equilibrium_map(scenes, wholes, [110.0], spacing=4)
    assert found.searches == 2
    for k, (one, whole) in enumerate(zip(scenes, wholes, strict=True)):
        expected, here = find_equilibria(one, whole), found.position[found.column == k]
        assert len(here) == len(expected)
        assert max(np.linalg.norm(here - e.position, axis=1).min() for e in expected) < 1e-9


@pytest.mark.slow
def test_sheets_are_found_around_their_folds():
    """With one search in a corner of the map, far beyond the folds: the same as with searches all over it."""
    columns, frequencies = moved_rotors("horizontal", MEASURES["horizontal"]), FREQUENCIES[2:]
    one = equilibrium_map(*columns, frequencies, spacing=100)
    many = equilibrium_map(*columns, frequencies, spacing=4)
    assert one.searches == 4
    assert many.searches > 8
    np.testing.assert_array_equal(one.number, many.number)


@pytest.mark.slow
def test_a_cube_has_the_map_of_its_mean():
    """Where it levitates by its multipoles about the moment: 3 µm from where all its charges have it."""
    body = Box((10e-3,) * 3)
    cube = Floater(body.circumradius, 1.305, 1.0, 7500.0, None, body)
    (scene,), (table,) = moved_rotors("horizontal", [2e-3], "cuboid", cube)
    found = equilibrium_map([scene], [table], [105.0, 110.0])
    assert found.stable.sum() == 2
    for row, place in zip(found.row[found.stable], found.position[found.stable], strict=True):
        at = replace(scene, frequency=float(found.frequencies[row]))
        (true,) = (e for e in find_equilibria(at, table) if e.stable)
        assert 0 < np.linalg.norm(place - true.position) < 1e-5


@pytest.mark.slow
def test_a_map_has_mutual_magnetisation():
    """Places to 1e-9 m of a search with the tables of that rotor."""
    frequencies, (scenes, tables) = np.array([120.0, 125.0]), moved_rotors("tilt", np.radians([9.5, 10.0]), "cuboid")
    answers = [cached_mutual_table(scene.rotor, PERMEABLE, print)[0] for scene in scenes]
    wholes = [Interaction(table, (Mutual(one, PERMEABLE.moment),)) for table, one in zip(tables, answers, strict=True)]
    found, there = equilibrium_map(scenes, wholes, frequencies), replace(scenes[1], frequency=120.0)
    expected, rigid = find_equilibria(there, wholes[1]), find_equilibria(there, tables[1])
    here = (found.row == 0) & (found.column == 1)
    apart = [np.linalg.norm(found.position[here] - e.position, axis=1).min() for e in expected]
    assert here.sum() == len(expected)
    assert max(apart) < 1e-9
    assert abs(expected[0].position[2] - rigid[0].position[2]) > 3e-5


def test_what_has_no_map_says_so():
    body, (scenes, tables) = Box((4e-3, 6e-3, 10e-3)), moved_rotors("horizontal", [1e-3])
    oblique = FloaterPart(Magnet(body, 1.3 * np.array([0.0, 0.6, 0.8])), 7500.0)
    with pytest.raises(InputError, match="its moment along a principal axis"):
        equilibrium_map([replace(scenes[0], floater=Floater.composed([oblique]))], tables, [100.0])
    with pytest.raises(EquilibriumError, match="only where the rotor turns"):
        equilibrium_map(scenes, tables, [0.0, 10.0])
    copper = replace(scenes[0], floater=replace(PERMEABLE, conductivity=5.8e7))
    with pytest.raises(InputError, match=r"floater.conductivity_S_m must leave its skin depth large"):
        equilibrium_map([copper], tables, [50.0, 400.0])
    metal = replace(scenes[0], floater=replace(PERMEABLE, conductivity=6.7e5))
    with pytest.raises(InputError, match="tables must all have the same effects"):
        equilibrium_map([*scenes, metal], tables * 2, [100.0])
    conducting = replace(scenes[0], rotor=tuple(replace(m, conductivity=6e7) for m in scenes[0].rotor))
    with pytest.raises(InputError, match="must leave its skin depth large"):
        equilibrium_map([conducting], tables, [110.0])
