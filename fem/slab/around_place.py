"""The tables of a plate for a floater about one place: where it may go, and which frequencies it hears."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...geometry.basics import Array, Watch, unwatched
from ...geometry.bodies import Magnet
from ...geometry.scenes import Plate
from ..plate_currents import Region
from ..plate_tables import (
    PlateTable,
    RotorShare,
    cached_driven_plate,
    cached_with_share,
    driven_plate_key,
    reachable_region,
)
from ..rotor_tables import Accuracy, RotorTable, shortened_table
from .table import slab_and_rotor_table

REACH = 0.003
"""The floater may move so far from where it begins, along each axis, m."""
RASTER = 0.001
"""Bounds of regions are multiples of this, m, so that scenes that differ little share a table."""
LOWEST, HIGHEST, HARMONICS = 0.5, 250.0, 2.0
"""Frequencies of a table, Hz, at least; and the multiple of the rotor's that it must hold."""
COARSE = 50.0
"""The highest frequency is a multiple of this, Hz, for the same reason."""
PLUMB = 1e-9
"""Cosine of the angle between a slab's normal and the vertical below which it stands upright."""


@dataclass(frozen=True, eq=False)
class PlateAround:
    """What a plate's table for a floater about a place is made from.

    Parameters
    ----------
    plate : as the model sees it
    model : "slab", or "reduced" for the network of the finite elements
    rotor : its field
    region, frequencies, rtol : as of `plate_and_rotor_table`
    """

    plate: Plate
    model: str
    rotor: RotorTable
    region: Region
    frequencies: tuple[float, float]
    rtol: float

    @cached_property
    def key(self) -> str:
        """The same for scenes that share the table."""
        return f"{self.model}-{driven_plate_key(*self._asked, __package__)}"

    def made(self, report: Callable[[str], None], watch: Watch = unwatched) -> tuple[PlateTable, RotorShare, bool]:
        """The table, the rotor's share in it, and whether they were cached. Raises what the models raise."""
        if self.model == "slab":
            return cached_with_share(self.key, lambda: slab_and_rotor_table(*self._asked), report)
        return cached_driven_plate(*self._asked, report, watch)

    @property
    def _asked(self) -> tuple[Plate, RotorTable, Region, tuple[float, float], float]:
        return self.plate, self.rotor, self.region, self.frequencies, self.rtol


def plate_around(
    plate: Plate, model: str, table: RotorTable, place: Array, radius: float, frequency: float, rtol: float
) -> PlateAround:
    """The plate's table for a floater about a place, to be made.

    Parameters
    ----------
    model : "slab", or "reduced" for the network of the finite elements
    table : the rotor's field
    place : (3,) m, in the frame that turns with the rotor
    radius, frequency : of the floater, m, and of the rotor, Hz

    Raises
    ------
    InputError : the plate leaves the floater no room
    """
    if model == "slab" and plate.lowering and abs(plate.box.rotation[2, np.argmin(plate.box.size)]) < PLUMB:
        plate = replace(plate, lowering=None)  # an infinite slab that moves along itself stays where it is
    sideways = float(np.hypot(place[0], place[1])) + REACH
    region = _rastered(reachable_region(plate, [0.0, 0.0, place[2]], [sideways, sideways, REACH], radius))
    highest = max(HIGHEST, COARSE * math.ceil(HARMONICS * frequency / COARSE - 1e-9))
    return PlateAround(plate, model, table, region, (LOWEST, highest), rtol)


def rotor_nearby(table: RotorTable, rotor: tuple[Magnet, ...], place: Array, radius: float, rtol: float) -> RotorTable:
    """The rotor's table with the coefficients that count from `REACH` nearer to the magnets than `place` (3,) m on."""
    gap = min(float(magnet.body.distance(place)) for magnet in rotor) - REACH
    return shortened_table(table, Accuracy(rtol, max(gap, radius)))


def _rastered(region: Region) -> Region:
    """The region with bounds on the raster; what is nearly symmetric becomes so, which halves the work."""
    lower, upper = np.floor(region.lower / RASTER + 1e-6), np.ceil(region.upper / RASTER - 1e-6)
    for axis in np.flatnonzero((lower < 0) & (upper > 0)):
        upper[axis] = max(-lower[axis], upper[axis])
        lower[axis] = -upper[axis]
    return Region(lower * RASTER, upper * RASTER)
