"""The figure of a flight draws no motion that its samples do not have."""

import numpy as np
import pytest
import xarray as xr

from spinlev.studies.results import trajectory_figure


@pytest.mark.parametrize(("interval", "title", "unit"), [(0.005, "A closer look", "s"), (6.4, "every 6.4 s", "h")])
def test_samples_farther_apart_than_a_bounce_are_points(interval, title, unit):
    """Ten bounces a second: joined every 6.4 s they would look like slow ones."""
    time = interval * np.arange(2000)
    place = np.zeros((2000, 3))
    place[:, 2] = -0.02 + 1e-4 * np.sin(2 * np.pi * 10.03 * time)
    moment = np.tile([0.1, 0.0, 0.995], (2000, 1))
    along = ("time", "axis")
    columns = {"position": (along, place), "moment": (along, moment), "position_rotor_frame": (along, place)}
    look = trajectory_figure(xr.Dataset(columns, {"time": time, "axis": ["x", "y", "z"]})).axes[1]
    assert look.get_title("left").endswith(title)
    assert look.get_xlabel() == f"time ({unit})"
    assert (look.lines[0].get_linestyle() == "None") == (interval > 1)
