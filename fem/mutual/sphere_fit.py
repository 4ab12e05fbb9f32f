"""The sphere's answer of degree 2 and more, and the rotor's answer to that, fitted with the points of `AnswerGrid`s."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ...geometry.basics import Array
from .answer_grid import POWERS, RETURNED, AnswerGrid, orbits
from .answer_samples import ReturnedSamples, SphereSamples
from .table import FULL

SMALL = 1e-9
"""Relative size of a singular value that is none."""
PARALLEL = 1e-9


def classes(grid: AnswerGrid, mirrored: bool) -> Array:
    """(n, classes): which points belong to a class."""
    number = orbits(grid.points, mirrored)
    return np.asarray(np.eye(number.max() + 1)[number])


def least_squares(columns: Array, values: Array) -> Array:
    """Weights of columns of any sizes."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    return np.asarray(np.linalg.lstsq(columns / size, values, rcond=SMALL)[0] / size)


def sphere_fit(grids: Sequence[AnswerGrid], samples: SphereSamples) -> tuple[list[AnswerGrid], Array]:
    """Weights of the points' powers, and of pairs of magnets, that give energy and force of the sphere's answer."""
    found = [_powers(grid, samples.places) for grid in grids]
    sums = [_classed(grid, value, slope) for grid, (value, slope) in zip(grids, found, strict=True)]
    pairs = list(combinations(range(len(grids)), 2))
    if pairs:
        step = 1e-4 * grids[0].radius
        moves = (0 * np.eye(3)[0], *(step * np.eye(3)), *(-step * np.eye(3)))
        at = [_pair_products(grids, samples.places + move) for move in moves]
        sums.append((at[0], np.stack([(at[1 + a] - at[4 + a]) / (2 * step) for a in range(3)], axis=1)))
    value, slope = (np.concatenate(parts, axis=-1) for parts in zip(*sums, strict=True))
    rows = [value / samples.energy_size[:, None], *np.moveaxis(slope / samples.force_size[:, None, None], 1, 0)]
    right = [-samples.energy / samples.energy_size, *(samples.force / samples.force_size[:, None]).T]
    weights = list(least_squares(np.concatenate(rows), np.concatenate(right)))
    made = [replace(grid, degrees=_spread(grid, weights, len(POWERS))) for grid in grids]
    coupled = np.zeros((len(grids), len(grids)))
    for (a, b), weight in zip(pairs, weights, strict=True):
        coupled[a, b] = coupled[b, a] = weight
    return made, coupled


def returned_fit(grids: Sequence[AnswerGrid], samples: ReturnedSamples) -> list[AnswerGrid]:
    """Weights of the points' powers that give the rotor's answer V to the sphere's answer, and its derivatives."""
    sums = [_classed(grid, *_vectors(grid, samples.places)) for grid in grids]
    value, slope = (np.concatenate(parts, axis=-1) for parts in zip(*sums, strict=True))
    sizes = np.linalg.norm(samples.field, axis=1), np.linalg.norm(samples.slope, axis=(1, 2))
    value, slope = value / sizes[0][:, None, None], slope / sizes[1][:, None, None, None]
    right = [(samples.field / sizes[0][:, None]).ravel(), (samples.slope / sizes[1][:, None, None]).ravel()]
    rows = [part.reshape(-1, part.shape[-1]) for part in (value, slope)]
    weights = list(least_squares(np.concatenate(rows), np.concatenate(right)))
    return [replace(grid, returned=_spread(grid, weights, len(RETURNED))) for grid in grids]


def _kinds(grid: AnswerGrid) -> Array:
    """(n, classes) of the points; none where there is no remanence."""
    if not grid.axis.any():
        return np.zeros((len(grid.points), 0))
    return classes(grid, mirrored=bool(np.sum(np.abs(grid.axis) > PARALLEL) == 1))


def _classed(grid: AnswerGrid, value: Array, slope: Array) -> tuple[Array, Array]:
    """What each power (..., powers, n) of the points sums to for each of their classes: (..., powers · classes)."""
    kinds = _kinds(grid)
    value, slope = value @ kinds, slope @ kinds
    return value.reshape(*value.shape[:-2], -1), slope.reshape(*slope.shape[:-2], -1)


def _spread(grid: AnswerGrid, weights: list[float], powers: int) -> Array:
    """(n, powers, 2) of the points, from the next of the weights, which are taken off the list."""
    kinds = _kinds(grid)
    parts = [kinds @ np.array([weights.pop(0) for _ in range(kinds.shape[1])]) for _ in range(2 * powers)]
    return np.stack(parts, axis=1).reshape(-1, powers, 2)


def _powers(grid: AnswerGrid, places: Array) -> tuple[Array, Array]:
    """Of every point (n): 1 and (ĵ·d)²/d² times (R/d)^2p at places (m): (m, 6, n), and their gradients (m, 3, 6, n)."""
    d = grid.box.to_body(places)[:, None] - grid.points
    inverse = 1 / np.sum(d**2, axis=2)
    along = d @ grid.axis
    values, slopes = [], []
    for p in POWERS:
        power = grid.radius ** (2 * p) * inverse**p
        values += [power, power * along**2 * inverse]
        flat = (-2 * p * power * inverse)[..., None] * d
        steep = (-2 * (p + 1) * power * along**2 * inverse**2)[..., None] * d
        slopes += [flat, steep + (2 * power * along * inverse)[..., None] * grid.axis]
    turned = np.stack(slopes, axis=1) @ grid.box.rotation.T
    return np.stack(values, axis=1), np.moveaxis(turned, 3, 1)


def _vectors(grid: AnswerGrid, places: Array) -> tuple[Array, Array]:
    """Of every point (n): ĵ and (ĵ·d) d/d² times (R/d)^2q: (m, 3, 4, n), and their derivatives (m, 3, 3, 4, n)."""
    d = grid.box.to_body(places)[:, None] - grid.points
    inverse = (1 / np.sum(d**2, axis=2))[..., None]
    along, axis = (d @ grid.axis)[..., None], grid.axis
    values, slopes = [], []
    for q in RETURNED:
        power = grid.radius ** (2 * q) * inverse**q
        share = power * along * inverse
        flat = -2 * q * power * inverse * d
        steep = -2 * (q + 1) * share * inverse * d + power * inverse * axis
        values += [power * axis, share * d]
        slopes += [
            axis[:, None] * flat[..., None, :],
            d[..., None] * steep[..., None, :] + share[..., None] * np.eye(3),
        ]
    turn = grid.box.rotation
    value, slope = np.stack(values, axis=1) @ turn.T, turn @ np.stack(slopes, axis=1) @ turn.T
    return np.moveaxis(value, 3, 1), np.moveaxis(slope, (3, 4), (1, 2))


def _pair_products(grids: Sequence[AnswerGrid], places: Array) -> Array:
    """Products (m, pairs) of the gradients of two magnets' central dipoles, as `dipole_slope`'s."""
    slopes = []
    for grid in grids:
        d, j = places - grid.box.center, grid.box.rotation @ grid.axis
        square = np.sum(d**2, axis=1)
        along = d @ j
        entries = []
        for a, b in (*((a, a) for a in range(3)), (0, 1), (0, 2), (1, 2)):
            entries.append(j[a] * d[:, b] + j[b] * d[:, a] + (a == b) * along - 5 * along * d[:, a] * d[:, b] / square)
        slopes.append(np.array(entries) / square**2.5)
    return np.array(
        [np.einsum("e,em,em->m", FULL, slopes[a], slopes[b]) for a, b in combinations(range(len(grids)), 2)]
    ).T
