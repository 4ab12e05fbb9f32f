"""Solid harmonics and what derivatives do to their coefficients.

Normalisation of W. Dehnen, Comput. Astrophys. Cosmol. 1 (2014) 1: with the regular harmonics Υ_lm and the
irregular ones Θ_lm,

    1/|r - s| = Σ_lm conj Υ_lm(s) Θ_lm(r),    ∂_z Θ_lm = -Θ_(l+1)m,   (∂_x ± i ∂_y) Θ_lm = ±Θ_(l+1)(m±1),
    ∂_z Υ_lm = Υ_(l-1)m,   (∂_x ± i ∂_y) Υ_lm = ±Υ_(l-1)(m±1),        Θ_l(-m) = (-1)^m conj Θ_lm.

A real harmonic function outside a sphere is Σ_lm c_lm Θ_lm with c_l(-m) = (-1)^m conj c_lm; only m ≥ 0 is kept.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement
from typing import Any, Self

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array, frozen_array
from ..compiled_code import compiled, one_thread

Coefficients = NDArray[np.complex128]  # c[l, m] for 0 ≤ m ≤ l, as a square array
Member = tuple[int, int, int]  # l, m, and 0 for the real or 1 for the imaginary part
FOUR_PI = 4 * np.pi

CHUNK = 4096  # points at once, so that what belongs to them fits in memory
# Points at once of harmonics, more of few degrees: so that these fit in the processor's cache
BLOCK, NUMBERS = 128, 1 << 18
STEP, STEPS = 4, 6  # degrees that are compiled together, and how often: a second, once; others are seldom asked for
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


@cache
def _leading(degree: int) -> Array:
    """[l, m]: Υ_lm over (x + iy)^m and the polynomial of z that `_step` takes for it; 0 for m > l."""
    found = np.zeros((degree + 1, degree + 1))
    for m in range(degree + 1):
        found[m, m] = (-0.5) ** m / FACTORIALS[m]
        for l in range(m + 1, degree + 1):
            found[l, m] = found[l - 1, m] * (2 * l - 1) / ((l - m) * (l + m))
    return frozen_array(found, found.shape)


@cache
def _step(last: int) -> Any:
    """Compiled: what `real_harmonics` gives of the next `STEP` degrees, from the two up to the `last` one."""
    before, here = ([hy.expression(f"h_{l}_{k}") for k in range(2 * l + 1)] for l in (last - 1, last))
    variables, (x, y, z), made = [*before, *here], [hy.par[k] for k in range(3)], list[Any]()
    square = x * x + y * y + z * z
    for l in range(last + 1, last + STEP + 1):
        upper = [z * part for part in here]
        for k, factor in enumerate(_ladder(l).tolist()):
            upper[k] -= factor * square * before[k]
        cosine, sine = here[-2:] if l > 1 else (here[0], None)
        turned = [cosine * x - sine * y, cosine * y + sine * x] if l > 1 else [cosine * x, cosine * y]
        before, here = here, [*upper, *turned]
        made += here
    # optimised as is usual they take five times as long to compile, half a second, and no less to evaluate
    return compiled(hy.cfunc, made, variables, fast_math=True, opt_level=0)


@cache
def _ladder(l: int) -> Array:
    """(2 l - 3,): what of r² times degree l - 2 goes into degree l; no other scale has so short a recurrence."""
    m = (np.arange(max(2 * l - 3, 0)) + 1) // 2
    return ((l - 1) ** 2 - m * m) / ((2.0 * l - 1) * (2.0 * l - 3))


def real_harmonics(degree: int, points: Array, factor: Array | float) -> Array:
    """Harmonics ((degree + 1)², n) at points (3, n): degree by degree those of m = 0, cos φ, sin φ, cos 2φ, ...

    They are `factor` (n,) times the parts of Υ_lm, over `_leading`.
    """
    steps = min(-(-degree // STEP), STEPS)
    found = np.empty(((max(degree, steps * STEP) + 1) ** 2, points.shape[1]))
    found[0], (x, y, z), square = factor, points, np.sum(points**2, axis=0)
    with one_thread():
        for last in range(0, steps * STEP, STEP):
            first, here, end = max(last - 1, 0) ** 2, (last + 1) ** 2, (last + STEP + 1) ** 2
            _step(last)(found[first:here], pars=points, outputs=found[here:end])
    for l in range(steps * STEP + 1, degree + 1):
        lower, upper, new = (found[(l + k) ** 2 : (l + k + 1) ** 2] for k in (-2, -1, 0))
        np.multiply(upper, z, out=new[:-2])
        new[:-4] -= _ladder(l)[:, None] * square * lower
        new[-2], new[-1] = upper[-2] * x - upper[-1] * y, upper[-2] * y + upper[-1] * x
    return found[: (degree + 1) ** 2]


@cache
def _places(degree: int) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
    """l, m, and whether it goes as sin mφ, ((degree + 1)²,) of each of `real_harmonics`."""
    number = np.arange((degree + 1) ** 2)
    l = np.sqrt(number + 0.5).astype(int)
    k = number - l * l
    return l, (k + 1) // 2, (k > 0) & (k % 2 == 0)


def regular_values(degree: int, x: Array, y: Array, z: Array) -> dict[tuple[int, int], Any]:
    """Complex regular harmonics Υ_lm (n,) by (l, m), 0 ≤ m ≤ l ≤ `degree`, at coordinates x, y, z (n,)."""
    values, sizes = real_harmonics(degree, np.stack([x, y, z]), 1.0), _leading(degree)
    return {
        (l, m): sizes[l, m] * (values[l * l + 2 * m - 1] + 1j * values[l * l + 2 * m] if m else values[l * l] + 0j)
        for l in range(degree + 1)
        for m in range(l + 1)
    }


def weighted_sums(degree: int, points: Array, weights: Array) -> Coefficients:
    """Σ_n weight_n Υ_lm(r_n), [k, l, m], up to a `degree` at `points` (n, 3) with `weights` (n, k)."""
    step, total = _block(degree), np.zeros(((degree + 1) ** 2, weights.shape[1]))
    for start in range(0, len(points), step):
        some = np.ascontiguousarray(points[start : start + step].T)
        total += real_harmonics(degree, some, 1.0) @ weights[start : start + step]
    return _whole(total.T)


def _whole(parts: Array) -> Coefficients:
    """[..., l, m] of parts (..., (degree + 1)²) in the order of `real_harmonics`."""
    degree = math.isqrt(parts.shape[-1]) - 1
    found, (l, m, sine) = np.zeros((*parts.shape[:-1], degree + 1, degree + 1), complex), _places(degree)
    found.real[..., l[~sine], m[~sine]] = parts[..., ~sine]
    found.imag[..., l[sine], m[sine]] = parts[..., sine]
    return np.asarray(found * _leading(degree))


def _block(degree: int) -> int:
    return max(BLOCK, NUMBERS // (degree + 1) ** 2)


def both_signs(coefficients: Coefficients) -> tuple[Coefficients, int]:
    """[..., l, m] also of m < 0 by c_l(-m) = (-1)^m conj c_lm, with room for m ± 1; and the column of m = 0."""
    size = coefficients.shape[-1]
    full, orders = np.zeros((*coefficients.shape[:-1], 2 * size + 3), complex), np.arange(size)
    full[..., size + 1 - orders] = (-1.0) ** orders * np.conj(coefficients)
    full[..., size + 1 + orders] = coefficients
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


def _outer_parts(coefficients: Coefficients) -> Array:
    """(..., (degree + 1)²) of c_lm [..., l, m]: Σ c_lm Θ_lm(r) is their sum over `_outer_harmonics`."""
    degree = coefficients.shape[-1] - 1
    l, m, sine = _places(degree)
    # Θ_lm(r) = (l-m)! (l+m)! Υ_lm(r/r²)/r; of c_l(-m) the real part is the same
    whole = coefficients * (factorials(degree) * _leading(degree) * np.where(np.arange(degree + 1), 2.0, 1.0))
    return np.where(sine, -whole.imag[..., l, m], whole.real[..., l, m])


def _outer_harmonics(degree: int, points: Array) -> Array:
    """`real_harmonics` of r/r², over r, at points r (3, n)."""
    inverse = 1 / np.sum(points**2, axis=0)
    return real_harmonics(degree, points * inverse, np.sqrt(inverse))


class OuterValues:
    """Θ_lm at some points, for sums over them and of them: computed once."""

    def __init__(self, degree: int, points: Array) -> None:
        """Up to a `degree` at `points` (n, 3)."""
        step = _block(degree)
        parts = [points[start : start + step] for start in range(0, max(len(points), 1), step)]
        values = [_outer_harmonics(degree, np.ascontiguousarray(some.T)) for some in parts]
        self._values = np.concatenate(values, axis=1)

    def sums(self, coefficients: Coefficients) -> Array:
        """Σ c_lm Θ_lm (..., n), of [..., l, m] of any lower degree too."""
        parts = _outer_parts(coefficients)
        return np.asarray(parts @ self._values[: parts.shape[-1]])

    def weighted(self, weights: Array) -> Coefficients:
        """Σ_n weight_n Θ_lm [..., l, m] with weights (..., n)."""
        found = _whole(weights @ self._values.T)
        return np.asarray(found * factorials(found.shape[-1] - 1))


@dataclass(frozen=True, eq=False)
class OuterSums:
    """Sums Σ c_lm Θ_lm of k functions, about one centre or several."""

    degree: int
    used: NDArray[np.intp]  # numbers of the harmonics that they have
    weights: Array  # (k, used, centres)

    @classmethod
    def of(cls, coefficients: Coefficients) -> Self:
        """Of arrays c_lm (centres, k, l, m)."""
        degree, parts = coefficients.shape[-1] - 1, _outer_parts(coefficients)
        used = np.flatnonzero(parts.any(axis=(0, 1)))
        return cls(degree, used, np.ascontiguousarray(parts[..., used].transpose(1, 2, 0)))

    def totals(self, places: Array) -> Array:
        """Totals (n, k) of all centres, from each of which every point has its place: (centres, n, 3)."""
        (count, _, centers), number, block = self.weights.shape, places.shape[1], _block(self.degree)
        together = max(1, block // max(number, 1))  # of few points many centres share a call
        result = np.zeros((number, count))
        for first in range(0, centers if len(self.used) else 0, together):
            weights = self.weights[:, :, first : first + together].reshape(count, -1)
            for start in range(0, number, block):
                here = slice(start, start + block)
                points = np.ascontiguousarray(places[first : first + together, here].reshape(-1, 3).T)
                values = _outer_harmonics(self.degree, points)
                if len(self.used) < len(values):
                    values = values[self.used]
                result[here] += (weights @ values.reshape(weights.shape[1], -1)).T
        return result


def outer_sums(coefficients: Sequence[Coefficients], points: Array) -> Array:
    """Σ c_lm Θ_lm (n, k) at points (n, 3), for k arrays c of one size."""
    return OuterSums.of(np.stack(coefficients)[None]).totals(points[None])


def derivative(coefficients: Coefficients, axis: int) -> Coefficients:
    """Coefficients [..., l, m] of ∂f/∂x_axis of f = Σ c_lm Θ_lm: one degree more."""
    full, zero = both_signs(coefficients)
    orders = zero + np.arange(coefficients.shape[-1] + 1)
    lower, upper = full[..., orders - 1], full[..., orders + 1]
    found = ((lower - upper) / 2, (lower + upper) / 2j, -full[..., orders])[axis]
    return np.concatenate([np.zeros_like(found[..., :1, :]), found], axis=-2)


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
    degrees = range(1, math.isqrt(values.shape[1] + 1))
    return [(values[:, d * d - 1 : d * (d + 2)] @ _spread(d)).reshape(-1, *(3,) * d) for d in degrees]


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


def members(degree: int, lowest: int = 0) -> list[Member]:
    """All real harmonics up to a degree, the lowest degrees first."""
    return [(l, m, part) for l in range(lowest, degree + 1) for m in range(l + 1) for part in (0, 1)[: 1 + (m > 0)]]


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

    The mean of |Θ_lm|² is (l-m)!(l+m)!/(2l+1), that of |grad f|² (l+1)(2l+1) times the mean of f² of a degree l.
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
    """c_lm up to a `degree` of Σ a_k Y_k on the unit sphere: `amplitudes` a_k of orthonormal Y_k named by `keys`."""
    result = np.zeros((degree + 1, degree + 1), complex)
    for value, (l, m, part) in zip(amplitudes, keys, strict=True):
        result[l, m] += (2 * l + 1) / FOUR_PI / norm(l, m) * (-1j * value if part else value)
    return result


def rotated_harmonics(coefficients: Coefficients, axes: Array) -> Coefficients:
    """Coefficients of f(axesᵀ x) of f = Σ c_lm Θ_lm, from a frame with `axes` as columns to the outer one."""
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
