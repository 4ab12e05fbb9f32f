"""The figure of a flight draws no motion that its samples do not have, and nothing beyond its edges."""

import numpy as np
import pytest
import xarray as xr

from spinlev.studies.results import figure_bytes, trajectory_figure


def flight(time, height):
    """A dataset of a flight on the axis."""
    place = np.zeros((len(time), 3))
    place[:, 2] = height
    moment = np.tile([0.1, 0.0, 0.995], (len(time), 1))
    along = ("time", "axis")
    columns = {"position": (along, place), "moment": (along, moment), "position_rotor_frame": (along, place)}
    return xr.Dataset(columns, {"time": time, "axis": ["x", "y", "z"]})


@pytest.mark.parametrize(("interval", "title", "unit"), [(0.005, "A closer look", "s"), (6.4, "every 6.4 s", "h")])
def test_samples_farther_apart_than_a_bounce_are_points(interval, title, unit):
    """Ten bounces a second: joined every 6.4 s they would look like slow ones."""
    time = interval * np.arange(2000)
    look = trajectory_figure(flight(time, -0.02 + 1e-4 * np.sin(2 * np.pi * 10.03 * time))).axes[1]
    assert look.get_title("left").endswith(title)
    assert look.get_xlabel() == f"time ({unit})"
    assert (look.lines[0].get_linestyle() == "None") == (interval > 1)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-9, 3.7e-7, 2.3e-5, 1.7e-2])
def test_all_texts_have_room_at_their_fixed_places(size):
    """Numbers with many digits, with an exponent of their own above the axis, and with none."""
    time = 0.05 * np.arange(400)
    figure = trajectory_figure(flight(time, -0.12 + size * np.sin(20 * time)))
    figure_bytes(figure, "png")
    needed = figure.get_tightbbox()
    wide, high = figure.get_size_inches()
    assert needed.x0 >= 0
    assert needed.y0 >= 0
    assert needed.x1 <= wide
    assert needed.y1 <= high
