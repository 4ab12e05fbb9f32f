"""Fields that are harmonic where the floater is, as sums over the same few multipoles at points beyond.

B = -∇ Σ c_k Θ_k: each multipole is free of divergence and curl by construction.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import product

import heyoka as hy
import numpy as np
import scipy

from ...geometry.common import Array, Watch, freeze, unwatched
from ..compiled_code import compiled
from ..harmonics.expressions import FieldExpressions, Vector, harmonic_sums, weighted
from ..harmonics.solid import derivative, outer_sums

INDEPENDENT = 1e-10  # Squared part of a multipole that the chosen ones must leave for it to be taken
NOISE = 1e-11  # Weights below this share of the largest are what symmetry forbids
# Multipoles at a time, by default; the fit ends where so many steps leave more than this share of the error.
STEP, PATIENCE, STALLED = 2, 6, 0.95


@cache
def cartesian(order: int) -> Array:
    """(3, …, 3, 2 order + 1): minus the derivatives by x, y and z from those that `Multipoles.derivatives` gives."""
    found = np.zeros((*(3,) * order, 2 * order + 1))
    steps = [((1, 0.5), (-1, 0.5)), ((1, -0.5j), (-1, 0.5j)), ((0, 1.0),)]  # ∂x and ∂y by ∂x ± i∂y; ∂z
    for axes in product(range(3), repeat=order):
        terms: dict[int, complex] = {0: 1.0}  # by the power b of ∂x + i∂y, or -b of ∂x - i∂y; all other factors are ∂z
        for axis in axes:
            last, terms = terms, defaultdict(complex)
            for b, value in last.items():
                for step, factor in steps[axis]:
                    terms[b + step] += factor * value * (-1 if b * step < 0 else 1)  # both together are -∂z²
        for b, value in terms.items():
            parts = np.array([value.real, -np.sign(b) * value.imag])[: 1 + (b != 0)]
            found[axes][max(2 * abs(b) - 1, 0) : 2 * abs(b) + 1] -= (-1.0) ** order * parts
    return found


@dataclass(frozen=True, eq=False)
class Multipoles:
    """Single multipoles Re Θ_lm and Im Θ_lm of unit strength (T) at given centres."""

    centers: Array = field(metadata={"units": "m"})  # (k, 3)
    kinds: Array  # (k, 3) whole numbers: degree l, order m, and 0 for the real or 1 for the imaginary part
    scale: float = field(metadata={"units": "m"})  # length that makes coordinates free of units

    def __post_init__(self) -> None:
        freeze(self, centers=(len(self.kinds), 3), kinds=(len(self.kinds), 3))

    @classmethod
    def at(cls, centers: Iterable[Array], kinds: Sequence[tuple[int, int, int]], scale: float) -> "Multipoles":
        """All `kinds` at each of `centers`, with a `scale`."""
        pairs = list(product(centers, kinds))
        return cls(np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs], float), scale)

    def subset(self, numbers: Sequence[int]) -> "Multipoles":
        return Multipoles(self.centers[list(numbers)], self.kinds[list(numbers)], self.scale)

    def factors(self, order: int) -> Array:
        """(k,) of `derivatives`."""
        degree, m, _ = self.kinds.astype(int).T
        return np.asarray((-1.0) ** m * scipy.special.factorial2(2 * (degree + order) - 1))

    def derivatives(self, position: Vector, order: int) -> list[list[hy.expression]]:
        """Derivatives of each harmonic f by scaled lengths over its factor, as heyoka expressions of a `position` (m).

        With n = `order`, (-∂z)ⁿ f, then both parts of (-1)ᵇ (-∂z)ⁿ⁻ᵇ (∂x + i∂y)ᵇ f for b = 1 … n: sums of two monic
        harmonics, as (∂x ± i∂y) Θ_lm = ±Θ_(l+1)(m±1). Factors are left to those who sum many: in Taylor's method every
        product costs.
        """
        found: dict[int, list[hy.expression]] = {}
        for center in np.unique(self.centers, axis=0):
            here = np.flatnonzero((self.centers == center).all(axis=1)).tolist()
            kinds = {number: self.kinds[number].astype(int).tolist() for number in here}
            keys = sorted({(l + order, abs(m + b)) for l, m, _ in kinds.values() for b in range(-order, order + 1)})
            place = [(p - float(c)) * (1.0 / self.scale) for p, c in zip(position, center, strict=True)]
            single = [{(*key, part): 1.0} for key in keys for part in (0, 1)]
            sums = harmonic_sums(place, single, monic=True)
            known = dict(zip(keys, zip(sums[::2], sums[1::2], strict=True), strict=True))
            for number, (l, m, part) in kinds.items():
                if m == 0:
                    higher = (e for b in range(order) for e in known[l + order, b + 1])
                    found[number] = [known[l + order, 0][0], *higher]
                    continue
                # f is Θ_lm + conj, or i times -conj
                found[number] = [(-2.0 if part else 2.0) * known[l + order, m][part]]
                for b in range(1, order + 1):
                    (re, im), (other_re, other_im) = known[l + order, m + b], known[l + order, abs(m - b)]
                    sign = (-1.0) ** min(m, b)  # of what conj Θ_lm adds: Θ_l(-m) = (-1)^m conj Θ_lm
                    other_re, other_im = sign * other_re, (-sign if m >= b else sign) * other_im
                    found[number] += [other_im - im, re - other_re] if part else [re + other_re, im + other_im]
        return [found[number] for number in range(len(self.kinds))]

    def expressions(self, position: Vector) -> list[FieldExpressions]:
        """B (T) and its gradient (T/m) of each as heyoka expressions of a position (m)."""
        found = []
        numbers = self.factors(1), self.factors(2) / self.scale
        for *each, one, two in zip(self.derivatives(position, 1), self.derivatives(position, 2), *numbers, strict=True):
            flux = [weighted(one * row, each[0]) for row in cartesian(1)]
            found.append((flux, [[weighted(two * row, each[1]) for row in rows] for rows in cartesian(2)]))
        return found

    def _compiled(self, *orders: int) -> hy.cfunc_dbl:
        variables = hy.make_vars("x", "y", "z")
        parts = zip(*(self.derivatives(variables, order) for order in orders), strict=True)
        outputs = [entry for several in parts for part in several for entry in part]
        # Optimised it would be twice as fast at best, and compiled in ten times the time.
        return compiled(hy.cfunc, outputs, variables, compact_mode=len(outputs) > 2000, opt_level=0, batch_size=1)

    @cached_property
    def _field_and_slope(self) -> hy.cfunc_dbl:
        return self._compiled(1, 2)

    @cached_property
    def _bend(self) -> hy.cfunc_dbl:
        return self._compiled(3)

    def _tensors(self, order: int, values: Array) -> Array:
        """(n, k, 3, …, 3) from derivatives (k, 2 order + 1, n)."""
        whole = values * self.factors(order)[:, None, None] / self.scale ** (order - 1)
        return np.moveaxis(np.tensordot(whole, cartesian(order), (1, -1)), 1, 0)

    def evaluate(self, points: Array) -> tuple[Array, Array]:
        """B (n, k, 3) T and ∂B_i/∂x_j (n, k, 3, 3) T/m at points (n, 3) m."""
        values = self._field_and_slope(np.ascontiguousarray(points.T)).reshape(len(self.kinds), 8, -1)
        return self._tensors(1, values[:, :3]), self._tensors(2, values[:, 3:])

    def curvature(self, points: Array) -> Array:
        """∂²B_i/∂x_j∂x_k (n, k, 3, 3, 3) T/m² at points (n, 3) m."""
        return self._tensors(3, self._bend(np.ascontiguousarray(points.T)).reshape(len(self.kinds), 7, -1))

    def fields(self, points: Array) -> Array:
        """B (n, k, 3) T at points (n, 3) m, without compilation."""
        found = np.zeros((len(points), len(self.kinds), 3))
        degree = int(self.kinds[:, 0].max())
        for center in np.unique(self.centers, axis=0):
            here = np.flatnonzero((self.centers == center).all(axis=1))
            l, m, part = self.kinds[here].astype(int).T
            single = np.zeros((len(here), degree + 1, degree + 1), complex)
            single[np.arange(len(here)), l, m] = np.where(part, 1j, 1.0)
            parts = [-derivative(coefficients, axis) for coefficients in single for axis in range(3)]
            found[:, here] = outer_sums(parts, (points - center) / self.scale).reshape(len(points), len(here), 3)
        return found


@dataclass(frozen=True, eq=False)
class Fit:
    """Field functions as sums of multipoles."""

    multipoles: Multipoles  # the k chosen
    weights: Array  # (functions, k) c_k
    error: Array  # (functions, n, 3) what is left at the points of the fit


def fit_multipoles(
    choice: Multipoles,
    points: Array,
    values: Array,
    state_scale: Array,
    point_scale: Array,
    tolerance: float,
    enough: Callable[[Array], bool],
    step: int = STEP,
    watch: Watch = unwatched,
) -> Fit:
    """Few of a `choice` of multipoles that meet the tolerance and are `enough`, or as many as still help.

    `values`: (functions, n, 3) B of each function at `points` (n, 3); `state_scale`, `point_scale`: (functions,) and
    (n,) factors that make errors comparable; `tolerance`: for the norm of the scaled error over functions and
    components, at every point; `enough`: whether errors (functions, n, 3) are small enough; `step`: multipoles between
    two looks at the error; `watch`: progress callback.
    """
    columns = choice.fields(points) * point_scale[:, None, None]
    columns = columns.swapaxes(1, 2).reshape(-1, len(choice.kinds))
    target = (values * state_scale[:, None, None] * point_scale[:, None]).reshape(len(values), len(columns)).T
    size = np.linalg.norm(columns, axis=0)
    free, rest = columns / size, target
    chosen: list[int] = []
    left = [_worst(rest)]
    while True:
        least = max(tolerance, np.finfo(float).eps * left[0])  # progress goes by the orders of magnitude to it
        gone = 1.0 if left[-1] <= least else float(np.log(left[0] / left[-1]) / np.log(left[0] / least))
        watch("field functions of the plate", gone)
        error = rest.T.reshape(values.shape) / state_scale[:, None, None] / point_scale[:, None]
        stalled = len(left) > PATIENCE and left[-1] > STALLED * left[-1 - PATIENCE]
        if stalled or (left[-1] <= tolerance and enough(error)):
            break
        for _ in range(step):
            remaining = np.einsum("ij,ij->j", free, free)
            gain = np.sum((free.T @ rest) ** 2, axis=1) / np.maximum(remaining, INDEPENDENT)
            best = int(np.argmax(np.where(remaining > INDEPENDENT, gain, 0.0)))
            if remaining[best] <= INDEPENDENT:  # none is left: the error stays until the fit has stalled
                break
            direction = free[:, best] / np.linalg.norm(free[:, best])
            chosen.append(best)
            free = free - np.outer(direction, direction @ free)
            rest = rest - np.outer(direction, direction @ rest)
        left.append(_worst(rest))
    scaled = np.linalg.lstsq(columns[:, chosen] / size[chosen], target, rcond=None)[0]
    weights = (scaled / size[chosen][:, None]).T
    small = np.abs(scaled.T) < NOISE * np.abs(scaled).max(initial=0.0)
    return Fit(choice.subset(chosen), np.where(small, 0.0, weights / state_scale[:, None]), error)


def _worst(rest: Array) -> float:
    return float(np.sqrt(np.max(np.sum((rest**2).reshape(len(rest) // 3, 3 * rest.shape[1]), axis=1))))
