"""Parity parts of the potentials of dipoles at the quadrature points of a plate, many places at once.

The potential of a moment along e_j is e_j × K with the kernel K = (μ0/4π) r/r³.  Its mirror images differ from those of
K by signs, and a sign that a mirror gives to one component only is itself a parity: one sum over the images of K gives
the parts of all three moments.
"""

from collections.abc import Iterator

import numpy as np

from ...geometry.basics import MU_0, Array
from ..elements import Parity

CHUNK = 16
"""Places at a time: bounds the memory."""
CROSS = ((0, 1, 2, 1.0), (0, 2, 1, -1.0), (1, 0, 2, -1.0), (1, 2, 0, 1.0), (2, 0, 1, 1.0), (2, 1, 0, -1.0))
"""Component, moment's axis j, component of K and sign of what is not zero in e_j × K."""


def dipole_images(parity: Parity, points: Array, places: Array) -> Iterator[Array]:
    """(classes, m, 3, n, 3) T m, potentials at `points` (n, 3) of unit moments along x, y, z at m of the `places`."""
    flips, characters = parity.flips, parity.characters
    partner = [_rows(characters, characters * flip) for flip in flips.T]
    for start in range(0, len(places), CHUNK):
        some = places[start : start + CHUNK]
        offset = (points * flips[:, None])[:, None] - some[:, None]
        square = np.einsum("fmna,fmna->fmn", offset, offset)
        offset *= (MU_0 / (4 * np.pi) / (square * np.sqrt(square)))[..., None]  # a power would take five times as long
        parts = parity.project(offset)
        images = np.zeros((len(flips), len(some), 3, len(points), 3))
        for component, moment, kernel, sign in CROSS:
            images[:, :, moment, :, component] = sign * parts[partner[component], :, :, kernel]
        yield images


def _rows(table: Array, wanted: Array) -> list[int]:
    """Where each row of `wanted` stands in `table`."""
    return [int(np.flatnonzero((table == row).all(axis=1))[0]) for row in wanted]
