"""What a floater feels of the currents that it makes in a plate: reaction tensors and their gradients in a ball."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...fem.closed_forms.eddy_sphere import ComplexArray
from ...fem.harmonics.expansion import UPPER
from ...fem.plate.table import RotorShare
from ...geometry.common import Array
from ..motion.plate import Felt, PlateMemory, decay_numbers, pushed, rotor_numbers
from ..motion.state import Parameter, Vector, dot
from .plate_harmonics import LocalHarmonics, local_harmonics

EVERY = 3
"""Of the points of `sphere_fit` so many are left out but one."""


@dataclass(frozen=True, eq=False)
class Reactions:
    """Those of some currents, and how far those of others are from them.

    Parameters
    ----------
    known : the harmonics of the fields
    weights : (states, count) of the fields in the ball
    rates : (states,) at which the currents decay, 1/s
    omegas : (n,) angular frequencies at which they are compared, rad/s
    """

    known: LocalHarmonics
    weights: Array
    rates: Array
    omegas: Array

    def deviation(self, weights: Array, rates: Array) -> float:
        """Largest difference of the tensors or their gradients, over the largest of all at its frequency."""
        parts = zip(self._tensors(weights, rates), self._own, strict=True)
        return max(float((np.abs(a - b).max(axis=1) / np.abs(b).max(axis=1)).max()) for a, b in parts)

    def currents(self) -> Array:
        """(states, …) by each harmonic at its largest, in and out of phase, at all frequencies, weighted alike."""
        driven = self._response(self.rates)[:, :, None] * (self.weights * self._largest(np.eye(self.known.count)))
        driven /= np.sqrt(self._scales)[:, None, None]
        return np.concatenate([*driven.real, *driven.imag], axis=1)

    def _largest(self, weights: Array) -> Array:
        """(n,) largest norms of the fields of some weights."""
        return np.asarray(np.linalg.norm(self.known.values(weights)[0], axis=2).max(axis=1))

    def _response(self, rates: Array) -> ComplexArray:
        """(omegas, n) iω/(λ + iω)."""
        turning = 1j * self.omegas[:, None]
        return np.asarray(turning / (rates + turning))

    @cached_property
    def _own(self) -> tuple[ComplexArray, ComplexArray]:
        return self._tensors(self.weights, self.rates)

    @cached_property
    def _scales(self) -> Array:
        """(omegas,) largest entries of the tensors."""
        return np.asarray(np.abs(self._own[0]).max(axis=1))

    def _tensors(self, weights: Array, rates: Array) -> tuple[ComplexArray, ComplexArray]:
        """Σ iω/(λ + iω) b b' and Σ iω/(λ + iω) ∇b b' (omegas, …) at points on the surface, where they are largest."""
        near, bent = (part[:, ::EVERY] for part in self.known.values(weights))
        response = self._response(rates)
        pairs = [np.einsum("inc,inb->incb", part, near).reshape(len(rates), -1) for part in (near, bent)]
        first, second = (response.real @ pair + 1j * (response.imag @ pair) for pair in pairs)
        return first, second


FREQUENCIES = 5
"""At which reactions are compared, in equal ratios."""


@dataclass(frozen=True, eq=False)
class FewerStates:
    """States for a ball, those of a symmetry together.

    Parameters
    ----------
    directions : (all, n) V
    rates : (n,) 1/s
    weights : (n, count) of their fields
    pattern : (n, count) where these are not zero by symmetry
    """

    directions: Array
    rates: Array
    weights: Array
    pattern: NDArray[np.bool_]


def fewer_states(
    known: LocalHarmonics,
    weights: Array,
    present: NDArray[np.bool_],
    rates: Array,
    frequencies: tuple[float, float],
    allowed: float,
) -> FewerStates:
    """The fewest states that err by no more than `allowed`, relative.

    Parameters
    ----------
    known : the harmonics
    weights : (all, count) of the states' fields in the ball
    present : (all, count) which of them are not zero by symmetry
    rates : (all,) 1/s
    frequencies : lowest and highest, Hz
    """
    weights = np.where(present, weights, 0.0)
    exact = Reactions(known, weights, rates, 2 * np.pi * np.geomspace(*frequencies, FREQUENCIES))
    classes = [_Class.of(exact, np.flatnonzero((present == row).all(axis=1))) for row in np.unique(present, axis=0)]
    sizes = np.sort(np.concatenate([each.sizes for each in classes]))

    def reduced(left_out: int) -> tuple[Array, Array]:
        parts = [each.largest(sizes[left_out]) for each in classes]
        return np.concatenate([v for v, _ in parts], axis=1), np.concatenate([rate for _, rate in parts])

    def misses(left_out: int) -> float:
        directions, found = reduced(left_out)
        return exact.deviation(directions.T @ weights, found)

    directions, found = reduced(_most(len(sizes) - 1, lambda left_out: misses(left_out) <= allowed))
    pattern = np.array([present[np.argmax(np.abs(direction))] for direction in directions.T])
    return FewerStates(directions, found, np.where(pattern, directions.T @ weights, 0.0), pattern)


@dataclass(frozen=True, eq=False)
class _Class:
    """States of one symmetry (rows of all), and the principal directions of their currents, the largest first."""

    rows: NDArray[np.intp]
    rates: Array
    sizes: Array
    principal: Array

    @classmethod
    def of(cls, exact: Reactions, rows: NDArray[np.intp]) -> _Class:
        principal, sizes, _ = np.linalg.svd(exact.currents()[rows], full_matrices=False)
        return cls(rows, exact.rates, sizes, principal)

    def largest(self, least: float) -> tuple[Array, Array]:
        """Directions (all, n) and rates (n,) of those not smaller than `least`."""
        kept = self.principal[:, : int(np.sum(self.sizes >= least))]
        found, turn = np.linalg.eigh(kept.T @ (self.rates[self.rows, None] * kept))
        directions = np.zeros((len(self.rates), len(found)))
        directions[self.rows] = kept @ turn
        return directions, found


def _most(highest: int, good: Callable[[int], bool]) -> int:
    """The largest number up to `highest` that is good, if none is good above one that is not; 0 is."""
    low, high = 0, highest + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


@dataclass(frozen=True, eq=False)
class Reduction:
    """The states of a ball.

    Parameters
    ----------
    directions : (all, n) V
    signals : s (all,) of the floater, at a scaled time in a scaled state (12 or more,)
    """

    directions: Array
    signals: Callable[[float, Array], Array]

    def own(self, state: Array) -> Array:
        """The ball's state (12 + n + 1,), from one with all states (12 + all + 1,)."""
        return np.concatenate([state[:12], state[12:-1] @ self.directions, state[-1:]])

    def whole(self, time: float, state: Array) -> Array:
        """A state with all of the plate's, from the ball's at a scaled time."""
        signals = self.signals(time, state)
        currents = self.directions @ (state[12:-1] - signals @ self.directions)
        return np.concatenate([state[:12], currents + signals, state[-1:]])


@dataclass(frozen=True, eq=False)
class WholePlate:
    """The table's own multipoles: they hold wherever the table does.

    Parameters
    ----------
    memory : the plate
    first : number of the first runtime parameter
    """

    memory: PlateMemory
    first: int = len(Parameter)
    further: int = 0

    @property
    def share(self) -> RotorShare:
        """See `PlateFormula`."""
        return self.memory.share

    @property
    def reach(self) -> list[int]:
        """See `PlateFormula`: all."""
        series = self.share.series
        return [len(self.memory.table.multipoles.kinds)] * ((len(series) - 1) * series.shape[2])

    @property
    def lowered(self) -> bool:
        """See `PlateFormula`."""
        return self.memory.plate.lowering is not None

    @property
    def weights(self) -> list[list[hy.expression | None]]:
        """See `PlateFormula`."""
        return [[hy.expression(float(w)) if w else None for w in row] for row in self.memory.table.weights]

    def numbers(self, values: Array) -> Array:
        """Values of its runtime parameters, from those of `parameters`."""
        table = self.memory.table
        return np.concatenate([decay_numbers(table.rates, values), rotor_numbers(self, table.weights, values)])

    def seen(self, place: Vector, source: Vector) -> tuple[Vector, Felt]:
        """See `PlateFormula`."""
        parts = self.memory.table.multipoles.expressions(place)

        def felt(strengths: Vector) -> tuple[Vector, Vector]:
            pairs = list(zip(strengths, parts, strict=True))
            field = [hy.sum([w * b[i] for w, (b, _) in pairs]) for i in range(3)]
            slope = {(i, j): hy.sum([w * g[i][j] for w, (_, g) in pairs]) for i, j in UPPER}
            return field, pushed(slope, source)

        return [dot(source, field) for field, _ in parts], felt


@dataclass(frozen=True)
class PlateKind:
    """What balls with the same compiled code have in common.

    Parameters
    ----------
    degree : of the harmonics
    turning : highest degree of the rotor's currents, for each harmonic of its turn
    present : which of the ball's states have which harmonics, (states, count) as bytes
    """

    degree: int
    turning: tuple[int, ...]
    present: bytes

    @property
    def pattern(self) -> NDArray[np.bool_]:
        """`present` as an array."""
        return np.frombuffer(self.present, bool).reshape(-1, (self.degree + 1) ** 2 - 1)


@dataclass(frozen=True, eq=False)
class PlateInBall:
    """See `PlateFormula`.

    Parameters
    ----------
    memory : the plate
    kind : of the balls
    first : number of the first runtime parameter: centre (3) m and 1/radius 1/m of the ball, in the plate's frame,
        then the weights
    """

    memory: PlateMemory
    kind: PlateKind
    first: int
    lowered: bool = False

    @property
    def share(self) -> RotorShare:
        """Only its shape counts."""
        return at_depth(self.memory.share, 0.0, len(self.kind.turning))

    @property
    def reach(self) -> list[int]:
        """See `PlateFormula`."""
        return [(degree + 1) ** 2 - 1 for degree in self.kind.turning for _ in range(2)]

    @property
    def further(self) -> int:
        """See `PlateFormula`."""
        return 4 + int(self.kind.pattern.sum())

    @property
    def weights(self) -> list[list[hy.expression | None]]:
        """See `PlateFormula`."""
        pattern = self.kind.pattern
        numbers = np.cumsum(pattern.ravel()).reshape(pattern.shape) + self.first + 3
        return [
            [hy.par[int(n)] if there else None for n, there in zip(*rows, strict=True)]
            for rows in zip(numbers, pattern, strict=True)
        ]

    def offset(self, place: Vector) -> list[hy.expression]:
        """From the ball's centre, in radii, of a place in the plate's frame, m."""
        return [(p - hy.par[self.first + i]) * hy.par[self.first + 3] for i, p in enumerate(place)]

    def seen(self, place: Vector, source: Vector) -> tuple[Vector, Felt]:
        """See `PlateFormula`."""
        known = local_harmonics(self.kind.degree)
        basis = known.basis(self.offset(place))

        def felt(strengths: Vector) -> tuple[Vector, Vector]:
            slope = known.gradient(basis, strengths)
            inverse = hy.par[self.first + 3]
            return known.field(basis, strengths), [inverse * p for p in pushed(slope, source)]

        return known.heard(basis, source), felt

    def numbers(
        self, center: Array, radius: float, weights: Array, fewer: FewerStates, depth: float, values: Array
    ) -> Array:
        """Values of the runtime parameters for a ball, the plate at a depth, m.

        Parameters
        ----------
        weights : (all, count) of all states' fields; the rotor's currents are told by all of them
        fewer : the states of the floater's currents
        """
        share = at_depth(self.memory.share, depth, len(self.kind.turning))
        standing = replace(self, memory=replace(self.memory, share=share))
        own = np.concatenate([center, [1 / radius], fewer.weights[self.kind.pattern]])
        return np.concatenate([own, decay_numbers(fewer.rates, values), rotor_numbers(standing, weights, values)])


def at_depth(share: RotorShare, depth: float, harmonics: int | None = None) -> RotorShare:
    """The share of a plate that stays at a depth (m), with so many harmonics; None for all."""
    place = 2 * depth / share.distance - 1 if share.distance else 0.0
    factors = np.polynomial.chebyshev.chebvander(np.array([place]), share.series.shape[2] - 1)[0]
    series = (share.series @ factors)[:, :, None]
    return RotorShare(0.0, series if harmonics is None else series[: 2 * harmonics + 1], share.error)
