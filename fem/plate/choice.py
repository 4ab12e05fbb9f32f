"""Which model of the plate a scene needs."""

import math
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import MU_0, Array, InputError, Report
from ...geometry.magnets import Magnet
from ...geometry.scene.contents import Plate, Scene
from ...geometry.shapes import Box
from ..rotor.models import Accuracy, AccuracyError, shortened_table
from ..rotor.table import RotorTable
from .rotor_share import DOWN
from .slab import cached_edge_error, edge_error
from .table import Region
from .tables import PlateAround

NEGLIGIBLE = 1e-6  # Part of the floater's weight below which the largest conceivable force of the plate is left out
REACH = 0.003  # The floater may move so far from where it begins, along each axis, m
RASTER = 0.001  # Bounds of regions are multiples of this, m, so that scenes that differ little share a table
# So are centres of those about an equilibrium of this, with odd halves: all that are nearest to one share a table.
CENTERS = 0.004
USUAL = 0.00635, 0.027  # The three lengths are for about this radius and distance of the floater, m: the article's
# Frequencies of a table, Hz, at least; and the multiple of the rotor's that it must hold.
LOWEST, HIGHEST, HARMONICS = 0.5, 250.0, 2.0
# How far a crossed bound moves out, in widths of the region: across the plate's face, and along it, where it is dear.
FACING, BESIDE = 2.0, 0.5
# Half the width of a wider region along the face by its distance: at 2.3 a slab takes 230 states, at 4.6 minutes.
WIDEST = 3.0
AT = 1e-6  # Distance from a bound, in widths of the region, at which it counts as crossed: that is where the event is
SKIN = 0.9  # Nearest that a region comes to the plate, in radii of the floater, which touches it at one
PLUMB = 1e-9  # Cosine of the angle between a slab's normal and the vertical below which it stands upright


class PlateChoice(NamedTuple):
    """Model of a plate."""

    model: str
    reason: str  # in words
    edges: float = 0.0  # relative error by edges that the model leaves out


def resolve_plate_model(
    scene: Scene, model: str, place: Array | None, rtol: float, report: Report = lambda text: None
) -> PlateChoice:
    """The plate's model in the motion of a `scene` about a `place` (3,) m; `report` gets what is worked out.

    `auto` as `model` is, to `rtol`, none where an image would not matter, a slab where by a bound or a coarse solution
    the edges do not, and else the finite elements' reduced network.
    """
    if (plate := scene.plate) is None:
        return PlateChoice("none", "the scene has no plate")
    if place is None:
        return PlateChoice("none", "there is no equilibrium around which to make a table")
    if model == "fem":
        return PlateChoice("reduced", "the finite elements enter the motion by their reduced network")
    if model == "slab" and plate.each:
        raise InputError("Input plate_model must be fem, reduced or none of several plates; instead received slab.")
    if model != "auto":
        return PlateChoice(model, "as requested", edge_error(plate, place) if model == "slab" else 0.0)
    gap = float(plate.body.distance(place))
    mirror = 3 * MU_0 * scene.floater.moment**2 / (32 * np.pi * gap**4)
    weight = scene.floater.mass * float(np.linalg.norm(scene.gravity) or 9.81)
    if mirror < NEGLIGIBLE * weight:
        return PlateChoice(
            "none", f"at {gap * 1e3:.3g} mm the plate pushes with less than {NEGLIGIBLE:.0e} of the weight"
        )
    if plate.each:
        return PlateChoice("reduced", "the currents of several plates act on each other")
    body, normal = plate.box.to_body(place), int(np.argmin(plate.box.size))
    if abs(body[normal]) > plate.box.half_edges[normal]:
        error = edge_error(plate, place)
        if error <= rtol:
            return PlateChoice("slab", f"the plate's edges take at most {error:.1e} of its reaction", error)
        if not isinstance(plate.body, Box):
            return PlateChoice("reduced", f"edges may take {error:.1e} of an infinite slab's reaction")
        rotor = np.mean([magnet.box.center for magnet in scene.rotor], axis=0)
        error = cached_edge_error(plate, np.array([place, rotor]), scene.frequency, report)
        if error <= rtol:
            return PlateChoice("slab", f"measured, the plate's edges take {error:.1e} of its reaction", error)
        return PlateChoice(
            "reduced", f"measured, edges take {error:.1e} of an infinite slab's reaction, {rtol:.1e} is allowed"
        )
    return PlateChoice("reduced", "the floater is beside the plate's edge")


def plate_around(
    plate: Plate,
    model: str,
    table: RotorTable,
    place: Array,
    radius: float,
    frequency: float,
    rtol: float,
    region: Region | None = None,
) -> PlateAround:
    """The plate's table for a floater about a `place` (3,) m, in the frame turning with the rotor, to be made.

    `model`: "slab", or "reduced" for the elements' network; `table`: the rotor's field; `radius` (m) of the floater and
    `frequency` (Hz) of the rotor; `rtol`: relative accuracy; `region`: where the floater may be, plate's frame; left
    out, near the place, all the way down. Raises InputError: the plate leaves the floater no room.
    """
    if model == "slab" and plate.lowering and abs(plate.box.rotation[2, np.argmin(plate.box.size)]) < PLUMB:
        plate = replace(plate, lowering=None)  # an infinite slab that moves along itself stays where it is
    if region is None:
        gap = float(plate.body.distance(place))
        size = _size(radius, place, gap if gap > radius else np.inf)  # else it is refused
        reach = REACH * size
        sideways = float(np.hypot(place[0], place[1])) + reach
        region = reachable_region(plate, [0.0, 0.0, place[2]], [sideways, sideways, reach], radius)
        region = _rastered(region, plate, radius, size)
    highest = HIGHEST * 2.0 ** max(0, math.ceil(math.log2(HARMONICS * max(frequency, 1.0) / HIGHEST) - 1e-9))
    return PlateAround(plate, table, region, (LOWEST, highest), rtol, model == "slab")


def reachable_region(plate: Plate, center: ArrayLike, half_edges: ArrayLike, radius: float = 0.0) -> Region:
    """Where a floater can come to in the frame of `plate`, during all of its lowering.

    The box about `center` with `half_edges` (3,) m along the laboratory's axes and its image under the lowering are
    united; what is nearer than `radius` (m) to the plate is cut off. Raises InputError: the centre is not farther off,
    all the way.
    """
    center = np.asarray(center, float)
    ends = plate.box.to_body(np.array([center, center - plate.way * DOWN]))
    signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3, indexing="ij"), -1).reshape(8, 3)
    corners = center + np.asarray(half_edges, float) * signs
    body = plate.box.to_body(np.concatenate([corners, corners - plate.way * DOWN]))
    lower, upper = body.min(axis=0), body.max(axis=0)
    for middle, half in plate.body.blocks:
        apart = ends - middle
        beyond = np.min(np.abs(apart) - half, axis=0)
        axis = int(np.argmax(beyond))
        if beyond[axis] <= radius or apart[0, axis] * apart[1, axis] < 0:
            raise InputError(
                f"Input center_mm must be farther than {radius * 1e3:.4g} mm from the plate's faces on all of its way; "
                f"instead received {np.round(center * 1e3, 6).tolist()}, {max(beyond[axis], 0) * 1e3:.4g} mm from "
                "them. Move the plate away."
            )
        _cut(lower, upper, axis, middle[axis], half[axis] + radius, bool(apart[0, axis] > 0))
    return Region(lower, upper)


def _cut(lower: Array, upper: Array, axis: int, middle: float, clear: float, above: bool) -> None:
    """Move the bound (3,) m of a region `above` a plate's body, or below, until it is `clear` (m) of its middle."""
    if above:
        lower[axis] = max(lower[axis], middle + clear)
    else:
        upper[axis] = min(upper[axis], middle - clear)


def wider_region(plate: Plate, region: Region, radius: float, seen: Array) -> Region:
    """The region of a table for a floater that left `region` at `seen` (3,) m, in the frame of `plate`.

    Bounds that it crossed move out so far that a fall from far off needs few tables; along the face all, as a turning
    floater comes to the others next, but none nearer to the face than its `radius` (m). Raises AccuracyError: too wide
    for its distance from the plate.
    """
    half, size = plate.box.half_edges, region.upper - region.lower
    facing = int(np.argmax(np.abs(region.center) - half))
    below, above = seen < region.lower + AT * size, seen > region.upper - AT * size
    across = np.arange(3) == facing
    if (below | above)[~across].any():
        below, above = below | ~across, above | ~across
    out = np.where(across, FACING, BESIDE) * size
    lower = np.where(below, np.minimum(region.lower - out, seen - out / 2), region.lower)
    upper = np.where(above, np.maximum(region.upper + out, seen + out / 2), region.upper)
    touching = half[facing] + radius
    if region.center[facing] > 0 and lower[facing] < touching + radius:  # what is left to the face is not worth a table
        lower[facing] = touching
    if region.center[facing] < 0 and upper[facing] > -touching - radius:
        upper[facing] = -touching
    found = _rastered(Region(lower, upper), plate, radius)
    gap = float(max(found.lower[facing], -found.upper[facing]) - half[facing])
    wide = float(np.max((found.upper - found.lower)[~across])) / 2
    if wide > WIDEST * gap:
        raise AccuracyError(
            f"Input region of a table of the plate's response must reach at most {WIDEST:g} times its distance from "
            f"the plate to the sides, {WIDEST * gap * 1e3:.3g} mm here; instead received {wide * 1e3:.3g} mm. "
            "Begin the trajectory where it stays nearer, or simulate a shorter one."
        )
    return found


@lru_cache(1)  # a trajectory and what is said of it ask for the same
def rotor_nearby(
    table: RotorTable, rotor: tuple[Magnet, ...], place: tuple[float, ...], radius: float, rtol: float
) -> RotorTable:
    """The rotor's table with coefficients that count for `rtol` about `place` (3,) m, `radius` off at least."""
    gap = min(float(magnet.body.distance(place)) for magnet in rotor) - REACH * _size(radius, place)
    return shortened_table(table, Accuracy(rtol, max(gap, radius)))


def _size(radius: float, place: ArrayLike, gap: float = np.inf) -> float:
    """Of a scene, by its floater's radius, place and `gap` to the plate, m: a power of two, so that neighbours share.

    A small floater far from its rotor moves as far as another; near a plate it is looked at half way to it at most.
    """
    ratios = radius / USUAL[0], float(np.linalg.norm(place)) / USUAL[1], 1.0
    return float(2 ** min(np.round(np.log2(sorted(ratios)[1])), np.floor(np.log2(gap / 2 / REACH))))


def _rastered(region: Region, plate: Plate, radius: float, shared: float | None = None) -> Region:
    """The region on the raster, `SKIN` radii (m) off the face, made symmetric if nearly so.

    It is `shared` by neighbours in a scene of this size.
    """
    raster = RASTER * (shared or 1.0)
    lower, upper = np.floor(region.lower / raster + 1e-6), np.ceil(region.upper / raster - 1e-6)
    if shared:
        step = CENTERS / RASTER
        middle = step * np.round(region.center / (step * raster))
        half = 2 * np.ceil((np.maximum(upper - middle, middle - lower) - 1) / 2) + 1
        lower, upper = middle - half, middle + half
    for axis in np.flatnonzero((lower < 0) & (upper > 0)):
        upper[axis] = max(-lower[axis], upper[axis])
        lower[axis] = -upper[axis]
    lower, upper = lower * raster, upper * raster
    for center, size in plate.body.blocks:  # a thin one may be within the raster: the region itself says where it is
        facing = int(np.argmax(np.maximum(region.lower - center, center - region.upper) - size))
        above = bool(region.center[facing] > center[facing])
        _cut(lower, upper, facing, center[facing], size[facing] + SKIN * radius, above)
    return Region(lower, upper)
