"""Tables of finite-element fields with a stated error, from a ladder of refinements.

From rung to rung the order of the elements, the layers at the edges, the quadrature, the curvature of the outer sphere
and the degree of its open boundary all grow, and the coefficients of the expansions converge geometrically. The
difference of two rungs is the error of the lower one; times ρ/(1 - ρ), with ρ the ratio of the last two differences, it
is that of the upper one, and it is kept as a field: the doubt "discretisation". The closed part of the moments is
exact; what is cut off the expansions is known and kept as the doubt "truncation".
"""

from __future__ import annotations

import importlib.metadata
import resource
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..geometry.box import Array
from ..geometry.gaps import largest_shift
from ..geometry.magnet import Magnet
from ..geometry.mesh import MeshSettings
from ..geometry.pieces import CONVERGENCE, cut_magnets
from .accuracy import Accuracy, guards, places
from .carrier import carrier
from .closed_part import closed_part
from .multipole import MultipoleExpansion, without_noise
from .rotor_solution import Refinement, RotorSolution, solve_rotor
from .table import KNOWN, RotorTable
from .trim import trimmed

RUNGS = (2, 3, 4, 5, 6, 7, 8)
"""Orders of the elements."""
FIRST_RATE = 0.5
"""Ratio of two differences that is assumed before it is known; 0.1 to 0.3 were measured."""
FASTEST_RATE, SLOWEST_RATE = 0.1, 0.75
FASTEST_RATE_STRONG, STRONG = 0.3, 0.5
"""For μ - 1 from 0.5 on: the singularity at edges is so strong there that the layers, not the orders, set the pace."""
SAFETY = 2.5
"""Factor on the extrapolated difference."""
HIGHEST_DEGREE = 44
BESIDE = 2.5
"""How much larger errors may be beside edges and corners, at the same distance from the magnet's centre."""
GAP_SAFETY = 20.0
"""Change of the reaction, relative to gap over edge, that a closed gap makes; 5 µm between 10 mm cubes need 17."""


class AccuracyWarning(UserWarning):
    """A table does not reach the accuracy that was asked for."""


def rung(order: int, settings: MeshSettings) -> Refinement:
    """The refinement that belongs to an order: layers at the edges 1 (orders 2, 3), 2 (to 6), 3 (7, 8)."""
    layers = 1 if order < 4 else 2 if order < 7 else 3
    mesh = replace(settings, hp_layers=layers if settings.hp_layers else 0, curve_order=min(order + 1, 8))
    return Refinement(order, mesh, 2 * order + 2)


def fem_table(
    magnets: tuple[Magnet, ...],
    accuracy: Accuracy | None = None,
    settings: MeshSettings | None = None,
    use_symmetry: bool = True,
) -> RotorTable:
    """Field of magnets with recoil permeability: closed form of the remanence, and expansions of what is added to it.

    Orders from 2 to 8 are tried until the estimated error meets the accuracy. If none does, the last table is returned
    with an `AccuracyWarning`; its error estimate says how far it is off.
    """
    accuracy, settings, start = accuracy or Accuracy(), settings or MeshSettings(), time.perf_counter()
    cut = cut_magnets(magnets, accuracy.clearance(magnets))
    pieces = [piece for whole in cut for piece in whole]
    points, scale = places(magnets, accuracy.clearance(magnets))
    degree = _degree(pieces, points, accuracy.rtol)
    carriers = tuple(carrier(magnet) for magnet in magnets)
    closed, unsure = closed_part(cut, magnets, carriers, degree)

    def reaction(order: int) -> RotorSolution:
        return solve_rotor(magnets, rung(order, settings), "split", degree, cut, use_symmetry, carriers)

    solution, order, doubt = climb(reaction, points, scale, accuracy.rtol / 3, settings)
    whole = solution.expansions(
        [without_noise(a + b, 1e-15) for a, b in zip(closed, solution.coefficients, strict=True)]
    )
    doubts = {
        "discretisation": used(doubt),
        "quadrature": used(solution.expansions(unsure)),
        "tail": used(tail(whole)),
        "gap": used(gap_doubt(magnets, solution)),
    }
    doubts = {cause: parts for cause, parts in doubts.items() if parts}
    rest = RotorTable("fem", magnets, carriers, (), doubts).absolute_error(points)[0]
    allowed = 0.99 * np.maximum(scale * accuracy.rtol - rest, scale * accuracy.rtol / 20)
    beside, scale_beside = guards(magnets, accuracy.clearance(magnets))
    kept, dropped = trimmed(
        whole, np.concatenate([points, beside]), np.concatenate([allowed, BESIDE * accuracy.rtol * scale_beside])
    )
    if any(part.coefficients.any() for part in dropped):
        doubts[KNOWN] = used(dropped)
    table = RotorTable("fem", magnets, carriers, used(kept), doubts)
    reached = float(np.max(table.absolute_error(points)[0] / scale))
    if reached > accuracy.rtol:
        warnings.warn(
            f"The field's estimated error is {reached:.1e}, more than the {accuracy.rtol:.1e} asked for from "
            f"{accuracy.clearance(magnets) * 1e3:.3g} mm off the magnets' faces on.",
            AccuracyWarning,
            stacklevel=2,
        )
    return replace(table, provenance=provenance(solution, order, settings, reached, time.perf_counter() - start))


def climb(
    solve: Callable[[int], RotorSolution], points: Array, scale: Array, target: float, settings: MeshSettings
) -> tuple[RotorSolution, int, list[MultipoleExpansion]]:
    """Climb the ladder until the error is below the target.

    Parameters
    ----------
    solve : solution at an order
    points, scale : where (n, 3) m the error is looked at, and the field (n,) T to which it is relative
    settings : of the mesh, as given to `rung`

    Returns
    -------
    The last solution, its order, and the estimated error of its field.
    """
    coarse, before = solve(RUNGS[0]), np.inf
    for order in RUNGS[1:]:
        fine = solve(order)
        difference = [b - a for a, b in zip(coarse.coefficients, fine.coefficients, strict=True)]
        field = sum(e.evaluate(points)[0] for e in fine.expansions(difference))
        size = float(np.max(np.linalg.norm(field, axis=1) / scale))
        rate = _rate(size, before, _fastest(fine, rung(order, settings)))
        factor = SAFETY * rate / (1 - rate)
        if factor * size <= target:
            break
        coarse, before = fine, size
    return fine, order, fine.expansions([factor * d for d in difference])


def _fastest(solution: RotorSolution, wanted: Refinement) -> float:
    """Rate that may be trusted: slow where layers at the edges lack, since orders then converge slowly later on."""
    if solution.layers < wanted.mesh.hp_layers:
        return FIRST_RATE
    contrast = max(magnet.contrast for magnet in solution.mesh.magnets)
    return FASTEST_RATE if contrast < STRONG else FASTEST_RATE_STRONG


def _rate(size: float, before: float, fastest: float) -> float:
    """Ratio of the next difference to the last one."""
    if np.isinf(before):
        return FIRST_RATE
    return min(max(size / before, fastest) if before else 0.0, SLOWEST_RATE)


def _degree(pieces: Sequence[Magnet], points: Array, rtol: float) -> int:
    """Degree at which what the permeability adds has surely fallen below the tolerance; 5 to `HIGHEST_DEGREE`."""
    needed = 5.0
    for piece in pieces:
        ratio = np.linalg.norm(points - piece.box.center, axis=1).min() / piece.box.circumradius
        if piece.contrast:
            needed = max(needed, 4 + np.log(piece.contrast / rtol) / np.log(ratio))
    return int(min(np.ceil(needed), HIGHEST_DEGREE))


def used(expansions: Sequence[MultipoleExpansion]) -> tuple[MultipoleExpansion, ...]:
    """Those of the expansions that are not zero."""
    return tuple(expansion for expansion in expansions if expansion.coefficients.any())


def tail(expansions: Sequence[MultipoleExpansion]) -> list[MultipoleExpansion]:
    """What lies beyond the highest degree: the last two degrees, continued as a geometric series."""
    found = []
    for expansion in expansions:
        last = np.array(expansion.coefficients)
        last[:-2] = 0.0
        found.append(MultipoleExpansion(expansion.center, expansion.radius, last / (CONVERGENCE**2 - 1)))
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
