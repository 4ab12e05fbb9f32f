"""Mutual magnetisation of a rotor and a permeable sphere as one energy, and the fit of its weights to samples."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, permutations

import heyoka as hy
import numpy as np
import scipy
from numpy.typing import ArrayLike

from ...geometry.common import Array
from ...geometry.magnets import Magnet
from .grid import (
    CHARGES,
    FEW_CHARGES,
    OF_RETURN,
    OF_SPHERE,
    AnswerGrid,
    EnergySum,
    charge_sum,
    coupled_sum,
    mixed_energy,
    pair_energy,
)
from .samples import ReturnedSamples, SphereSamples

SMALL = 1e-9  # relative size of a singular value that is none
# From so many magnets on, points of a class have one weight and magnets respond to each other by their centres
MANY = 4
# What a weight costs that is held, and one that is not, by an error of the size of all that is fitted
HELD, FREE = 1e-3, 1e-6
PARALLEL = 1e-9


@dataclass(frozen=True, eq=False)
class MutualTable:
    """What rotor and floater add to each other's magnetisation: U = -½ α B0² + Σ -½ λ b² - u - V·M, M = m + α B0.

    Parameters
    ----------
    magnets : of the rotor
    grids : of those magnets that respond or are magnetised
    coupling : (3k, 3k) A m²/T: energies of the fields at the grids' inner points, -½ bᵀ coupling b
    pairs : (n, n) J: energies of the sphere by what two magnets' fields, as those of charges, do in it together
    mixed : (n, n) T: fields by which the second magnet responds to the sphere's response to the first
    images : (3,) weights of the images that stand for its response to charges
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

    @cached_property
    def _sums(self) -> list[EnergySum]:
        """Whose sum is the energy of the moment M."""
        sums = [grid.energy(grid.numbers) for grid in self.grids]
        number = round((len(self.coupling) / (3 * max(len(self.grids), 1))) ** (1 / 3))
        inner = [grid.inner(number) for grid in self.grids]
        if self.coupling.any():
            sums.append(coupled_sum(np.concatenate(inner), self.coupling))
        for a, b in permutations(range(len(self.grids)), 2):
            if self.mixed[a, b]:
                sums.append(mixed_sum(self.grids[a], inner[b], self.images, self.mixed[a, b]))
            if a < b and self.pairs[a, b]:
                sums.append(pair_sum(self.grids[a], self.grids[b], self.images, self.pairs[a, b]))
        return sums

    def energy(
        self,
        position: Sequence[hy.expression],
        moment: Sequence[hy.expression],
        flux: Sequence[hy.expression],
        share: hy.expression | float = 1.0,
    ) -> hy.expression:
        """The energy U as an expression.

        Parameters
        ----------
        position : of the floater's centre (3 expressions, m), rotor's frame
        moment, flux : rigid moment (A m²) and the rotor's field B0 (T), times `share`
        share : lets the energy come in units of its own, J times share²: it is one over their root
        """
        whole = [m + self.polarizability * b for m, b in zip(moment, flux, strict=True)]
        parts = [-0.5 * self.polarizability * hy.sum([b * b for b in flux])]
        return hy.sum([*parts, *(one.expression(position, whole, share) for one in self._sums)])

    def derivatives(self, places: Array, moments: Array) -> tuple[Array, Array, Array]:
        """Energy (n,) J of moments M without -½ α B0², gradient (n, 6) and second derivatives (n, 6, 6).

        By place (n, 3) m and moment (n, 3) A m², in this order.
        """
        number = len(places)
        total = np.zeros(number), np.zeros((number, 6)), np.zeros((number, 6, 6))
        for one in self._sums:
            for whole, part in zip(total, one.derivatives(places, moments), strict=True):
                whole += part
        return total

    def added(self, places: Array, moments: Array, field: Array, gradient: Array) -> tuple[Array, Array, Array]:
        """What mutual magnetisation adds to energy (n,) J, force (n, 3) N and torque (n, 3) N m.

        Parameters
        ----------
        places, moments : (n, 3) m of the floater's centre, and (n, 3) A m² of its rigid moment, rotor's frame
        field, gradient : B0 (n, 3) T and ∂B0_i/∂x_j (n, 3, 3) T/m of the rotor there
        """
        alpha = self.polarizability
        energy, slope, _ = self.derivatives(places, moments + alpha * field)
        by_place, by_moment = slope[:, :3], slope[:, 3:]
        # M follows the place by B0, so that the force has a part by the moment
        force = -by_place + alpha * np.einsum("ni,nij->nj", field - by_moment, gradient)
        return energy - alpha / 2 * np.sum(field**2, axis=1), force, -np.cross(moments, by_moment)

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (n,) of what is added to force and torque, at points (n, 3) m."""
        places = np.asarray(points, float).reshape(-1, 3)
        gap = np.min([magnet.body.distance(places) for magnet in self.magnets], axis=0) - self.grids[0].radius
        at = np.log(np.maximum(gap, self.gaps[0]))
        force, torque = (np.exp(np.interp(at, np.log(self.gaps), np.log(e))) for e in self.errors.T + 1e-12)
        return force, torque

    def __repr__(self) -> str:
        points = sum(len(grid.points) for grid in self.grids)
        told = ", ".join(
            f"{e:.1e} at {g * 1e3:.2g} mm" for g, e in zip(self.gaps, self.errors.max(axis=1), strict=True)
        )
        return f"MutualTable: {points} points in {len(self.grids)} magnets; relative error {told} from contact"


def pair_sum(first: AnswerGrid, second: AnswerGrid, images: Array, weight: float = 1.0) -> EnergySum:
    """Minus `weight` (J) times the energy of the sphere by what the charges of `first` and `second` do in it together.

    `images` are the weights of `pair_energy`.
    """
    places, amounts = first.charges(CHARGES)
    return charge_sum(pair_energy, (places, weight * amounts), second.charges(CHARGES), first.radius, images)


def mixed_sum(source: AnswerGrid, points: Array, images: Array, weight: float = 1.0) -> EnergySum:
    """Minus `weight` (T) times the energy of the moment by what `points` (k, 3) m respond to the sphere's response.

    That is to the `source`; `images` are the weights of `mixed_energy`.
    """
    places, amounts = source.charges(FEW_CHARGES)
    mean = points, np.full(len(points), 1 / len(points))
    return charge_sum(mixed_energy, (places, weight * amounts), mean, source.radius, images)


def sphere_fit(grids: Sequence[AnswerGrid], images: Array, samples: SphereSamples) -> tuple[list[AnswerGrid], Array]:
    """Weights of the points' powers, and of pairs of magnets, that give energy and force of the sphere's response.

    Parameters
    ----------
    grids : whose `degrees` are sought
    images : weights of the sphere's images
    samples : the response of degree 2 and more
    """

    def scaled(energy: Array, slope: Array, _: Array) -> Array:
        by_place = np.moveaxis(slope[..., :3], -1, 0)
        return np.concatenate([energy / samples.energy_size, *(by_place / samples.force_size)], axis=1)

    pairs = list(combinations(range(len(grids)), 2))
    sums = [pair_sum(grids[a], grids[b], images) for a, b in pairs]
    right = scaled(samples.energy[None], -samples.force[None], samples.force)[0]
    found, weights = _fitted(grids, OF_SPHERE, sums, samples.places, scaled, right, HELD)
    coupled = np.zeros((len(grids), len(grids)))
    for (a, b), weight in zip(pairs, weights, strict=True):
        coupled[a, b] = coupled[b, a] = weight
    return [replace(grid, degrees=part) for grid, part in zip(grids, found, strict=True)], coupled


def returned_fit(
    grids: Sequence[AnswerGrid], inner: Sequence[Array], images: Array, samples: ReturnedSamples
) -> tuple[list[AnswerGrid], Array]:
    """Weights of the points' powers, and of pairs, that give V and its slopes.

    Parameters
    ----------
    grids : whose `returned` are sought
    inner : (k, 3) m of each magnet, points that respond for the whole of it
    images : weights of the sphere's images
    samples : the rotor's response to the sphere's
    """
    sizes = np.linalg.norm(samples.field, axis=1)[:, None], np.linalg.norm(samples.slope, axis=(1, 2))[:, None, None]

    def scaled(_: Array, slope: Array, second: Array) -> Array:
        parts = slope[..., 3:] / sizes[0], second[..., 3:, :3] / sizes[1]
        return np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1)

    pairs = list(permutations(range(len(grids)), 2))
    sums = [mixed_sum(grids[a], inner[b], images) for a, b in pairs]
    # the energy is -M·V
    right = -np.concatenate([(samples.field / sizes[0]).ravel(), (samples.slope / sizes[1]).ravel()])
    found, weights = _fitted(grids, OF_RETURN, sums, samples.places, scaled, right, 10 * HELD)
    mixed = np.zeros((len(grids), len(grids)))
    for (a, b), weight in zip(pairs, weights, strict=True):
        mixed[a, b] = weight
    return [replace(grid, returned=part) for grid, part in zip(grids, found, strict=True)], mixed


def _fitted(
    grids: Sequence[AnswerGrid],
    numbers: range,
    sums: Sequence[EnergySum],
    places: Array,
    scaled: Callable[[Array, Array, Array], Array],
    right: Array,
    cost: float,
) -> tuple[list[Array], Array]:
    """Some `numbers` of the points (n, powers, 2) of each grid, and weights (k,) of sums.

    `scaled` makes the equations' columns (g, rows) of the energies' derivatives, and `right` is what they shall give.
    """
    columns, held, kinds, still = list[Array](), list[Array](), list[Array](), np.zeros_like(places)
    single = 1 < len(grids) < MANY  # beside other magnets each point has a weight of its own, too
    for grid in grids:
        kind = classes(grid, mirrored=bool(np.sum(np.abs(grid.axis) > PARALLEL) == 1))
        alone = np.eye(len(kind)) if single else kind[:, :0]
        kinds.append(np.concatenate([kind, alone], axis=1)[:, : None if grid.axis.any() else 0])
        for k in numbers:
            columns.append(scaled(*grid.energy(np.eye(13)[k]).derivatives(places, still, kinds[-1])))
            held.append(np.arange(kinds[-1].shape[1]) >= kind.shape[1])
    for one in sums:
        columns.append(scaled(*one.derivatives(places, still, np.ones((len(one.rows), 1)))))
        held.append(np.zeros(1, bool))
    found = least_squares(np.concatenate(columns).T, right, np.concatenate(held), cost)
    parts = iter(np.split(found, np.cumsum([len(column) for column in columns])[:-1]))
    each = [np.stack([kind @ next(parts) for _ in numbers], axis=1).reshape(len(kind), -1, 2) for kind in kinds]
    return each, np.array([float(part[0]) for part in parts])


def classes(grid: AnswerGrid, mirrored: bool) -> Array:
    """(n, classes): which points are exchanged by mirrors at the body's planes, or else by its centre."""
    key = np.round(grid.points * 1e9).astype(int)
    if mirrored:
        key = np.abs(key)
    else:
        first = np.array([next((v for v in row if v), 0) for row in key])
        key = key * np.where(first < 0, -1, 1)[:, None]
    number = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    return np.asarray(np.eye(number.max() + 1)[number])


def least_squares(columns: Array, values: Array, held: Array, cost: float = HELD) -> Array:
    """Weights (k,) of columns (n, k) of any sizes that give values (n,).

    Parameters
    ----------
    held : (k,) which weights are kept small: by themselves they are hardly determined
    cost : of a held one, by an error of the size of all values
    """
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    scaled = columns / size
    if not held.any():
        return np.asarray(np.linalg.lstsq(scaled, values, rcond=SMALL)[0] / size)
    square = scaled.T @ scaled
    square[np.diag_indices_from(square)] += np.where(held, cost, FREE) ** 2
    return np.asarray(scipy.linalg.solve(square, scaled.T @ values, assume_a="pos") / size)
