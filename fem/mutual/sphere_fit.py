"""The sphere's answer of degree 2 and more, and the rotor's answer to that, fitted with the points of `AnswerGrid`s."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np
import scipy
from numpy.typing import NDArray

from ...geometry.basics import Array
from .answer_grid import POWERS, RETURNED, AnswerGrid, orbits
from .answer_samples import ReturnedSamples, SphereSamples
from .point_kernel import mixed_derivatives, pair_derivatives, pairs_mixed, pairs_of_charges

SMALL = 1e-9
"""Relative size of a singular value that is none."""
MANY = 4
"""From so many magnets on, points of a class have one weight and magnets answer to each other by their centres."""
HELD, FREE = 1e-3, 1e-6
"""What a weight costs that is held, and one that is not, by an error of the size of all that is told."""
PARALLEL = 1e-9


def classes(grid: AnswerGrid, mirrored: bool) -> Array:
    """(n, classes): which points belong to a class."""
    number = orbits(grid.points, mirrored)
    return np.asarray(np.eye(number.max() + 1)[number])


def least_squares(columns: Array, values: Array, held: Array, cost: float = HELD) -> Array:
    """Weights of columns of any sizes; those `held` are kept small: by themselves they are hardly determined."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    scaled = columns / size
    if not held.any():
        return np.asarray(np.linalg.lstsq(scaled, values, rcond=SMALL)[0] / size)
    square = scaled.T @ scaled
    square[np.diag_indices_from(square)] += np.where(held, cost, FREE) ** 2
    return np.asarray(scipy.linalg.solve(square, scaled.T @ values, assume_a="pos") / size)


def sphere_fit(grids: Sequence[AnswerGrid], images: Array, samples: SphereSamples) -> tuple[list[AnswerGrid], Array]:
    """Weights of the points' powers, and of pairs of magnets, that give energy and force of the sphere's answer."""
    found, kinds = [_powers(grid, samples.places) for grid in grids], _kinds(grids)
    sums = [_classed(kind, value, slope) for kind, (value, slope) in zip(kinds, found, strict=True)]
    pairs = list(combinations(range(len(grids)), 2))
    for a, b in pairs:
        value, slope, _ = pair_derivatives(pairs_of_charges(grids[a], grids[b], images), samples.places)
        sums.append((value[:, None], slope[:, :, None]))
    value, slope = (np.concatenate(parts, axis=-1) for parts in zip(*sums, strict=True))
    rows = [value / samples.energy_size[:, None], *np.moveaxis(slope / samples.force_size[:, None, None], 1, 0)]
    right = [-samples.energy / samples.energy_size, *(samples.force / samples.force_size[:, None]).T]
    held = np.concatenate([_held(grids, kinds, len(POWERS)), np.zeros(len(pairs), bool)])
    weights = list(least_squares(np.concatenate(rows), np.concatenate(right), held))
    made = [replace(g, degrees=_spread(kind, weights, len(POWERS))) for g, kind in zip(grids, kinds, strict=True)]
    coupled = np.zeros((len(grids), len(grids)))
    for (a, b), weight in zip(pairs, weights, strict=True):
        coupled[a, b] = coupled[b, a] = weight
    return made, coupled


def returned_fit(
    grids: Sequence[AnswerGrid], inner: Sequence[Array], images: Array, samples: ReturnedSamples
) -> tuple[list[AnswerGrid], Array]:
    """Weights of the points' powers, and of pairs, that give V, the rotor's answer to the sphere's, and its slopes."""
    kinds, pairs = _kinds(grids), list(permutations(range(len(grids)), 2))
    sums = [_classed(kind, *_vectors(grid, samples.places)) for kind, grid in zip(kinds, grids, strict=True)]
    for a, b in pairs:
        nothing = np.zeros_like(samples.places)
        _, flat, steep = mixed_derivatives(pairs_mixed(grids[a], inner[b], images), samples.places, nothing)
        sums.append((flat[:, 3:, None], steep[:, 3:, :3, None]))
    value, slope = (np.concatenate(parts, axis=-1) for parts in zip(*sums, strict=True))
    sizes = np.linalg.norm(samples.field, axis=1), np.linalg.norm(samples.slope, axis=(1, 2))
    value, slope = value / sizes[0][:, None, None], slope / sizes[1][:, None, None, None]
    right = [(samples.field / sizes[0][:, None]).ravel(), (samples.slope / sizes[1][:, None, None]).ravel()]
    rows = [part.reshape(-1, part.shape[-1]) for part in (value, slope)]
    held = np.concatenate([_held(grids, kinds, len(RETURNED)), np.zeros(len(pairs), bool)])
    weights = list(least_squares(np.concatenate(rows), np.concatenate(right), held, 10 * HELD))
    made = [replace(g, returned=_spread(kind, weights, len(RETURNED))) for g, kind in zip(grids, kinds, strict=True)]
    mixed = np.zeros((len(grids), len(grids)))
    for (a, b), weight in zip(pairs, weights, strict=True):
        mixed[a, b] = weight
    return made, mixed


def _kinds(grids: Sequence[AnswerGrid]) -> list[Array]:
    """(n, kinds) of each grid's points, beside other magnets each point too; none where there is no remanence."""
    found = []
    for grid in grids:
        kinds = classes(grid, mirrored=bool(np.sum(np.abs(grid.axis) > PARALLEL) == 1))
        if _single(grids):
            kinds = np.concatenate([kinds, np.eye(len(kinds))], axis=1)
        found.append(kinds if grid.axis.any() else kinds[:, :0])
    return found


def _single(grids: Sequence[AnswerGrid]) -> bool:
    """Whether points are fitted one by one."""
    return 1 < len(grids) < MANY


def _held(grids: Sequence[AnswerGrid], kinds: Sequence[Array], powers: int) -> NDArray[np.bool_]:
    """Which weights belong to a point by itself."""
    first = [kind.shape[1] - (len(kind) if _single(grids) else 0) for kind in kinds]
    each = [np.arange(kind.shape[1]) >= n for kind, n in zip(kinds, first, strict=True)]
    return np.concatenate([np.tile(part, 2 * powers) for part in each])


def _classed(kinds: Array, value: Array, slope: Array) -> tuple[Array, Array]:
    """What each power (..., powers, n) of the points sums to for each of their kinds: (..., powers · kinds)."""
    value, slope = value @ kinds, slope @ kinds
    return value.reshape(*value.shape[:-2], -1), slope.reshape(*slope.shape[:-2], -1)


def _spread(kinds: Array, weights: list[float], powers: int) -> Array:
    """(n, powers, 2) of the points, from the next of the weights, which are taken off the list."""
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
