"""The field of one uniformly polarised magnet in any pose, accurate near and far."""

from collections.abc import Sequence
from functools import cached_property
from itertools import product

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...geometry.common import MU_0, Array, InputError
from ...geometry.magnets import Magnet
from ...geometry.shapes import Box, Cylinder, Ring, Sphere
from ...geometry.solids import Part, Solid
from ..harmonics.expansion import turned_expressions, turned_field, uniform_moments
from ..harmonics.expressions import CompiledField, FieldExpressions, Number
from .cuboid import cuboid_field
from .round import resolved_distance, round_slope, round_tensor, segments_field

FAR = 5.0
"""From this many circumradii on, moments are as exact as the closed form, whose terms cancel more and more."""
FAR_DEGREE = 17
"""The first moments left out are of degree 19 (the even ones of a box vanish): 5^-19 is 5e-14."""


class UniformField:
    """B and its gradient of a magnet with exactly its remanent polarisation (μr = 1), rotor's frame."""

    def __init__(self, magnet: Magnet) -> None:
        self.magnet = magnet

    def expressions(self, position: Sequence[hy.expression], number: Number = float) -> FieldExpressions:
        """Closed form at a position (three expressions, m), turned from the magnet's axes into the rotor's."""
        body, axes = self.magnet.body, self.magnet.body.rotation
        if isinstance(body, Sphere):
            return uniform_moments(self.magnet, 1).expressions(position, number)
        shifted = [position[i] - number(body.center[i]) for i in range(3)]
        if np.array_equal(axes, np.eye(3)):
            return self._in_body(shifted, number)
        return turned_field(axes, self._in_body(turned_expressions(axes.T, shifted, number), number), number)

    def _in_body(self, position: Sequence[hy.expression], number: Number) -> FieldExpressions:
        """Closed form in the magnet's own axes."""
        body, polarization = self.magnet.body, self.magnet.polarization
        if isinstance(body, Box):
            return cuboid_field(position, body.half_edges, polarization, number)
        assert isinstance(body, Cylinder | Ring)
        return segments_field(position, body, polarization)

    @cached_property
    def _near(self) -> CompiledField:
        return CompiledField(self.expressions, seldom=self.is_long)

    @property
    def is_long(self) -> bool:
        """Whether its closed form is so long that to optimise its code takes a second (cylinder) or three (ring)."""
        return isinstance(self.magnet.body, Cylinder | Ring)

    @cached_property
    def _far(self) -> CompiledField:
        return CompiledField(uniform_moments(self.magnet, FAR_DEGREE).expressions, seldom=True)

    def rows(self, columns: Array) -> Array:
        """B (T) outside, μ0 H inside, and its gradient (T/m), (12, n), at `columns` (3, n) m; 1e-13 at any distance.

        Of cylinders and rings 1e-10, but for places that `is_close`.
        """
        far, close = self.is_far(columns), self.is_close(columns)
        found = np.empty((12, columns.shape[1]))
        for chosen, field in ((~far & ~close, self._near), (far, self._far)):
            if chosen.any():
                found[:, chosen] = field.rows(np.ascontiguousarray(columns[:, chosen]))
        if close.any():
            found[:, close] = self._beside(columns[:, close].T)
        return found

    def _beside(self, points: Array) -> Array:
        """As `rows`, beside the surface of a round magnet."""
        body, polarization = self.magnet.body, self.magnet.polarization_in_rotor
        assert not isinstance(body, Box | Part)
        field, slope = round_tensor(body, points) @ polarization, round_slope(body, points) @ polarization
        return np.concatenate([field.T, slope.reshape(len(points), 9).T])

    def is_close(self, columns: Array) -> NDArray[np.bool_]:
        """Which of `columns` (3, n) m are in a round magnet or so near that the expressions do not do: (n,)."""
        body = self.magnet.body
        if isinstance(body, Box | Part):
            return np.zeros(columns.shape[1], bool)
        nearest = 0.0 if isinstance(body, Sphere) else resolved_distance(body)
        return np.asarray(body.distance(columns.T) < nearest)

    def is_far(self, columns: Array) -> NDArray[np.bool_]:
        """Which of `columns` (3, n) m are so far away that moments are the more exact: (n,)."""
        body = self.magnet.body
        return squared_distance(columns, body.center) > (FAR * body.circumradius) ** 2


def squared_distance(columns: Array, center: Array) -> Array:
    """Squared distances (n,) m² of `columns` (3, n) m from a point."""
    x, y, z = columns - center[:, None]
    return np.asarray(x * x + y * y + z * z)


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
    if isinstance(body, Part):
        raise InputError(
            "Input rotor must have no part from a file where closed forms are asked for; instead it has one. "
            "Choose --model fem and --interaction rigid."
        )
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
    known = [magnet for magnet in magnets if magnet.polarization.any()]
    fields = [demagnetizing_tensor(m.body, points) @ m.polarization_in_rotor for m in known]
    return np.asarray(np.sum([np.zeros_like(points), *fields], axis=0))


def remanent_potential(magnets: Sequence[Magnet], points: Array) -> Array:
    """Potential (n,) T m of cuboids with μr = 1 at points (n, 3) m."""
    return np.asarray(sum(potential_vector(m.box, points) @ m.polarization_in_rotor for m in magnets))


Fields = tuple[Array, Array]
"""H and M, each (n, 3) A/m; B = μ0 (H + M)."""


def fields_of_magnets(magnets: Sequence[Magnet], points: Array) -> Fields:
    """H and M of cuboids at points (n, 3) m off their edges.

    H is that of the remanent polarisation J alone, M = J/μ0 + (μr - 1) H inside. The H of the second part of M is
    left out: of the order of μr - 1, relative to H (`closed_form_error`). Exact for μr = 1.
    """
    h = remanent_field(magnets, points) / MU_0
    magnetization = np.zeros_like(h)
    for magnet in magnets:
        inside = magnet.body.distance(points) <= 0
        magnetization[inside] = magnet.polarization_in_rotor / MU_0
        magnetization[inside] += h[inside] @ (magnet.permeability_in_rotor - np.eye(3)).T
    return h, magnetization


def closed_form_error(magnets: Sequence[Magnet]) -> float:
    """Estimated error of `fields_of_magnets`, relative to the field: the largest μr - 1."""
    return max((magnet.contrast for magnet in magnets), default=0.0)


def fields_of_sphere(moment: Array, center: Array, radius: float, points: Array) -> Fields:
    """H and M of a sphere magnetised uniformly with `moment` (3,) A m²: a dipole's outside, H = -M/3 inside; exact."""
    away = points - center
    distance = np.linalg.norm(away, axis=1)[:, None]
    within = distance <= radius
    magnetization = np.where(within, moment / (4 / 3 * np.pi * radius**3), 0.0)
    unit = away / np.maximum(distance, radius)  # of length 1 outside, where it is used
    outside = (3 * unit * (unit @ moment)[:, None] - moment) / (4 * np.pi * np.maximum(distance, radius) ** 3)
    return np.where(within, -magnetization / 3, outside), magnetization
