"""The plate of a scene as a table: which model, for which region, and from where."""

from dataclasses import replace

import numpy as np

from ...dynamics.motion import PlateMemory
from ...fem.plate_currents import Region
from ...fem.plate_tables import cached_driven_plate, reachable_region
from ...fem.rotor_tables import Accuracy, RotorTable, shortened_table
from ...fem.slab import edge_error, slab_and_rotor_table
from ...geometry.basics import Array, InputError
from ...geometry.bodies import TOUCHING, sphere_overlap
from ...geometry.scenes import Plate, Scene
from ..terminal import note, stages

REACH = 0.003
"""The floater may move so far from where it begins, along each axis, m."""
RASTER = 0.001
"""Bounds of regions are multiples of this, m, so that scenes that differ little share a table."""
LOWEST, HIGHEST, HARMONICS = 0.5, 250.0, 2.0
"""Frequencies of a table, Hz, at least; and the multiple of the rotor's that it must hold."""
PLUMB = 1e-9
"""Cosine of the angle between a slab's normal and the vertical below which it stands upright."""


def plate_memory(
    scene: Scene, plate: Plate, model: str, table: RotorTable, place: Array, rtol: float, edges: float | None = None
) -> tuple[PlateMemory, bool]:
    """The plate's currents for a floater about `place` (3,) m that turns with the rotor; whether they were cached.

    Parameters
    ----------
    edges : relative error by edges that the model leaves out; default for a slab is its bound

    Raises
    ------
    InputError : the plate leaves the floater no room, or is no slab for the floater and the rotor
    """
    if model == "slab" and plate.lowering and abs(plate.box.rotation[2, np.argmin(plate.box.size)]) < PLUMB:
        plate = replace(plate, lowering=None)  # an infinite slab that moves along itself stays where it is
    sideways = float(np.hypot(place[0], place[1])) + REACH
    region = _rastered(reachable_region(plate, [0.0, 0.0, place[2]], [sideways, sideways, REACH], scene.floater.radius))
    frequencies = (LOWEST, max(HIGHEST, HARMONICS * scene.frequency))
    note("Plate's currents ...")
    if model == "slab":
        made, share = slab_and_rotor_table(plate, table, region, frequencies, rtol)
        found = False
    else:
        with stages("Plate's currents") as watch:
            made, share, found = cached_driven_plate(plate, table, region, frequencies, rtol, note, watch)
    note("  from the cache." if found else f"  {len(made.rates)} states in {made.provenance['seconds']:.1f} s.")
    if edges is None:
        edges = edge_error(plate, place) if model == "slab" else 0.0
    return PlateMemory(plate, made, share, model, edges), found


def table_in_flight(scene: Scene, table: RotorTable, place: Array, rtol: float) -> RotorTable:
    """The rotor's table with the coefficients that count from `REACH` nearer to the magnets than `place` (3,) m on."""
    gap = min(float(magnet.box.distance(place)) for magnet in scene.rotor) - REACH
    return shortened_table(table, Accuracy(rtol, max(gap, scene.floater.radius)))


def _rastered(region: Region) -> Region:
    """The region with bounds on the raster; what is nearly symmetric becomes so, which halves the work."""
    lower, upper = np.floor(region.lower / RASTER + 1e-6), np.ceil(region.upper / RASTER - 1e-6)
    for axis in np.flatnonzero((lower < 0) & (upper > 0)):
        upper[axis] = max(-lower[axis], upper[axis])
        lower[axis] = -upper[axis]
    return Region(lower * RASTER, upper * RASTER)


def check_room(scene: Scene, place: Array) -> None:
    """A plate that leaves a floater at `place` (3,) m no room is a wrong scene.

    Raises
    ------
    InputError : it overlaps the floater
    """
    depth = sphere_overlap(place, scene.floater.radius, scene.plate.box) if scene.plate else 0.0
    if scene.plate and depth > TOUCHING:
        center, levitates = (np.round(c * 1e3, 3).tolist() for c in (scene.plate.box.center, place))
        raise InputError(
            f"Input plate.center_mm must leave room for the floater; instead received {center}: the plate overlaps it "
            f"by {depth * 1e3:.4g} mm where it levitates, at {levitates} mm; move the plate away."
        )
