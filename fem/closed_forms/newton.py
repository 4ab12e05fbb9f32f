"""Newton potential of a uniform cuboid and its attraction, in closed form.

Over a rectangle at normal distance u, with corner offsets v_j, w_k (j, k = ±1), r_jk = |(u, v_j, w_k)|

    ∫ dS/r = Σ_j j v_j Λ_w(j) + Σ_k k w_k Λ_v(k) - |u| Σ_jk jk atan2(v_j w_k, |u| r_jk),

where Λ = 2 atanh(L/(r1 + r2)) = ∫ ds/r along an edge: no singular lines but the edges themselves.  The attraction
∫ r/r³ dV is the difference of it over opposite faces, and the potential ∫ dV/r = ½ Σ_faces (distance) ∫ dS/r.
O. D. Kellogg, Foundations of Potential Theory (1929), ch. III;
W. D. MacMillan, The Theory of the Potential (1930), § 43.
"""

from itertools import product

import numpy as np

from ...geometry.basics import Array

SIGNS = (1, -1)
Signs = tuple[int, ...]


def _face_integrals(points: Array, half_edges: Array) -> dict[tuple[int, int], Array]:
    """∫ dS/r (n,), m, over each face (axis, side) of a cuboid, seen from points (n, 3), m, along its axes.

    Its eight corners and twelve edges are each looked at once.
    """
    offset = [{s: points[:, axis] + s * half_edges[axis] for s in SIGNS} for axis in range(3)]
    square = [{s: values**2 for s, values in one.items()} for one in offset]
    distance: dict[Signs, Array] = {}
    for i, j, k in product(SIGNS, repeat=3):
        distance[i, j, k] = np.sqrt(square[0][i] + square[1][j] + square[2][k])
    edges: dict[tuple[int, Signs], Array] = {}
    for axis, first, second in product(range(3), SIGNS, SIGNS):
        ends = distance[_corner(axis, 1, first, second)] + distance[_corner(axis, -1, first, second)]
        edges[axis, _corner(axis, 0, first, second)] = 2 * np.arctanh(2 * half_edges[axis] / ends)
    found = {}
    for axis, side in product(range(3), SIGNS):
        second, third = (axis + 1) % 3, (axis + 2) % 3
        height = np.abs(offset[axis][-side])
        total = np.zeros_like(height)
        for s in SIGNS:
            total += s * offset[second][s] * edges[third, _corner(axis, -side, s, 0)]
            total += s * offset[third][s] * edges[second, _corner(axis, -side, 0, s)]
            up, down = (distance[_corner(axis, -side, s, k)] for k in SIGNS)
            total -= s * height * _turned(height, offset[second][s], offset[third], up, down)
        found[axis, side] = total
    return found


def _corner(axis: int, along: int, second: int, third: int) -> Signs:
    """Signs along x, y and z of those along an axis and the two that follow it in turn."""
    found = [0, 0, 0]
    found[axis], found[(axis + 1) % 3], found[(axis + 2) % 3] = along, second, third
    return tuple(found)


def _turned(height: Array, v: Array, w: dict[int, Array], up: Array, down: Array) -> Array:
    """Σ_k k atan2(v w_k, height r_k), as the angle of one product of complex numbers."""
    real = height**2 * up * down + v**2 * w[1] * w[-1]
    return np.asarray(np.arctan2(v * height * (w[1] * down - w[-1] * up), real))


def attraction(points: Array, half_edges: Array) -> Array:
    """∫ (x - x')/|x - x'|³ dV' (n, 3), m, at `points` (n, 3), m, from the centre of a cuboid along its axes."""
    faces = _face_integrals(points, half_edges)
    return np.stack([faces[axis, 1] - faces[axis, -1] for axis in range(3)], axis=1)


def newton_potential(points: Array, half_edges: Array) -> Array:
    """∫ dV'/|x - x'| (n,), m², at `points` (n, 3), m, from the centre of a cuboid along its axes."""
    faces = _face_integrals(points, half_edges)
    parts = [0.5 * (half_edges[axis] - side * points[:, axis]) * faces[axis, side] for axis, side in faces]
    return np.asarray(np.sum(parts, axis=0))
