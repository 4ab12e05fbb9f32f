"""Maps of the field on a plane, through the magnets: point dipoles, closed form and finite elements side by side."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import xarray as xr

from ...fem.rotor_tables import near_field, rotor_table
from ...geometry.basics import MU_0, Array
from ...geometry.scenes import Scene
from ..results import save_figures, write_dataset
from ..terminal import note
from .field_map_figure import field_map_figure
from .vtu import write_grids

PLANES = {"xy": (0, 1, 2), "xz": (0, 2, 1), "yz": (1, 2, 0)}
MODELS = ("dipole", "cuboid", "fem")
OFF_EDGE = 1e-6
"""Points nearer to an edge or to a dipole than this (m) have no field: it is infinite there."""
HIGHEST = 5
"""Order of the elements in a map; its error is part of it."""


def field_map_job(
    scene: Scene, plane: str, extent: Array | None, offset: float, steps: int, out: Path
) -> tuple[Mapping[str, Any], list[str]]:
    """Write field-map.nc, .png, .pdf and .vtu of the rotor's field on a plane.

    Parameters
    ----------
    plane : "xy", "xz" or "yz", in the rotor's frame
    extent : (4,) m, ends of the map along both axes; None: twice the rotor's
    offset : third coordinate, m
    steps : points along the longer side
    """
    found = field_map(scene, plane, extent, offset, steps)
    write_dataset(found, out / "field-map.nc", scene)
    files = [str(out / "field-map.nc"), *save_figures({"field-map": field_map_figure(found)}, out)]
    files.append(str(out / "field-map.vtu"))
    _write_vtu(found, out / "field-map.vtu", plane, offset)
    error = float(np.nanmax(found["error"].values) / np.nanmax(np.linalg.norm(found["B"].sel(model="fem"), axis=-1)))
    apart = {m: float(np.nanmedian(found["difference"].sel(model=m))) for m in MODELS[:2]}
    values = {"model": "fem", "error_estimate": error, "median_difference": apart, "files": files}
    return values, [
        f"B, H and M on the plane {plane}: half of the places differ by more than {apart['dipole']:.1e} (dipole) and "
        f"{apart['cuboid']:.1e} (closed form) from the finite elements, whose largest error is {error:.1e}.",
        f"In {', '.join(files)}",
    ]


def field_map(scene: Scene, plane: str, extent: Array | None, offset: float, steps: int) -> xr.Dataset:
    """The field of every model on a plane, as `field_map_job` writes it."""
    along, up, across = PLANES[plane]
    left, right, lower, upper = _around(scene, along, up) if extent is None else extent
    size = max(right - left, upper - lower) / (steps - 1)
    u = np.linspace(left, right, max(2, round((right - left) / size) + 1))
    v = np.linspace(lower, upper, max(2, round((upper - lower) / size) + 1))
    points = np.zeros((len(v), len(u), 3))
    points[..., along], points[..., up], points[..., across] = u, v[:, None], offset
    places = points.reshape(-1, 3)
    clear = np.min([magnet.body.edge_distance(places) for magnet in scene.rotor], axis=0) > OFF_EDGE
    b, h = (np.full((3, len(places), 3), np.nan) for _ in range(2))
    b[0], h[0] = (_dipoles(scene, places),) * 2
    note("Finite elements for the map ...")
    closed = near_field([magnet.rigid for magnet in scene.rotor], places[clear])
    elements = near_field(scene.rotor, places[clear], highest=HIGHEST)
    for k, found in enumerate((closed, elements), start=1):
        b[k, clear], h[k, clear] = found.flux_density, found.field
    error, magnet = np.full(len(places), np.nan), np.full(len(places), -1)
    error[clear], magnet[clear] = elements.error, elements.magnet
    size_b = np.linalg.norm(b, axis=2)
    shape = (len(v), len(u))
    dims = ("v", "u")
    vectors, attrs = ("model", *dims, "component"), {"units": "T"}
    difference = np.linalg.norm(b - b[2], axis=2) / size_b[2]
    return xr.Dataset(
        {
            "B": (vectors, b.reshape(3, *shape, 3), attrs | {"long_name": "flux density"}),
            "H": (vectors, h.reshape(3, *shape, 3) / MU_0, {"units": "A/m", "long_name": "magnetic field"}),
            "M": (vectors, (b - h).reshape(3, *shape, 3) / MU_0, {"units": "A/m", "long_name": "magnetisation"}),
            "difference": (("model", *dims), difference.reshape(3, *shape), {"units": "1", "long_name": "|ΔB|/|B|"}),
            "error": (dims, error.reshape(shape), attrs | {"long_name": "estimated error of the finite elements"}),
            "magnet": (dims, magnet.reshape(shape) + 1, {"units": "1", "long_name": "number of the magnet, 0 in air"}),
        },
        {
            "model": list(MODELS),
            "component": list("xyz"),
            "u": ("u", u, {"units": "m", "long_name": plane[0]}),
            "v": ("v", v, {"units": "m", "long_name": plane[1]}),
        },
        {"plane": plane, "offset_m": offset, "title": "Field of the rotor on a plane, in its frame at t = 0"},
    )


def _around(scene: Scene, along: int, up: int) -> Array:
    """A square (4,) m about the rotor, twice its size."""
    corners = np.concatenate([magnet.body.corners for magnet in scene.rotor])[:, [along, up]]
    middle, half = (corners.max(axis=0) + corners.min(axis=0)) / 2, np.ptp(corners, axis=0).max()
    return np.array([middle[0] - half, middle[0] + half, middle[1] - half, middle[1] + half])


def _dipoles(scene: Scene, places: Array) -> Array:
    """B (n, 3) T of the magnets' dipoles, also where the magnets are; NaN at the dipoles themselves."""
    dipoles = rotor_table(scene.rotor, "dipole").expansions
    clear = np.min([np.linalg.norm(places - d.center, axis=1) for d in dipoles], axis=0) > OFF_EDGE
    field = np.full(places.shape, np.nan)
    field[clear] = np.sum([dipole.evaluate(places[clear])[0] for dipole in dipoles], axis=0)
    return field


def _write_vtu(found: xr.Dataset, path: Path, plane: str, offset: float) -> None:
    along, up, across = PLANES[plane]
    u, v = found["u"].values, found["v"].values
    points = np.zeros((len(v) * len(u), 3))
    points[:, along], points[:, up], points[:, across] = np.tile(u, len(v)), np.repeat(v, len(u)), offset
    number = np.arange(len(points)).reshape(len(v), len(u))
    corners = (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    cells = np.stack([corner.ravel() for corner in corners], axis=1)
    data: dict[str, Array] = {"error": found["error"].values.ravel(), "magnet": found["magnet"].values.ravel()}
    for model in MODELS:
        chosen = found.sel(model=model)
        data |= {f"{name}_{model}": chosen[name].values.reshape(-1, 3) for name in "BHM"}
        data[f"difference_{model}"] = chosen["difference"].values.ravel()
    write_grids(path, meshio.Mesh(points, [("quad", cells)], point_data=data))
