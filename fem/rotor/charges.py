"""A rotor's field by charges on its magnets' surfaces: about their centres, or all over them where that will not do."""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from ...geometry.common import Array, InputError, Watch, unwatched
from ...geometry.cutting import CONVERGENCE
from ...geometry.magnets import Magnet
from ...geometry.shapes import Box
from ...geometry.solids import Part
from ..closed_forms.moments import carriers_of
from ..elements.surface import FEW, bears_charges, gap
from ..elements.surface_charges import SurfaceCharges
from ..harmonics.expansion import FittedExpansions, MultipoleExpansion, summed_derivatives, without_noise
from ..harmonics.solid import FOUR_PI, weighted_sums
from . import models
from .models import Accuracy, Rotor
from .table import CHARGES, PIECES, RotorTable

NODES = (4, 6, 8, 10, 12, 14, 16, 20, 24)  # along an edge of a face, from coarse to fine
# Ratio of two steps of these that is assumed at first, and between which one is believed: a geometric series is left
FIRST_RATE, FASTEST_RATE, SLOWEST_RATE = 0.3, 0.25, 0.75
FASTEST_OF_FEW = 0.4  # whose errors fall as n⁻⁴
RATE_SAFETY = 2.0
CONTACT = 0.02  # gap, in edges, below which round bodies count as touching
LARGEST = 6e7  # numbers of the matrices that are kept, at most
FITTED = 40  # coefficients up to which a fit of them takes less than the charges
SOME = 5  # every so many places are looked at from step to step


# Beside a magnet where its moments do not converge: distances between expansions all over it, by that at which the
# field is to hold; their degree and number of coefficients, and the most of all; nodes by the number of expansions;
# points by coefficients of a fit, and others at which it is looked at; and what it may miss there of the tolerance
SPACINGS, BESIDE_DEGREE, MOMENTS, MOST_FITTED = (1.0, 0.8, 0.65, 0.5, 0.4, 0.33), 2, 8, 4000
DENSER, ROWS, OTHERS, MISSED = 12, 0.7, 1000, 0.15
FALLS = 6.5  # power of the distance by which a fit's error falls, about
SAFETY = 4.0  # for the places that are not looked at
# Nodes beside each other whose normals are mixed; and how much nearer than the clearance that may lead
BESIDE_EACH_OTHER, NEARER = 16, 0.9


def without_charges(magnets: Rotor, accuracy: Accuracy, points: Array) -> str:
    """Why charges on their surfaces do not describe `magnets` to an `accuracy` at `points`; empty where they do."""
    permeable = [magnet for magnet in magnets if magnet.contrast]
    if any(isinstance(magnet.body, Part) for magnet in magnets):  # nor has it a closed form, where μr = 1
        return "one is a part from a STEP file"
    if not all(bears_charges(magnet) for magnet in permeable):
        return "one has two permeabilities"
    for first, second in combinations([magnet.body for magnet in permeable], 2):
        if not (isinstance(first, Box) and isinstance(second, Box)) and gap(first, second) < CONTACT:
            return "two of them, of which one is round, touch"
    clearance = accuracy.clearance(magnets)
    for magnet, whole in zip(permeable, converging(magnets, accuracy, points), strict=True):
        if whole:
            continue
        if MOMENTS * magnet.body.area / (SPACINGS[0] * clearance) ** 2 > MOST_FITTED:
            return f"one is so large that too many pieces would make up its field {clearance * 1e3:.3g} mm off"
        if len(SurfaceCharges([magnet], NODES[1]).places) ** 2 > LARGEST:
            return "one is so long or flat that its charges would take too much memory"
    return ""


def _spread(points: Array, spacing: float, most: int) -> Array:
    """Some of the points (n, 3) m, evenly: at a spacing (m) from each other at least, and no more than the `most`."""
    chosen, farthest, apart, along = list[int](), 0, np.full(len(points), np.inf), np.ascontiguousarray(points.T)
    while apart[farthest] > spacing**2 and len(chosen) < most:
        chosen.append(farthest)
        away = along - along[:, farthest, None]
        np.minimum(apart, np.einsum("an,an->n", away, away), out=apart)
        farthest = int(np.argmax(apart))
    return np.asarray(points[chosen])


def _all_around(nodes: SurfaceCharges, clearance: float, seed: int) -> Array:
    """Points (n, 3) m at the clearance (m) from a magnet with `nodes`: off faces, edges and corners, and in holes."""
    generator, near = np.random.default_rng(seed), cKDTree(nodes.places).query(nodes.places, BESIDE_EACH_OTHER)[1]
    # beside an edge or a corner lie nodes of several faces, whose normals are mixed at random
    mixed = np.take_along_axis(near, generator.integers(near.shape[1], size=(len(near), 3)), axis=1)
    away = np.einsum("nk,nka->na", generator.dirichlet(np.ones(3), len(near)), nodes.normals[mixed])
    away /= np.maximum(np.linalg.norm(away, axis=1), np.finfo(float).tiny)[:, None]
    points = nodes.places + clearance * away
    return np.asarray(points[nodes.magnets[0].body.distance(points) >= NEARER * clearance])


def _fitted_beside(
    magnets: Rotor, accuracy: Accuracy, surfaces: SurfaceCharges, number: int, charges: Array
) -> tuple[FittedExpansions, float]:
    """Expansions all over one of the `surfaces`' magnets, as many as its `charges` (n,) T need, and their error.

    They are fitted at the clearance; the error is found at other places, in units of what the highest degree does.
    """
    magnet, clearance = surfaces.magnets[number], accuracy.clearance(magnets)
    enough = DENSER * magnet.body.area / (SPACINGS[-1] * clearance) ** 2
    nodes = SurfaceCharges([magnet], int(np.ceil(4 * np.sqrt(enough / len(SurfaceCharges([magnet], 4).places)))))

    def at(points: Array) -> tuple[Array, Array]:
        """What is allowed at points, and the field."""
        scale = models.typical_field(magnets, points)
        allowed = accuracy.rtol * np.minimum(scale, 2 * np.median(scale))
        return allowed, surfaces.field_beside(number, charges, points)

    around, elsewhere = (_all_around(nodes, clearance, seed) for seed in (3, 4))
    elsewhere = elsewhere[:: 1 + len(elsewhere) // OTHERS]
    allowed, wanted = at(elsewhere)
    tried, left = list[tuple[float, FittedExpansions, float]](), list(SPACINGS)
    while left:
        spacing = left.pop(0)
        centers = _spread(nodes.places, spacing * clearance, len(nodes.places))
        count = len(centers) * MOMENTS
        if tried and count > MOST_FITTED:
            continue
        points = _spread(around, 0.0, max(int(ROWS * count), models.NEAR))
        weights, field = at(points)
        fit = FittedExpansions(centers, np.full(len(centers), clearance / 3), BESIDE_DEGREE, points, weights)
        own, step = (summed_derivatives(parts, elsewhere, 1) for parts in fit.of(field))
        missed, most = (float(np.max(np.linalg.norm(b, axis=1) / allowed)) for b in (own - wanted, step))
        tried.append((missed, fit, SAFETY * missed / most if most else 0.0))
        if missed <= MISSED:
            break
        # first those that will do, and where these are too many the finest of the others
        finer, enough = [one for one in left if one < spacing], spacing * (MISSED / missed) ** (1 / FALLS)
        left = [one for one in finer if one <= enough] + sorted(one for one in finer if one > enough)
    return min(tried, key=lambda one: one[0])[1:]


def converging(magnets: Rotor, accuracy: Accuracy, points: Array) -> list[bool]:
    """Of each permeable magnet, whether its moments converge at all `points` (n, 3) m, as those of compact ones do."""
    least = models.least_ratio(magnets, accuracy.rtol)
    return [ratio >= least for ratio in _ratios([magnet for magnet in magnets if magnet.contrast], points)]


@lru_cache(maxsize=8)
def bear_charges(rotor: Rotor, accuracy: Accuracy) -> bool:
    """Whether charges on their surfaces describe magnets, and moments about their centres these charges' field."""
    points = models.error_points(rotor, accuracy.clearance(rotor))[0]
    return not without_charges(rotor, accuracy, points) and all(converging(rotor, accuracy, points))


def _ratios(magnets: Sequence[Magnet], points: Array) -> list[float]:
    """Least distance of points (n, 3) m from each magnet's centre, in circumradii."""
    bodies = [magnet.body for magnet in magnets]
    return [float(np.linalg.norm(points - body.center, axis=1).min()) / body.circumradius for body in bodies]


def surface_table(magnets: Rotor, accuracy: Accuracy, watch: Watch = unwatched) -> RotorTable:
    """Field of magnets of one recoil permeability each: closed forms, and expansions of the charges on their surfaces.

    Nodes are added until the estimated error meets `accuracy`; if none of `NODES` that memory allows do, as where faces
    that nearly touch lie across each other, with an `AccuracyWarning`. `magnets` are cuboids, cylinders, rings and
    spheres in the rotor's frame; `watch` is called with the progress. Raises InputError: one has two permeabilities, is
    a part from a file, or far too large; or round ones touch.
    """
    start = time.perf_counter()
    points, scale = models.error_points(magnets, accuracy.clearance(magnets))
    if reason := without_charges(magnets, accuracy, points):
        raise InputError(
            f'Input rotor must have magnets that charges on their surfaces describe, for the model "surface"; instead '
            f"{reason}. Choose --model fem."
        )
    carriers, permeable = carriers_of(magnets), [m for m in magnets if m.contrast]
    converge = converging(magnets, accuracy, points)
    compact = [magnet for magnet, converges in zip(permeable, converge, strict=True) if converges]
    ratios = _ratios(compact, points)
    degree = models.enough_degree(compact, ratios, accuracy.rtol / 10)

    whole, steps, tail, pieces, before, count = *(list[MultipoleExpansion]() for _ in range(4)), np.inf, 0
    surfaces, fits = None, list[tuple[FittedExpansions, float] | None]()
    # the fewest nodes do not show what pieces of a magnet need
    for k, more in enumerate(NODES[len(compact) < len(permeable) :] if permeable else ()):
        # few crowd otherwise than more do, so that a step from these to those says nothing of what is left
        alike = (count <= FEW) == (more <= FEW)
        if k > 1 and surfaces and surfaces.numbers_at(more if alike else NODES[NODES.index(more) + 1]) > LARGEST:
            break
        count, surfaces = more, SurfaceCharges(magnets, more)
        charges = surfaces.beyond(carriers)
        fits = fits or [
            None if converges else _fitted_beside(magnets, accuracy, surfaces, number, charges)
            for number, converges in enumerate(converge)
        ]
        single = [charged_expansion(surfaces, i, charges, degree) for i, one in enumerate(fits) if not one]
        tail = models.extrapolated_tail(single, min(ratios, default=CONVERGENCE))
        coarse, whole, pieces = whole, single, []
        for number, beside in enumerate(fits):
            if beside:
                own, last = beside[0].of(surfaces.field_beside(number, charges, beside[0].points))
                pieces += [replace(e, coefficients=beside[1] * e.coefficients) for e in last]
                whole = whole + own
        if not alike or not k:
            before = np.inf
            continue
        step = [replace(b, coefficients=b.coefficients - a.coefficients) for a, b in zip(coarse, whole, strict=True)]
        missed = summed_derivatives(step, points[::SOME], 1)
        size = float(np.max(np.linalg.norm(missed, axis=1) / scale[::SOME]))
        fastest = FASTEST_OF_FEW if count <= FEW else FASTEST_RATE
        rate = float(np.clip(size / before, fastest, SLOWEST_RATE)) if np.isfinite(before) else FIRST_RATE
        left, before = RATE_SAFETY * rate / (1 - rate), size
        steps = [replace(part, coefficients=left * part.coefficients) for part in step]
        watch("charges on the surfaces", k / len(NODES))
        if left * size <= accuracy.rtol / 4:
            break
    fitted, beside, alone = any(fits), None, len(tail)
    fits.clear()  # hundreds of megabytes, of which `beside` would keep a part
    doubts = {"discretisation": steps[:alone], "tail": tail, PIECES: pieces, CHARGES: steps[alone:]}
    polarized = tuple(one for one in carriers if one.polarization.any())
    table = RotorTable("surface", magnets, polarized, tuple(whole), doubts)
    # of hundreds of expansions it takes seconds to find what may be left out, where hardly anything may
    if not fitted or np.max(table.absolute_error(points)[0] / scale) < accuracy.rtol / 2:
        table = models.trimmed_table(table, accuracy, (points, scale), models.BETWEEN / 20, 1.0, FITTED)
    models.warn_beyond(table, accuracy, points, scale)
    return replace(table, provenance={"nodes": count, "seconds": time.perf_counter() - start})


def charged_expansion(surfaces: SurfaceCharges, number: int, charges: Array, degree: int) -> MultipoleExpansion:
    """Expansion, up to a degree, of `charges` (n,) T on one of the surfaces' magnets, about its centre."""
    body = surfaces.magnets[number].body
    (places, amounts), radius = surfaces.refined(number, charges), body.circumradius
    weights = amounts[:, None] / (FOUR_PI * radius**2)
    (sums,) = weighted_sums(degree, (places - body.center) / radius, weights)
    sums[0] = 0.0  # a magnet has no charge
    return MultipoleExpansion(body.center, radius, without_noise(np.conj(sums), 1e-15))
