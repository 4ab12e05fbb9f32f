"""What a point of an `AnswerGrid`, or a pair of charges, contributes, compiled once for all of them and all rotors.

A sum over the points of a magnet at many places is then one call on their product, and the first and second derivatives
come with it: for a cube, in a few microseconds a place.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import heyoka as hy
import numpy as np

from ...geometry.basics import Array
from ..storage import compiled
from .answer_grid import UNIT, AnswerGrid, point_energy
from .permeable_sphere import IMAGES, answer_to_charge, field_of_answer

ENTRIES = [(a, b) for a in range(6) for b in range(a, 6)]
"""Of a symmetric matrix over place and moment: those that are computed."""
WHERE = np.array([[ENTRIES.index((min(a, b), max(a, b))) for b in range(6)] for a in range(6)])
"""Which of them each entry is."""

NUMBERS = 13
"""Of a point."""
IDENTITY = np.eye(3)


@cache
def _kernel() -> Any:
    place, moment = hy.make_vars("x", "y", "z"), hy.make_vars("m_x", "m_y", "m_z")
    numbers = [hy.expression(f"n_{k}") for k in range(NUMBERS)]
    energy = point_energy(place, moment, numbers, [hy.par[0], hy.par[1], hy.par[2]], hy.par[3])
    free = [*place, *moment]
    gradient = list(hy.diff_tensors([energy], diff_args=free, diff_order=1).gradient)
    hessian = np.asarray(hy.diff_tensors(gradient, diff_args=free, diff_order=1).jacobian)
    outputs = [energy, *gradient, *(hessian[a, b] for a, b in ENTRIES)]
    return compiled(hy.cfunc, outputs, [*free, *numbers], fast_math=True)


CHUNK = 48
"""Places at once, so that all numbers stay in the processor's cache."""


def grid_derivatives(grid: AnswerGrid, places: Array, moments: Array) -> tuple[Array, Array, Array]:
    """Energy (n,) J, gradient (n, 6) and second derivatives (n, 6, 6) by place (m) and moment (A m²) at (n, 3) each."""
    rotation = grid.box.rotation
    seen, pointing = grid.box.to_body(places), moments @ rotation
    if len(places) <= CHUNK:
        found = _summed(grid, seen, pointing)
    else:
        sums = [_summed(grid, seen[k : k + CHUNK], pointing[k : k + CHUNK]) for k in range(0, len(places), CHUNK)]
        found = np.concatenate(sums, axis=1)
    slope, second = found[1:7].T, found[7:].T[:, WHERE]
    if np.array_equal(rotation, IDENTITY):
        return found[0], slope, second
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = rotation
    return found[0], slope @ turn.T, turn @ second @ turn.T


def _summed(grid: AnswerGrid, places: Array, moments: Array) -> Array:
    """The kernel's outputs (28, n), summed over the points."""
    count, points = len(places), len(grid.points)
    given = np.empty((6 + NUMBERS, count, points))
    np.subtract(places.T[:, :, None], grid.points.T[:, None], out=given[:3])
    given[3:6] = moments.T[:, :, None]
    given[6:] = grid.numbers.T[:, None]
    pars = np.empty((4, count * points))
    pars[:3], pars[3] = grid.axis[:, None], grid.radius
    found = _kernel()(given.reshape(len(given), -1), pars=pars)
    return np.asarray(found.reshape(len(found), count, points).sum(axis=2))


@cache
def _pair_kernel() -> Any:
    place, way, product = hy.make_vars("x", "y", "z"), hy.make_vars("w_x", "w_y", "w_z"), hy.make_vars("product")
    other = [x + w for x, w in zip(place, way, strict=True)]
    energy = product * answer_to_charge(place, other, [hy.par[k] for k in range(len(IMAGES))])
    gradient = list(hy.diff_tensors([energy], diff_args=place, diff_order=1).gradient)
    hessian = np.asarray(hy.diff_tensors(gradient, diff_args=place, diff_order=1).jacobian)
    outputs = [energy, *gradient, *(hessian[a, b] for a, b in PLACES)]
    return compiled(hy.cfunc, outputs, [*place, *way, product], fast_math=True)


PLACES = [(a, b) for a in range(3) for b in range(a, 3)]
BESIDE = np.array([[PLACES.index((min(a, b), max(a, b))) for b in range(3)] for a in range(3)])
FEW = 8
"""Places at once for pairs of charges."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of points with weights.

    Parameters
    ----------
    begins, ways : (n, 3) the first points by the radius, and from the second ones to these
    products : (n,) of the weights
    images : (3,) weights of the sphere's images
    radius : of the sphere, m
    """

    begins: Array
    ways: Array
    products: Array
    images: Array
    radius: float

    def summed(self, kernel: Any, outputs: int, places: Array, moments: Array | None = None) -> Array:
        """A kernel's outputs (k, m) at places (m, 3) m, summed over the pairs."""
        count, found, variables = len(self.begins), np.zeros((outputs, len(places))), 7 if moments is None else 10
        for start in range(0, len(places) if count else 0, FEW):
            block = places[start : start + FEW] / self.radius
            given = np.empty((variables, len(block), count))
            np.subtract(block.T[:, :, None], self.begins.T[:, None], out=given[:3])
            given[3:6], given[6] = self.ways.T[:, None], self.products
            if moments is not None:
                given[7:] = moments[start : start + FEW].T[:, :, None]
            pars = np.repeat(self.images[:, None], len(block) * count, axis=1)
            sums = kernel(given.reshape(variables, -1), pars=pars)
            found[:, start : start + FEW] = sums.reshape(outputs, len(block), count).sum(axis=2)
        return found


def paired(first: tuple[Array, Array], second: tuple[Array, Array], images: Array, radius: float) -> Pairs:
    """All pairs of points (k, 3) m with weights (k,)."""
    (here, q), (there, p) = first, second
    begins = np.repeat(here, len(there), axis=0) / radius
    ways = (here[:, None] - there).reshape(-1, 3) / radius
    return Pairs(begins, ways, np.outer(q, p).ravel(), images, radius)


def pairs_of_charges(first: AnswerGrid, second: AnswerGrid, images: Array) -> Pairs:
    """Two magnets' charges, as `pair_derivatives` needs them."""
    return paired(first.charges, second.charges, images, first.radius)


def pairs_mixed(source: AnswerGrid, answering: Array, images: Array) -> Pairs:
    """A magnet's few charges and points (k, 3) m of another, as `mixed_derivatives` needs them."""
    return paired(source.few_charges, (answering, np.full(len(answering), 1 / len(answering))), images, source.radius)


def pair_derivatives(pairs: Pairs, places: Array) -> tuple[Array, Array, Array]:
    """Σ q q' Σ_l (t_l/t) P_l (ab)^-(l+1) (n,) of two magnets' charges at places (n, 3) m of the floater.

    With its gradient (n, 3) and second derivatives (n, 3, 3) by the place, m.
    """
    found = pairs.summed(_pair_kernel(), 10, places)
    return found[0], found[1:4].T / pairs.radius, found[4:].T[:, BESIDE] / pairs.radius**2


@cache
def _mixed_kernel() -> Any:
    place, way, product = hy.make_vars("x", "y", "z"), hy.make_vars("w_x", "w_y", "w_z"), hy.make_vars("product")
    moment = hy.make_vars("m_x", "m_y", "m_z")
    other = [x + w for x, w in zip(place, way, strict=True)]
    energy = product * mixed_energy(place, other, moment, [hy.par[k] for k in range(len(IMAGES))])
    free = [*place, *moment]
    gradient = list(hy.diff_tensors([energy], diff_args=free, diff_order=1).gradient)
    hessian = np.asarray(hy.diff_tensors(gradient, diff_args=free, diff_order=1).jacobian)
    outputs = [energy, *gradient, *(hessian[a, b] for a, b in ENTRIES)]
    return compiled(hy.cfunc, outputs, [*place, *way, product, *moment], fast_math=True)


def mixed_energy(a: Sequence[Any], b: Sequence[Any], moment: Sequence[Any], images: Sequence[Any]) -> hy.expression:
    """Moment times the field of a point at b that the sphere's answer to a charge at a magnetises; lengths in radii."""
    field, inverse = field_of_answer(a, b, images), 1.0 / hy.sum([x * x for x in b])
    along, pointing, both = (
        hy.sum([x * y for x, y in zip(u, v, strict=True)]) for u, v in ((b, field), (b, moment), (moment, field))
    )
    return inverse * hy.sqrt(inverse) * (3.0 * inverse * along * pointing - both)


def mixed_derivatives(pairs: Pairs, places: Array, moments: Array) -> tuple[Array, Array, Array]:
    """What points answer to the sphere's answer to another magnet's charges, as `grid_derivatives`; in no units."""
    found = pairs.summed(_mixed_kernel(), 7 + len(ENTRIES), places, moments)
    units = np.repeat([1 / pairs.radius, 1.0], 3)
    return found[0], found[1:7].T * units, found[7:].T[:, WHERE] * units[:, None] * units


@cache
def _field_kernel() -> Any:
    place, moment = hy.make_vars("x", "y", "z"), hy.make_vars("m_x", "m_y", "m_z")
    free, field = [*place, *moment], point_field(place, moment)
    first = np.asarray(hy.diff_tensors(field, diff_args=free, diff_order=1).jacobian)
    second = [
        np.asarray(hy.diff_tensors(list(row), diff_args=free, diff_order=1).jacobian)[a, b]
        for row in first
        for a, b in ENTRIES
    ]
    return compiled(hy.cfunc, [*field, *first.ravel(), *second], free, fast_math=True)


def point_field(d: Sequence[Any], moment: Sequence[Any]) -> list[hy.expression]:
    """Field (3) T of a moment (A m²) at a way d (3 expressions, m) from it or to it."""
    inverse = 1.0 / hy.sum([t * t for t in d])
    cube = UNIT * (inverse * hy.sqrt(inverse))
    along = 3.0 * inverse * hy.sum([m * t for m, t in zip(moment, d, strict=True)])
    return [cube * (along * t - m) for t, m in zip(d, moment, strict=True)]


def coupled_derivatives(points: Array, coupling: Array, places: Array, moments: Array) -> tuple[Array, Array, Array]:
    """-½ bᵀ coupling b of the fields b at points (k, 3) m of moments at places (n, 3), as `grid_derivatives`."""
    count, number = len(places), len(points)
    given = np.empty((6, count, number))
    np.subtract(places.T[:, :, None], points.T[:, None], out=given[:3])
    given[3:] = moments.T[:, :, None]
    found = _field_kernel()(given.reshape(6, -1)).reshape(84, count, number)
    field = found[:3].transpose(1, 2, 0).reshape(count, 3 * number)
    slope = found[3:21].reshape(3, 6, count, number).transpose(2, 3, 0, 1).reshape(count, 3 * number, 6)
    answer = -field @ coupling
    each = np.moveaxis(answer.reshape(count, number, 3), 2, 0)[:, None] * found[21:].reshape(3, -1, count, number)
    bend = each.sum(axis=(0, 3)).T
    second = bend[:, WHERE] - np.swapaxes(slope, 1, 2) @ (coupling @ slope)
    return np.sum(answer * field, axis=1) / 2, (answer[:, None] @ slope)[:, 0], second
