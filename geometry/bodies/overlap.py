"""Exact overlap of boxes and spheres in any pose, and gaps that are too narrow for elements."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..basics import Array, Box, Solid, rotation_matrix
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


def body_overlap(first: Solid, second: Solid) -> float:
    """Penetration depth of two convex bodies, m: the shortest shift that parts them; negative if they are apart.

    Some direction shows the widest gap between them.  Where faces or mantles meet it is one of those that are tried
    first, and the depth is exact; elsewhere it is found by a search, which can only tell too large a depth.
    """
    if isinstance(first, Box) and isinstance(second, Box):
        return box_overlap(first, second)
    offset = second.center - first.center

    def gap(directions: Array) -> Array:
        ways = directions / np.linalg.norm(directions, axis=1)[:, None]
        return np.asarray(np.abs(ways @ offset) - first.reach(ways) - second.reach(ways))

    axes = np.vstack([first.rotation.T, second.rotation.T])
    across = np.vstack([offset, *(offset - (offset @ axis) * axis for axis in axes)])
    tried = np.vstack([axes, across, np.random.default_rng(0).normal(size=(200, 3))])
    tried = tried[np.linalg.norm(tried, axis=1) > 1e-12]
    widest = tried[int(np.argmax(gap(tried)))]
    scale = first.circumradius + second.circumradius
    found = scipy.optimize.minimize(lambda n: -gap(n[None])[0] / scale, widest, method="Nelder-Mead", tol=1e-9)
    return float(min(scale * found.fun, -gap(tried).max()))


def sphere_overlap(center: ArrayLike, radius: float, body: Solid) -> float:
    """Penetration depth of a sphere into a body, m; negative if they are apart."""
    return radius - float(body.distance(center))


def turned(body: Solid, angle: float) -> Solid:
    """The body after the rotor has turned by `angle` (rad) about z."""
    turn = rotation_matrix((0.0, 0.0, np.degrees(angle)))
    return replace(body, center=turn @ body.center, rotation=turn @ body.rotation)


def deepest_overlap_in_a_turn(rotating: Solid, fixed: Box) -> float:
    """Largest penetration depth of a body that turns about z into a fixed box, m; negative if always apart."""
    apart = float(fixed.distance(np.zeros(3))) - _farthest(rotating)
    if apart > 0:  # it never leaves a sphere that does not reach the fixed one
        return -apart

    def gap(angle: float) -> float:
        return -body_overlap(turned(rotating, angle), fixed)

    angles = np.linspace(0.0, 2 * np.pi, 73)
    best = angles[int(np.argmin([gap(angle) for angle in angles]))]
    step = angles[1]
    refined = scipy.optimize.minimize_scalar(
        gap, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-9}
    )
    return -min(gap(best), float(refined.fun))


def _farthest(body: Solid) -> float:
    """Distance from the origin that no point of the body exceeds, m."""
    if isinstance(body, Box):
        return float(np.linalg.norm(body.corners, axis=1).max())
    return float(np.linalg.norm(body.center)) + body.circumradius


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
