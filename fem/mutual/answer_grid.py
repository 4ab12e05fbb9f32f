"""A magnet that answers to a floater, as few points: energies of harmonic fields, and of what they do to the sphere.

A dipole m at x makes the field b_k = μ0/4π [3 d (m·d) d⁻⁵ - m d⁻³] at point k, d = x - x_k, along the body's axes.  The
magnet answers with the energy

    -½ Σ_k Σ_a λ_ka b_ka²,

Gauss's rule for the energy of its magnetisation with weights that are fitted to finite elements (`answer_fit`).  The
field that its own remanence, along ĵ, has beyond the uniform part in a permeable sphere about x costs

    -Σ_k Σ_p (v_kp + w_kp (ĵ·d)²/d²) (R/d)^2p,

and what the magnet answers to this part of the sphere is a field on the moment, with the energy

    -Σ_k Σ_q (s_kq m·ĵ + t_kq (ĵ·d)(m·d)/d²) (R/d)^2q.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import MU_0, Array, Box, Solid, Sphere

UNIT = MU_0 / (4 * np.pi)
IN_SPHERE, IN_CIRCLE = 0.64, 0.8
"""Edges of the boxes that stand for a sphere and for the section of a cylinder, in diameters."""
CHARGES, FEW_CHARGES = 4, 2
"""Along an edge of a face; the first meet what two magnets' fields do in the sphere to 1e-3 of all that is added."""
POWERS, RETURNED = (4, 5, 6), (5, 6)
"""p of the sphere's energy: two dipoles' begin with p = 4, those of degree 2; and q, about that of three dipoles."""


@dataclass(frozen=True, eq=False)
class AnswerGrid:
    """Points of one magnet with their energies.

    Parameters
    ----------
    box : of the magnet, see `answer_box`
    axis : (3,) direction of its remanence along the body's axes; zero: none
    radius : of the floater, m
    counts : points along each body axis
    strengths : (n, 3) λ, A m²/T, along the body's axes
    degrees : (n, 3, 2) v and w of each power, J
    returned : (n, 2, 2) s and t of each power, T
    """

    box: Box
    axis: Array
    radius: float
    counts: tuple[int, int, int]
    strengths: Array
    degrees: Array
    returned: Array

    @property
    def nodes(self) -> list[Array]:
        """Places of Gauss's points along each body axis, m."""
        return [
            h * np.polynomial.legendre.leggauss(n)[0] for h, n in zip(self.box.half_edges, self.counts, strict=True)
        ]

    @cached_property
    def points(self) -> Array:
        """(n, 3) m along the body's axes, from its centre."""
        return np.array(list(product(*self.nodes)))

    @cached_property
    def charges(self) -> tuple[Array, Array]:
        """Places (k, 3) m in the rotor's frame of charges that stand for the remanence, and these (k,)."""
        return face_charges(self.box, self.axis, CHARGES)

    @cached_property
    def few_charges(self) -> tuple[Array, Array]:
        """The same, fewer."""
        return face_charges(self.box, self.axis, FEW_CHARGES)

    def inner(self, number: int) -> Array:
        """(number³, 3) m in the rotor's frame: Gauss's points for what the magnet is as a whole."""
        nodes = np.polynomial.legendre.leggauss(number)[0]
        return self.box.center + np.array(list(product(nodes, repeat=3))) * self.box.half_edges @ self.box.rotation.T

    def energy(self, position: Sequence[Any], moment: Sequence[Any], share: Any) -> hy.expression:
        """Energy at a position (3 expressions, m) of a moment (A m² times `share`); in J times share²."""
        place = _along(self.box, [x - float(c) for x, c in zip(position, self.box.center, strict=True)])
        pointing, parts = _along(self.box, moment), []
        for point, row in zip(self.points, self.numbers, strict=True):
            d = [x - float(t) for x, t in zip(place, point, strict=True)]
            answer, degrees, returned = row[:3], row[3:9], row[9:]
            weights = [*answer, *(share * share * v for v in degrees), *(share * s for s in returned)]
            parts.append(point_energy(d, pointing, weights, self.axis.tolist(), self.radius))
        return hy.sum(parts)

    @cached_property
    def numbers(self) -> Array:
        """(n, 13) of each point: λ (3), v and w of three powers, s and t of two."""
        return np.concatenate([self.strengths, *(w.reshape(len(w), -1) for w in (self.degrees, self.returned))], axis=1)


def point_energy(
    d: Sequence[Any], moment: Sequence[Any], numbers: Sequence[Any], axis: Sequence[Any], r: Any
) -> hy.expression:
    """Energy of one point, from d (m), the moment, its `numbers`, ĵ and R, in the body's axes."""
    v4, w4, v5, w5, v6, w6, s5, t5, s6, t6 = numbers[3:]
    inverse = 1.0 / hy.sum([x * x for x in d])
    along = hy.sum([m * x for m, x in zip(moment, d, strict=True)])
    field = [3.0 * inverse * along * x - m for x, m in zip(d, moment, strict=True)]  # times 4π d³/μ0
    square = hy.sum([s * (b * b) for s, b in zip(numbers[:3], field, strict=True)])
    answer = (0.5 * UNIT**2) * (inverse * inverse * inverse * square)
    ratio, axial = r * r * inverse, hy.sum([j * x for j, x in zip(axis, d, strict=True)])
    pointing = hy.sum([j * m for j, m in zip(axis, moment, strict=True)])
    flat = v4 + ratio * (v5 + s5 * pointing + ratio * (v6 + s6 * pointing))
    steep = w4 * axial + ratio * (w5 * axial + t5 * along + ratio * (w6 * axial + t6 * along))
    return -answer - ratio * ratio * ratio * ratio * (flat + inverse * axial * steep)


def face_charges(box: Box, axis: Array, number: int) -> tuple[Array, Array]:
    """Places (k, 3) m of charges on a box's faces that stand for a remanence along `axis` in the body, and these (k,).

    At Gauss's points, `number` along an edge, in units of the charge of a face that the remanence leaves upright.
    """
    nodes, weights = np.polynomial.legendre.leggauss(number)
    along, places, amounts = list(zip(nodes, weights / 2, strict=True)), [np.zeros((0, 3))], []
    for k in np.flatnonzero(np.abs(axis) > 1e-9):
        for side, (u, first), (v, second) in product((-1.0, 1.0), along, along):
            places.append(np.roll([[side, u, v]], k, axis=1) * box.half_edges)
            amounts.append(side * axis[k] * first * second)
    return box.center + np.concatenate(places) @ box.rotation.T, np.array(amounts)


def _along(box: Box, vector: Sequence[Any]) -> list[Any]:
    """Components along the body's axes of a vector in the rotor's frame."""
    exact = np.where(np.abs(box.rotation.T) < 1e-15, 0.0, box.rotation.T)
    return [hy.sum([float(r) * v for r, v in zip(row, vector, strict=True) if r]) for row in exact]


DIGITS = 7.2
"""-ln of the error of Gauss's rule, about: with the weights fitted, force and torque are met to 1e-3."""


def answer_box(body: Solid) -> Box:
    """The box in which a body's points lie: itself, or for round ones a box that hardly leaves it."""
    if isinstance(body, Box):
        return body
    share = np.full(3, IN_SPHERE) if isinstance(body, Sphere) else np.array([IN_CIRCLE, IN_CIRCLE, 1.0])
    return Box(body.size * share, body.center, body.rotation)


def point_counts(box: Box, clearance: float, digits: float = DIGITS) -> tuple[int, int, int]:
    """Gauss points along each edge for fields with sources no nearer than a clearance (m) to the faces.

    Gauss's error falls as ρ^-2n, ρ the sum of the half axes of the ellipse about the edge that reaches the source.
    """
    z = 1 + clearance / box.half_edges
    nx, ny, nz = (int(n) for n in np.ceil(digits / np.log(z + np.sqrt(z * z - 1))))
    return nx, ny, nz


def orbits(grid_points: Array, mirrored: bool) -> NDArray[np.intp]:
    """Numbers (n,) of the classes of points (n, 3) that mirrors at the body's planes, or else its centre, exchange."""
    key = np.round(grid_points * 1e9).astype(int)
    if mirrored:
        key = np.abs(key)
    else:
        first = np.array([next((v for v in row if v), 0) for row in key])
        key = key * np.where(first < 0, -1, 1)[:, None]
    return np.asarray(np.unique(key, axis=0, return_inverse=True)[1]).ravel()
