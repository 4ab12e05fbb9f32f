"""The sources that currents are trained on and probed with: dipoles in a region, and what else drives the plate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from ...geometry.basics import Array, spread_points
from ..eddy_currents import EddySpace, Source, dipole_images
from .current_space import source_images
from .region import Region

PROBES = 6
"""Dipoles at places off the grid, beside those at the region's corners."""
MOST_PLACES, FEWEST_PLACES, PER_GAP = 6, 3, 1.5
"""Places of the grid along an edge: at most, at least, and more for each distance to the plate that it is long."""


@dataclass(frozen=True, eq=False)
class OtherSources:
    """What drives the plate beside a dipole in the region: the rotor.

    Parameters
    ----------
    training : sources in the plate's frame whose currents the network shall hold
    probes : others of the kind; the field of their currents is asked for in the region
    places : (n, 3) m, where they are: the mesh must do for dipoles there
    """

    training: Sequence[Source] = ()
    probes: Sequence[Source] = ()
    places: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class SourceSet:
    """Unit dipoles along x, y and z at `places` (n, 3) m, and after them other sources."""

    places: Array
    others: Sequence[Source] = ()

    def __len__(self) -> int:
        return 3 * len(self.places) + len(self.others)

    def rows(self, space: EddySpace, root: Array) -> Array:
        """(classes, sources, width) weighted potentials by parity class."""
        found = np.empty((len(space.parity.classes), len(self), root.size))
        images = chain(
            dipole_images(space.parity, space.points, self.places),
            source_images(space.parity, space.points, self.others),
        )
        start = 0
        for part in images:
            rows = part.reshape(len(found), -1, root.size)
            found[:, start : start + rows.shape[1]] = rows
            start += rows.shape[1]
        found *= root
        return found


def grid_counts(region: Region, half_edges: Array) -> tuple[int, int, int]:
    """Places along each edge of a region: more where it is long against its distance from the plate."""
    of_region, of_plate = region.nearest(half_edges)
    gap = float(np.linalg.norm(of_region - of_plate))
    wanted = np.ceil(2 + PER_GAP * (region.upper - region.lower) / gap)
    x, y, z = np.clip(wanted, FEWEST_PLACES, MOST_PLACES).astype(int)
    return int(x), int(y), int(z)


def probe_places(region: Region, fold: bool = False) -> Array:
    """(n, 3) m: corners of the region, folded those not mirrored, and some places within."""
    inside = spread_points(region.lower, region.upper, PROBES)
    return np.concatenate([region.surface((2, 2, 2), fold), inside])
