"""Exact overlap of boxes and spheres in any pose, and gaps that are too narrow for elements."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..basics import Array, Box, rotation_matrix
from .magnet import Magnet

TOUCHING = 1e-9
"""Bodies that overlap by less than this (m) only touch: it is far above round-off and far below any tolerance."""
NARROW = 2e-3
"""Gaps below this part of the smallest edge are closed for the mesh."""


def separation(first: Box, second: Box) -> tuple[float, Array]:
    """Widest gap between two boxes, m (negative: shortest shift that parts them), and its direction (3,).

    Separating-axis theorem (S. Gottschalk et al., SIGGRAPH 1996): two boxes are apart exactly if one of the
    three axes of either or one of the nine products of their edges parts them.
    """
    a, b = first.rotation.T, second.rotation.T
    crossed = np.cross(a[:, None, :], b[None, :, :]).reshape(9, 3)
    length = np.linalg.norm(crossed, axis=1)
    axes = np.vstack([a, b, crossed[length > 1e-9] / length[length > 1e-9, None]])
    reach = np.abs(axes @ first.rotation) @ first.half_edges + np.abs(axes @ second.rotation) @ second.half_edges
    along = axes @ (second.center - first.center)
    best = int(np.argmax(np.abs(along) - reach))
    return float(np.abs(along[best]) - reach[best]), axes[best] * np.sign(along[best])


def box_overlap(first: Box, second: Box) -> float:
    """Penetration depth of two boxes, m: the shortest shift that parts them; negative if they are apart."""
    return -separation(first, second)[0]


def sphere_overlap(center: ArrayLike, radius: float, box: Box) -> float:
    """Penetration depth of a sphere into a box, m; negative if they are apart."""
    return radius - float(box.distance(center))


def turned(box: Box, angle: float) -> Box:
    """The box after the rotor has turned by `angle` (rad) about z."""
    turn = rotation_matrix((0.0, 0.0, np.degrees(angle)))
    return Box(box.size, turn @ box.center, turn @ box.rotation)


def deepest_overlap_in_a_turn(rotating: Box, fixed: Box) -> float:
    """Largest penetration depth of a box that turns about z into a fixed one, m; negative if always apart."""
    apart = float(fixed.distance(np.zeros(3))) - float(np.linalg.norm(rotating.corners, axis=1).max())
    if apart > 0:  # it never leaves a sphere that does not reach the fixed one
        return -apart

    def gap(angle: float) -> float:
        return -box_overlap(turned(rotating, angle), fixed)

    angles = np.linspace(0.0, 2 * np.pi, 73)
    best = angles[int(np.argmin([gap(angle) for angle in angles]))]
    step = angles[1]
    refined = scipy.optimize.minimize_scalar(
        gap, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-9}
    )
    return -min(gap(best), float(refined.fun))


def overlapping_magnets(magnets: Sequence[Magnet]) -> list[tuple[int, int, float]]:
    """Pairs of magnets that overlap (touching is allowed) with their depth, m."""
    pairs = [(i, j, box_overlap(magnets[i].box, magnets[j].box)) for j in range(len(magnets)) for i in range(j)]
    return [(i, j, depth) for i, j, depth in pairs if depth > TOUCHING]


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
