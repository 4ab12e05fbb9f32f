"""Expansions shortened to the coefficients that matter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.box import Array
from .harmonics import irregular_gradient, irregular_values
from .multipole import MultipoleExpansion

Part = tuple[int, int, int, complex]
"""Number of the expansion, l, m, and the real or imaginary part of the coefficient."""


def trimmed(
    expansions: Sequence[MultipoleExpansion], points: Array, allowed: Array
) -> tuple[list[MultipoleExpansion], list[MultipoleExpansion]]:
    """The coefficients that matter, and those left out: together they make at most `allowed` (n,) T at points (n, 3) m.

    The smallest ones are left out first, as many as the field of all of them allows.
    """
    parts = [
        (k, int(l), int(m), part)
        for k, expansion in enumerate(expansions)
        for l, m in zip(*np.nonzero(expansion.coefficients), strict=True)
        for part in (expansion.coefficients[l, m].real, 1j * expansion.coefficients[l, m].imag)
        if part
    ]
    if not parts:
        return list(expansions), [_with(e, [], 0) for e in expansions]
    fields = np.concatenate([_fields(e, [p for p in parts if p[0] == k], points) for k, e in enumerate(expansions)])
    fields /= allowed[:, None]
    order = np.argsort(np.linalg.norm(fields, axis=2).max(axis=1))
    together = np.linalg.norm(np.cumsum(fields[order], axis=0), axis=2).max(axis=1)
    count = int(np.argmax(together > 1)) if (together > 1).any() else len(order)
    dropped, kept = [parts[k] for k in order[:count]], [parts[k] for k in order[count:]]
    return (
        [_with(e, kept, k) for k, e in enumerate(expansions)],
        [_with(e, dropped, k) for k, e in enumerate(expansions)],
    )


def _fields(expansion: MultipoleExpansion, parts: list[Part], points: Array) -> Array:
    """B (parts, n, 3) of every single part."""
    if not parts:
        return np.zeros((0, len(points), 3))
    harmonics = irregular_values(expansion.degree + 1, (points - expansion.center) / expansion.radius)
    fields = []
    for _, l, m, value in parts:
        gradient = irregular_gradient(harmonics, l, m)
        fields.append([-(1 if m == 0 else 2) * np.real(value * component) for component in gradient])
    return np.moveaxis(np.array(fields), 1, 2)


def _with(expansion: MultipoleExpansion, parts: list[Part], number: int) -> MultipoleExpansion:
    """The expansion with only the given parts among those of its number, no longer than they need."""
    mine = [part for part in parts if part[0] == number]
    degree = max((l for _, l, _, _ in mine), default=0)
    coefficients = np.zeros((degree + 1, degree + 1), complex)
    for _, l, m, value in mine:
        coefficients[l, m] += value
    return MultipoleExpansion(expansion.center, expansion.radius, coefficients)
