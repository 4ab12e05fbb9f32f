"""Solid harmonics and what derivatives do to their coefficients.

Normalisation of W. Dehnen, Comput. Astrophys. Cosmol. 1 (2014) 1: with the regular harmonics Υ_lm and the
irregular ones Θ_lm,

    1/|r - s| = Σ_lm conj Υ_lm(s) Θ_lm(r),    ∂_z Θ_lm = -Θ_(l+1)m,   (∂_x ± i ∂_y) Θ_lm = ±Θ_(l+1)(m±1),
    ∂_z Υ_lm = Υ_(l-1)m,   (∂_x ± i ∂_y) Υ_lm = ±Υ_(l-1)(m±1),        Θ_l(-m) = (-1)^m conj Θ_lm.

A real harmonic function outside a sphere is Σ_lm c_lm Θ_lm with c_l(-m) = (-1)^m conj c_lm; only m ≥ 0 is kept.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array, frozen_array

Coefficients = NDArray[np.complex128]  # c[l, m] for 0 ≤ m ≤ l, as a square array
Member = tuple[int, int, int]  # l, m, and 0 for the real or 1 for the imaginary part
FOUR_PI = 4 * np.pi

CHUNK = 4096  # points at once, so that the harmonics of all degrees fit in memory
# Points at once of sums, more of few degrees as far as their harmonics are so many numbers, and terms times points: so
# that they fit in the processor's cache
BLOCK, NUMBERS, TERMS = 256, 1 << 16, 1 << 14
FACTORIALS = np.array([float(math.factorial(n)) for n in range(171)])  # all that a double can hold


@cache
def gauss_legendre(count: int) -> tuple[Array, Array]:
    """Nodes and weights (`count`,) of Gauss's rule from -1 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return frozen_array(nodes, (count,)), frozen_array(weights, (count,))


@cache
def factorials(degree: int) -> Array:
    """(l-m)! (l+m)! as [l, m], 1 for m > l: Θ_lm over Υ_lm on the unit sphere. For degrees up to 85."""
    l, m = np.indices((degree + 1, degree + 1))
    return frozen_array(np.where(m <= l, FACTORIALS[np.maximum(l - m, 0)] * FACTORIALS[l + m], 1.0), l.shape)


def regular_orders(degree: int, x: Array, y: Array, z: Array) -> Iterator[tuple[int, Array, Any]]:
    """Order by order m: Υ_lm = R_lm (x + iy)^m, as m, R (degree + 1 - m, n) and the power (n,).

    Real recurrences for one m at a time take a third of the time and memory of all complex harmonics.

    Parameters
    ----------
    degree : highest l
    x, y, z : coordinates (n,)
    """
    square, across = x * x + y * y + z * z, x + 1j * y
    power, first = np.ones_like(across), 1.0
    for m in range(degree + 1):
        if m:
            power, first = power * across, -first / (2 * m)
        rows = np.empty((degree + 1 - m, len(x)))
        rows[0] = first
        for l in range(m + 1, degree + 1):
            upper = z * rows[l - 1 - m]
            upper *= 2 * l - 1
            if l - 2 >= m:
                upper -= square * rows[l - 2 - m]
            np.divide(upper, (l + m) * (l - m), out=rows[l - m])
        yield m, rows, power


def regular_values(degree: int, x: Array, y: Array, z: Array) -> dict[tuple[int, int], Any]:
    """Complex regular harmonics Υ_lm (n,) by (l, m), 0 ≤ m ≤ l ≤ `degree`, at coordinates x, y, z (n,)."""
    orders = regular_orders(degree, x, y, z)
    return {(m + k, m): row * power for m, rows, power in orders for k, row in enumerate(rows)}


def weighted_sums(degree: int, points: Array, weights: Array) -> Coefficients:
    """Σ_n weight_n Υ_lm(r_n), [k, l, m], up to a `degree` at `points` (n, 3) with `weights` (n, k)."""
    result = np.zeros((weights.shape[1], degree + 1, degree + 1), complex)
    for first in range(0, len(points), CHUNK):
        here = slice(first, first + CHUNK)
        for m, rows, power in regular_orders(degree, *np.ascontiguousarray(points[here].T)):
            turned = np.ascontiguousarray(power[:, None] * weights[here])
            result[:, m:, m] += (rows @ turned.view(float)).view(complex).T
    return result


def both_signs(coefficients: Coefficients) -> tuple[Coefficients, int]:
    """[l, m] also of m < 0 by c_l(-m) = (-1)^m conj c_lm, with room for m ± 1; and the column of m = 0."""
    size = len(coefficients)
    full, orders = np.zeros((size, 2 * size + 3), complex), np.arange(size)
    full[:, size + 1 - orders] = (-1.0) ** orders * np.conj(coefficients)
    full[:, size + 1 + orders] = coefficients
    return full, size + 1


def regular_derivative(sums: Coefficients, axis: int) -> Coefficients:
    """[l, m] of a real linear functional of ∂Υ_lm/∂x_axis, from its values on Υ_lm itself (m ≥ 0)."""
    full, zero = both_signs(sums)
    orders, below = zero + np.arange(len(sums)), np.vstack([np.zeros((1, full.shape[1])), full[:-1]])
    plus, minus = below[:, orders + 1], -below[:, orders - 1]
    return np.asarray(((plus + minus) / 2, (plus - minus) / 2j, below[:, orders])[axis])


def irregular_values(degree: int, points: Array) -> dict[tuple[int, int], Any]:
    """Θ_lm, 0 ≤ m ≤ l ≤ degree, at NumPy points (n, 3), by Θ_lm(r) = (l-m)! (l+m)! Υ_lm(r/r²)/r."""
    square = np.sum(points**2, axis=1)
    found = regular_values(degree, *(points / square[:, None]).T)
    distance, sizes = np.sqrt(square), factorials(degree)
    return {key: sizes[key] / distance * v for key, v in found.items()}


def irregular_gradient(harmonics: dict[tuple[int, int], Any], l: int, m: int) -> list[Any]:
    """Gradient (three complex arrays) of Θ_lm, m ≥ 0, from `harmonics` of `irregular_values` up to l + 1."""
    plus = harmonics[l + 1, m + 1]
    minus = harmonics[l + 1, m - 1] if m else -np.conj(harmonics[l + 1, 1])
    return [(plus - minus) / 2, (plus + minus) / 2j, -harmonics[l + 1, m]]


@dataclass(frozen=True, eq=False)
class OuterSums:
    """Sums Σ c_lm Θ_lm of k functions, about one centre or several: the real harmonics they have, and their weights."""

    degrees: Array  # of each centre, falling
    # l, m and number of the centre of those with cos mφ, then of those with sin mφ; centre by centre
    orders: tuple[tuple[NDArray[np.intp], ...], ...]
    weights: tuple[Array, Array]  # (count, k) of each kind

    @classmethod
    def of(cls, coefficients: Sequence[Coefficients]) -> Self:
        """Of arrays c of one size, about one centre."""
        stacked = np.stack(coefficients, axis=-1)
        m = np.arange(len(stacked))
        sizes = (np.sqrt(factorials(len(stacked) - 1)) * np.where(m, 2.0, 1.0))[..., None]
        parts = stacked.real * sizes, np.where(m[:, None], -stacked.imag, 0.0) * sizes
        orders = tuple(np.nonzero(part.any(axis=2)) for part in parts)
        return cls(
            np.array([len(stacked) - 1]),
            tuple((l, m, np.zeros_like(l)) for l, m in orders),
            (parts[0][orders[0]], parts[1][orders[1]]),
        )

    @classmethod
    def joined(cls, sums: Sequence[Self]) -> tuple[Self, NDArray[np.intp]]:
        """Of several centres together, and their numbers (sums,) in the order in which it has them."""
        order = np.argsort([-one.degrees[0] for one in sums], kind="stable")
        chosen = [sums[k] for k in order]
        orders = [
            (*(np.concatenate([one.orders[kind][i] for one in chosen]) for i in (0, 1)),
             np.repeat(np.arange(len(chosen)), [len(one.weights[kind]) for one in chosen]))
            for kind in (0, 1)
        ]  # fmt: skip
        weights = [np.concatenate([one.weights[kind] for one in chosen]) for kind in (0, 1)]
        return cls(np.array([one.degrees[0] for one in chosen]), tuple(orders), (weights[0], weights[1])), order

    def totals(self, places: Array) -> Array:
        """Totals (n, k) of all centres, from each of which every point has its place: (centres, n, 3).

        At few points many centres share the steps of the recurrences, of which 27 expansions would else ask for 600.
        """
        block = max(BLOCK, NUMBERS // int(self.degrees[0] + 1) ** 2)
        together = max(1, block // max(places.shape[1], 1))
        result = np.zeros((places.shape[1], self.weights[0].shape[1]))
        for first in range(0, len(places), together):
            for start in range(0, len(result), block):
                here = slice(start, start + block)
                result[here] += self._part(first, places[first : first + together, here])
        return result

    def _part(self, first: int, places: Array) -> Array:
        """`totals` of the centres from a `first` one on, at points that fit in the cache together."""
        (centers, count), points = places.shape[:2], places.reshape(-1, 3)
        degrees = self.degrees[first : first + centers]
        square = np.einsum("na,na->n", points, points)
        x, y, z = points.T / square
        ends = [count * int(np.sum(degrees >= l)) for l in range(degrees[0] + 1)]
        zonal, power = _zonal(ends, z, 1 / square), np.empty((len(ends), len(points)), complex)
        power[0], across = 1 / np.sqrt(square), x + 1j * y
        for order, end in enumerate(ends[1:], 1):
            np.multiply(power[order - 1, :end], -np.sqrt(1 - 0.5 / order) * across[:end], out=power[order, :end])
        total = np.zeros((count, self.weights[0].shape[1]))
        shape, step = (centers, count), max(1, TERMS // count)
        for (l, m, k), weights, part in zip(self.orders, self.weights, (power.real, power.imag), strict=True):
            begin, end = np.searchsorted(k, (first, first + centers))
            heights, across = zonal.reshape(*zonal.shape[:2], *shape), part.reshape(len(ends), *shape)
            for start in range(begin, end, step):
                here = slice(start, min(start + step, end))
                values = heights[l[here], m[here], k[here] - first] * across[m[here], k[here] - first]
                total += values.T @ weights[here]
        return total


def outer_sums(coefficients: Sequence[Coefficients], points: Array) -> Array:
    """Σ c_lm Θ_lm (n, k) at points (n, 3), for k arrays c of one size."""
    return OuterSums.of(coefficients).totals(points[None])


def _zonal(ends: Sequence[int], z: Array, square: Array) -> Array:
    """√((l-m)! (l+m)!) Υ_lm (l, m, n) at heights z with r², without the factor that it has for l = m.

    Of degree l at the first `ends`[l] points only. All orders at once: a tenth of the calls that one by one would need.
    """
    factors, found = _ladder(len(ends) - 1), np.empty((len(ends), len(ends), len(z)))
    for l, end in enumerate(ends):
        found[l, l, :end] = 1.0
        if l:
            np.multiply(found[l - 1, :l, :end], factors[0, l, :l, None] * z[:end], out=found[l, :l, :end])
        if l > 1:
            found[l, : l - 1, :end] -= factors[1, l, : l - 1, None] * square[:end] * found[l - 2, : l - 1, :end]
    return found


@cache
def _ladder(degree: int) -> Array:
    """(2, l, m): factors of z and r² in the recurrence of `_zonal`."""
    l, m = np.indices((degree + 1, degree + 1))
    root = np.sqrt(np.maximum(l * l - m * m, 1))
    return frozen_array(
        np.array([(2 * l - 1) / root, np.sqrt(np.maximum((l - 1) ** 2 - m * m, 0)) / root]), (2, *l.shape)
    )


def derivative(coefficients: Coefficients, axis: int) -> Coefficients:
    """Coefficients of ∂f/∂x_axis of f = Σ c_lm Θ_lm: one degree more."""
    full, zero = both_signs(coefficients)
    orders = zero + np.arange(len(coefficients) + 1)
    lower, upper = full[:, orders - 1], full[:, orders + 1]
    found = ((lower - upper) / 2, (lower + upper) / 2j, -full[:, orders])[axis]
    return np.vstack([np.zeros((1, len(orders))), found])


Entry = tuple[int, ...]  # Indices i, j, ... of a tensor ∂_i ∂_j ... u


@cache
def entries(degree: int) -> tuple[Entry, ...]:
    """Of the derivatives of a harmonic u of one degree, 2 degree + 1 that determine the rest: at most one is by z."""
    return tuple(e for e in combinations_with_replacement(range(3), degree) if e.count(2) < 2)


def entry(known: Mapping[Entry, Any], indices: Entry) -> Any:
    """One entry of a symmetric tensor without trace, from those of `entries`."""
    *rest, last = sorted(indices)
    if last < 2 or not rest or rest[-1] < 2:
        return known[*rest, last]
    return -entry(known, (0, 0, *rest[:-1])) - entry(known, (1, 1, *rest[:-1]))


@cache
def _spread(degree: int) -> Array:
    """(2 degree + 1, 3^degree): all entries of a tensor by those of `entries`."""
    unit = dict(zip(entries(degree), np.eye(2 * degree + 1), strict=True))
    return np.array([entry(unit, tuple(indices)) for indices in np.ndindex((3,) * degree)]).T


@cache
def _kept(degree: int) -> NDArray[np.intp]:
    """Places of `entries` in a flat tensor."""
    return np.asarray(np.ravel_multi_index(np.array(entries(degree)).T.tolist(), (3,) * degree))


def tensors(values: Array) -> list[Array]:
    """Derivatives (n, 3), (n, 3, 3), ... of harmonic functions, from their `entries` of degrees 1, 2, ... (n, k)."""
    found: list[Array] = []
    start = 0
    while start < values.shape[1]:
        degree = len(found) + 1
        found.append((values[:, start : start + 2 * degree + 1] @ _spread(degree)).reshape(-1, *(3,) * degree))
        start += 2 * degree + 1
    return found


def contracted(degree: int, vector: Array) -> Array:
    """Matrix (2 degree + 1, 2 degree - 1) from `entries` of one degree to those of its tensor times a vector (3,)."""
    whole = _spread(degree).reshape(-1, 3 ** (degree - 1), 3) @ vector
    return np.asarray(whole[:, _kept(degree - 1)])


def turned_entries(values: Array, axes: Array) -> Array:
    """`entries` (n, k) of all degrees along the columns of `axes` (3, 3) or (n, 3, 3), along the outer axes."""
    found, axes = [], np.broadcast_to(axes, (len(values), 3, 3))
    for degree, tensor in enumerate(tensors(values), 1):
        for _ in range(degree):  # each turns the first index and makes it the last
            tensor = np.einsum("nij,nj...->n...i", axes, tensor)
        found.append(tensor.reshape(-1, 3**degree)[:, _kept(degree)])
    return np.concatenate(found, axis=1)


def members(degree: int) -> list[Member]:
    """All real harmonics up to a degree, the lowest degrees first."""
    return [(l, m, part) for l in range(degree + 1) for m in range(l + 1) for part in (0, 1)[: 1 + (m > 0)]]


def real_terms(coefficients: Coefficients) -> dict[Member, float]:
    """The same function as a sum over real harmonics, by `members`; zero weights left out."""
    terms: dict[Member, float] = {}
    for l, m in zip(*np.nonzero(coefficients), strict=True):
        c, factor = coefficients[l, m], 1.0 if m == 0 else 2.0
        if c.real:
            terms[int(l), int(m), 0] = factor * float(c.real)
        if c.imag and m:
            terms[int(l), int(m), 1] = -factor * float(c.imag)
    return terms


def field_sizes(degree: int) -> Array:
    """Root mean square of |grad Re Θ_lm| (or Im) over the unit sphere, [l, m], times √2 for m > 0; 0 for m > l.

    The mean of |Θ_lm|² is (l-m)!(l+m)!/(2l+1), and that of |grad f|² is (l+1)(2l+1) times the mean of f² for a
    harmonic f of degree l. The size of Σ c_lm Θ_lm is the root of Σ |c_lm|² size_lm².
    """
    l, m = np.indices((degree + 1, degree + 1))
    return np.where(m <= l, np.sqrt(np.where(m == 0, 1.0, 2.0) * (l + 1.0) * factorials(degree)), 0.0)


def field_spectrum(coefficients: Coefficients) -> Array:
    """Root mean square of |grad f| over the unit sphere, by degree: (L+1,)."""
    return np.asarray(np.linalg.norm(np.abs(coefficients) * field_sizes(len(coefficients) - 1), axis=1))


def orthonormal(keys: Sequence[Member], points: Array) -> Array:
    """Real orthonormal harmonics (n, columns) in the directions of `points` (n, 3)."""
    degree = max(l for l, _, _ in keys)
    harmonics = regular_values(degree, *(points / np.linalg.norm(points, axis=1)[:, None]).T)
    parts = [harmonics[l, m].imag if part else harmonics[l, m].real for l, m, part in keys]
    return np.stack([norm(l, m) * part for (l, m, _), part in zip(keys, parts, strict=True)], axis=1)


def norm(l: int, m: int) -> float:
    """Factor that makes Re Υ_lm, and Im Υ_lm if m > 0, orthonormal on the unit sphere."""
    square = (2 * l + 1) / FOUR_PI * factorials(l)[l, m]
    return float(np.sqrt(square if m == 0 else 2 * square))


def harmonic_parity(key: Member, axis: int) -> int:
    """Whether a real harmonic is even (+1) or odd (-1) at the plane across a coordinate axis."""
    l, m, part = key
    return -1 if ((m + part) % 2, part, (l + m) % 2)[axis] else 1


def mirrored_harmonics(coefficients: Coefficients, axis: int) -> Coefficients:
    """Coefficients of f(S x), with S the mirror at the plane across a coordinate axis, of f = Σ c_lm Θ_lm."""
    l, m = np.indices(coefficients.shape)
    if axis == 2:
        return np.asarray((-1.0) ** (l + m) * coefficients)
    return np.asarray((-1.0) ** (m if axis == 0 else 0 * m) * np.conj(coefficients))


def outer_coefficients(amplitudes: Array, keys: Sequence[Member], degree: int) -> Coefficients:
    """c_lm, up to a degree, of Σ c_lm Θ_lm that is Σ a_k Y_k on the unit sphere.

    `amplitudes` (k,) are the a_k of orthonormal harmonics Y_k, which are named by `keys`.
    """
    result = np.zeros((degree + 1, degree + 1), complex)
    for value, (l, m, part) in zip(amplitudes, keys, strict=True):
        result[l, m] += (2 * l + 1) / FOUR_PI / norm(l, m) * (-1j * value if part else value)
    return result


def rotated_harmonics(coefficients: Coefficients, axes: Array) -> Coefficients:
    """Coefficients of f(axesᵀ x) of f = Σ c_lm Θ_lm: from a frame with the columns of `axes` as axes to the outer one.

    Exact but for round-off: 1e-14 of the largest term at degree 50, in milliseconds.
    """
    if np.array_equal(axes, np.eye(3)):
        return coefficients
    last = np.arctan2(axes[1, 2], axes[0, 2])  # first about z, then about y, then about z again
    across = np.array([np.cos(last), np.sin(last), 0.0])
    middle = np.arctan2(across @ axes[:, 2], axes[2, 2])
    first = np.arctan2(*(np.array([-across[1], across[0], 0.0]) @ axes[:, :2]))
    degrees = np.arange(len(coefficients))
    l, m = np.indices(coefficients.shape)
    size = np.sqrt(factorials(len(coefficients) - 1))
    amplitudes = coefficients * np.where(m <= l, size, 0.0)
    for degree in degrees[1:]:
        orders, known = degrees[: degree + 1], amplitudes[degree, : degree + 1]
        below = (-1.0) ** orders[:0:-1] * np.conj(known[:0:-1])
        speeds, modes = _swings(int(degree))
        turned = np.concatenate([below, known]) * np.exp(-1j * first * np.arange(-degree, degree + 1))
        turned = modes @ (np.exp(-1j * middle * speeds) * (modes.conj().T @ turned))
        amplitudes[degree, : degree + 1] = turned[degree:] * np.exp(-1j * last * orders)
    return np.asarray(amplitudes / size)


@cache
def _swings(degree: int) -> tuple[Array, Coefficients]:
    """Eigenvalues (n,) and vectors (n, n) of the angular momentum about y among orders -degree to degree."""
    m = np.arange(-degree, degree)
    rising = np.diag(np.sqrt((degree - m) * (degree + m + 1.0)) / 2, -1)
    values, vectors = np.linalg.eigh((rising - rising.T) / 1j)
    return values, vectors
