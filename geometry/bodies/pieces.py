"""Magnets cut into pieces so compact that a multipole expansion about each converges where it is needed."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from ..basics import Array, Box, InputError, Solid
from .magnet import Magnet

CONVERGENCE = 1.3
"""Least distance of a point from a piece's centre, in circumradii of the piece."""
MOST = 300
"""Pieces of a body."""


def cut_magnets(
    magnets: Sequence[Magnet], nearest: float, whole: float = CONVERGENCE
) -> tuple[tuple[Magnet, ...], ...]:
    """Pieces of every magnet, equal boxes, for expansions that are used from the distance `nearest` (m) from faces on.

    Parameters
    ----------
    whole : least distance of a point from the centre of a magnet that stays whole, in circumradii; at 1.3 a cube does
        down to 0.63 of its edge from a face.  Magnets of other shapes stay whole here, see `cells_of`.

    Raises
    ------
    InputError : a magnet would need more than `MOST` pieces
    """
    return tuple(
        tuple(_pieces(magnet, _counts(magnet.box, nearest, whole))) if isinstance(magnet.body, Box) else (magnet,)
        for magnet in magnets
    )


def _counts(box: Box, nearest: float, whole: float) -> tuple[int, ...]:
    """Number of pieces along each axis: the longest side of the pieces is cut until they are compact enough."""
    counts = np.ones(3, dtype=int)
    while True:
        half = box.size / counts / 2
        if nearest + half.min() >= (CONVERGENCE if counts.max() > 1 else whole) * np.linalg.norm(half):
            return tuple(int(n) for n in counts)
        cut_further(counts, half, box, nearest)


def cut_further(counts: Array, half: Array, body: Solid, nearest: float) -> None:
    """One more piece along the axis on which pieces are longest. Raises InputError where there are too many."""
    counts[np.argmax(half)] += 1
    if counts.prod() > MOST:
        raise InputError(
            f"Input bodies must be such that {MOST} compact pieces make one up; instead a {body.described_size} "
            f"needs more for its field to be known {nearest * 1e3:.3g} mm from its faces. Give it as several bodies."
        )


def _pieces(magnet: Magnet, counts: tuple[int, ...]) -> list[Magnet]:
    if counts == (1, 1, 1):
        return [magnet]
    box, size = magnet.box, magnet.box.size / counts
    return [
        Magnet(
            Box(size, box.center + box.rotation @ (size * (np.array(place) + 0.5) - box.half_edges), box.rotation),
            magnet.polarization,
            magnet.recoil_permeability,
            magnet.transverse_permeability,
        )
        for place in product(*(range(n) for n in counts))
    ]
