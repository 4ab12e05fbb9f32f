"""Expansions shortened to the coefficients that matter."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...geometry.basics import Array
from .multipole import MultipoleExpansion
from .solid import irregular_gradient, irregular_values
from .turning import rotated_harmonics

Part = tuple[int, int, int, complex]
"""Number of the expansion, l, m, and the real or imaginary part of the coefficient."""
MOST = 300
"""Coefficients up to which a fit is worth its time."""
ROUNDS = 6
"""Of reweighting in a fit."""


def trimmed_expansions(
    expansions: Sequence[MultipoleExpansion], points: Array, allowed: Array
) -> tuple[list[MultipoleExpansion], list[MultipoleExpansion]]:
    """The coefficients that matter, and what they leave out: at most `allowed` (n,) T at points (n, 3) m.

    The smallest ones are left out first. Those that stay are fitted to the whole field (weighted least squares), and
    stand in for what is missing: little more than half as many do then. Dipole moments stay as they are.  Coefficients
    are those along each expansion's own axes, where its expressions are written.
    """
    parts = [
        (k, int(l), int(m), part)
        for k, expansion in enumerate(expansions)
        for own in (expansion.own_coefficients,)
        for l, m in zip(*np.nonzero(own), strict=True)
        for part in (own[l, m].real, 1j * own[l, m].imag)
        if part
    ]
    if not parts:
        return list(expansions), [_with(e, [], 0) for e in expansions]
    fields = np.concatenate([_fields(e, [p for p in parts if p[0] == k], points) for k, e in enumerate(expansions)])
    fields /= allowed[:, None]
    dipoles = [part for part in parts if part[1] == 1]
    if _largest(fields.sum(axis=0)) <= 1:
        dipoles = []
    order = [i for i in np.argsort(-np.linalg.norm(fields, axis=2).max(axis=1)) if parts[i] not in dipoles]
    factors = _fewest(fields[order])
    kept = [(k, l, m, c * f) for (k, l, m, c), f in zip((parts[i] for i in order), factors, strict=False)]
    kept += dipoles
    missing = [(k, l, m, -c) for k, l, m, c in kept] + parts
    return (
        [_with(e, kept, k) for k, e in enumerate(expansions)],
        [_with(e, missing, k) for k, e in enumerate(expansions)],
    )


def _fewest(fields: Array) -> Array:
    """Factors of the first few of the fields (k, n, 3), with which they make the sum of all to 1 at every point."""
    total = fields.sum(axis=0)
    too_few, enough, left_out = 0, 0, total.copy()
    while enough < len(fields) and _largest(left_out) > 1:
        left_out -= fields[enough]
        enough += 1
    if not enough:
        return np.zeros(0)
    factors = np.ones(enough)
    if enough > MOST:
        return factors
    while enough - too_few > 1:
        count = (enough + too_few) // 2
        found = _fitted(fields[:count], total)
        if found is None:
            too_few = count
        else:
            factors, enough = found, count
    return factors


def _fitted(fields: Array, total: Array) -> Array | None:
    """Factors (k,) with which the fields make the total to 1 at every point; None if none were found."""
    columns, weights = fields.reshape(len(fields), -1), np.ones(len(total))
    scale = 1 / np.sqrt(np.einsum("kn,kn->k", columns, columns))
    for _ in range(ROUNDS):
        weighted = columns * np.repeat(weights, 3) * scale[:, None]
        factors = scale * _solved(weighted, total.ravel() * np.repeat(weights, 3))
        error = np.linalg.norm(total - (factors @ columns).reshape(total.shape), axis=1)
        if error.max() <= 1:
            return np.asarray(factors)
        weights *= np.sqrt(0.3 + error / error.max())  # towards equal largest errors
        weights /= weights.mean()
    return None


def _solved(rows: Array, right: Array) -> Array:
    """Least squares (k,) by normal equations, which suffice for rows (k, n) of like size: the error is looked at."""
    return np.asarray(np.linalg.lstsq(rows @ rows.T, rows @ right, rcond=None)[0])


def _largest(field: Array) -> float:
    """The largest size of vectors (n, 3)."""
    return float(np.sqrt(np.einsum("ni,ni->n", field, field).max(initial=0.0)))


def _fields(expansion: MultipoleExpansion, parts: list[Part], points: Array) -> Array:
    """B (parts, n, 3) of every single part, which is along the expansion's own axes."""
    if not parts:
        return np.zeros((0, len(points), 3))
    places = (points - expansion.center) @ expansion.axes / expansion.radius
    harmonics = irregular_values(expansion.degree + 1, places)
    fields = []
    for _, l, m, value in parts:
        gradient = irregular_gradient(harmonics, l, m)
        fields.append([-(1 if m == 0 else 2) * np.real(value * component) for component in gradient])
    return np.moveaxis(np.array(fields), 1, 2) @ expansion.axes.T


def _with(expansion: MultipoleExpansion, parts: list[Part], number: int) -> MultipoleExpansion:
    """The expansion with only the given parts among those of its number, along its own axes; as long as they need."""
    mine = [part for part in parts if part[0] == number]
    degree = max((l for _, l, _, _ in mine), default=0)
    coefficients = np.zeros((degree + 1, degree + 1), complex)
    for _, l, m, value in mine:
        coefficients[l, m] += value
    return replace(expansion, coefficients=rotated_harmonics(coefficients, expansion.axes))
