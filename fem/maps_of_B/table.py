"""A field fitted to a map, with the spread of equally likely fields as its error bar.

A map that cannot be one of the scene's magnets is refused: a wrong unit makes it wrong by powers of ten.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import Array, counted, freeze, millimetres
from ...geometry.magnets import Magnet
from ...geometry.scene.contents import MapReading
from ...geometry.shapes import Sphere
from ...geometry.solids import Part
from ..cache import TableKind
from ..closed_forms.uniform import remanent_field
from ..harmonics.expansion import MultipoleExpansion
from ..harmonics.expressions import FieldExpressions, Vector
from ..harmonics.solid import Coefficients, derivative, field_sizes, field_spectrum, outer_sums
from ..rotor.table import RangeError, RotorTable, error_below, keeps_shape
from .columns import METERS, TESLAS, UNITS, FieldMap, FieldMapError
from .fit import FLOOR, MARGIN, HarmonicBasis, HarmonicFit, fit_harmonics
from .read import read_field_map

SUBSET = 400  # Map points that are enough to compare
# Largest ratio of B of the map to that of the magnets, or the other way round; least mean cosine between both.
FACTOR, ALIGNED = 2.0, 0.5
ENOUGH = 0.1  # Least share of the points that lies outside the magnets where the units are right
# Units explain a map as well as the best ones up to so many times their deviation, or a deviation of so much.
AS_GOOD, GOOD = 3.0, 0.02
# A zero is no reading where the magnets' field is so many times the smallest that was read, and so much of |B|.
STEPS, COMPONENT = 30.0, 0.1


@dataclass(frozen=True)
class _Comparison:
    """A map beside its magnets: median ratio of |B|, mean cosine, median deviation, share of points outside."""

    ratio: float
    cosine: float
    deviation: float
    share: float

    def agrees(self, magnets: Sequence[Magnet]) -> bool:
        contrast = max(magnet.contrast for magnet in magnets)
        most = FACTOR * max(1.0, contrast)  # iron makes the field of the remanent polarisation alone another one
        return 1 / most <= self.ratio <= most and (self.cosine >= ALIGNED or contrast > 1)


def require_plausible(field_map: FieldMap, magnets: Sequence[Magnet], radius: float) -> None:
    """Refuse a `field_map` that contradicts the magnets.

    The stronger half of `SUBSET` points farther than `radius` (m) from `magnets` is compared with the field of their
    remanence. Raises FieldMapError: B larger or smaller by more than a factor of two, along other directions, or
    exactly zero; or no point outside. Where another unit would explain it, it is named.
    """
    if not any(magnet.polarization.any() for magnet in magnets):
        return
    rotor = list(magnets)
    for k, magnet in enumerate(magnets):
        if isinstance(body := magnet.body, Part):  # the sphere of its volume is near enough to a factor of two
            center, across = body.center + body.rotation @ body.centroid, float(np.cbrt(body.volume * 0.75 / np.pi))
            rotor[k] = replace(magnet, body=Sphere(across, center, body.rotation))
    found = _compared(field_map, rotor, radius)
    if found is not None and found.agrees(rotor):
        _require_no_zeros(field_map, rotor, radius)
        return
    rule = f"agree with the magnets of the scene to a factor of {FACTOR:g}"
    if found is None:
        received = f"all {len(field_map.points)} points lie within, and no field can be fitted to them"
        rule = f"have points farther than {radius * 1e3:.4g} mm from the magnets' centres"
    elif 1 / FACTOR <= found.ratio <= FACTOR:
        received = f"B is turned against theirs by {np.degrees(np.arccos(found.cosine)):.0f}° on the mean"
    else:
        factor, size = (found.ratio, "large") if found.ratio > 1 else (1 / max(found.ratio, 1e-300), "small")
        received = f"B looks {float(f'{factor:.3g}'):g} times too {size} for this rotor"
    ways = _way_out(_likely_units(field_map, rotor, radius), field_map.read_as)
    raise FieldMapError(f"Input map must {rule}; instead {received}{ways}")


def _outside(points: Array, magnets: Sequence[Magnet], radius: float) -> NDArray[np.bool_]:
    away = np.array([np.linalg.norm(points - magnet.box.center, axis=1) for magnet in magnets])
    return np.asarray(away.min(axis=0) > radius)


def _compared(
    field_map: FieldMap, magnets: Sequence[Magnet], radius: float, length: float = 1.0, strength: float = 1.0
) -> _Comparison | None:
    """The map, its lengths and B multiplied by factors, with the magnets; None where no value lies outside of them."""
    observed = np.isfinite(field_map.field)
    (outside,) = np.nonzero(_outside(length * field_map.points, magnets, radius) & observed.any(axis=1))
    if not len(outside):
        return None
    some = outside[np.linspace(0, len(outside) - 1, min(len(outside), SUBSET)).astype(int)]
    expected = np.where(observed[some], remanent_field(magnets, length * field_map.points[some]), 0.0)
    field = np.where(observed[some], strength * field_map.field[some], 0.0)
    sizes = np.linalg.norm(expected, axis=1)
    strong = sizes >= np.median(sizes)
    field, expected, size = field[strong], expected[strong], sizes[strong] + np.finfo(float).tiny
    amplitude = np.linalg.norm(field, axis=1)
    cosine = np.sum(field * expected, axis=1) / (size * amplitude + np.finfo(float).tiny)
    deviation = np.linalg.norm(field - expected, axis=1) / size
    ratio, apart = float(np.median(amplitude / size)), float(np.median(deviation))
    return _Comparison(ratio, float(cosine.mean()), apart, len(outside) / len(observed))


def _likely_units(field_map: FieldMap, magnets: Sequence[Magnet], radius: float) -> list[tuple[str, str]]:
    """Units of length and of B that would explain the map, at most two, first those with one change."""
    length, field = (UNITS[unit] for unit in field_map.read_as)
    found: list[tuple[int, float, tuple[str, str]]] = []
    for units in product(METERS, TESLAS):
        changes = sum(unit != read for unit, read in zip(units, field_map.read_as, strict=True))
        one = _compared(field_map, magnets, radius, METERS[units[0]] / length, TESLAS[units[1]] / field)
        if one is not None and one.share > ENOUGH and one.agrees(magnets):
            found.append((changes, one.deviation, units))
    best = min((deviation for _, deviation, _ in found), default=0.0)
    alike = sorted(entry for entry in found if entry[1] <= max(AS_GOOD * best, GOOD))
    return [units for _, _, units in alike[:2]]


def _way_out(likely: Sequence[tuple[str, str]], read_as: tuple[str, str]) -> str:
    if not likely:
        return ". Is it the map of another rotor, in another frame, or are the magnets' sizes or polarisations others?"
    words = ({"name": "lengths", "title": "x", "key": "length"}, {"name": "B", "title": "Bx", "key": "field"})
    guess, title, key = "{name} in {unit}, but read as {read}", "{title}_{unit}", 'rotor.map_{key}_unit = "{plain}"'

    def said(form: str) -> str:
        ways = []
        for units in likely:
            changed = [row for row in zip(words, units, read_as, strict=True) if row[1] != row[2]]
            ways += [[form.format(**w, unit=u, read=r, plain=u.replace("µ", "u")) for w, u, r in changed]]
        return ", or ".join(map(" and ".join, ways))

    way = f"Correct the unit in the file (a title such as {said(title)}), or set {said(key)}."
    return f": probably {said(guess)}. {way}"


def _require_no_zeros(field_map: FieldMap, magnets: Sequence[Magnet], radius: float) -> None:
    """Raise FieldMapError for readings of exactly zero where the magnets have a field: what a lost mask leaves."""
    values = np.abs(field_map.field[np.isfinite(field_map.field) & (field_map.field != 0)])
    observed = np.isfinite(field_map.field)
    zero = ~np.any(observed & (field_map.field != 0), axis=1) & observed.any(axis=1)
    (rows,) = np.nonzero(zero & _outside(field_map.points, magnets, radius))
    if not len(rows) or not len(values):
        return
    whole = remanent_field(magnets, field_map.points[rows])
    seen = np.linalg.norm(np.where(observed[rows], whole, 0.0), axis=1)
    wrong = (seen > STEPS * values.min()) & (seen > COMPONENT * np.linalg.norm(whole, axis=1))
    if wrong.any():
        first = int(rows[np.argmax(wrong)])
        raise FieldMapError(
            f"Input B must be NaN or empty where it is not known; instead it is exactly zero at "
            f"{counted(int(wrong.sum()), 'point')} where the magnets have a field, such as "
            f"{millimetres(field_map.points[first])}. Leave these rows out."
        )


PAIRS = [(i, j) for i in range(3) for j in range(i, 3)]  # Entries of a symmetric matrix
TWICE = [1.0 if i == j else 2.0 for i, j in PAIRS]
# The error bar in standard deviations: with a spread of a dozen members, once in 500 the error is beyond it.
COVERAGE = 4.0


@dataclass(frozen=True, eq=False)
class GriddedTable:
    """Multipole expansions fitted to a map, with the error that the map leaves: a `FieldTable`.

    That is `COVERAGE` times the spread of fits as good, and what degrees beyond the largest may hold.
    """

    # without closed forms; its provenance gives how the fit was made
    expansions: RotorTable
    # c_lm of equally likely fields minus the table's, complex (members, expansions, L+1, L+1)
    deviations: Coefficients = field(metadata={"units": "T"})
    # (2, 3) opposite corners of the box where the map determines the field; may be infinite
    region: Array = field(metadata={"units": "m"})

    def __post_init__(self) -> None:
        freeze(self, region=(2, 3))

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
        pairs = zip(self.expansions.expansions, self._derivatives, strict=True)
        values = sum(outer_sums(parts, (points - e.center) / e.radius) for e, parts in pairs)
        squares = np.square(values).reshape(len(points), -1, 9).mean(axis=1)
        return np.sqrt(squares[:, :3].sum(axis=1)), np.sqrt(squares[:, 3:] @ TWICE)

    def expressions(self, position: Vector) -> FieldExpressions:
        return self.expansions.expressions(position)

    def derivatives(self, points: Array, order: int) -> Array:
        return self.expansions.derivatives(points, order)

    @keeps_shape
    def evaluate(self, points: Array) -> tuple[Array, Array]:
        """B (..., 3) T and ∂B_i/∂x_j (..., 3, 3) T/m at points (..., 3) m, rotor's frame. Raises RangeError."""
        known = self.in_range(points)
        if not known.all():
            parts = [f"{e.radius * 1e3:.4g} mm from {millimetres(e.center)}" for e in self.expansions.expansions]
            text = f"farther than {', '.join(parts)}"
            if np.isfinite(self.region).all():
                text += f" and in the map's box from {millimetres(self.region[0])} to {millimetres(self.region[1])}"
            where = ", ".join(f"{c * 1e3:.6g}" for c in points[int(np.argmin(known))])
            raise RangeError(f"Input points must lie {text}; instead received a point at ({where}) mm.")
        return self.expansions.evaluate(points)

    @keeps_shape
    def relative_error(self, points: Array) -> tuple[Array, Array]:
        """Estimated relative errors (...,) of B and of its gradient (Frobenius norm), meant as upper bounds."""
        b, g = self.evaluate(points)
        neglected_b, neglected_g = self.expansions.relative_error(points)
        spread_b, spread_g = self._spread(points)
        tiny = np.finfo(float).tiny
        return (
            FLOOR + neglected_b + COVERAGE * spread_b / (np.linalg.norm(b, axis=1) + tiny),
            FLOOR + neglected_g + COVERAGE * spread_g / (np.linalg.norm(g, axis=(1, 2)) + tiny),
        )

    @keeps_shape
    def in_range(self, points: Array) -> NDArray[np.bool_]:
        """Which of the points (..., 3) m lie outside the sources' spheres and where the map gives the field."""
        known: NDArray[np.bool_] = np.all((self.region[0] <= points) & (points <= self.region[1]), axis=1)
        for expansion in self.expansions.expansions:
            known &= np.linalg.norm(points - expansion.center, axis=1) > expansion.radius
        return known


TAIL = 45  # Degree to which the part left out is continued
EDGE = 1.1  # Points nearer than so many times the nearest one's distance tell how large the part left out is
EDGE_POINTS = 2000  # At most so many of them
EDGE_SAFETY = 2.0


def fit_field_map(
    field_map: FieldMap, centers: ArrayLike, radius: float | None = None, max_degree: int = 30
) -> GriddedTable:
    """Fit multipole expansions about `centers`, (3,) or (k, 3) m, one for each body of sources, to a map of B.

    `radius` (m) of the spheres about them that hold all sources, where the table begins; None: the distance of the
    nearest map point. The degree is chosen up to `max_degree`, and so that every unknown has two observations. A
    `field_map` without errors has a common fraction of B at each distance, by the misfit. B of a 10 mm cube, or of two
    that touch, on a 2 mm grid comes to 3e-6 at 13 mm; 1e5 observations about two centres take 20 s of processor time,
    which grows as the square of the number of centres. Raises FieldMapError: too few observations for a dipole, or
    points inside a sphere of sources.
    """
    start = time.perf_counter()
    middle = np.asarray(centers, float).reshape(-1, 3)
    distances = np.linalg.norm(field_map.points[:, None] - middle, axis=2)
    radii = distances.min(axis=0) * (1 - 1e-9) if radius is None else np.full(len(middle), float(radius))
    if len(inside := np.argwhere(distances <= radii)):
        raise FieldMapError(
            f"Input points must lie farther than {radii[0] * 1e3:.6g} mm from every centre (see FieldMap.outside); "
            f"instead received point {inside[0, 0]} at {distances[tuple(inside[0])] * 1e3:.6g} mm."
        )
    basis, seen = HarmonicBasis(middle, radii, 1), field_map.observations
    if seen < (needed := 2 * basis.count(1)):
        raise FieldMapError(f"Input field must hold at least {needed} observed components; instead received {seen}.")
    basis = replace(basis, degree=max(d for d in range(1, max_degree + 1) if 2 * basis.count(d) <= seen))
    errors = field_map.errors
    if errors is None:  # the typical size of a component, T, that falls as a dipole's
        fall = distances.min(axis=1)[:, None] ** 3
        errors = np.repeat((float(np.sqrt(np.nanmean((field_map.field * fall) ** 2))) or 1.0) / fall, 3, axis=1)
    fit = fit_harmonics(basis, field_map.points, field_map.field, errors, np.random.default_rng(0))
    wide = min(fit.degree + MARGIN, basis.degree)
    deviations = np.array([basis.coefficients(member, wide) for member in fit.deviations])
    if field_map.errors is not None:
        deviations *= max(1.0, 1.0 / fit.misfit)
    coefficients = basis.coefficients(fit.unknowns, fit.degree)
    expansions = tuple(MultipoleExpansion(*part) for part in zip(middle, radii, coefficients, strict=True))
    doubts = {"tail": _left_out(basis, fit, field_map, distances, expansions)}
    provenance: dict[str, str | float] = {
        "map_points": len(field_map.points),
        "observations": seen,
        "degree": fit.degree,
        "misfit": fit.misfit,
        "misfit_means": "relative" if field_map.errors is None else "per given standard error",
        "seconds": time.perf_counter() - start,
    }
    region = _region(field_map, middle, radii)
    return GriddedTable(RotorTable("map", (), (), expansions, doubts, provenance), deviations, region)


def _left_out(
    basis: HarmonicBasis, fit: HarmonicFit, field_map: FieldMap, distances: Array, parts: Sequence[MultipoleExpansion]
) -> tuple[MultipoleExpansion, ...]:
    """What may follow a series that was cut at the basis' end, as fields of the size that is to be doubted.

    It falls as the last eight degrees did, or is level: `EDGE_SAFETY` times held-out residuals near the sources.
    """
    if fit.degree < basis.degree:
        return ()
    tails = [replace(e, coefficients=_tail(field_spectrum(e.coefficients))) for e in parts]
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
    """Coefficients (T) that continue a spectrum to degree `TAIL`, falling as its last eight did, or level."""
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


def map_table(path: Path | None, magnets: Sequence[Magnet], reading: MapReading | None = None) -> GriddedTable:
    """Table of the map at `path`, read as `reading` says, in the rotor's frame, outside spheres about `magnets`.

    Raises FieldMapError: no map, a file that is none, one that contradicts the magnets, or too few values.
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
