"""Newton potential of a uniform cuboid and its attraction, in closed form.

Over a rectangle at normal distance u, with corner offsets v_j, w_k (j, k = ±1), r_jk = |(u, v_j, w_k)|

    ∫ dS/r = Σ_j j v_j Λ_w(j) + Σ_k k w_k Λ_v(k) - |u| Σ_jk jk atan2(v_j w_k, |u| r_jk),

where Λ = 2 atanh(L/(r1 + r2)) = ∫ ds/r along an edge: no singular lines but the edges themselves.  The attraction
∫ r/r³ dV is the difference of it over opposite faces, and the potential ∫ dV/r = ½ Σ_faces (distance) ∫ dS/r.
O. D. Kellogg, Foundations of Potential Theory (1929), ch. III;
W. D. MacMillan, The Theory of the Potential (1930), § 43.
"""

import numpy as np

from ...geometry.basics import Array

SIGNS = (1, -1)


def _edge_integral(length: float, first: Array, second: Array) -> Array:
    return 2 * np.arctanh(length / (first + second))


def rectangle_integral(normal: Array, v: Array, w: Array, half_v: float, half_w: float) -> Array:
    """∫ dS/r (n,), m, of a rectangle about the origin, seen from (normal, v, w), m."""
    offset_v, offset_w = {j: v + j * half_v for j in SIGNS}, {k: w + k * half_w for k in SIGNS}
    r = {(j, k): np.sqrt(normal**2 + offset_v[j] ** 2 + offset_w[k] ** 2) for j in SIGNS for k in SIGNS}
    total = np.zeros_like(normal)
    for s in SIGNS:
        total += s * offset_v[s] * _edge_integral(2 * half_w, r[s, 1], r[s, -1])
        total += s * offset_w[s] * _edge_integral(2 * half_v, r[1, s], r[-1, s])
    height = np.abs(normal)
    for (j, k), distance in r.items():
        total -= j * k * height * np.arctan2(offset_v[j] * offset_w[k], height * distance)
    return total


def _faces(points: Array, half_edges: Array, axis: int) -> dict[int, Array]:
    """∫ dS/r over the two faces across `axis`."""
    second, third = (axis + 1) % 3, (axis + 2) % 3
    return {
        s: rectangle_integral(
            points[:, axis] - s * half_edges[axis],
            points[:, second],
            points[:, third],
            half_edges[second],
            half_edges[third],
        )
        for s in SIGNS
    }


def attraction(points: Array, half_edges: Array) -> Array:
    """∫ (x - x')/|x - x'|³ dV' (n, 3), m, at `points` (n, 3), m, from the centre of a cuboid along its axes."""
    faces = [_faces(points, half_edges, axis) for axis in range(3)]
    return np.stack([f[1] - f[-1] for f in faces], axis=1)


def newton_potential(points: Array, half_edges: Array) -> Array:
    """∫ dV'/|x - x'| (n,), m², at `points` (n, 3), m, from the centre of a cuboid along its axes."""
    total = np.zeros(len(points))
    for axis in range(3):
        for s, integral in _faces(points, half_edges, axis).items():
            total += 0.5 * (half_edges[axis] - s * points[:, axis]) * integral
    return total
