"""A ladder of refinements, and the error that its last step tells.

From step to step the order of the elements, the layers at the edges, the quadrature, the curvature of the outer sphere
and the degree of its open boundary all grow, and the coefficients of the expansions converge geometrically. The
difference d_n of two rungs is the error of the lower one. With ρ the ratio of the last two differences where they are
largest, that of the upper one is d_n ρ/(1 - ρ), and ρ d_(n-1) may stand for d_n there. Both are kept as fields, to be
added, because elsewhere, far away above all, one of them may be small by chance.

A step in order cannot tell what the layers leave: about factor^(2λ) a layer, where the potential goes as r^λ at an edge
and λ falls from 1 to 2/3 as μ grows. From `STRONG` on there are more of them, so that this is small beside the step.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...geometry.basics import Array, Watch, unwatched
from ...geometry.bodies import Magnet
from ...geometry.meshes import MeshSettings
from ..harmonics import Coefficients, MultipoleExpansion
from .rotor_solution import Refinement, RotorSolution

LAYERS = {2: 1, 3: 1, 4: 2, 5: 2, 6: 2, 7: 3, 8: 3}
"""Layers at the edges by order of the elements."""
LAYERS_STRONG = {2: 1, 3: 2, 4: 3, 5: 3, 6: 4, 7: 4, 8: 4}
STRONG = 0.5
"""μ - 1 from which on edges need `LAYERS_STRONG`; with μr = 5, two layers leave 2.4e-6 of the dipole, three 1.4e-7."""
FIRST_RATE = 0.5
"""Ratio of two differences that is assumed before it is known; 0.1 to 0.3 were measured."""
DEARER = 2.3
"""How much longer an order takes than the one before it, about: for the progress."""
FASTEST_RATE, FASTEST_RATE_STRONG, SLOWEST_RATE = 0.1, 0.3, 0.75
SAFETY = 1.25
"""Factor on each of the two extrapolated differences."""


def strongest(magnets: Sequence[Magnet]) -> float:
    """Largest μ - 1 of magnets."""
    return max(magnet.contrast for magnet in magnets)


def refinement_of(order: int, settings: MeshSettings, contrast: float = 0.0) -> Refinement:
    """The refinement that belongs to an order of the elements and to the largest μ - 1 of the magnets."""
    layers = (LAYERS if contrast < STRONG else LAYERS_STRONG)[order] if settings.hp_layers else 0
    return Refinement(order, replace(settings, hp_layers=layers, curve_order=min(order + 1, 8)), 2 * order + 2)


def refined(
    solve: Callable[[int], RotorSolution],
    points: Array,
    scale: Array,
    target: float,
    settings: MeshSettings,
    watch: Watch = unwatched,
) -> tuple[RotorSolution, int, dict[str, list[MultipoleExpansion]]]:
    """The solution at the first order whose error is below the target.

    Parameters
    ----------
    solve : solution at an order
    points, scale : where (n, 3) m the error is looked at, and the field (n,) T to which it is relative
    settings : of the mesh, as given to `refinement_of`
    watch : hears of the progress, as far as the rate of convergence foretells it

    Returns
    -------
    The last solution, its order, and the two estimates of its error, to be added, as fields.
    """
    first, *others = LAYERS
    coarse, before, old = solve(first), np.inf, list[Coefficients]()
    for order in others:
        fine = solve(order)
        new = [b - a for a, b in zip(coarse.coefficients, fine.coefficients, strict=True)]
        field = sum(e.evaluate(points)[0] for e in fine.expansions(new))
        size = float(np.max(np.linalg.norm(field, axis=1) / scale))
        rate = _rate(size, before, _fastest(fine, order, settings))
        factor = SAFETY * rate / (1 - rate)
        earlier = [size / before * d for d in old] if old and before else new
        if 2 * factor * size <= target:
            break
        watch("orders of the elements", _finished(order, 2 * factor * size / target, rate))
        coarse, before, old = fine, size, new
    doubts = {"discretisation": new, "discretisation, earlier step": earlier}
    return fine, order, {cause: fine.expansions([factor * d for d in ds]) for cause, ds in doubts.items()}


def _finished(order: int, missed: float, rate: float) -> float:
    """Share of the work that orders up to this one are, if the error is still so many times too large."""
    last = min(order + max(1, int(np.ceil(np.log(missed) / -np.log(rate)))), max(LAYERS))
    return float((DEARER ** (order - 1) - 1) / (DEARER ** (last - 1) - 1))


def _fastest(solution: RotorSolution, order: int, settings: MeshSettings) -> float:
    """Rate that may be trusted: slow where layers at the edges lack, since orders then converge slowly later on."""
    contrast = strongest(solution.mesh.magnets)
    if solution.layers < refinement_of(order, settings, contrast).mesh.hp_layers:
        return FIRST_RATE
    return FASTEST_RATE if contrast < STRONG else FASTEST_RATE_STRONG


def _rate(size: float, before: float, fastest: float) -> float:
    """Ratio of the next difference to the last one."""
    if np.isinf(before):
        return FIRST_RATE
    return min(max(size / before, fastest) if before else 0.0, SLOWEST_RATE)
