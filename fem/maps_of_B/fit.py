"""Fields of single solid harmonics at many points: the columns of a least-squares fit."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ...geometry.common import Array
from ..harmonics.solid import Coefficients, field_sizes, irregular_gradient, irregular_values


@dataclass(frozen=True, eq=False)
class HarmonicBasis:
    """Fields -∇Θ_lm about centres (sources inside the map), degree by degree all centres: `count(L)` up to degree L.

    The root mean square of a column on its sphere is 3/(2l+1): unknowns (T) are of a like size for every degree.
    """

    centers: Array  # (k, 3) and (k,) m, spheres that hold the sources
    radii: Array
    degree: int  # highest degree about the centres

    def count(self, degree: int) -> int:
        """Unknowns of all harmonics up to `degree`."""
        return len(self.centers) * ((degree + 1) ** 2 - 1)

    def columns(self, points: Array) -> Array:
        """Fields (unknowns, 3, n) at points (n, 3) m."""
        result = np.empty((self.count(self.degree), 3, len(points)))
        sizes = _sizes(self.degree)
        for k, (center, radius) in enumerate(zip(self.centers, self.radii, strict=True)):
            harmonics = irregular_values(self.degree + 1, (points - center) / radius)
            for row, l, m in _terms(self.degree, len(self.centers), k):
                gradient = -(2.0 if m else 1.0) / sizes[l, m] * np.array(irregular_gradient(harmonics, l, m))
                result[row] = gradient.real  # of Re c_lm; the terms ±m are complex conjugates
                if m:
                    result[row + 1] = -gradient.imag  # of Im c_lm
        return result

    def coefficients(self, unknowns: Array, degree: int) -> list[Coefficients]:
        """Expansion coefficients c_lm (T) about each centre from the first `count(degree)` unknowns (T)."""
        sizes = _sizes(degree)
        found = []
        for k in range(len(self.centers)):
            c = np.zeros((degree + 1, degree + 1), complex)
            for row, l, m in _terms(degree, len(self.centers), k):
                c[l, m] = (unknowns[row] + (1j * unknowns[row + 1] if m else 0)) / sizes[l, m]
            found.append(c)
        return found


def _sizes(degree: int) -> Array:
    """Unknown that belongs to a coefficient c_lm of 1, [l, m]."""
    return field_sizes(degree) * ((2 * np.arange(degree + 1) + 1) / 3)[:, None]


def _terms(degree: int, centers: int, k: int) -> Iterator[tuple[int, int, int]]:
    """Row of the first unknown, degree and order of each harmonic about centre number k."""
    for l in range(1, degree + 1):
        first = centers * (l * l - 1) + k * (2 * l + 1)
        for m in range(l + 1):
            yield first + max(2 * m - 1, 0), l, m


# Groups of points, each of which is held out once: they choose the degree, and the fits without them differ.
GROUPS = 12
MARGIN = 4  # Degrees beyond the chosen one that the error bar takes into account
# Unknowns are left out that change the fit by less than so many standard errors: symmetry makes most of them zero.
NEGLIGIBLE = 0.1
FLOOR = 1e-8  # Smallest misfit that normal equations in double precision can tell, relative to the observations
ROUND_OFF = 16 * np.finfo(float).eps
CHUNK = 2000  # Points whose columns are held in memory at once


@dataclass(frozen=True, eq=False)
class HarmonicFit:
    """What a fit found."""

    degree: int  # the degree chosen
    unknowns: Array  # (count,) T
    # root mean square of held-out residuals over the errors given, by degree; that of 0 is the field itself
    misfits: Array
    groups: NDArray[np.intp]  # (n,) number of the group that each point is in
    held_out: Array  # (GROUPS, more) T, fits without each group, `MARGIN` degrees higher (as far as the basis goes)
    deviations: Array  # (GROUPS, more) T, differences to `unknowns` of solutions as likely as the data leave them

    @property
    def misfit(self) -> float:
        return float(self.misfits[self.degree])


def fit_harmonics(
    basis: HarmonicBasis, points: Array, field: Array, errors: Array, generator: np.random.Generator
) -> HarmonicFit:
    """Fit the harmonics of `basis` to a `field` (n, 3) T, NaN where not observed, at `points` (n, 3) m.

    Unknowns are fields on the sources' spheres, of which none is expected to be much larger than the dipole's own: that
    expectation (a ridge) decides where the data do not. The degree is the one that predicts held-out observations best
    (cross-validation). How the fits without one group differ gives the error (jackknife; B. Efron, The Jackknife, SIAM
    1982, ch. 3), whatever the noise; what the expectation alone decides is added. `errors`: (n, 3) standard errors, T,
    of which ratios matter; `generator`: chooses the groups.
    """
    groups = generator.permutation(len(points)) % GROUPS
    parts = np.array([_normal_matrix(basis, points, field, errors, groups == k) for k in range(GROUPS)])
    whole = parts.sum(axis=0)
    count = basis.count(1)
    dipoles = np.linalg.lstsq(whole[:count, :count], whole[:count, -2], rcond=1e-10)[0]
    expected = float(np.abs(dipoles).max()) or 1.0  # field (T) of the largest unknown
    nothing = _misfit([whole], [np.zeros(0)])
    misfits = [nothing]
    for degree in range(1, basis.degree + 1):
        found = [_solve(whole, basis.count(degree), misfits[-1] / expected, part) for part in parts]
        misfits.append(max(_misfit(parts, found), FLOOR * nothing))
    degree = max(int(np.argmin(misfits)), 1)
    ridge = misfits[degree] / expected
    unknowns = _solve(whole, basis.count(degree), ridge)
    stiffness = np.sqrt(whole.diagonal()[: len(unknowns)] + ridge**2)
    kept = np.where(np.abs(unknowns) * stiffness < NEGLIGIBLE * misfits[degree], 0.0, unknowns)
    more = basis.count(min(degree + MARGIN, basis.degree))
    held_out = np.array([_solve(whole, more, ridge, part) for part in parts])
    undecided = misfits[degree] * ridge * generator.normal(size=(more, GROUPS))
    # Their spread is the jackknife's: √(GROUPS-1) times the change by each group.
    likely = held_out + (np.sqrt(GROUPS - 1) - 1) * (held_out - held_out.mean(axis=0))
    likely = likely + _inverse_times(whole[:more, :more], ridge, undecided).T
    deviations = likely - np.pad(kept, (0, more - len(kept)))
    return HarmonicFit(degree, kept, np.array(misfits), groups, held_out, deviations)


def _normal_matrix(
    basis: HarmonicBasis, points: Array, field: Array, errors: Array, chosen: NDArray[np.bool_]
) -> Array:
    """Products of weighted columns, weighted field (last but one) and count (last) of `chosen` points."""
    size = basis.count(basis.degree) + 1
    product = np.zeros((size + 1, size + 1))
    (where,) = np.nonzero(chosen)
    for part in np.array_split(where, max(len(where) // CHUNK, 1)):
        observed = np.isfinite(field[part].T)
        columns = np.concatenate([basis.columns(points[part]), field[None, part].swapaxes(1, 2)])
        columns /= errors[part].T
        columns = columns.reshape(size, -1) if observed.all() else columns[:, observed]
        product[:-1, :-1] += columns @ columns.T
        product[-1, -1] += columns.shape[1]
    return product


def _solve(normal: Array, count: int, ridge: float, left_out: Array | None = None) -> Array:
    """First `count` unknowns of a normal matrix, without the part `left_out`, with `ridge`² on its diagonal."""
    matrix, right = normal[:count, :count].copy(), normal[:count, -2].copy()
    if left_out is not None:
        matrix -= left_out[:count, :count]
        right -= left_out[:count, -2]
    return _inverse_times(matrix, ridge, right)


def _inverse_times(matrix: Array, ridge: float, right: Array) -> Array:
    """(matrix + `ridge`²)⁻¹ right; round-off is added to the diagonal, scaled to ones, so that Cholesky succeeds."""
    scale = 1 / np.sqrt(matrix.diagonal() + ridge**2)
    regular = (matrix + ridge**2 * np.eye(len(matrix))) * scale[:, None] * scale
    regular[np.diag_indices(len(matrix))] += ROUND_OFF
    return np.asarray((scale * scipy.linalg.cho_solve(scipy.linalg.cho_factor(regular), (scale * right.T).T).T).T)


def _misfit(normals: Array | list[Array], solutions: list[Array]) -> float:
    """Root mean square of the weighted residuals that each solution leaves in the data of its normal matrix."""
    squares = observations = 0.0
    for normal, unknowns in zip(normals, solutions, strict=True):
        count = len(unknowns)
        explained = 2 * unknowns @ normal[:count, -2] - unknowns @ normal[:count, :count] @ unknowns
        squares += max(normal[-2, -2] - explained, 0.0)
        observations += normal[-1, -1]
    return float(np.sqrt(squares / observations))
