"""Models of a rotor's field as tables: dipoles, moments, closed forms, finite elements; and what each leaves out."""

import importlib.metadata
import resource
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.common import MU_0, Array, InputError, Watch, even_directions, unwatched
from ...geometry.cutting import CONVERGENCE, cells_of, cut_magnets
from ...geometry.magnets import Magnet
from ...geometry.meshes.magnets import MeshSettings
from ...geometry.overlap import closing_shifts
from ...geometry.shapes import Sphere
from ...geometry.solids import Part, places_off
from ..closed_forms.moments import carrier, carriers_of, closed_part, first_order_moments, uniform_cells
from ..elements.ladder import RotorSolution, refined, refinement_of, solve_rotor, strongest
from ..harmonics.expansion import MOST, MultipoleExpansion, trimmed_expansions, uniform_moments, without_noise
from .table import KNOWN, RotorTable, nonzero

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
    # Distance from faces from which on `rtol` holds, m; None: 0.8 of the largest magnet's edge, if it were a cube
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
    """Points (n, 3) m at which errors are looked at, from `clearance` on outwards, and the scale (n,) of B (T) there.

    That is of the magnets' dipoles with their permeability, right to a few per cent, but at least a third of its median
    at like distances, and a share of what it would be without signs; 1 T if nothing is magnetised.
    """
    size = max(float(np.linalg.norm(m.box.corners - magnets[0].box.center, axis=1).max()) for m in magnets)
    points = [points_around(magnets, clearance + f * size, FARTHER if f else NEAR) for f in OFFSETS]
    shares = [min(CANCELLED + CANCELLED_FARTHER * f, CANCELLED_MOST) for f in OFFSETS]
    carriers = _carriers(magnets)  # which are their own: they are computed once
    scales = [typical_field(carriers, shell, share) for shell, share in zip(points, shares, strict=True)]
    return np.concatenate(points), np.concatenate(scales)


def points_around(magnets: tuple[Magnet, ...], offset: float, number: int = FARTHER) -> Array:
    """Points (n, 3) m at an `offset` (m) from the faces of `magnets`, in `number` directions of each, fewer of many."""
    directions = even_directions(max(number * FEW // max(len(magnets), FEW), LEAST_NUMBER))
    points = np.concatenate([places_off(magnet.body, directions, offset) for magnet in magnets])
    outside = np.all([magnet.body.distance(points) >= offset * (1 - 1e-6) for magnet in magnets], axis=0)
    return np.asarray(points[outside])


def typical_field(magnets: tuple[Magnet, ...], points: Array, share: float = CANCELLED) -> Array:
    """B (n,) T to which errors of `magnets` at `points` as far off are relative; `share`: of it without signs."""
    fields = [uniform_moments(magnet, 1).evaluate(points)[0] for magnet in _carriers(magnets)]
    field = np.linalg.norm(sum(fields), axis=1)
    least = np.maximum(np.median(field) / 3, share * sum(np.linalg.norm(one, axis=1) for one in fields))
    return np.maximum(field, least) if field.any() else np.ones(len(field))


def _carriers(magnets: tuple[Magnet, ...]) -> tuple[Magnet, ...]:
    """See `carriers_of`; parts as they are."""
    found = zip(magnets, carriers_of(magnets), strict=True)
    return tuple(magnet if isinstance(magnet.body, Part) else one for magnet, one in found)


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
    shapes = [uniform_moments(magnet, DEGREE) for magnet in rotor]
    for k, whole in enumerate(shapes):
        rest = np.where(np.arange(whole.degree + 1)[:, None] == 1, 0.0, whole.coefficients)
        shapes[k] = replace(whole, coefficients=rest)
    return _finished(RotorTable("dipole", rotor, (), dipoles, {"shape": shapes}), accuracy, start)


def moments_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """As many moments of the remanence about the magnets' pieces as the accuracy needs."""
    start = time.perf_counter()
    points, scale = error_points(rotor, accuracy.clearance(rotor))
    pieces = [piece for whole in _cut(rotor, accuracy) for piece in whole]
    full = [uniform_moments(piece, 2 * DEGREE - 1) for piece in pieces]
    apart = [np.linalg.norm(points - one.center, axis=1) > one.nearest for one in full]
    there = np.all(apart, axis=0)  # elsewhere, as in the hole of a ring, no number of moments makes the field
    kept, dropped = trimmed_expansions(full, points[there], scale[there] * accuracy.rtol / 2)
    return _finished(RotorTable("moments", rotor, (), tuple(kept), {KNOWN: dropped}), accuracy, start)


def cuboid_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """The closed form of the remanence; moments of parts, which have none."""
    start = time.perf_counter()
    known = tuple(magnet for magnet in rotor if not isinstance(magnet.body, Part))
    parts = [magnet for magnet in rotor if isinstance(magnet.body, Part)]
    moments = tuple(cell for magnet in parts for cell in uniform_cells(magnet, accuracy.clearance(rotor)))
    return _finished(RotorTable("cuboid", rotor, known, moments, {"part": part_doubts(rotor)}), accuracy, start)


def part_doubts(rotor: Rotor) -> list[MultipoleExpansion]:
    """What curved elements leave out of parts or add to them: a share of the dipole of each."""
    found = []
    for magnet in rotor:
        if isinstance(body := magnet.body, Part):
            ball = Sphere(body.circumradius, body.center, body.rotation)
            dipole = uniform_moments(Magnet(ball, magnet.polarization), 1)
            share = PART_ERROR * body.volume / ball.volume
            found.append(replace(dipole, coefficients=share * dipole.coefficients))
    return found


def _finished(table: RotorTable, accuracy: Accuracy, start: float) -> RotorTable:
    """With what the permeability adds, to first order, about every piece of the magnets that have one."""
    found, rotor = [], table.magnets
    for magnet, pieces in zip(rotor, _cut(rotor, accuracy), strict=True):
        factor = FIRST_ORDER_SAFETY * np.sqrt(1 + magnet.contrast)
        for piece in pieces if magnet.contrast else ():
            added = factor * first_order_moments(piece, rotor, DEGREE)
            found.append(MultipoleExpansion(piece.body.center, piece.body.circumradius, added))
    made = {"seconds": time.perf_counter() - start}
    return replace(table, doubts={**table.doubts, "permeability": found}, provenance=made)


def _cut(rotor: Rotor, accuracy: Accuracy) -> tuple[Rotor, ...]:
    """Pieces whose series converge as near as is asked, or as `NEAREST_OF_MODEL`: nearer by, thousands."""
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
    magnets: Rotor, accuracy: Accuracy | None = None, settings: MeshSettings | None = None, watch: Watch = unwatched
) -> RotorTable:
    """Field of permeable magnets: closed form of the remanence, and expansions of what is added to it.

    Orders from 2 to 8 are tried until the estimated error meets `accuracy`, by default 3e-6 from 0.8 edges on; if none
    does, with an `AccuracyWarning`. `magnets` are in the rotor's frame; `settings` are of the mesh; `watch` gets the
    progress.
    """
    accuracy, settings, start = accuracy or Accuracy(), settings or MeshSettings(), time.perf_counter()
    clearance = accuracy.clearance(magnets)
    cut = cut_magnets(magnets, clearance, least_ratio(magnets, accuracy.rtol))
    pieces = [piece for whole in cut for piece in whole]
    points, scale = error_points(magnets, clearance)
    cells = [cells_of(piece.body, clearance) for piece in pieces]
    # least distance of the points from the nearest cell's centre, in radii
    ratios = [float((np.linalg.norm(points[:, None] - own.centers, axis=2) / own.radii).min()) for own in cells]
    degree = enough_degree(pieces, ratios, accuracy.rtol)
    carriers = carriers_of(magnets)
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
        **steps,
        "quadrature": solution.expansions(unsure),
        "tail": extrapolated_tail(whole, min(ratios)),
        "gap": solution.expansions([gap * c for c in solution.coefficients]),
        "part": part_doubts(magnets),
    }
    polarized = tuple(one for one in carriers if one.polarization.any())
    table = RotorTable("fem", magnets, polarized, tuple(whole), doubts)
    table = trimmed_table(table, accuracy, (points, scale), BETWEEN / 20, 1.0)
    reached = warn_beyond(table, accuracy, points, scale)
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


def moment_error(magnets: Rotor, points: Array, scale: Array) -> float:
    """What leaving out the permeability does to B at `points` by `magnets`' moments alone, over `scale`, at most."""
    missing = np.zeros((len(points), 3))
    for magnet in magnets:
        if magnet.contrast and not isinstance(magnet.body, Part):
            change = replace(magnet, polarization=carrier(magnet).polarization - magnet.polarization).rigid
            missing += uniform_moments(change, 1).evaluate(points)[0]
    return float(np.max(np.linalg.norm(missing, axis=1) / scale))


def warn_beyond(table: RotorTable, accuracy: Accuracy, points: Array, scale: Array) -> float:
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
    """Points (n, 3) m nearer to edges than `clearance`, as far from a centre as faces' places, and B's scale there."""
    directions = np.random.default_rng(2).normal(size=(150, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    points = np.concatenate([m.box.center + (clearance + m.box.half_edges.max()) * directions for m in magnets])
    gaps = np.min([magnet.body.distance(points) for magnet in magnets], axis=0)
    points = points[(gaps >= clearance / 2) & (gaps < clearance)]
    return points, typical_field(magnets, points)


def trimmed_table(
    table: RotorTable, accuracy: Accuracy, looked_at: tuple[Array, Array], least: float, beside: float, most: int = MOST
) -> RotorTable:
    """The `table` without what its other doubts leave room for to `accuracy`; that is known, and a doubt of its own.

    It is `looked_at` at `error_points`. `least` and `beside` are shares of the tolerance that may be left out in any
    case, and next to edges; `most` is that of `trimmed_expansions`.
    """
    clearance, (points, scale) = accuracy.clearance(table.magnets), looked_at
    rest = table.absolute_error(points)[0]
    allowed = np.maximum(BETWEEN * (scale * accuracy.rtol - rest), least * scale * accuracy.rtol)
    # without points beside edges the fit, which need only hold at the others, would run wild there
    guards, scale_beside = _guards(table.magnets, clearance)
    allowed = np.concatenate([allowed, beside * BESIDE * accuracy.rtol * scale_beside])
    kept, dropped = trimmed_expansions(table.expansions, np.concatenate([points, guards]), allowed, most)
    doubts = {**table.doubts, KNOWN: (*table.doubts.get(KNOWN, ()), *dropped)}
    return replace(table, expansions=nonzero(kept), doubts=doubts)


def least_ratio(magnets: Sequence[Magnet], rtol: float) -> float:
    """Least distance from the centre of a box that stays whole, in circumradii, so that `HIGHEST_DEGREE` will do."""
    share = max(magnet.contrast for magnet in magnets)
    return float(np.clip((share / rtol) ** (WHOLE / (HIGHEST_DEGREE - BEFORE)), LEAST, CONVERGENCE)) if share else LEAST


def enough_degree(pieces: Sequence[Magnet], ratios: Sequence[float], rtol: float) -> int:
    """Degree at which what the permeability adds has surely fallen below the tolerance; 5 to `HIGHEST_DEGREE`."""
    needed = 5.0
    for piece, ratio in zip(pieces, ratios, strict=True):
        share = 1.0 if isinstance(piece.body, Part) else piece.contrast  # all of a part's field is in its moments
        if share:
            needed = max(needed, BEFORE + np.log(share / rtol) / np.log(ratio))
    return int(min(np.ceil(needed), HIGHEST_DEGREE))


def extrapolated_tail(expansions: Sequence[MultipoleExpansion], ratio: float = CONVERGENCE) -> list[MultipoleExpansion]:
    """What lies beyond the highest degree, geometrically; `ratio`: least distance from a centre, in radii."""
    found, faster = [], float(np.clip(ratio, LEAST, CONVERGENCE)) ** 2
    for expansion in expansions:
        last = np.array(expansion.coefficients)
        last[:-2] = 0.0
        found.append(MultipoleExpansion(expansion.center, expansion.radius, last / (faster - 1)))
    return found


def of_true_moment(rotor: Rotor, table: RotorTable) -> Rotor:
    """The `rotor`'s magnets with μr = 1, polarised so that each has the dipole moment that it has in a `table`."""
    found = []
    for magnet, moment in zip(rotor, replace(table, magnets=rotor).moments, strict=True):
        along = MU_0 / magnet.body.volume * magnet.body.rotation.T @ moment
        found.append(replace(magnet, polarization=along, recoil_permeability=1.0, transverse_permeability=None))
    return tuple(found)


# Share of the tolerance that what is left out may always have, even if the table itself does not meet it
AT_LEAST = 0.5


def shortened_table(table: RotorTable, accuracy: Accuracy) -> RotorTable:
    """The same field within `accuracy`, from its `nearest` on; what is left out is a known doubt of it."""
    if not table.expansions:
        return table
    points = error_points(table.magnets, accuracy.clearance(table.magnets))
    return trimmed_table(table, accuracy, points, AT_LEAST, AT_LEAST)
