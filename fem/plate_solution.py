"""The currents of a plate for dipoles in some boxes, by finite elements to a wanted accuracy: the expensive part.

The order is raised as in `plate`; an order that is expected to do is not solved for the sake of its error alone, but
the currents are trained on it at once, and its error follows from their network.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.box import Array
from ..geometry.plate_mesh import MeshRule, plate_mesh
from ..geometry.scene import Plate
from .accuracy_error import AccuracyError
from .current_space import CurrentSpace, space_couplings
from .current_training import SourceSet, train
from .eddy import solve_eddy
from .eddy_space import EddySpace
from .phasor import ComplexArray
from .plate import BEST_REDUCTION, STALLED, order_error, own_tensors, truncation_error
from .plate_limits import highest_order
from .plate_region import Region
from .plate_training import OtherSources, grid_counts, probe_places
from .sources import unit_dipoles

MESH_SHARE, SPACE_SHARE = 0.6, 0.1
"""Shares of the tolerance for the finite elements, and for what the current space misses of their currents."""
STRICT = 5e-4
"""Tolerances below this have a finer mesh."""
HOPEFUL = 1.5
"""An order whose expected error is at most so many times what is allowed is trained at once."""


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
) -> PlateSolution:
    """Currents for dipoles in `boxes` and for `others`, at all frequencies between the two (Hz).

    Raises
    ------
    ValueError : a box touches the plate
    AccuracyError : the mesh is too coarse for `rtol`
    """
    start = time.perf_counter()
    others = others or OtherSources()
    rule = rule or (MeshRule() if rtol >= STRICT else MeshRule(1.0, 1.6, 1.4))
    half = plate.box.half_edges
    corners = np.concatenate([*(box.grid((2, 2, 2), fold=True) for box in boxes), others.places])
    ladder = Ladder(plate, corners, frequencies[1], rule, MESH_SHARE * rtol)
    training = SourceSet(
        np.concatenate([box.grid(grid_counts(box, half), fold=True) for box in boxes]), others.training
    )
    probes = SourceSet(np.concatenate([probe_places(box, fold=True) for box in boxes]), others.probes)
    allowed = SPACE_SHARE * rtol
    while True:
        if ladder.expected() <= HOPEFUL * ladder.allowed or ladder.order + 1 == ladder.highest:
            space, missing = train(ladder.next_space(), training, probes, frequencies, allowed)
            couplings = space_couplings(space.dipole_couplings(corners), space.inductances, 2 * np.pi * frequencies[1])
            ladder.climb(couplings)
            if ladder.error <= ladder.allowed:
                break
        else:
            ladder.climb(ladder.solved())
        ladder.refuse()
    return PlateSolution(
        tuple(boxes), frequencies, space, ladder.error, missing.worst, probes.places, missing.angular_frequencies,
        missing.residuals[:, : 3 * len(probes.places), : 3 * len(probes.places)], time.perf_counter() - start,
    )  # fmt: skip


class Ladder:
    """Orders of the finite elements on one mesh, one after the other, and the error of each.

    Parameters
    ----------
    corners : (n, 3) m, places of the dipoles whose tensors are compared, plate's frame
    frequency : Hz
    allowed : relative error
    """

    def __init__(self, plate: Plate, corners: Array, frequency: float, rule: MeshRule, allowed: float) -> None:
        self.mesh = plate_mesh(plate.box.size, plate.conductivity, corners, frequency, rule)
        self.highest = highest_order(self.mesh.mesh.ne)
        self.corners, self.frequency, self.rule, self.allowed = corners, frequency, rule, allowed
        self.reach = rule.reach * float(plate.box.size.max())
        self.order, self.error, self.change, self.truncation = 0, np.inf, np.ones(len(corners)), np.zeros(len(corners))
        self.last = self.change
        self.tensors: ComplexArray = np.zeros((len(corners), 3, 3), complex)
        self.climb(self.solved())

    def next_space(self) -> EddySpace:
        """Of the next order."""
        return EddySpace(self.mesh, self.order + 1)

    def solved(self) -> ComplexArray:
        """Couplings of the corners' dipoles at the next order."""
        response = solve_eddy(self.mesh, self.order + 1, self.frequency, unit_dipoles(self.corners))
        self.truncation = truncation_error(response, self.reach)
        return response.couplings

    def climb(self, couplings: ComplexArray) -> None:
        """Take the next order's couplings."""
        tensors = own_tensors(couplings)
        self.order += 1
        if self.order > 1:
            size = np.linalg.norm(tensors, axis=(1, 2))
            self.last, self.change = self.change, np.linalg.norm(tensors - self.tensors, axis=(1, 2)) / size
            self.error = float(np.max(order_error(self.change, self.last) + self.truncation / size))
        self.tensors = tensors

    def expected(self) -> float:
        """Error of the next order, if it helps as the last did; nothing is expected of the first two."""
        if self.order < 2 or self.error <= self.allowed:
            return np.inf if self.order < 2 else 0.0
        reduction = self.change / self.last
        return float(np.max(order_error(self.change * reduction, self.change)))

    def refuse(self) -> None:
        """Go on only where that can help.

        Raises
        ------
        AccuracyError : the mesh is too coarse
        """
        hopeless = self.error * BEST_REDUCTION ** (self.highest - self.order) > self.allowed
        stalled = self.order > 2 and float(np.max(self.change / self.last)) > STALLED
        if self.order > 1 and (hopeless or stalled) and self.error > self.allowed:
            raise AccuracyError(
                f"Input rtol must be at least {self.error / MESH_SHARE:.1e} for the mesh rule {self.rule}; instead "
                f"received {self.allowed / MESH_SHARE:.1e}."
            )
