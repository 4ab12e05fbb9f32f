"""Field and potential of uniformly polarised magnets inside and outside of them, as matrices on the polarisation.

With the corner sums of `cuboid`, H = T J and H = -grad (g·J), J in T: T is minus the demagnetising tensor at a point, g
the potential of the box's charged faces. NumPy, for the many points inside the elements; each matrix serves every
polarisation. Sources as in `cuboid`; the potential of a charged rectangle also in D. Nagy, Geophysics 31 (1966) 362.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np

from ...geometry.basics import Array, Box, Solid
from ...geometry.bodies import Magnet
from .round_magnets import round_tensor

SIGNS = (-1, 1)
FOUR_PI = 4 * np.pi


class _Corners:
    """Distances of points (n, 3), in body axes, from the eight corners of a box."""

    def __init__(self, box: Box, points: Array) -> None:
        body = box.to_body(points)
        self.half = box.half_edges
        self.offset = [{s: body[:, a] - s * self.half[a] for s in SIGNS} for a in range(3)]
        square = [{s: d * d for s, d in axis.items()} for axis in self.offset]
        self.distance = {
            (i, j, k): np.sqrt(square[0][i] + square[1][j] + square[2][k]) for i, j, k in product(SIGNS, repeat=3)
        }
        self.edges = {axis: self._edges(axis) for axis in range(3)}

    def _edges(self, axis: int) -> dict[tuple[int, int], Array]:
        """∫ ds/r along the four edges parallel to an axis, by the signs of the two other axes."""
        first, second = (a for a in range(3) if a != axis)
        found = {}
        for i, j in product(SIGNS, repeat=2):
            key = {first: i, second: j}
            ends = [self.distance[tuple({**key, axis: k}[a] for a in range(3))] for k in SIGNS]  # type: ignore[index]
            reach, length = ends[0] + ends[1], 2 * self.half[axis]
            rest = np.maximum(reach - length, 1e-300)
            found[i, j] = np.log((reach + length) / rest)
        return found


def demagnetizing_tensor(body: Solid, points: Array) -> Array:
    """(n, 3, 3): H = T J (T) at points (n, 3) m, off the body's edges, of a polarisation J; frame of the points."""
    return _box_tensor(body, points) if isinstance(body, Box) else round_tensor(body, points)


def _box_tensor(box: Box, points: Array) -> Array:
    corners = _Corners(box, points)
    tensor = np.zeros((len(points), 3, 3))
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        for signs, r in corners.distance.items():
            u, v, w = (corners.offset[axis][signs[axis]] for axis in (a, b, c))
            with np.errstate(divide="ignore", invalid="ignore"):
                tensor[:, a, a] += np.prod(signs) * np.nan_to_num(np.arctan(v * w / (u * r)))
        first, second = min(a, b), max(a, b)
        tensor[:, a, b] = sum(i * j * edge for (i, j), edge in corners.edges[3 - first - second].items())
        tensor[:, b, a] = tensor[:, a, b]
    return np.asarray(box.rotation @ tensor @ box.rotation.T / FOUR_PI)


def potential_vector(box: Box, points: Array) -> Array:
    """(n, 3) m: H = -grad (g·J) of a polarisation J; continuous everywhere, as t log t at an edge."""
    corners = _Corners(box, points)
    vector = np.zeros((len(points), 3))
    for a in range(3):
        b, c = (other for other in range(3) if other != a)
        for signs, r in corners.distance.items():
            u, v, w = (np.abs(corners.offset[a][signs[a]]), corners.offset[b][signs[b]], corners.offset[c][signs[c]])
            vector[:, a] -= np.prod(signs) * u * np.arctan2(v * w, u * r)
        for i, j in product(SIGNS, repeat=2):
            # -Σ ij v_j Λ_c(i, j) for the edges along c, and likewise for those along b
            for across, along in ((b, c), (c, b)):
                key = (i, j) if a < across else (j, i)
                vector[:, a] -= i * j * corners.offset[across][j] * corners.edges[along][key]
    return np.asarray(vector @ box.rotation.T / FOUR_PI)


def remanent_field(magnets: Sequence[Magnet], points: Array) -> Array:
    """μ0 H (n, 3) T of magnets with μr = 1 at points (n, 3) m, off their edges."""
    return np.asarray(sum(demagnetizing_tensor(m.body, points) @ m.polarization_in_rotor for m in magnets))


def remanent_potential(magnets: Sequence[Magnet], points: Array) -> Array:
    """Potential (n,) T m of cuboids with μr = 1 at points (n, 3) m."""
    return np.asarray(sum(potential_vector(m.box, points) @ m.polarization_in_rotor for m in magnets))
