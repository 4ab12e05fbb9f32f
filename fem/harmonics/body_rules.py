"""Quadrature of polynomials over bodies, exact up to a degree."""

import numpy as np

from ...geometry.basics import Array, Box, Part, Ring, Solid, Sphere
from ...geometry.meshes import part_rule


def polynomial_rule(body: Solid, degree: int) -> tuple[Array, Array]:
    """Points (n, 3) m and weights (n,) m³ that integrate polynomials up to `degree` over a body.

    To round-off, but for a part: as well as curved elements fill it, 1e-8.
    """
    if isinstance(body, Part):
        return part_rule(body, degree)
    if isinstance(body, Box):
        return box_rule(body, (degree // 2 + 1,) * 3)
    if isinstance(body, Sphere):
        local, weights = _sphere_rule(body.radius, degree)
    else:
        inner = body.inner_radius if isinstance(body, Ring) else 0.0
        local, weights = _ring_rule(inner, body.radius, body.height / 2, degree)
    return body.center + local @ body.rotation.T, weights


def box_rule(box: Box, counts: tuple[int, int, int]) -> tuple[Array, Array]:
    """Points (n, 3) m and weights (n,) m³ of Gauss's rule in a box, with so many points along each edge."""
    nodes, weights = zip(*(np.polynomial.legendre.leggauss(n) for n in counts), strict=True)
    grid = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    volumes = np.prod(box.half_edges) * np.einsum("i,j,k->ijk", *weights).ravel()
    return box.center + (box.half_edges * grid) @ box.rotation.T, volumes


def _circle(count: int) -> Array:
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _ring_rule(inner: float, outer: float, half: float, degree: int) -> tuple[Array, Array]:
    """Even powers of the distance from the axis are polynomials of its square."""
    t, weight = np.polynomial.legendre.leggauss(degree // 2 + 1)
    square = inner**2 + (t + 1) / 2 * (outer**2 - inner**2)
    circle = _circle(degree + 1)
    shape = (len(t), len(t), len(circle))
    across = np.sqrt(square)[:, None, None, None] * circle[None, None]
    across = np.broadcast_to(across, (*shape, 2))
    height = np.broadcast_to((half * t)[None, :, None, None], (*shape, 1))
    points = np.concatenate([across, height], axis=-1).reshape(-1, 3)
    ring = weight * (outer**2 - inner**2) / 4 * (2 * np.pi / len(circle))
    return points, np.repeat(np.outer(ring, half * weight).ravel(), len(circle))


def _sphere_rule(radius: float, degree: int) -> tuple[Array, Array]:
    t, weight = np.polynomial.legendre.leggauss(degree // 2 + 2)
    circle = _circle(degree + 1)
    shape = (len(t), len(t), len(circle))
    distance, cosine = radius * (t + 1) / 2, t
    across = (distance[:, None] * np.sqrt(1 - cosine**2))[:, :, None, None] * circle
    height = np.broadcast_to(np.outer(distance, cosine)[:, :, None, None], (*shape, 1))
    points = np.concatenate([across, height], axis=-1).reshape(-1, 3)
    shell = weight * radius / 2 * distance**2 * (2 * np.pi / len(circle))
    return points, np.repeat(np.outer(shell, weight).ravel(), len(circle))
