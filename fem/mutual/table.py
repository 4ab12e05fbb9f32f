"""What rotor and floater do to each other's magnetisation, as one energy: the table that the motion is driven by.

With the rotor's own field B0 and the floater's rigid moment m at x, beyond -m·B0 the energy is

    U = -½ α B0² - ½ Σ_k λ_k (M·b_k)² - u - M·V,    M = m + α B0,

with harmonic b_k (`answer_grid`; magnets as a whole also by the field at their centres, in which they answer to each
other).  α is the sphere's polarisability; that M stands for m lets the rotor answer to what B0 induces in the sphere.
The sphere's answer of degree 2 and more to B0 has the energy -u; the rotor answers to it with the field V at x, and so,
as derivatives of -M·V, come the sphere's answer of these degrees to the rotor's answer and their forces.
Left out is what goes to and fro once more: less than 2e-4 of what is told.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, permutations

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from ...geometry.bodies import Magnet
from .answer_grid import AnswerGrid
from .permeable_sphere import answer_to_charge
from .point_kernel import (
    Pairs,
    coupled_derivatives,
    grid_derivatives,
    mixed_derivatives,
    mixed_energy,
    pair_derivatives,
    pairs_mixed,
    pairs_of_charges,
    point_field,
)


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
    coupling: Array
    pairs: Array
    mixed: Array
    images: Array
    polarizability: float
    gaps: Array = field(default_factory=lambda: np.array([1.0]))
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
