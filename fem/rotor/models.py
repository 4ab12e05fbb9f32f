"""Tables of finite-element fields with a stated error.

What the elements add comes from a ladder of refinements, see `refined`, whose last two steps give the doubts of
the discretisation.
The closed part of the moments is exact; what is cut off the expansions is known and kept as the doubt "truncation".
"""

import importlib.metadata
import resource
import time
import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...geometry.basics import Array, Part, Watch, unwatched
from ...geometry.bodies import CONVERGENCE, Cells, Magnet, cells_of, cut_magnets, largest_shift
from ...geometry.meshes import MeshSettings
from ..closed_forms import carrier, closed_part
from ..harmonics import MultipoleExpansion, trimmed_expansions, without_noise
from ..magnetostatics import RotorSolution, refined, refinement_of, solve_rotor, strongest
from .accuracy import BETWEEN, Accuracy, error_points, guards
from .simple_models import part_doubts
from .table import KNOWN, RotorTable

HIGHEST_DEGREE = 44
BEFORE, WHOLE = 4, 0.6
"""Degrees before moments begin to fall; and those that a whole box needs beyond them, by those at which its moments are
surely small enough: at most 0.53 was measured, of cubes and two other boxes. Pieces need more, with moments from where
they are cut."""
LEAST = 1.05
"""Distance from the centre of a box, in circumradii, from which on its moments fall fast enough to be continued."""
BESIDE = 2.5
"""How much larger errors may be beside edges and corners, at the same distance from the magnet's centre."""
GAP_SAFETY = 20.0
"""Change of the reaction, relative to gap over edge, that a closed gap makes; 5 µm between 10 mm cubes need 17."""


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
    with an `AccuracyWarning`; its error estimate says how far it is off.  `watch` hears of the progress.
    """
    accuracy, settings, start = accuracy or Accuracy(), settings or MeshSettings(), time.perf_counter()
    cut = cut_magnets(magnets, accuracy.clearance(magnets), _least_ratio(magnets, accuracy.rtol))
    pieces = [piece for whole in cut for piece in whole]
    points, scale = error_points(magnets, accuracy.clearance(magnets))
    cells = [cells_of(piece.body, accuracy.clearance(magnets)) for piece in pieces]
    ratios = [_ratio(own, points) for own in cells]
    degree = _degree(pieces, ratios, accuracy.rtol)
    carriers = tuple(carrier(magnet) for magnet in magnets)
    closed, unsure = closed_part(cut, magnets, carriers, degree, cells)

    def reaction(order: int) -> RotorSolution:
        refinement = refinement_of(order, settings, strongest(magnets))
        return solve_rotor(magnets, refinement, "split", degree, cut, carriers=carriers, cells=cells)

    solution, order, steps = refined(reaction, points, scale, accuracy.rtol / 3, settings, watch)
    whole = solution.expansions(
        [without_noise(a + b, 1e-15) for a, b in zip(closed, solution.coefficients, strict=True)]
    )
    polarized = tuple(one for one in carriers if one.polarization.any())
    doubts = {
        **{cause: nonzero(step) for cause, step in steps.items()},
        "quadrature": nonzero(solution.expansions(unsure)),
        "tail": nonzero(extrapolated_tail(whole, min(ratios))),
        "gap": nonzero(gap_doubt(magnets, solution)),
        **part_doubts(magnets),
    }
    doubts = {cause: parts for cause, parts in doubts.items() if parts}
    rest = RotorTable("fem", magnets, polarized, (), doubts).absolute_error(points)[0]
    allowed = BETWEEN * np.maximum(scale * accuracy.rtol - rest, scale * accuracy.rtol / 20)
    beside, scale_beside = guards(magnets, accuracy.clearance(magnets))
    kept, dropped = trimmed_expansions(
        whole, np.concatenate([points, beside]), np.concatenate([allowed, BESIDE * accuracy.rtol * scale_beside])
    )
    if any(part.coefficients.any() for part in dropped):
        doubts[KNOWN] = nonzero(dropped)
    table = RotorTable("fem", magnets, polarized, nonzero(kept), doubts)
    reached = float(np.max(table.absolute_error(points)[0] / scale))
    if reached > accuracy.rtol:
        warnings.warn(
            f"The field's estimated error is {reached:.1e}, more than the {accuracy.rtol:.1e} asked for from "
            f"{accuracy.clearance(magnets) * 1e3:.3g} mm off the magnets' faces on.",
            AccuracyWarning,
            stacklevel=2,
        )
    return replace(table, provenance=provenance(solution, order, settings, reached, time.perf_counter() - start))


def _least_ratio(magnets: Sequence[Magnet], rtol: float) -> float:
    """Least distance from the centre of a box that stays whole, in circumradii, so that `HIGHEST_DEGREE` will do."""
    share = max(magnet.contrast for magnet in magnets)
    return float(np.clip((share / rtol) ** (WHOLE / (HIGHEST_DEGREE - BEFORE)), LEAST, CONVERGENCE)) if share else LEAST


def _ratio(cells: Cells, points: Array) -> float:
    """Least distance of points (n, 3) m from the nearest cell's centre, in radii."""
    return float(np.min(np.linalg.norm(points[:, None] - cells.centers, axis=2).min(axis=0) / cells.radii))


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


def gap_doubt(magnets: tuple[Magnet, ...], solution: RotorSolution) -> list[MultipoleExpansion]:
    """What the gaps that were closed for the mesh change: they are to the magnets as the error to the reaction."""
    smallest = min(float(magnet.box.size.min()) for magnet in magnets)
    factor = GAP_SAFETY * largest_shift(magnets) / smallest
    return solution.expansions([factor * c for c in solution.coefficients])


def provenance(
    solution: RotorSolution, order: int, settings: MeshSettings, reached: float, seconds: float
) -> dict[str, str | float]:
    """How a table was made."""
    return {
        "solver": "ngsolve " + importlib.metadata.version("ngsolve"),
        "mesher": "netgen-mesher " + importlib.metadata.version("netgen-mesher"),
        "mirror_planes": len(solution.mesh.planes),
        "elements": solution.mesh.elements,
        "order": order,
        "unknowns": solution.unknowns,
        "hp_layers": solution.layers,
        "ball_radius_mm": solution.mesh.ball_radius * solution.mesh.unit * 1e3,
        "error_estimate": reached,
        "seconds": seconds,
        "peak_memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
