"""A plate at rest in a ball: the fields of its currents as harmonics about the ball's centre.

Where the plate is symmetric about planes through the centre, each state has but some of the harmonics: which ones, is
part of the compiled code.  All numbers are runtime parameters, so that it serves all balls, frequencies and plates of
the same kind.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...fem.plate_tables import RotorShare
from ...geometry.basics import Array
from ..motion import Felt, PlateMemory, Vector, decay_numbers, pushed, rotor_numbers
from .fewer import FewerStates
from .functions import local_harmonics


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
