"""Gaps between magnets that are too narrow for elements."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ..basics import Array, Box
from .magnet import Magnet
from .overlap import TOUCHING, separation

NARROW = 2e-3
"""Gaps below this part of the smallest edge are closed for the mesh."""


def shifted_magnet(magnet: Magnet, shift: Array) -> Magnet:
    """The magnet moved by `shift` (3,) m."""
    box = magnet.box
    return replace(magnet, box=Box(box.size, box.center + shift, box.rotation)) if shift.any() else magnet


def closing_shifts(magnets: Sequence[Magnet]) -> Array:
    """(n, 3) m: how to move the magnets so that narrow gaps close; the first of a pair stays."""
    shifts = np.zeros((len(magnets), 3))
    narrow = NARROW * min(float(magnet.box.size.min()) for magnet in magnets)
    for i, j in combinations(range(len(magnets)), 2):
        gap, axis = separation(shifted_magnet(magnets[i], shifts[i]).box, shifted_magnet(magnets[j], shifts[j]).box)
        if TOUCHING < gap < narrow:
            shifts[j] -= gap * axis
    return shifts


def largest_shift(magnets: Sequence[Magnet]) -> float:
    """Length of the longest of the `closing_shifts`, m."""
    return float(np.linalg.norm(closing_shifts(magnets), axis=1).max())
