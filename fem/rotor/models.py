"""Models of a rotor's field as tables: dipoles, moments, closed forms, finite elements; and what each leaves out."""

import importlib.metadata
import resource
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from ...geometry.common import MU_0, Array, InputError, Watch, even_directions, unwatched
from ...geometry.cutting import CONVERGENCE, cells_of, cut_magnets
from ...geometry.magnets import Magnet
from ...geometry.meshes.magnets import MeshSettings
from ...geometry.overlap import closing_shifts
from ...geometry.shapes import Box, Sphere
from ...geometry.solids import Part, places_off
from ..closed_forms.moments import carrier, closed_part, first_order_moments, uniform_cells
from ..elements.ladder import RotorSolution, refined, refinement_of, solve_rotor, strongest
from ..elements.surface import SurfaceCharges, bears_charges, gap
from ..harmonics.expansion import (
    MOST,
    FittedExpansions,
    MultipoleExpansion,
    summed_derivatives,
    trimmed_expansions,
    uniform_moments,
    without_noise,
)
from ..harmonics.solid import FOUR_PI, weighted_sums
from .table import CHARGES, KNOWN, PIECES, RotorTable

# Errors are looked at this far out, beyond the nearest distance, in sizes of the rotor
OFFSETS = (0.0, 1.0, 3.0, 10.0, 100.0)
NEAR, FARTHER = 600, 150  # in how many directions; nearest by, what is left out of a series changes within 10°
# Share of what the magnets' fields would be without signs to which errors are relative where they cancel: next to the
# rotor, more by each of its sizes, and at most. Far from a rotor without a moment nothing is left of its field but what
# permeability does, and errors relative to that took minutes and gigabytes that no floater there would feel.
CANCELLED, CANCELLED_FARTHER, CANCELLED_MOST = 0.05, 0.03, 0.3
FEW, LEAST_NUMBER = 4, 40  # magnets whose directions are as many as that, and the fewest of one of many
BETWEEN = 0.8  # what may be left out, by what is allowed: between these places it is up to a fifth more than there
# Least distance from faces from which on a table is to be accurate, by the edge of the largest magnet, if it were a
# cube: a floater far smaller than the rotor floats as far away as a large one, and the number of pieces that are
# needed grows as the third power of the reciprocal
NEAREST = 0.25


class AccuracyError(InputError):
    """A tolerance below what can be reached; the message names it and the smallest that can."""


@dataclass(frozen=True)
class Accuracy:
    """Accuracy asked of a table, and from which distance on."""

    rtol: float = 3e-6  # relative error of B
    # Distance from the magnets' faces from which on `rtol` holds, m, `NEAREST` of the largest magnet's edge at least;
    # None: 0.8 of that edge, if it were a cube
    nearest: float | None = None

    def __post_init__(self) -> None:
        if not 0 < self.rtol < 1:
            raise ValueError(f"Input rtol must lie between 0 and 1; instead received {self.rtol}.")
        if self.nearest is not None and self.nearest <= 0:
            raise ValueError(f"Input nearest must be positive; instead received {self.nearest}.")

    def clearance(self, magnets: tuple[Magnet, ...]) -> float:
        """The distance from faces from which on `rtol` holds, m."""
        edge = float(max(magnet.body.volume for magnet in magnets) ** (1 / 3))
        return 0.8 * edge if self.nearest is None else max(self.nearest, NEAREST * edge)


def error_points(magnets: tuple[Magnet, ...], clearance: float) -> tuple[Array, Array]:
    """Points (n, 3) m at which errors are looked at, and the scale (n,) of B (T) there.

    They lie at a distance `clearance` from the magnets and farther out. The scale is that of the magnets' dipoles with
    their permeability, which is right to a few per cent, but at least a third of its median at like distances and
    a share of what it would be without signs, where fields cancel; 1 T if nothing is magnetised.
    """
    size = max(float(np.linalg.norm(m.box.corners - magnets[0].box.center, axis=1).max()) for m in magnets)
    points = [points_around(magnets, clearance + f * size, FARTHER if f else NEAR) for f in OFFSETS]
    shares = [min(CANCELLED + CANCELLED_FARTHER * f, CANCELLED_MOST) for f in OFFSETS]
    carriers = _carriers(magnets)  # which are their own: they are computed once
    scales = [typical_field(carriers, shell, share) for shell, share in zip(points, shares, strict=True)]
    return np.concatenate(points), np.concatenate(scales)


def points_around(magnets: tuple[Magnet, ...], offset: float, number: int = FARTHER) -> Array:
    """Points (n, 3) m at a distance `offset` (m) from the nearest of the `magnets`' faces.

    In `number` directions, of each of up to `FEW` magnets, and in fewer of more.
    """
    directions = even_directions(max(number * FEW // max(len(magnets), FEW), LEAST_NUMBER))
    points = np.concatenate([places_off(magnet.body, directions, offset) for magnet in magnets])
    outside = np.all([magnet.body.distance(points) >= offset * (1 - 1e-6) for magnet in magnets], axis=0)
    return np.asarray(points[outside])


def typical_field(magnets: tuple[Magnet, ...], points: Array, share: float = CANCELLED) -> Array:
    """B (n,) T to which errors at points (n, 3) m, all about as far away, are relative: see `error_points`.

    `share` is the least, of the field of all magnets without their signs.
    """
    fields = [uniform_moments(magnet, 1).evaluate(points)[0] for magnet in _carriers(magnets)]
    field = np.linalg.norm(sum(fields), axis=1)
    least = np.maximum(np.median(field) / 3, share * sum(np.linalg.norm(one, axis=1) for one in fields))
    return np.maximum(field, least) if field.any() else np.ones(len(field))


def _carriers(magnets: tuple[Magnet, ...]) -> tuple[Magnet, ...]:
    """See `carrier`; parts as they are."""
    return tuple(magnet if isinstance(magnet.body, Part) else carrier(magnet) for magnet in magnets)


DEGREE = 25  # degree up to which the part that a model leaves out is computed
PART_ERROR = 1e-8  # how exactly curved elements fill a part, relative to its dipole; seen: 4e-10 of a third of a ring
# Of the smallest edge of the magnets: distance from faces down to which series of what is left out converge
NEAREST_OF_MODEL = 1 / 8
# The first-order magnetisation is right to a few per cent at low degrees, to χ at high ones, for χ = μ - 1 ≤ 0.2
FIRST_ORDER_SAFETY = 1.1
Rotor = tuple[Magnet, ...]


def dipole_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """Moments J V/μ0 of the remanence at the magnets' centres."""
    start = time.perf_counter()
    dipoles = tuple(uniform_moments(magnet, 1) for magnet in rotor)
    shapes = []
    for magnet in rotor:
        whole = uniform_moments(magnet, DEGREE)
        rest = np.array(whole.coefficients)
        rest[1:2] = 0.0
        shapes.append(replace(whole, coefficients=rest))
    return _finished(RotorTable("dipole", rotor, (), dipoles, {"shape": tuple(shapes)}), accuracy, start)


def moments_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """As many moments of the remanence about the magnets' pieces as the accuracy needs."""
    start = time.perf_counter()
    points, scale = error_points(rotor, accuracy.clearance(rotor))
    pieces = [piece for whole in _cut(rotor, accuracy) for piece in whole]
    full = [uniform_moments(piece, 2 * DEGREE - 1) for piece in pieces]
    apart = [np.linalg.norm(points - one.center, axis=1) > one.nearest for one in full]
    there = np.all(apart, axis=0)  # elsewhere, as in the hole of a ring, no number of moments makes the field
    kept, dropped = trimmed_expansions(full, points[there], scale[there] * accuracy.rtol / 2)
    return _finished(RotorTable("moments", rotor, (), tuple(kept), {KNOWN: tuple(dropped)}), accuracy, start)


def cuboid_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """The closed form of the remanence; moments of parts, which have none."""
    start = time.perf_counter()
    known = tuple(magnet for magnet in rotor if not isinstance(magnet.body, Part))
    parts = [magnet for magnet in rotor if isinstance(magnet.body, Part)]
    moments = tuple(cell for magnet in parts for cell in uniform_cells(magnet, accuracy.clearance(rotor)))
    return _finished(RotorTable("cuboid", rotor, known, moments, part_doubts(rotor)), accuracy, start)


def part_doubts(rotor: Rotor) -> dict[str, tuple[MultipoleExpansion, ...]]:
    """What curved elements leave out of parts or add to them: a share of the dipole of each."""
    found = []
    for magnet in rotor:
        body = magnet.body
        if isinstance(body, Part):
            dipole = uniform_moments(
                Magnet(Sphere(body.circumradius, body.center, body.rotation), magnet.polarization), 1
            )
            share = PART_ERROR * body.volume / Sphere(body.circumradius).volume
            found.append(replace(dipole, coefficients=share * dipole.coefficients))
    return {"part": tuple(found)} if found else {}


def _finished(table: RotorTable, accuracy: Accuracy, start: float) -> RotorTable:
    doubts = {**table.doubts, "permeability": neglected_permeability(table.magnets, accuracy)}
    known = {cause: parts for cause, parts in doubts.items() if parts}
    return replace(table, doubts=known, provenance={"seconds": time.perf_counter() - start})


def neglected_permeability(rotor: Rotor, accuracy: Accuracy) -> tuple[MultipoleExpansion, ...]:
    """What the permeability adds, to first order, about every piece of the magnets that have one."""
    found = []
    for magnet, pieces in zip(rotor, _cut(rotor, accuracy), strict=True):
        factor = FIRST_ORDER_SAFETY * np.sqrt(1 + magnet.contrast)
        for piece in pieces if magnet.contrast else ():
            added = factor * first_order_moments(piece, rotor, DEGREE)
            found.append(MultipoleExpansion(piece.body.center, piece.body.circumradius, added))
    return tuple(found)


def _cut(rotor: Rotor, accuracy: Accuracy) -> tuple[Rotor, ...]:
    """Pieces whose series converge as near as is asked, or as `NEAREST` of an edge: nearer by they say too much.

    Their number grows with the cube of edge by distance: for a floater of 1 mm below a cube of 10 mm it was 2000, of
    which each keeps some 10 kB and takes tenths of a second.
    """
    edge = min(float(magnet.box.size.min()) for magnet in rotor)
    return cut_magnets(rotor, max(accuracy.clearance(rotor), NEAREST_OF_MODEL * edge))


HIGHEST_DEGREE = 44
# Degrees before moments begin to fall; and those that a whole box needs beyond them, by those at which its moments
# are surely small enough: at most 0.53 was measured, of cubes and two other boxes. Pieces need more, with moments
# from where they are cut.
BEFORE, WHOLE = 4, 0.6
# Distance from the centre of a box, in circumradii, from which on its moments fall fast enough to be continued
LEAST = 1.05
BESIDE = 2.5  # how much larger errors may be beside edges and corners, at the same distance from the magnet's centre
# Change of the reaction, relative to gap over edge, that a closed gap makes; 5 µm between 10 mm cubes need 17
GAP_SAFETY = 20.0


class AccuracyWarning(UserWarning):
    """A table does not reach the accuracy that was asked for."""


def fem_table(
    magnets: tuple[Magnet, ...],
    accuracy: Accuracy | None = None,
    settings: MeshSettings | None = None,
    watch: Watch = unwatched,
) -> RotorTable:
    """Field of magnets with recoil permeability: closed form of the remanence, and expansions of what is added to it.

    Orders from 2 to 8 are tried until the estimated error meets the accuracy. If none does, the last table is returned
    with an `AccuracyWarning`; its error estimate says how far it is off.

    Parameters
    ----------
    magnets : of the rotor, m and T in its frame
    accuracy : asked for; by default 3e-6 from 0.8 edges on
    settings : of the mesh
    watch : called with the progress
    """
    accuracy, settings, start = accuracy or Accuracy(), settings or MeshSettings(), time.perf_counter()
    clearance = accuracy.clearance(magnets)
    cut = cut_magnets(magnets, clearance, _least_ratio(magnets, accuracy.rtol))
    pieces = [piece for whole in cut for piece in whole]
    points, scale = error_points(magnets, clearance)
    cells = [cells_of(piece.body, clearance) for piece in pieces]
    # least distance of the points from the nearest cell's centre, in radii
    ratios = [
        float(np.min(np.linalg.norm(points[:, None] - own.centers, axis=2).min(axis=0) / own.radii)) for own in cells
    ]
    degree = _degree(pieces, ratios, accuracy.rtol)
    carriers = tuple(carrier(magnet) for magnet in magnets)
    closed, unsure = closed_part(cut, magnets, carriers, degree, cells)

    def reaction(order: int) -> RotorSolution:
        refinement = refinement_of(order, settings, strongest(magnets))
        return solve_rotor(magnets, refinement, "split", degree, cut, carriers=carriers, cells=cells)

    solution, order, steps = refined(reaction, points, scale, accuracy.rtol / 3, settings, watch)
    sums = [without_noise(a + b, 1e-15) for a, b in zip(closed, solution.coefficients, strict=True)]
    whole = solution.expansions(sums)
    # gaps that were closed for the mesh are to the magnets as their error to the reaction
    smallest = min(float(magnet.box.size.min()) for magnet in magnets)
    gap = GAP_SAFETY * float(np.linalg.norm(closing_shifts(magnets), axis=1).max()) / smallest
    doubts = {
        **{cause: nonzero(step) for cause, step in steps.items()},
        "quadrature": nonzero(solution.expansions(unsure)),
        "tail": nonzero(extrapolated_tail(whole, min(ratios))),
        "gap": nonzero(solution.expansions([gap * c for c in solution.coefficients])),
        **part_doubts(magnets),
    }
    polarized = tuple(one for one in carriers if one.polarization.any())
    table = RotorTable("fem", magnets, polarized, tuple(whole), {k: parts for k, parts in doubts.items() if parts})
    table = _trimmed(table, accuracy, (points, scale), BETWEEN / 20, 1.0)
    reached = _warn_beyond(table, accuracy, points, scale)
    mesh = solution.mesh
    made: dict[str, str | float] = {
        "solver": "ngsolve " + importlib.metadata.version("ngsolve"),
        "mesher": "netgen-mesher " + importlib.metadata.version("netgen-mesher"),
        "mirror_planes": len(mesh.planes),
        "elements": mesh.elements,
        "order": order,
        "unknowns": solution.unknowns,
        "hp_layers": solution.layers,
        "ball_radius_mm": mesh.ball_radius * mesh.unit * 1e3,
        "error_estimate": reached,
        "seconds": time.perf_counter() - start,
        "peak_memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    return replace(table, provenance=made)


NODES = (4, 6, 8, 10, 12, 14, 16, 20, 24)  # along an edge of a face, from coarse to fine
# Ratio of two steps of these that is assumed at first, and between which one is believed: a geometric series is left
FIRST_RATE, FASTEST_RATE, SLOWEST_RATE = 0.3, 0.25, 0.75
RATE_SAFETY = 2.0
CONTACT = 0.02  # gap, in edges, below which round bodies count as touching
LARGEST = 6e7  # numbers of the matrices that are kept, at most
FITTED = 40  # coefficients up to which a fit of them takes less than the charges
SOME = 5  # every so many places are looked at from step to step


# Beside a magnet where its moments do not converge: distances between expansions on its surface, by that at which the
# field is to hold; their degree and the most coefficients of all; nodes by their number, at least; points by
# coefficients of a fit, and others at which it is looked at; and what it may miss of the tolerance
SPACINGS, BESIDE_DEGREE, MOST_FITTED = (1.0, 0.8, 0.65, 0.5, 0.4), 2, 4000
DENSER, ROWS, OTHERS, MISSED = 12, 0.7, 1000, 0.2
# Nodes beside each other whose normals are mixed; and how much nearer than the clearance that may lead
BESIDE_EACH_OTHER, NEARER = 16, 0.9


def without_charges(magnets: Rotor, accuracy: Accuracy, points: Array) -> str:
    """Why charges on their surfaces do not describe the magnets; empty where they do.

    Parameters
    ----------
    magnets : of the rotor
    accuracy : asked of the table
    points : (n, 3) m at which it is to hold, as of `error_points`
    """
    permeable = [magnet for magnet in magnets if magnet.contrast]
    if any(isinstance(magnet.body, Part) for magnet in permeable):
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
        if 8 * magnet.body.area / (SPACINGS[0] * clearance) ** 2 > MOST_FITTED:
            return f"one is so large that too many pieces would make up its field {clearance * 1e3:.3g} mm off"
        if len(SurfaceCharges([magnet], NODES[1]).places) ** 2 > LARGEST:
            return "one is so long or flat that its charges would take too much memory"
    return ""


def _spread(points: Array, spacing: float, most: int) -> Array:
    """Some of the points (n, 3) m, all over where they are: no nearer to each other than a spacing (m), or the `most`."""
    chosen, farthest, apart = list[int](), 0, np.full(len(points), np.inf)
    while apart[farthest] > spacing and len(chosen) < most:
        chosen.append(farthest)
        apart = np.minimum(apart, np.linalg.norm(points - points[farthest], axis=1))
        farthest = int(np.argmax(apart))
    return np.asarray(points[chosen])


def _all_around(nodes: SurfaceCharges, clearance: float, seed: int) -> Array:
    """Points (n, 3) m at the clearance (m) from a magnet with `nodes`, about edges and corners and in holes, too."""
    generator, near = np.random.default_rng(seed), cKDTree(nodes.places).query(nodes.places, BESIDE_EACH_OTHER)[1]
    count = np.arange(len(near))
    # about an edge or a corner lie nodes of several faces
    shares = generator.dirichlet(np.ones(3), len(near))
    normals = [
        nodes.normals,
        *(nodes.normals[near[count, generator.integers(near.shape[1], size=len(near))]] for _ in "ab"),
    ]
    away = np.einsum("nk,kna->na", shares, normals)
    away /= np.maximum(np.linalg.norm(away, axis=1), np.finfo(float).tiny)[:, None]
    points = nodes.places + clearance * away
    return np.asarray(points[nodes.magnets[0].body.distance(points) >= NEARER * clearance])


def _fitted_beside(
    magnets: Rotor, accuracy: Accuracy, surfaces: SurfaceCharges, number: int, charges: Array
) -> tuple[FittedExpansions, float]:
    """Expansions on one of the `surfaces`' magnets, as many as its `charges` (n,) T need, and what they may miss.

    They are fitted to the field at the clearance from the magnet, and so are as exact outside. That is known from other
    places, in units of what the highest degree does.
    """
    magnet, clearance = surfaces.magnets[number], accuracy.clearance(magnets)
    most = DENSER * magnet.body.area / (SPACINGS[-1] * clearance) ** 2
    nodes = SurfaceCharges([magnet], int(np.ceil(4 * np.sqrt(most / len(SurfaceCharges([magnet], 4).places)))))
    around = _all_around(nodes, clearance, 3)

    def at(points: Array) -> tuple[Array, Array]:
        """What is allowed at points, and the field."""
        scale = typical_field(magnets, points)
        allowed = accuracy.rtol * np.minimum(scale, 2 * np.median(scale))
        return allowed, surfaces.field_beside(number, charges, points)

    elsewhere = _all_around(nodes, clearance, 4)
    elsewhere = elsewhere[:: 1 + len(elsewhere) // OTHERS]
    allowed, wanted = at(elsewhere)
    found = None
    for spacing in SPACINGS:
        centers = _spread(nodes.places, spacing * clearance, len(nodes.places))
        count = len(centers) * ((BESIDE_DEGREE + 1) ** 2 - 1)
        if found and count > MOST_FITTED:
            break
        points = _spread(around, 0.0, max(int(ROWS * count), NEAR))
        weights, field = at(points)
        fit = FittedExpansions(centers, np.full(len(centers), clearance / 3), BESIDE_DEGREE, points, weights)
        own, step = (summed_derivatives(parts, elsewhere, 1) for parts in fit.of(field))
        missed, most = (np.max(np.linalg.norm(b, axis=1) / allowed) for b in (own - wanted, step))
        found = fit, float(2 * missed / most)
        if missed <= MISSED:
            break
    assert found
    return found


def converging(magnets: Rotor, accuracy: Accuracy, points: Array) -> list[bool]:
    """Of each permeable magnet, whether its moments converge at all `points` (n, 3) m, as those of compact ones do."""
    least = _least_ratio(magnets, accuracy.rtol)
    return [ratio >= least for ratio in _ratios([magnet for magnet in magnets if magnet.contrast], points)]


def _ratios(magnets: Sequence[Magnet], points: Array) -> list[float]:
    """Least distance of points (n, 3) m from each magnet's centre, in circumradii."""
    bodies = [magnet.body for magnet in magnets]
    return [float(np.linalg.norm(points - body.center, axis=1).min()) / body.circumradius for body in bodies]


def moment_error(magnets: Rotor, points: Array, scale: Array) -> float:
    """What leaving out the permeability does to B by the moments alone, the largest over the points.

    Parameters
    ----------
    magnets : of the rotor; those from STEP files are left out
    points : (n, 3) m
    scale : (n,) T that errors are relative to
    """
    missing = np.zeros((len(points), 3))
    for magnet in magnets:
        if magnet.contrast and not isinstance(magnet.body, Part):
            change = replace(magnet, polarization=carrier(magnet).polarization - magnet.polarization).rigid
            missing += uniform_moments(change, 1).evaluate(points)[0]
    return float(np.max(np.linalg.norm(missing, axis=1) / scale))


def surface_table(magnets: Rotor, accuracy: Accuracy, watch: Watch = unwatched) -> RotorTable:
    """Field of magnets of one recoil permeability each: closed forms, and expansions of the charges on their surfaces.

    Nodes are added until the estimated error meets the accuracy. If no number of `NODES` that memory allows does so, as
    where faces that nearly touch lie across each other, the last table is returned with an `AccuracyWarning`.

    Parameters
    ----------
    magnets : cuboids, cylinders, rings and spheres, m and T in the rotor's frame
    accuracy : asked for
    watch : called with the progress

    Raises
    ------
    InputError : a magnet has two permeabilities, is a part from a file, or is far too large; or round ones touch
    """
    start = time.perf_counter()
    points, scale = error_points(magnets, accuracy.clearance(magnets))
    if reason := without_charges(magnets, accuracy, points):
        raise InputError(
            f'Input rotor must have magnets that charges on their surfaces describe, for the model "surface"; instead '
            f"{reason}. Choose --model fem."
        )
    carriers, permeable = tuple(carrier(magnet) for magnet in magnets), [m for m in magnets if m.contrast]
    converge = converging(magnets, accuracy, points)
    compact = [magnet for magnet, converges in zip(permeable, converge, strict=True) if converges]
    ratios = _ratios(compact, points)
    degree = _degree(compact, ratios, accuracy.rtol / 10)

    whole, steps, tail, pieces, before, count = *(list[MultipoleExpansion]() for _ in range(4)), np.inf, 0
    surfaces, fits = None, list[tuple[FittedExpansions, float] | None]()
    # the fewest nodes do not show what pieces of a magnet need
    for k, more in enumerate(NODES[len(compact) < len(permeable) :] if permeable else ()):
        if k > 1 and surfaces and surfaces.numbers_at(more) > LARGEST:
            break
        count, surfaces = more, SurfaceCharges(magnets, more)
        charges = surfaces.beyond(carriers)
        fits = fits or [
            None if converges else _fitted_beside(magnets, accuracy, surfaces, number, charges)
            for number, converges in enumerate(converge)
        ]
        single = [charged_expansion(surfaces, i, charges, degree) for i, one in enumerate(fits) if not one]
        tail = extrapolated_tail(single, min(ratios, default=CONVERGENCE))
        coarse, whole, pieces = whole, single, []
        for number, (fit, share) in ((i, one) for i, one in enumerate(fits) if one):
            own, last = fit.of(surfaces.field_beside(number, charges, fit.points))
            whole, pieces = whole + own, pieces + [replace(e, coefficients=share * e.coefficients) for e in last]
        if not k:
            continue
        step = [replace(b, coefficients=b.coefficients - a.coefficients) for a, b in zip(coarse, whole, strict=True)]
        missed = summed_derivatives(step, points[::SOME], 1)
        size = float(np.max(np.linalg.norm(missed, axis=1) / scale[::SOME]))
        rate = float(np.clip(size / before, FASTEST_RATE, SLOWEST_RATE)) if np.isfinite(before) else FIRST_RATE
        left, before = RATE_SAFETY * rate / (1 - rate), size
        steps = [replace(part, coefficients=left * part.coefficients) for part in step]
        watch("charges on the surfaces", k / len(NODES))
        if left * size <= accuracy.rtol / 4:
            break
    alone = len(tail)
    causes = {"discretisation": steps[:alone], "tail": tail, PIECES: pieces, CHARGES: steps[alone:]}
    known = {cause: parts for cause, some in causes.items() if (parts := nonzero(some))}
    polarized = tuple(one for one in carriers if one.polarization.any())
    table = RotorTable("surface", magnets, polarized, tuple(whole), known)
    table = _trimmed(table, accuracy, (points, scale), BETWEEN / 20, 1.0, FITTED)
    _warn_beyond(table, accuracy, points, scale)
    return replace(table, provenance={"nodes": count, "seconds": time.perf_counter() - start})


def charged_expansion(surfaces: SurfaceCharges, number: int, charges: Array, degree: int) -> MultipoleExpansion:
    """Expansion, up to a degree, of `charges` (n,) T on one of the surfaces' magnets, about its centre."""
    body = surfaces.magnets[number].body
    (places, amounts), radius = surfaces.refined(number, charges), body.circumradius
    weights = amounts[:, None] / (FOUR_PI * radius**2)
    (sums,) = weighted_sums(degree, (places - body.center) / radius, weights)
    sums[0] = 0.0  # a magnet has no charge
    return MultipoleExpansion(body.center, radius, without_noise(np.conj(sums), 1e-15))


def _warn_beyond(table: RotorTable, accuracy: Accuracy, points: Array, scale: Array) -> float:
    """Estimated error of a table at points (n, 3) m by their `scale` (n,) T; warns where it is more than was asked."""
    reached = float(np.max(table.absolute_error(points)[0] / scale))
    if reached > accuracy.rtol:
        warnings.warn(
            f"The field's estimated error is {reached:.1e}, more than the {accuracy.rtol:.1e} asked for from "
            f"{accuracy.clearance(table.magnets) * 1e3:.3g} mm off the magnets' faces on.",
            AccuracyWarning,
            stacklevel=3,
        )
    return reached


def _guards(magnets: tuple[Magnet, ...], clearance: float) -> tuple[Array, Array]:
    """Points (n, 3) m nearer to edges and corners than `clearance`, as far from a magnet's centre as its faces' places.

    With the scale (n,) of B (T) there.
    """
    directions = np.random.default_rng(2).normal(size=(150, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    points = np.concatenate([m.box.center + (clearance + m.box.half_edges.max()) * directions for m in magnets])
    gaps = np.min([magnet.body.distance(points) for magnet in magnets], axis=0)
    points = points[(gaps >= clearance / 2) & (gaps < clearance)]
    return points, typical_field(magnets, points)


def _trimmed(
    table: RotorTable,
    accuracy: Accuracy,
    looked_at: tuple[Array, Array],
    least: float,
    beside: float,
    most: int = MOST,
) -> RotorTable:
    """The table without what its other doubts leave room for; that is known, and a doubt of its own.

    It is `looked_at` at `error_points`. `least` is the share of the tolerance that may be left out even if the table
    itself does not meet it, `beside` that of `BESIDE` next to edges; `most` is that of `trimmed_expansions`.
    """
    clearance, (points, scale) = accuracy.clearance(table.magnets), looked_at
    rest = table.absolute_error(points)[0]
    allowed = np.maximum(BETWEEN * (scale * accuracy.rtol - rest), least * scale * accuracy.rtol)
    # without points beside edges the fit, which need only hold at the others, would run wild there
    guards, scale_beside = _guards(table.magnets, clearance)
    kept, dropped = trimmed_expansions(
        table.expansions,
        np.concatenate([points, guards]),
        np.concatenate([allowed, beside * BESIDE * accuracy.rtol * scale_beside]),
        most,
    )
    known = (*table.doubts.get(KNOWN, ()), *nonzero(dropped))
    return replace(table, expansions=nonzero(kept), doubts={**table.doubts, **({KNOWN: known} if known else {})})


def _least_ratio(magnets: Sequence[Magnet], rtol: float) -> float:
    """Least distance from the centre of a box that stays whole, in circumradii, so that `HIGHEST_DEGREE` will do."""
    share = max(magnet.contrast for magnet in magnets)
    return float(np.clip((share / rtol) ** (WHOLE / (HIGHEST_DEGREE - BEFORE)), LEAST, CONVERGENCE)) if share else LEAST


def _degree(pieces: Sequence[Magnet], ratios: Sequence[float], rtol: float) -> int:
    """Degree at which what the permeability adds has surely fallen below the tolerance; 5 to `HIGHEST_DEGREE`."""
    needed = 5.0
    for piece, ratio in zip(pieces, ratios, strict=True):
        share = 1.0 if isinstance(piece.body, Part) else piece.contrast  # all of a part's field is in its moments
        if share:
            needed = max(needed, BEFORE + np.log(share / rtol) / np.log(ratio))
    return int(min(np.ceil(needed), HIGHEST_DEGREE))


def nonzero(expansions: Sequence[MultipoleExpansion]) -> tuple[MultipoleExpansion, ...]:
    """Those of the expansions that are not zero."""
    return tuple(expansion for expansion in expansions if expansion.coefficients.any())


def extrapolated_tail(expansions: Sequence[MultipoleExpansion], ratio: float = CONVERGENCE) -> list[MultipoleExpansion]:
    """What lies beyond the highest degree: the last two degrees, continued as a geometric series.

    `ratio` is the least distance from a centre, in radii; beyond `CONVERGENCE` it counts as that.
    """
    found, faster = [], float(np.clip(ratio, LEAST, CONVERGENCE)) ** 2
    for expansion in expansions:
        last = np.array(expansion.coefficients)
        last[:-2] = 0.0
        found.append(MultipoleExpansion(expansion.center, expansion.radius, last / (faster - 1)))
    return found


def of_true_moment(rotor: Rotor, table: RotorTable) -> Rotor:
    """The `rotor`'s magnets with μr = 1, polarised so that each has the dipole moment that it has in a `table`."""
    parts = [(magnet.body.center, magnet.moment) for magnet in table.uniform]
    parts += [(expansion.center, expansion.moment) for expansion in table.expansions]
    centers = np.array([center for center, _ in parts])
    owners = np.argmin([magnet.body.distance(centers) for magnet in rotor], axis=0)
    found = []
    for k, magnet in enumerate(rotor):
        moment = sum((m for (_, m), owner in zip(parts, owners, strict=True) if owner == k), np.zeros(3))
        along = MU_0 / magnet.body.volume * magnet.body.rotation.T @ moment
        found.append(replace(magnet, polarization=along, recoil_permeability=1.0, transverse_permeability=None))
    return tuple(found)


# Share of the tolerance that what is left out may always have, even if the table itself does not meet it
AT_LEAST = 0.5


def shortened_table(table: RotorTable, accuracy: Accuracy) -> RotorTable:
    """The same field within `accuracy.rtol` from `accuracy.nearest` off the magnets' faces on.

    What is left out is known and a doubt of the new table, which still says how wrong it is, nearer too.  A table
    without expansions stays as it is.
    """
    if not table.expansions:
        return table
    return _trimmed(table, accuracy, error_points(table.magnets, accuracy.clearance(table.magnets)), AT_LEAST, AT_LEAST)
