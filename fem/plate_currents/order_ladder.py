"""Orders of a plate's finite elements, one after the other, until the error of reaction tensors is small enough.

Orders are compared at the real shift s = ω, where a solution is a quarter of the work: there they converge
monotonically (Ritz), and elements miss about as much as at iω (of a plate of 100 × 240 × 30 mm, 250 Hz, order 2 changes
4.7 per cent of order 1's tensors at iω and 5.2 at ω).
"""

from __future__ import annotations

import numpy as np

from ...geometry.basics import Array, Watch, unwatched
from ...geometry.meshes import MeshRule, plate_mesh
from ...geometry.scenes import Plate
from ..closed_forms import ComplexArray, unit_dipoles
from ..eddy_currents import EddySpace, solve_shifted
from ..rotor_tables import AccuracyError
from .limits import OPTION, highest_order
from .reaction import BEST_REDUCTION, STALLED, order_error, own_tensors, truncation_error

MESH_SHARE = 0.6
"""Share of the tolerance for the finite elements."""
MODULUS = 2.0
"""Most that |s/(1 + sτ)|² can grow from s = ω to s = iω, whatever the time constant τ."""


class Ladder:
    """Orders of the finite elements on one mesh, one after the other, and the error of each.

    Parameters
    ----------
    corners : (n, 3) m, places of the dipoles whose tensors are compared, plate's frame
    frequency : Hz
    allowed : relative error
    watch : hears of the progress
    """

    def __init__(
        self, plate: Plate, corners: Array, frequency: float, rule: MeshRule, allowed: float, watch: Watch = unwatched
    ) -> None:
        self.mesh = plate_mesh(plate.box.size, plate.conductivity, corners, frequency, rule)
        self.highest = highest_order(self.mesh.mesh.ne)
        self.corners, self.shift, self.allowed = corners, 2 * np.pi * frequency, allowed
        self.watch = watch
        self.reach = rule.reach * float(plate.box.size.max())
        self.order, self.error, self.change, self.truncation = 0, np.inf, np.ones(len(corners)), np.zeros(len(corners))
        self.last = self.change
        self.tensors: ComplexArray = np.zeros((len(corners), 3, 3), complex)
        self.take(self.solved())

    def next_space(self) -> EddySpace:
        """Of the next order."""
        return EddySpace(self.mesh, self.order + 1)

    def solved(self) -> ComplexArray:
        """Couplings of the corners' dipoles at the next order and the shift s."""
        self.watch(f"error at order {self.order + 1}", 0.0)
        response = solve_shifted(self.next_space(), self.shift, unit_dipoles(self.corners))
        self.truncation = MODULUS * truncation_error(response, self.reach)
        return response.couplings

    def take(self, couplings: ComplexArray) -> None:
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
        size = np.linalg.norm(self.tensors, axis=(1, 2))
        return float(np.max(order_error(self.change * reduction, self.change) + self.truncation / size))

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
                f"Input {OPTION} must be at least {self.error / MESH_SHARE:.2g} for the finite elements of this plate; "
                f"instead received {self.allowed / MESH_SHARE:g}. Ask for less, or take another model of it."
            )
