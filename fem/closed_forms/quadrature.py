"""Gauss rules pressed towards the places where closed-form fields of boxes have kinks and logarithms."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ...geometry.basics import Array, Box
from ...geometry.bodies import separation

NEAR = 0.1
"""Gaps below this part of the shortest edge are as contact to a rule."""


def enough_nodes(degree: int) -> int:
    """Nodes per panel for solid harmonics up to a degree beside such a field: round-off."""
    return max(20, degree + 6)


def oblique_contact(boxes: Sequence[Box]) -> bool:
    """Whether two boxes that are not parallel (nearly) touch: then kinks run across the panels of the rules."""
    return any(
        not _parallel(first, second) and separation(first, second)[0] < NEAR * min(first.size.min(), second.size.min())
        for first, second in combinations(boxes, 2)
    )


def _parallel(first: Box, second: Box) -> bool:
    return np.allclose(np.abs(first.rotation.T @ second.rotation).max(axis=0), 1, rtol=0, atol=1e-12)


def graded_rule(breaks: Array, nodes: int) -> tuple[Array, Array]:
    """Points and weights on the panels between `breaks`, by x = (15 t - 10 t³ + 3 t⁵)/8 on each.

    t log t at the ends of a panel is integrated to about nodes⁻¹².
    """
    t, weights = np.polynomial.legendre.leggauss(nodes)
    place, weight = (15 * t - 10 * t**3 + 3 * t**5) / 8, 1.875 * weights * (1 - t * t) ** 2
    middle, half = (breaks[1:] + breaks[:-1]) / 2, np.diff(breaks) / 2
    return (middle[:, None] + half[:, None] * place).ravel(), (half[:, None] * weight).ravel()


def panel_breaks(box: Box, others: Sequence[Box]) -> list[Array]:
    """Ends of the panels along each body axis: the faces, and where faces of parallel boxes lie between them."""
    result = []
    for axis in range(3):
        half = box.half_edges[axis]
        places = {-half, half}
        for other in others:
            body = box.to_body(other.corners)
            if _parallel(box, other):
                places |= {place for place in body[:, axis] if abs(place) < half * (1 - 1e-9)}
        ordered = np.array(sorted(places))
        apart = np.concatenate([[True], np.diff(ordered) > 1e-9 * half])
        result.append(ordered[apart])
    return result


def face_rule(box: Box, others: Sequence[Box], nodes: int) -> tuple[Array, Array]:
    """Points (n, 3) m on the faces, and outward normals times weight (n, 3) m²."""
    rules = [graded_rule(breaks, nodes) for breaks in panel_breaks(box, others)]
    points, areas = [], []
    for axis in range(3):
        second, third = (axis + 1) % 3, (axis + 2) % 3
        v, w = np.meshgrid(rules[second][0], rules[third][0], indexing="ij")
        weight = np.outer(rules[second][1], rules[third][1]).ravel()
        for side in (-1, 1):
            face = np.zeros((v.size, 3))
            face[:, axis], face[:, second], face[:, third] = side * box.half_edges[axis], v.ravel(), w.ravel()
            points.append(box.center + face @ box.rotation.T)
            areas.append(side * weight[:, None] * box.rotation[:, axis])
    return np.concatenate(points), np.concatenate(areas)


def volume_rule(box: Box, others: Sequence[Box], nodes: int) -> tuple[Array, Array]:
    """Points (n, 3) m inside the box and weights (n,) m³."""
    rules = [graded_rule(breaks, nodes) for breaks in panel_breaks(box, others)]
    grid = np.stack(np.meshgrid(*(points for points, _ in rules), indexing="ij"), -1).reshape(-1, 3)
    x, y, z = (weights for _, weights in rules)
    return box.center + grid @ box.rotation.T, (x[:, None, None] * y[:, None] * z).ravel()
