"""A field fitted to a map, with the spread of equally likely fields as its error bar."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import heyoka as hy
import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import Array, frozen_array, millimetres
from ...geometry.magnets import Magnet
from ...geometry.scene.contents import MapReading
from ..cache import TableKind
from ..harmonics.expansion import MultipoleExpansion
from ..harmonics.expressions import FieldExpressions
from ..harmonics.solid import Coefficients, derivative, field_sizes, field_spectrum, outer_sums
from ..rotor.table import RangeError, RotorTable, error_below
from .columns import FieldMap, FieldMapError
from .fit import FLOOR, MARGIN, HarmonicBasis, HarmonicFit, find_center, fit_harmonics
from .plausible import require_plausible
from .read import read_field_map

PAIRS = [(i, j) for i in range(3) for j in range(i, 3)]  # Entries of a symmetric matrix
TWICE = [1.0 if i == j else 2.0 for i, j in PAIRS]
# The error bar in standard deviations: with a spread of a dozen members, once in 500 the error is beyond it.
COVERAGE = 4.0


@dataclass(frozen=True, eq=False)
class GriddedTable:
    """Multipole expansions fitted to a map, with the error that the map leaves: a `FieldTable`.

    The field is that of sources inside the spheres of the expansions, so that it is free of divergence and curl by
    construction. Its error bar has two parts: `COVERAGE` times the spread of fields that fit the map equally well,
    and the expansions' own uncertainty, which is what degrees beyond the largest may hold.

    Parameters
    ----------
    expansions : table without closed forms; its provenance tells how the fit was made
    deviations : c_lm (T) of equally likely fields minus the table's, complex (members, expansions, L+1, L+1)
    region : (2, 3) m, opposite corners of the box where the map determines the field; may be infinite
    """

    expansions: RotorTable
    deviations: Coefficients = field(metadata={"units": "T"})
    region: Array = field(metadata={"units": "m"})

    def __post_init__(self) -> None:
        object.__setattr__(self, "region", frozen_array(self.region, (2, 3)))

    def __repr__(self) -> str:
        parts = [f"degree {part.degree} about {millimetres(part.center)}" for part in self.expansions.expansions]
        return "\n".join([f"GriddedTable {self.model!r}: {', '.join(parts)}", *error_below(self)])

    @property
    def model(self) -> str:
        return self.expansions.model

    @cached_property
    def _derivatives(self) -> list[list[Coefficients]]:
        """About each centre B_i and ∂B_i/∂x_j of each member, nine a member, as coefficients of one size."""
        found: list[list[Coefficients]] = []
        for expansion, members in zip(self.expansions.expansions, self.deviations.swapaxes(0, 1), strict=True):
            fields = [[-derivative(member, i) for i in range(3)] for member in members]
            found.append([])
            for b in fields:
                found[-1] += [np.pad(part, (0, 1)) for part in b]
                found[-1] += [derivative(b[i], j) / expansion.radius for i, j in PAIRS]
        return found

    def _spread(self, points: Array) -> tuple[Array, Array]:
        """Root mean square (n,) of the deviations of B (T) and of its gradient (T/m) at points (n, 3) m."""
        values = sum(
            outer_sums(parts, (points - e.center) / e.radius)
            for e, parts in zip(self.expansions.expansions, self._derivatives, strict=True)
        )
        squares = np.square(values).reshape(len(points), -1, 9).mean(axis=1)
        return np.sqrt(squares[:, :3].sum(axis=1)), np.sqrt(squares[:, 3:] @ TWICE)

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        return self.expansions.expressions(position)

    def evaluate(self, points: ArrayLike) -> tuple[Array, Array]:
        """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m in the rotor's frame.

        Raises RangeError: a point lies where the map does not determine the field.
        """
        points = np.asarray(points, float).reshape(-1, 3)
        known = self.in_range(points)
        if not known.all():
            where = ", ".join(f"{c * 1e3:.6g}" for c in points[int(np.argmin(known))])
            raise RangeError(f"Input points must lie {self._range()}; instead received a point at ({where}) mm.")
        return self.expansions.evaluate(points)

    def _range(self) -> str:
        parts = [f"{e.radius * 1e3:.4g} mm from {millimetres(e.center)}" for e in self.expansions.expansions]
        text = f"farther than {', '.join(parts)}"
        if np.isfinite(self.region).all():
            text += f" and in the map's box from {millimetres(self.region[0])} to {millimetres(self.region[1])}"
        return text

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (n,) of B and of its gradient (Frobenius norm), meant as upper bounds."""
        points = np.asarray(points, float).reshape(-1, 3)
        b, g = self.evaluate(points)
        neglected_b, neglected_g = self.expansions.relative_error(points)
        spread_b, spread_g = self._spread(points)
        tiny = np.finfo(float).tiny
        return (
            FLOOR + neglected_b + COVERAGE * spread_b / (np.linalg.norm(b, axis=1) + tiny),
            FLOOR + neglected_g + COVERAGE * spread_g / (np.linalg.norm(g, axis=(1, 2)) + tiny),
        )

    def in_range(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which of the points (n, 3) m lie outside the sources' spheres and where the map tells the field: (n,)."""
        points = np.asarray(points, float).reshape(-1, 3)
        known: NDArray[np.bool_] = np.all((self.region[0] <= points) & (points <= self.region[1]), axis=1)
        for expansion in self.expansions.expansions:
            known &= np.linalg.norm(points - expansion.center, axis=1) > expansion.radius
        return known


TAIL = 45  # Degree to which the part left out is continued
EDGE = 1.1  # Points nearer than so many times the nearest one's distance tell how large the part left out is
EDGE_POINTS = 2000  # At most so many of them
EDGE_SAFETY = 2.0


def fit_field_map(
    field_map: FieldMap,
    centers: ArrayLike | None = None,
    radius: float | None = None,
    max_degree: int = 30,
    background_degree: int = 0,
    seed: int = 0,
) -> GriddedTable:
    """Fit multipole expansions to a map of B.

    Raises FieldMapError: too few observations for a dipole, points inside a sphere of sources, or no centre found.

    Parameters
    ----------
    field_map : what is known of B; without errors they are taken as a common fraction of B at each distance, and the
        misfit tells which
    centers : (3,) or (k, 3) m, one for each body of sources, best at its middle (None: where one dipole fits best)
    radius : of the spheres about the centres that hold all sources, m; the table begins there (None: the distance
        of the nearest map point)
    max_degree : the degree is chosen up to this one, and so that every unknown has two observations
    background_degree : degree of a field from far away that is fitted and left out of the table, since it does not
        turn with the rotor (1: uniform, like the earth's; its value is in the provenance)
    seed : of the generator that picks held-out groups

    Accuracy: B of a 10 mm cube, or of two that touch, on a 2 mm grid to 3e-6 at 13 mm. 1e5 observations about two
    centres take 20 s of processor time; it grows as the square of the number of centres.
    """
    start = time.perf_counter()
    middle = find_center(field_map) if centers is None else np.asarray(centers, float).reshape(-1, 3)
    distances = np.linalg.norm(field_map.points[:, None] - middle, axis=2)
    radii = _radii(distances, radius)
    basis = _basis(field_map, middle, radii, max_degree, background_degree)
    errors = field_map.errors
    if errors is None:  # the typical size of a component, T, that falls as a dipole's
        fall = distances.min(axis=1)[:, None] ** 3
        errors = np.repeat((float(np.sqrt(np.nanmean((field_map.field * fall) ** 2))) or 1.0) / fall, 3, axis=1)
    fit = fit_harmonics(basis, field_map.points, field_map.field, errors, np.random.default_rng(seed))
    wide = min(fit.degree + MARGIN, basis.degree)
    deviations = np.array([basis.coefficients(member, wide) for member in fit.deviations])
    if field_map.errors is not None:
        deviations *= max(1.0, 1.0 / fit.misfit)
    coefficients = basis.coefficients(fit.unknowns, fit.degree)
    expansions = tuple(MultipoleExpansion(*part) for part in zip(middle, radii, coefficients, strict=True))
    left_out = _left_out(basis, fit, field_map, distances, expansions)
    doubts = {"tail": left_out} if left_out else {}
    provenance = _provenance(basis, fit, field_map, time.perf_counter() - start)
    region = _region(field_map, middle, radii)
    return GriddedTable(RotorTable("map", (), (), expansions, doubts, provenance), deviations, region)


def _radii(distances: Array, radius: float | None) -> Array:
    """(k,) radii of the sources' spheres; by default a hair less than the distance of the nearest map point."""
    if radius is None:
        return np.asarray(distances.min(axis=0) * (1 - 1e-9))
    inside = np.argwhere(distances <= radius)
    if len(inside):
        raise FieldMapError(
            f"Input points must lie farther than {radius * 1e3:.6g} mm from every centre (see FieldMap.outside); "
            f"instead received point {inside[0, 0]} at {distances[tuple(inside[0])] * 1e3:.6g} mm."
        )
    return np.full(distances.shape[1], float(radius))


def _basis(field_map: FieldMap, centers: Array, radii: Array, max_degree: int, background_degree: int) -> HarmonicBasis:
    extent = float(np.linalg.norm(field_map.points - centers[0], axis=1).max())
    smallest = HarmonicBasis(centers, radii, 1, background_degree, extent)
    field_map.require_observations(2 * smallest.count(1))
    fitting = [d for d in range(1, max_degree + 1) if 2 * smallest.count(d) <= field_map.observations]
    return HarmonicBasis(centers, radii, max(fitting), background_degree, extent)


def _left_out(
    basis: HarmonicBasis,
    fit: HarmonicFit,
    field_map: FieldMap,
    distances: Array,
    expansions: tuple[MultipoleExpansion, ...],
) -> tuple[MultipoleExpansion, ...]:
    """What may follow a series that was cut at the basis' end, as fields of the size that is to be doubted.

    A cut series goes on falling as its last eight degrees did, or is level; and it is as large as held-out residuals
    near the sources say, `EDGE_SAFETY` times, since a grid does not hit the worst places.
    """
    if fit.degree < basis.degree:
        return ()
    tails = [replace(e, coefficients=_tail(field_spectrum(e.coefficients))) for e in expansions]
    near = np.nonzero((distances <= EDGE * distances.min(axis=0)).any(axis=1))[0]
    near = near[:: 1 + len(near) // EDGE_POINTS]
    predicted = RotorTable("map", (), doubts={"tail": tuple(tails)}).absolute_error(field_map.points[near])[0]
    unseen = fit.held_out[fit.groups[near]]  # of the fits that did not see these points
    columns = basis.columns(field_map.points[near])[: unseen.shape[1]]
    residuals = field_map.field[near] - np.einsum("nu,uin->ni", unseen, columns)
    sizes = np.sqrt(np.nansum(residuals**2, axis=1))
    scale = EDGE_SAFETY * float(np.max(sizes / (predicted + np.finfo(float).tiny)))
    return tuple(replace(tail, coefficients=scale * tail.coefficients) for tail in tails)


def _tail(spectrum: Array) -> Coefficients:
    """Coefficients (T) that continue a spectrum to degree `TAIL`, nothing in its own degrees; which order is no matter.

    Of the last eight degrees the field falls in the mean by a ratio each, or is level.
    """
    last, before = spectrum[-4:].max(), spectrum[-8:-4].max(initial=0.0)
    ratio = min((last / before) ** 0.25, 1.0) if before > 0 else 1.0
    coefficients = np.zeros((TAIL + 1, TAIL + 1), complex)
    sizes = field_sizes(TAIL)[len(spectrum) :, 0]
    coefficients[len(spectrum) :, 0] = last * ratio ** np.arange(1, TAIL + 2 - len(spectrum)) / sizes
    return coefficients


def _region(field_map: FieldMap, centers: Array, radii: Array) -> Array:
    """Box of the map and a step around it; without bounds if it surrounds all sources: then all is known outwards."""
    step = np.median(scipy.spatial.KDTree(field_map.points).query(field_map.points, 2)[0][:, 1])
    corners = np.array([field_map.points.min(axis=0) - step, field_map.points.max(axis=0) + step])
    surrounds = np.all(corners[0] <= centers - radii[:, None]) and np.all(centers + radii[:, None] <= corners[1])
    return np.array([[-np.inf] * 3, [np.inf] * 3]) if surrounds else corners


def _provenance(basis: HarmonicBasis, fit: HarmonicFit, field_map: FieldMap, seconds: float) -> dict[str, str | float]:
    uniform = basis.background_field(fit.unknowns)
    return {
        "map_points": len(field_map.points),
        "observations": field_map.observations,
        "degree": fit.degree,
        "misfit": fit.misfit,
        "misfit_means": "relative" if field_map.errors is None else "per given standard error",
        **{f"background_{axis}_T": float(b) for axis, b in zip("xyz", uniform, strict=True)},
        "seconds": seconds,
    }


def map_table(path: Path | None, magnets: Sequence[Magnet], reading: MapReading | None = None) -> GriddedTable:
    """Table of a map of B in the rotor's frame; the sources lie in the smallest spheres about the magnets.

    What the map holds inside those spheres is left out. The magnets' shapes and places say where sources can be; their
    strength, whether the map is theirs. Raises FieldMapError: no map, a file that is none, one that contradicts the
    magnets, or too few values outside the spheres.
    """
    if path is None:
        raise FieldMapError("Input rotor.field_map must name a file for the model map; instead it is missing.")
    field_map = read_field_map(path, reading)
    radius = max(magnet.body.circumradius for magnet in magnets)
    centers = np.array([magnet.box.center for magnet in magnets])
    try:
        require_plausible(field_map, magnets, radius)
        for center in centers:
            field_map = field_map.outside(center, radius)
        return fit_field_map(field_map, centers, radius)
    except FieldMapError as error:
        raise FieldMapError(f"{path}: {error}") from None


MAP = TableKind("map", GriddedTable, "Solid-harmonic expansions fitted to a map of a magnetic field")
