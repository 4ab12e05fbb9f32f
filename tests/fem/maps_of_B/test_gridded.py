"""Gridded tables: the fit of a map against the exact field that the map was made from."""

import numpy as np
import pytest

from spinlev.fem.cache import TableFileError
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.maps_of_B.columns import FieldMap, FieldMapError
from spinlev.fem.maps_of_B.table import MAP, fit_field_map
from spinlev.fem.rotor.table import ROTOR, RangeError, RotorTable
from spinlev.geometry.magnets import Magnet, horizontal, vertical
from spinlev.geometry.shapes import Box

INNER, OUTER, STEP = 0.013, 0.040, 0.002
CORNERS = 0.0087
"""A radius (m) that holds a 10 mm cube, whose corners are at 8.66 mm."""


def exact(rotor):
    return RotorTable("cuboid", rotor, rotor)


def distance(points, rotor):
    return np.min([np.linalg.norm(points - magnet.box.center, axis=1) for magnet in rotor], axis=0)


def in_shell(points, rotor):
    d = distance(points, rotor)
    return points[(d >= INNER) & (d <= OUTER)]


def grid_map(rotor, step=STEP, noise=0.0):
    """Closed form on a grid of whole steps, from 13 to 40 mm around the rotor's cubes, with noise relative to |B|."""
    ticks = np.arange(-0.056, 0.0561, step)
    points = in_shell(np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), -1).reshape(-1, 3), rotor)
    field = exact(rotor).evaluate(points)[0]
    scatter = np.random.default_rng(7).normal(size=field.shape) * np.linalg.norm(field, axis=1)[:, None]
    return FieldMap(points, field + noise * scatter)


def off_grid(rotor, number=4000):
    """Random places in the shell, and as many on its inner edge, 0.1 mm inside the nearest grid point."""
    rng = np.random.default_rng(8)
    inside = rng.uniform(-OUTER, OUTER, (number, 3))
    direction = rng.normal(size=(number, 3))
    edge = [m.box.center + INNER * (1 + 1e-9) * direction / np.linalg.norm(direction, axis=1)[:, None] for m in rotor]
    return in_shell(np.concatenate([inside, *edge]), rotor)


def errors_and_bars(table, rotor, points):
    """For B and ∇B: relative error, error over the table's own value, and the error bar that goes with the latter.

    The first is relative to the true value, and to no less than a quarter of its median at that distance: between two
    magnets the field has zeros, where an error relative to itself has no meaning.
    """
    (b, g), (true_b, true_g), bars = table.evaluate(points), exact(rotor).evaluate(points), table.relative_error(points)
    result = []
    for value, true, bar, power in ((b, true_b, bars[0], 3), (g, true_g, bars[1], 4)):
        axes, fall = tuple(range(1, value.ndim)), distance(points, rotor) ** -power
        error, size = np.linalg.norm(value - true, axis=axes), np.linalg.norm(true, axis=axes)
        typical = np.median(size / fall) * fall
        result.append((error / np.maximum(size, 0.25 * typical), error / np.linalg.norm(value, axis=axes), bar))
    return result


ROTORS = {
    "centred": horizontal(0.0, 0.01, 1.305, 1.0),
    "displaced": horizontal(0.0023, 0.01, 1.305, 1.0),
    "vertical": vertical(0.012, 0.01, 1.305, 1.0),
    "touching": vertical(0.01, 0.01, 1.305, 1.0),
}


@pytest.fixture(scope="module", params=ROTORS)
def fitted(request):
    rotor = ROTORS[request.param]
    centers = [magnet.box.center for magnet in rotor]
    return rotor, fit_field_map(grid_map(rotor), centers, radius=CORNERS)


@pytest.mark.slow
def test_exact_values_on_a_2_mm_grid_give_the_field_between_13_and_40_mm(fitted):
    """The project's bounds, 1e-5 of B and 1e-4 of ∇B; and the error bars hold at every point."""
    rotor, table = fitted
    for bound, (relative, to_bar, bar) in zip(
        (1e-5, 1e-4), errors_and_bars(table, rotor, off_grid(rotor)), strict=True
    ):
        assert relative.max() < bound
        assert (to_bar <= bar).all()


@pytest.mark.slow
def test_divergence_and_curl_vanish_to_round_off(fitted):
    """The gradient is symmetric to the bit; its trace is a sum of some hundred terms with round-off each."""
    rotor, table = fitted
    _, g = table.evaluate(off_grid(rotor, 500))
    assert np.array_equal(g, np.swapaxes(g, 1, 2))
    assert np.abs(np.trace(g, axis1=1, axis2=2)).max() < 1e-13 * np.abs(g).max()


def test_the_gradient_is_the_derivative_of_the_field_of_a_coarse_map():
    rotor = ROTORS["vertical"]
    table = fit_field_map(grid_map(rotor, 0.004), [magnet.box.center for magnet in rotor], max_degree=9)
    points = off_grid(rotor, 20)
    assert_derivative(table, points[distance(points, rotor) > 0.014])


@pytest.mark.slow
def test_the_gradient_is_the_derivative_of_the_field(fitted):
    rotor, table = fitted
    assert_derivative(table, in_shell(off_grid(rotor, 20) + 0.002 * np.array([0, 0, -1]), rotor))


def assert_derivative(table, points):
    """Central differences of 1 µm: (1 µm / 13 mm)² of truncation times degree², and 1e-16/1e-4 of round-off."""
    step = 1e-6
    _, g = table.evaluate(points)
    for axis, shift in enumerate(step * np.eye(3)):
        difference = (table.evaluate(points + shift)[0] - table.evaluate(points - shift)[0]) / (2 * step)
        assert np.abs(difference - g[:, :, axis]).max() < 1e-6 * np.abs(g).max()


def test_noise_is_averaged_and_the_error_bar_is_true():
    """1e-3 of noise on each component: the bar holds at every point, and is about ten times the usual error."""
    rotor = ROTORS["displaced"]
    table = fit_field_map(grid_map(rotor, noise=1e-3), [m.box.center for m in rotor], CORNERS, max_degree=15)
    points = off_grid(rotor)
    for relative, to_bar, bar in errors_and_bars(table, rotor, points):
        assert (to_bar <= bar).all()
        assert np.median(bar) < 15 * np.median(to_bar)
        assert relative[distance(points, rotor) > 0.02].max() < 1e-3
    assert table.expansions.provenance["misfit"] == pytest.approx(1.73e-3, rel=0.03)  # √3: |B| over a component's size


@pytest.mark.slow
def test_a_probe_of_one_component_below_the_rotor_is_enough_there():
    """A harmonic field is known from its normal component on the map's planes; the table ends with the map's box."""
    rotor = ROTORS["centred"]
    whole = grid_map(rotor)
    below = whole.where(whole.points[:, 2] < -INNER)
    field = below.field.copy()
    field[:, :2] = np.nan
    table = fit_field_map(FieldMap(below.points, field), np.zeros(3))
    points = off_grid(rotor)
    points = points[table.in_range(points)]
    for bound, (relative, to_bar, bar) in zip((1e-6, 1e-5), errors_and_bars(table, rotor, points), strict=True):
        assert relative.max() < bound
        assert (to_bar <= bar).all()
    assert not table.in_range([0, 0, 0.02])
    with pytest.raises(RangeError, match="map's box"):
        table.evaluate([0, 0, 0.02])


def test_a_map_around_the_sources_is_known_outwards_and_not_inwards():
    rotor = ROTORS["centred"]
    table = fit_field_map(grid_map(rotor, 0.004), np.zeros(3), max_degree=9)
    assert table.in_range([0, 0, 1.0])
    with pytest.raises(RangeError, match="farther than 13"):
        table.evaluate([0, 0, 0.012])


def test_given_errors_scale_the_error_bar():
    """Errors given count even where the scatter is smaller; the bar grows in proportion but for the series' cut end."""
    data = grid_map(ROTORS["centred"], 0.004, noise=1e-4)
    points = off_grid(ROTORS["centred"], 100)
    points = points[distance(points, ROTORS["centred"]) > 0.02]
    sizes = [
        fit_field_map(FieldMap(data.points, data.field, np.full(data.field.shape, e)), np.zeros(3), CORNERS, 9)
        .relative_error(points)[0]
        .mean()
        for e in (0.01, 0.1)
    ]
    assert sizes[1] == pytest.approx(10 * sizes[0], rel=0.05)


def test_a_dipole_gives_a_dipole():
    """Data that degree 1 explains to round-off: the moment comes out to 1e-8, the accuracy of normal equations."""
    magnet = Magnet(Box(np.full(3, 0.01)), (0.3, -0.5, 1.1))
    dipole = RotorTable("dipole", (magnet,), (), (uniform_moments(magnet, 1),))
    points = grid_map(ROTORS["centred"], 0.004).points
    table = fit_field_map(FieldMap(points, dipole.evaluate(points)[0]), np.zeros(3), max_degree=6)
    (expansion,) = table.expansions.expansions
    assert expansion.moment == pytest.approx(magnet.moment, rel=1e-8)


def test_a_table_survives_the_disk_to_the_last_bit(tmp_path):
    table = fit_field_map(grid_map(ROTORS["vertical"], 0.004, noise=1e-3), [[0, 0, 0], [0, 0, 0.012]], max_degree=7)
    MAP.save(table, tmp_path / "t.nc")
    read, points = MAP.load(tmp_path / "t.nc"), off_grid(ROTORS["vertical"], 50)
    points = points[table.in_range(points)]
    for question in ("evaluate", "relative_error"):
        for before, after in zip(getattr(table, question)(points), getattr(read, question)(points), strict=True):
            assert np.array_equal(before, after)
    assert read.model == "map"
    assert dict(read.expansions.provenance) == dict(table.expansions.provenance)
    with pytest.raises(TableFileError, match="spinlev rotor"):
        ROTOR.load(tmp_path / "t.nc")


def test_maps_that_cannot_be_fitted_say_why():
    data = grid_map(ROTORS["centred"], 0.006)
    with pytest.raises(FieldMapError, match=r"farther than 15 mm .* received point \d+ at 1[345]"):
        fit_field_map(data, np.zeros(3), radius=0.015)
    assert fit_field_map(data.outside(np.zeros(3), 0.015), np.zeros(3), 0.015, 3).in_range([0, 0, 0.0151])
    with pytest.raises(FieldMapError, match="at least 6 observed components; instead received 3"):
        fit_field_map(data.where([0]), np.zeros(3))
