"""From a map of B to a field table."""

import time
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...geometry.basics import Array
from ..harmonics import Coefficients, MultipoleExpansion, field_sizes, field_spectrum
from ..rotor_tables import RotorTable
from .field_map import FieldMap, FieldMapError
from .fitted_table import GriddedTable
from .harmonic_basis import HarmonicBasis
from .harmonic_fit import MARGIN, HarmonicFit, fit_harmonics
from .source_center import find_center

TAIL = 45
"""Degree to which the part left out is continued."""
EDGE = 1.1
"""Points nearer than so many times the nearest one's distance tell how large the part left out is."""
EDGE_POINTS = 2000
"""At most so many of them."""
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

    Raises
    ------
    FieldMapError : too few observations for a dipole, points inside a sphere of sources, or no centre found
    """
    start = time.perf_counter()
    middle = find_center(field_map) if centers is None else np.asarray(centers, float).reshape(-1, 3)
    distances = np.linalg.norm(field_map.points[:, None] - middle, axis=2)
    radii = _radii(distances, radius)
    basis = _basis(field_map, middle, radii, max_degree, background_degree)
    errors = _default_errors(field_map, distances.min(axis=1)) if field_map.errors is None else field_map.errors
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


def _default_errors(field_map: FieldMap, distances: Array) -> Array:
    """Typical size (n, 3) of a component, T, that falls as a dipole's."""
    size = float(np.sqrt(np.nanmean((field_map.field * distances[:, None] ** 3) ** 2))) or 1.0
    return np.repeat(size / distances[:, None] ** 3, 3, axis=1)


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
    tails = [replace(e, coefficients=_zonal(_tail(field_spectrum(e.coefficients)))) for e in expansions]
    near = np.nonzero((distances <= EDGE * distances.min(axis=0)).any(axis=1))[0]
    near = near[:: 1 + len(near) // EDGE_POINTS]
    predicted = RotorTable("map", (), doubts={"tail": tuple(tails)}).absolute_error(field_map.points[near])[0]
    residuals = field_map.field[near] - _held_out_field(basis, fit, field_map.points, near)
    sizes = np.sqrt(np.nansum(residuals**2, axis=1))
    scale = EDGE_SAFETY * float(np.max(sizes / (predicted + np.finfo(float).tiny)))
    return tuple(replace(tail, coefficients=scale * tail.coefficients) for tail in tails)


def _zonal(spectrum: Array) -> Coefficients:
    """Coefficients of a field with a given root mean square (T) in every degree; which one does not matter."""
    coefficients = np.zeros((len(spectrum), len(spectrum)), complex)
    coefficients[:, 0] = spectrum / field_sizes(len(spectrum) - 1)[:, 0]
    return coefficients


def _held_out_field(basis: HarmonicBasis, fit: HarmonicFit, points: Array, chosen: NDArray[np.intp]) -> Array:
    """Field (chosen, 3) T at chosen points of the fits that did not see them."""
    unknowns = fit.held_out[fit.groups[chosen]]
    columns = basis.columns(points[chosen])[: unknowns.shape[1]]
    return np.asarray(np.einsum("nu,uin->ni", unknowns, columns))


def _tail(spectrum: Array) -> Array:
    """Continuation (T) of a spectrum to degree `TAIL`, nothing in its own degrees."""
    last, before = spectrum[-4:].max(), spectrum[-8:-4].max(initial=0.0)
    ratio = min((last / before) ** 0.25, 1.0) if before > 0 else 1.0
    beyond = last * ratio ** np.arange(1, TAIL + 2 - len(spectrum))
    return np.concatenate([np.zeros(len(spectrum)), beyond])


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
