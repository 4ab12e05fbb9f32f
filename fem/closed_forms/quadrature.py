"""Gauss rules pressed towards the places where closed-form fields of boxes have kinks and logarithms."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ...geometry.basics import Array, Box, Ring, Solid, Sphere
from ...geometry.bodies import separation

NEAR = 0.1
"""Gaps below this part of the shortest edge are as contact to a rule."""


def enough_nodes(degree: int) -> int:
    """Nodes per panel for solid harmonics up to a degree beside such a field: round-off."""
    return max(20, degree + 6)


def oblique_contact(bodies: Sequence[Solid]) -> bool:
    """Whether two bodies but parallel boxes (nearly) touch: then kinks run across the panels of the rules."""
    return any(
        not _parallel(first, second) and separation(first, second)[0] < NEAR * min(first.size.min(), second.size.min())
        for first, second in combinations(bodies, 2)
    )


def _parallel(first: Solid, second: Solid) -> bool:
    """Whether both are boxes, of the same axes."""
    if not (isinstance(first, Box) and isinstance(second, Box)):
        return False
    return np.allclose(np.abs(first.rotation.T @ second.rotation).max(axis=0), 1, rtol=0, atol=1e-12)


def graded_rule(breaks: Array, nodes: int) -> tuple[Array, Array]:
    """Points and weights on the panels between `breaks`, by x = (15 t - 10 t³ + 3 t⁵)/8 on each.

    t log t at the ends of a panel is integrated to about nodes⁻¹².
    """
    t, weights = np.polynomial.legendre.leggauss(nodes)
    place, weight = (15 * t - 10 * t**3 + 3 * t**5) / 8, 1.875 * weights * (1 - t * t) ** 2
    middle, half = (breaks[1:] + breaks[:-1]) / 2, np.diff(breaks) / 2
    return (middle[:, None] + half[:, None] * place).ravel(), (half[:, None] * weight).ravel()


def panel_breaks(box: Box, others: Sequence[Solid]) -> list[Array]:
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


def face_rule(box: Box, others: Sequence[Solid], nodes: int) -> tuple[Array, Array]:
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


def volume_rule(body: Solid, others: Sequence[Solid], nodes: int) -> tuple[Array, Array]:
    """Points (n, 3) m inside the body and weights (n,) m³."""
    if isinstance(body, Box):
        return _box_rule(body, others, nodes)
    circle = 2 * np.pi * (np.arange(2 * nodes) + 0.5) / (2 * nodes)
    across, height, weight = _sphere_section(body, nodes) if isinstance(body, Sphere) else _ring_section(body, nodes)
    turned = across[:, None, None] * np.stack([np.cos(circle), np.sin(circle)], axis=-1)
    upright = np.broadcast_to(height[:, None, None], (*turned.shape[:2], 1))
    points = np.concatenate([turned, upright], axis=-1).reshape(-1, 3)
    weights = np.repeat(weight * across * np.pi / nodes, 2 * nodes)
    return body.center + points @ body.rotation.T, weights


def _ring_section(body: Solid, nodes: int) -> tuple[Array, Array, Array]:
    """Distance from the axis, height, and weight (n,) m² over the section of a ring or cylinder."""
    inner = body.inner_radius if isinstance(body, Ring) else 0.0
    rho, wide = graded_rule(np.array([inner, body.half_edges[0]]), nodes)
    z, tall = graded_rule(np.array([-1.0, 1.0]) * body.half_edges[2], nodes)
    return np.repeat(rho, len(z)), np.tile(z, len(rho)), np.outer(wide, tall).ravel()


def _sphere_section(body: Sphere, nodes: int) -> tuple[Array, Array, Array]:
    """As `_ring_section`, of a sphere."""
    r, deep = graded_rule(np.array([0.0, body.radius]), nodes)
    cosine, weights = np.polynomial.legendre.leggauss(nodes)
    sine = np.sqrt(1 - cosine**2)
    return np.outer(r, sine).ravel(), np.outer(r, cosine).ravel(), np.outer(deep * r, weights / sine).ravel()


def _box_rule(box: Box, others: Sequence[Solid], nodes: int) -> tuple[Array, Array]:
    rules = [graded_rule(breaks, nodes) for breaks in panel_breaks(box, others)]
    grid = np.stack(np.meshgrid(*(points for points, _ in rules), indexing="ij"), -1).reshape(-1, 3)
    x, y, z = (weights for _, weights in rules)
    return box.center + grid @ box.rotation.T, (x[:, None, None] * y[:, None] * z).ravel()
