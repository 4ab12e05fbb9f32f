"""The sphere's answer of degree 2 and more, and the rotor's answer to that, fitted with the points of `AnswerGrid`s."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, permutations

import heyoka as hy
import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import Array
from ...geometry.magnets import Magnet
from .grid import (
    POWERS,
    RETURNED,
    AnswerGrid,
    Pairs,
    answer_to_charge,
    coupled_derivatives,
    grid_derivatives,
    mixed_derivatives,
    mixed_energy,
    orbits,
    pair_derivatives,
    pairs_mixed,
    pairs_of_charges,
    point_field,
)
from .samples import ReturnedSamples, SphereSamples

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


@dataclass(frozen=True, eq=False)
class MutualTable:
    """The answers of a rotor and a floater to each other.

    Parameters
    ----------
    magnets : of the rotor
    grids : of those magnets that answer or are magnetised
    coupling : (3k, 3k) A m²/T: energies of the fields at the grids' inner points, -½ bᵀ coupling b
    pairs : (n, n) J: energies of the sphere by what two magnets' fields, as those of charges, do in it together
    mixed : (n, n) T: fields by which the second magnet answers to the sphere's answer to the first
    images : (3,) weights of the images that tell its answer to charges
    polarizability : α, A m²/T
    gaps, errors : (k,) m between the bodies, and (k, 2) the largest relative errors of force and torque found there
    provenance : how the table was made; texts and numbers
    """

    magnets: tuple[Magnet, ...]
    grids: tuple[AnswerGrid, ...]
    coupling: Array = field(metadata={"units": "A m2/T"})
    pairs: Array = field(metadata={"units": "J"})
    mixed: Array = field(metadata={"units": "T"})
    images: Array
    polarizability: float = field(metadata={"units": "A m2/T"})
    gaps: Array = field(default_factory=lambda: np.array([1.0]), metadata={"units": "m"})
    errors: Array = field(default_factory=lambda: np.zeros((1, 2)))
    provenance: dict[str, str | float] = field(default_factory=dict)

    def energy(
        self,
        position: Sequence[hy.expression],
        moment: Sequence[hy.expression],
        flux: Sequence[hy.expression],
        share: hy.expression | float = 1.0,
    ) -> hy.expression:
        """U, J times share², at a position (3 expressions, m) of a rigid moment (A m²) in a field B0 (T), times share.

        `share` lets the energy come in units of its own: it is one over their root.
        """
        whole = [m + self.polarizability * b for m, b in zip(moment, flux, strict=True)]
        parts = [-0.5 * self.polarizability * hy.sum([b * b for b in flux])]
        parts += [grid.energy(position, whole, share) for grid in self.grids]
        return hy.sum([*parts, self.coupled(position, whole, share)])

    def coupled(
        self, position: Sequence[hy.expression], whole: Sequence[hy.expression], share: hy.expression | float = 1.0
    ) -> hy.expression:
        """The part of the energy of the moment M that magnets have by what they are as a whole, as `energy`."""
        mixed = share * self._mixed(position, whole)
        return self._between(position, whole) + mixed + share * share * self._together(position)

    def _between(self, position: Sequence[hy.expression], whole: Sequence[hy.expression]) -> hy.expression:
        """-½ bᵀ coupling b."""
        if not self.coupling.any():
            return hy.expression(0.0)
        ways = [[x - float(c) for x, c in zip(position, point, strict=True)] for p in self._inner for point in p]
        fields = [b for way in ways for b in point_field(way, whole)]
        entries = zip(*np.triu_indices(len(fields)), strict=True)
        return hy.sum(
            [float(-0.5 * (1 if a == b else 2) * self.coupling[a, b]) * (fields[a] * fields[b]) for a, b in entries]
        )

    def _mixed(self, position: Sequence[hy.expression], whole: Sequence[hy.expression]) -> hy.expression:
        """What magnets answer to the sphere's answer to others."""
        parts, images = [hy.expression(0.0)], self.images.tolist()
        for a, b in permutations(range(len(self.grids)), 2):
            if self.mixed[a, b]:
                (places, amounts), radius, points = self.grids[a].few_charges, self.grids[a].radius, self._inner[b]
                ways = [
                    [[(x - float(c)) / radius for x, c in zip(position, q, strict=True)] for q in p]
                    for p in (places, points)
                ]
                parts += [
                    float(-self.mixed[a, b] / len(points) * amount) * mixed_energy(here, there, whole, images)
                    for here, amount in zip(ways[0], amounts, strict=True)
                    for there in ways[1]
                ]
        return hy.sum(parts)

    def _together(self, position: Sequence[hy.expression]) -> hy.expression:
        """What each two magnets' charges do in the sphere."""
        parts, images = [hy.expression(0.0)], self.images.tolist()
        scaled = [
            [[(x - float(c)) / grid.radius for x, c in zip(position, place, strict=True)] for place in grid.charges[0]]
            for grid in self.grids
        ]
        for a, b in self._related:
            amounts = -self.pairs[a, b] * np.outer(self.grids[a].charges[1], self.grids[b].charges[1])
            parts += [
                float(amounts[k, l]) * answer_to_charge(scaled[a][k], scaled[b][l], images)
                for k, l in np.ndindex(*amounts.shape)
            ]
        return hy.sum(parts)

    def derivatives(self, places: Array, moments: Array) -> tuple[Array, Array, Array]:
        """Energy (n,) J of moments M without -½ α B0², gradient (n, 6) and second derivatives (n, 6, 6).

        By place (n, 3) m and moment (n, 3) A m², in this order.
        """
        energy, slope, second = np.zeros(len(places)), np.zeros((len(places), 6)), np.zeros((len(places), 6, 6))
        parts = [grid_derivatives(grid, places, moments) for grid in self.grids]
        if self.coupling.any():
            parts.append(coupled_derivatives(np.concatenate(self._inner), self.coupling, places, moments))
        for weight, given in self._answering:
            energies = mixed_derivatives(given, places, moments)
            parts.append((weight * energies[0], weight * energies[1], weight * energies[2]))
        for part in parts:
            energy, slope, second = energy + part[0], slope + part[1], second + part[2]
        for weight, given in self._charged:
            value, along, bend = pair_derivatives(given, places)
            energy = energy + weight * value
            slope[:, :3] += weight * along
            second[:, :3, :3] += weight * bend
        return energy, slope, second

    @cached_property
    def _answering(self) -> list[tuple[float, Pairs]]:
        """Magnets that answer to the sphere's answer to others."""
        each = permutations(range(len(self.grids)), 2)
        return [
            (-float(self.mixed[a, b]), pairs_mixed(self.grids[a], self._inner[b], self.images))
            for a, b in each
            if self.mixed[a, b]
        ]

    @cached_property
    def _charged(self) -> list[tuple[float, Pairs]]:
        """Two magnets each that are charged."""
        return [
            (-float(self.pairs[a, b]), pairs_of_charges(self.grids[a], self.grids[b], self.images))
            for a, b in self._related
        ]

    @cached_property
    def _inner(self) -> list[Array]:
        """The points of each magnet at which they answer to each other."""
        number = round((len(self.coupling) / (3 * max(len(self.grids), 1))) ** (1 / 3))
        return [grid.inner(number) for grid in self.grids]

    @property
    def _related(self) -> list[tuple[int, int]]:
        """Two magnets each."""
        return [(a, b) for a, b in combinations(range(len(self.grids)), 2) if self.pairs[a, b]]

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (n,) of what the answers add to force and torque, at points (n, 3) m."""
        places = np.asarray(points, float).reshape(-1, 3)
        radius = self.grids[0].radius
        gap = np.min([magnet.body.distance(places) for magnet in self.magnets], axis=0) - radius
        at = np.log(np.maximum(gap, self.gaps[0]))
        force, torque = (np.exp(np.interp(at, np.log(self.gaps), np.log(e))) for e in self.errors.T + 1e-12)
        return force, torque

    def __repr__(self) -> str:
        points = sum(len(grid.points) for grid in self.grids)
        told = ", ".join(
            f"{e:.1e} at {g * 1e3:.2g} mm" for g, e in zip(self.gaps, self.errors.max(axis=1), strict=True)
        )
        return f"MutualTable: {points} points in {len(self.grids)} magnets; relative error {told} from contact"
