"""The currents of a plate for dipoles in some boxes, by finite elements to a wanted accuracy: the expensive part.

The order is raised as in `plate`; an order that is expected to do is not solved for the sake of its error alone, but
the currents are trained on it at once, and its error follows from their network.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array, Watch, unwatched
from ...geometry.meshes import MeshRule
from ...geometry.scenes import Plate
from ..closed_forms import ComplexArray
from .current_space import CurrentSpace, space_couplings
from .current_training import train
from .order_ladder import MESH_SHARE, Ladder
from .region import Region
from .sources import OtherSources, SourceSet, grid_counts, probe_places

SPACE_SHARE = 0.1
"""Share of the tolerance for what the current space misses of the finite elements' currents."""
STRICT, LOOSE = 5e-4, 2e-3
"""Tolerances below the first have a finer mesh, from the second on a coarser one with less air: its truncation takes a
part of them."""
HOPEFUL, KEPT = 1.5, 1.1
"""An order whose expected error is at most so many times what is allowed is trained at once; once trained it is kept
with an error of the second times that: the next takes three times as long, and a few more states make up for it."""


@dataclass(frozen=True, eq=False)
class PlateSolution:
    """Currents of a plate in many states, for all dipoles in some boxes.

    Parameters
    ----------
    boxes : in the plate's frame
    frequencies : lowest and highest, Hz
    space : the states
    mesh_error : estimated relative error of reaction tensors by the finite elements
    space_error : bound of that by missing states, and of the error of the others' fields
    probes : (n, 3) m, places in the boxes that were not trained
    angular_frequencies : (k,) rad/s
    residuals : (k, 3n, 3n) products of the residuals ρ of unit moments at the probes, whose norms bound the errors of
        their fields (`shift_basis`)
    seconds : time spent
    """

    boxes: tuple[Region, ...]
    frequencies: tuple[float, float]
    space: CurrentSpace
    mesh_error: float
    space_error: float
    probes: Array
    angular_frequencies: Array
    residuals: ComplexArray
    seconds: float


def solve_currents(
    plate: Plate,
    boxes: Sequence[Region],
    frequencies: tuple[float, float],
    rtol: float,
    rule: MeshRule | None = None,
    others: OtherSources | None = None,
    watch: Watch = unwatched,
) -> PlateSolution:
    """Currents for dipoles in `boxes` and for `others`, at all frequencies between the two (Hz).

    Raises
    ------
    ValueError : a box touches the plate
    AccuracyError : the mesh is too coarse for `rtol`
    """
    start = time.perf_counter()
    others = others or OtherSources()
    rule = rule or mesh_rule(rtol)
    half = plate.box.half_edges
    corners = np.concatenate([*(box.grid((2, 2, 2), fold=True) for box in boxes), others.places])
    ladder = Ladder(plate, corners, frequencies[1], rule, MESH_SHARE * rtol, watch)
    training = SourceSet(
        np.concatenate([box.grid(grid_counts(box, half), fold=True) for box in boxes]), others.training
    )
    probes = SourceSet(np.concatenate([probe_places(box, fold=True) for box in boxes]), others.probes)
    allowed = SPACE_SHARE * rtol
    while True:
        if ladder.expected() <= HOPEFUL * ladder.allowed or ladder.order + 1 == ladder.highest:
            space, missing = train(ladder.next_space(), training, probes, frequencies, allowed, watch)
            couplings = space_couplings(space.dipole_couplings(corners), space.inductances, ladder.shift)
            ladder.take(couplings)
            if ladder.error <= KEPT * ladder.allowed:
                break
        else:
            ladder.take(ladder.solved())
        ladder.refuse()
    return PlateSolution(
        tuple(boxes), frequencies, space, ladder.error, missing.worst, probes.places, missing.angular_frequencies,
        missing.residuals[:, : 3 * len(probes.places), : 3 * len(probes.places)], time.perf_counter() - start,
    )  # fmt: skip


def mesh_rule(rtol: float) -> MeshRule:
    """Mesh that has been found to need the least work for a tolerance."""
    if rtol < STRICT:
        return MeshRule(1.0, 1.6, 1.4)
    return MeshRule(1.2, 3.0, 2.5, 4.0) if rtol >= LOOSE else MeshRule()
