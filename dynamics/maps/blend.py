"""Moments of a magnet that change with a measure of the rotor, interpolated between a few tables."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy
import numpy as np

from ...fem.harmonics import UPPER, FieldExpressions, MultipoleExpansion, harmonic_sums
from ...geometry.basics import Array
from ..motion import Parameter
from .movable import Translation


def chebyshev_points(lowest: float, highest: float, count: int) -> Array:
    """Chebyshev points of an interval, in ascending order."""
    return (lowest + highest) / 2 - (highest - lowest) / 2 * np.cos(np.pi * (np.arange(count) + 0.5) / count)


@dataclass(frozen=True, eq=False)
class Blend:
    """Expansions about one magnet as a polynomial of the measure.

    Parameters
    ----------
    measures : (k,) at which the expansions are known
    expansions : (k,) of them, of one radius, about the magnet where it is at measure zero
    """

    measures: Array
    expansions: tuple[MultipoleExpansion, ...]

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        """B and its gradient as expressions of a position (m) and of `Parameter.MEASURE`."""
        first = self.expansions[0]
        scaled = [(position[i] - float(first.center[i])) * (1.0 / first.radius) for i in range(3)]
        parts = [_terms(expansion) for expansion in self.expansions]
        shares = _shares(self.measures)
        sums = []
        for same in zip(*parts, strict=True):
            merged: dict[Any, Any] = {}
            for key in sorted({key for terms in same for key in terms}):
                merged[key] = hy.sum([share * t[key] for share, t in zip(shares, same, strict=True) if key in t])
            sums.append(merged)
        found = harmonic_sums(scaled, sums)
        upper = dict(zip(UPPER, found[3:], strict=True))
        upper[2, 2] = -upper[0, 0] - upper[1, 1]
        return found[:3], [[upper[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]


def _terms(expansion: MultipoleExpansion) -> list[dict[Any, float]]:
    fields, gradients = expansion.components
    slopes = [{key: w / expansion.radius for key, w in gradients[i][j].items()} for i, j in UPPER]
    return [*fields, *slopes]


def _shares(measures: Array) -> list[hy.expression]:
    """Lagrange's polynomials of the measure."""
    measure, found = hy.par[Parameter.MEASURE], []
    for k, own in enumerate(measures):
        others = np.delete(measures, k)
        share = hy.expression(1.0)
        for other in others:
            share = share * ((measure - float(other)) / float(own - other))
        found.append(share)
    return found


def blend_tables(
    tables: Sequence[tuple[MultipoleExpansion, ...]],
    measures: Array,
    magnets: Sequence[tuple[Array, Translation | None]],
) -> list[tuple[Blend, Translation | None]]:
    """The expansions of several tables (k,), known at `measures` (k,), as blends, one for each magnet.

    Parameters
    ----------
    magnets : centre (3,) m at measure zero of each, and how it moves

    Raises
    ------
    ValueError : a table has expansions about other places than its magnets' centres
    """
    found = []
    for center, move in magnets:
        series = []
        for measure, table in zip(measures, tables, strict=True):
            place = center if move is None else center + move.way_of(float(measure))
            here = [e for e in table if np.linalg.norm(e.center - place) < 1e-9]
            if len(here) != 1 or len(table) != len(magnets):
                raise ValueError(
                    f"Input rotor must have one expansion about each magnet's centre; instead it has {len(table)} for "
                    f"{len(magnets)} magnets, which were cut into pieces. Make them cubes."
                )
            series.append(MultipoleExpansion(center, here[0].radius, here[0].coefficients))
        found.append((Blend(measures, tuple(series)), move))
    return found
