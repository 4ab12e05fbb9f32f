"""Which model of the plate a scene needs."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...geometry.basics import MU_0, Array
from ...geometry.scenes import Scene
from .edges import cached_edge_error, edge_error

NEGLIGIBLE = 1e-6
"""Part of the floater's weight below which the largest conceivable force of the plate is left out."""


class PlateChoice(NamedTuple):
    """Model of a plate, the reason in words, and the relative error by edges that the model leaves out."""

    model: str
    reason: str
    edges: float = 0.0


def resolve_plate_model(
    scene: Scene, model: str, place: Array | None, rtol: float, report: Callable[[str], None] = lambda text: None
) -> PlateChoice:
    """The plate's model in the motion.

    `auto` is none where even a perfect conductor's image would not be felt, the infinite slab where a bound or else a
    coarse solution says that the edges are too far to matter, and otherwise the reduced network of the finite elements.
    """
    plate = scene.plate
    if plate is None:
        return PlateChoice("none", "the scene has no plate")
    if place is None:
        return PlateChoice("none", "there is no equilibrium around which to make a table")
    if model == "fem":
        return PlateChoice("reduced", "in the motion the finite elements enter by their reduced network")
    if model != "auto":
        return PlateChoice(model, "as asked", edge_error(plate, place) if model == "slab" else 0.0)
    gap = float(plate.box.distance(place))
    mirror = 3 * MU_0 * scene.floater.moment**2 / (32 * np.pi * gap**4)
    weight = scene.floater.mass * float(np.linalg.norm(scene.gravity) or 9.81)
    if mirror < NEGLIGIBLE * weight:
        return PlateChoice(
            "none", f"at {gap * 1e3:.3g} mm the plate pushes with less than {NEGLIGIBLE:.0e} of the weight"
        )
    body, normal = plate.box.to_body(place), int(np.argmin(plate.box.size))
    if abs(body[normal]) > plate.box.half_edges[normal]:
        error = edge_error(plate, place)
        if error <= rtol:
            return PlateChoice("slab", f"the plate's edges take at most {error:.1e} of its reaction", error)
        report("What the plate's edges change ...")
        rotor = np.mean([magnet.box.center for magnet in scene.rotor], axis=0)
        error = cached_edge_error(plate, np.array([place, rotor]), scene.frequency, report)
        if error <= rtol:
            return PlateChoice("slab", f"measured, the plate's edges take {error:.1e} of its reaction", error)
        return PlateChoice(
            "reduced", f"measured, edges take {error:.1e} of an infinite slab's reaction, {rtol:.1e} is allowed"
        )
    return PlateChoice("reduced", "the floater is beside the plate's edge")
