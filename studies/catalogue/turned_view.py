"""The bodies and the path of a flight as numbers for the view that a page lets its reader turn."""

from typing import Any

import numpy as np
import xarray as xr

from ...geometry.basics import Array, Box
from ...geometry.scenes import parse_scene

POINTS = 1500
"""Of the path, at most."""
FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
"""Corners of a box by the signs of their coordinates, x slowest."""


def view_of(result: xr.Dataset) -> dict[str, Any] | None:
    """Lengths in mm, rotor's frame at the end of the flight; None for a result without a flight."""
    if "scene" not in result.attrs or "position_rotor_frame" not in result:
        return None
    scene = parse_scene(str(result.attrs["scene"]), "scene")
    places = 1e3 * result["position_rotor_frame"].values
    boxes = [{"name": "rotor", "color": "76,86,106", "alpha": 0.9, **_faces(magnet.box)} for magnet in scene.rotor]
    if scene.plate is not None:
        boxes.append({"name": "plate", "color": "154,165,177", "alpha": 0.25, **_faces(scene.plate.box)})
    path = places[:POINTS]
    middle = (path.max(axis=0) + path.min(axis=0)) / 2
    reach = float(np.abs(path - middle).max()) or 1.0
    times = max(1.0, 10.0 ** np.floor(np.log10(5.0 / reach)))
    floater = {"center": _rounded(places[-1]), "radius": 1e3 * scene.floater.radius}
    return {
        "boxes": boxes,
        "floater": floater,
        "path": _rounded(middle + times * (path - middle)),
        "times": times,
    }


def _faces(box: Box) -> dict[str, Any]:
    signs = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    corners = 1e3 * (box.center + (signs * box.half_edges) @ box.rotation.T)
    return {"corners": _rounded(corners), "faces": FACES}


def _rounded(values: Array) -> Any:
    return np.round(values, 3).tolist()
