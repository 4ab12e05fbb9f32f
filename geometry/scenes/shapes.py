"""From the keys of a shape to the body, and back."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..basics import Box, Cylinder, Part, Ring, Solid, Sphere, rotation_matrix
from .schema import SIZES

MILLI = 1e-3
ARTICLE_SIZES = {"cube": ("edge_mm",), **{shape: SIZES[shape] for shape in ("cylinder", "sphere")}}
"""The keys of every shape that may stand for the cubes of a rotor of the article."""
FLOATER_SIZES = {shape: SIZES[shape] for shape in ("sphere", "cuboid", "cylinder")}
"""The keys of every shape of a floater."""
KEYS = ("size_mm", "edge_mm", "diameter_mm", "inner_diameter_mm", "height_mm")


def shape_faults(place: str, table: Any, sizes: Mapping[str, tuple[str, ...]]) -> list[str]:
    """What is wrong with the keys of a shape at a place of the scene file."""
    if getattr(table, "file", None):
        sizes = {"cuboid": ()}
        if table.shape not in sizes:
            return [f"Input {place}.shape must be left out beside file; instead received {table.shape!r}."]
    given = tuple(key for key in KEYS if getattr(table, key, None) is not None)
    wanted = sizes[table.shape]
    if set(given) != set(wanted) and not wanted:
        return [f"Input {place} must have no size beside file; instead received {' and '.join(given)}."]
    if set(given) != set(wanted):
        more = " and ".join(key for key in given if key not in wanted)
        return [
            f"Input {place} must have {' and '.join(wanted)}, as the shape is {table.shape!r}; "
            f"instead received {' and '.join(given) or 'no size'}." + (f" Leave out {more}." if more else "")
        ]
    if table.shape == "ring" and table.inner_diameter_mm >= table.diameter_mm:
        return [
            f"Input {place}.inner_diameter_mm must be less than diameter_mm {table.diameter_mm:g}; "
            f"instead received {table.inner_diameter_mm:g}."
        ]
    return []


def solid(
    table: Any, center_mm: Sequence[float] = (0.0, 0.0, 0.0), rotation_deg: Sequence[float] = (0.0, 0.0, 0.0)
) -> Solid:
    """The body of keys without faults, in its place."""
    pose = np.array(center_mm) * MILLI, rotation_matrix(rotation_deg)
    if table.shape in ("cuboid", "cube"):
        return Box(np.array(table.size_mm if table.shape == "cuboid" else [table.edge_mm] * 3) * MILLI, *pose)
    radius = table.diameter_mm * MILLI / 2
    if table.shape == "sphere":
        return Sphere(radius, *pose)
    if table.shape == "cylinder":
        return Cylinder(radius, table.height_mm * MILLI, *pose)
    return Ring(radius, table.inner_diameter_mm * MILLI / 2, table.height_mm * MILLI, *pose)


def placed(part: Part, center_mm: Sequence[float], rotation_deg: Sequence[float]) -> Part:
    """The solid of a STEP file, its own origin in a place."""
    turn = rotation_matrix(rotation_deg)
    return replace(part, center=np.array(center_mm) * MILLI - turn @ part.origin, rotation=turn)


def shape_keys(body: Solid) -> dict[str, Any]:
    """The keys of a body's shape in SI units of the body, but for its pose; a cuboid's is left out."""
    if isinstance(body, Box):
        return {"size_mm": body.size}
    if isinstance(body, Part):
        return {"file": str(body.file)}
    if isinstance(body, Sphere):
        return {"shape": "sphere", "diameter_mm": 2 * body.radius}
    known: dict[str, Any] = {"diameter_mm": 2 * body.radius, "height_mm": body.height}
    if isinstance(body, Ring):
        return {"shape": "ring", "inner_diameter_mm": 2 * body.inner_radius, **known}
    return {"shape": "cylinder", **known}
