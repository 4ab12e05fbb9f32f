"""The figures of a run draw no motion that its samples do not have, and nothing beyond their edges."""

import numpy as np
import pytest
import xarray as xr

from spinlev.studies.figures.run import field_figure, force_figure, trajectory_figure
from spinlev.studies.figures.style import figure_bytes


def flight(time, height):
    """A dataset of a flight on the axis."""
    place = np.zeros((len(time), 3))
    place[:, 2] = height
    moment = np.tile([0.1, 0.0, 0.995], (len(time), 1))
    along = ("time", "axis")
    columns = {"position": (along, place), "moment": (along, moment), "position_rotor_frame": (along, place)}
    return xr.Dataset(columns, {"time": time, "axis": ["x", "y", "z"]})


@pytest.mark.parametrize(("interval", "title", "unit"), [(0.005, "(b)", "s"), (6.4, "every 6.4 s", "h")])
def test_samples_farther_apart_than_a_bounce_are_points(interval, title, unit):
    """Ten bounces a second: joined every 6.4 s they would look like slow ones."""
    time = interval * np.arange(2000)
    look = trajectory_figure(flight(time, -0.02 + 1e-4 * np.sin(2 * np.pi * 10.03 * time))).axes[1]
    assert look.get_title("left").endswith(title)
    assert look.get_xlabel() == f"time ({unit})"
    assert (look.lines[0].get_linestyle() == "None") == (interval > 1)


def test_the_closer_look_follows_the_motion_between_its_samples():
    """Twenty samples in a period, at uneven times: within 0.4 % of the size, where straight lines miss a fortieth."""
    time = np.cumsum(0.005 * (1 + 0.3 * np.sin(np.arange(400.0))))
    line = trajectory_figure(flight(time, 1e-3 * np.sin(20 * np.pi * time))).axes[1].lines[0]
    fine, distance = line.get_xdata(), line.get_ydata()
    assert len(fine) > 10 * np.sum(time <= fine[-1])
    np.testing.assert_allclose(distance, -np.sin(20 * np.pi * fine), atol=4e-3)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-9, 3.7e-7, 2.3e-5, 1.7e-2])
def test_all_texts_have_room_at_their_fixed_places(size):
    """Numbers with many digits, with an exponent of their own above the axis, and with none."""
    time = 0.05 * np.arange(400)
    figure = trajectory_figure(flight(time, -0.12 + size * np.sin(20 * time)))
    assert has_room(figure)


@pytest.mark.parametrize("size", [1e-14, 1e-3, 1e5])
def test_fields_of_any_size_have_room(size):
    heights, models = -np.geomspace(1e-3, 0.5, 50), ["dipole", "cuboid", "fem"]
    field = size * np.array([1.0, 1.01, 1.02])[:, None, None] * np.ones((50, 3)) / heights[:, None] ** 2
    columns = {
        "axis_field": (("model", "axis_height", "axis"), field),
        "axis_error": (("model", "axis_height"), np.full((3, 50), 1e-9)),
    }
    result = xr.Dataset(columns, {"model": models, "axis_height": heights}, {"best_model": "fem"})
    assert has_room(field_figure(result))


@pytest.mark.parametrize(("weight", "size"), [(1e-6, 0.03), (0.08, 1.0), (900.0, 30.0)])
def test_forces_of_any_size_have_room(weight, size):
    """A floater of a milligram to one of 90 kg, with all lines that a legend can have, and its equilibria are shown."""
    depth = size * np.linspace(-0.06, -0.005, 60)
    place = np.stack([0 * depth, 0 * depth, depth], axis=1)
    along = ("curve_point", "axis")
    models = np.repeat(["dipole", "cuboid", "map"], 20)
    columns = {
        "curve_model": (("curve_point",), models),
        "curve_number": (("curve_point",), np.zeros(60, int)),
        "curve_position": (along, place),
        "curve_force": (("curve_point",), weight * np.cos(100 * depth / size)),
        "equilibrium_model": (("equilibrium",), np.array(["dipole", "map"])),
        "equilibrium_position": (("equilibrium", "axis"), place[[20, 40]]),
        "equilibrium_stable": (("equilibrium",), np.array([1, 0])),
        "equilibrium_with_plate": (("equilibrium",), np.array([1, 0])),
    }
    figure = force_figure(xr.Dataset(columns, {"axis": ["x", "y", "z"]}, {"weight_N": -weight}))
    assert has_room(figure)
    for axes, shown in zip(figure.axes, (place[[20, 40]], place[[20]]), strict=True):
        low, high = axes.get_xlim()
        distance = -1e3 * shown[:, 2]
        assert low < distance.min() <= distance.max() < high < -5e3 * depth[0]
    (legend,) = figure.legends
    label = min(axes.get_tightbbox().y0 for axes in figure.axes)
    assert legend.get_window_extent().y1 < label + 1


def has_room(figure):
    """Whether all that is drawn lies in the figure."""
    figure_bytes(figure, "png")
    needed, (wide, high) = figure.get_tightbbox(), figure.get_size_inches()
    return bool(min(needed.x0, needed.y0) >= 0 and needed.x1 <= wide and needed.y1 <= high)
