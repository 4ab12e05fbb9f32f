"""Orders of the finite elements until a tolerance is met, and the reaction of a plate at single places so found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import MU_0, Array, Watch, unwatched
from ...geometry.meshes.plate import MeshRule, plate_mesh, skin_depth
from ...geometry.scene.contents import Plate
from ..closed_forms.eddy_sphere import ComplexArray
from ..closed_forms.potentials import HomogeneousField, unit_dipoles
from ..rotor.models import AccuracyError
from .eddy import EddySpace, solve_eddy, solve_shifted
from .table import OPTION

HIGHEST_ORDER = 5
# Coupling unknowns that are solved at most: beyond, one frequency takes many minutes and several GB.
MOST_UNKNOWNS = 80_000
# The smallest error reduction from one order to the next that is believed without having seen the next.
LEAST_REDUCTION = 0.2
# More than an order ever gains: where even this for all orders left does not do, none of them is solved.
BEST_REDUCTION = 0.03
STALLED = 0.6  # A weaker reduction than this says that the mesh is too coarse for its order
MESH_SHARE = 0.6  # Share of a table's tolerance for the finite elements
MODULUS = 2.0  # Most that |s/(1 + sτ)|² can grow from s = ω to s = iω, whatever the time constant τ


class MeshTooLargeError(AccuracyError):
    """A mesh has more unknowns than are solved."""


class Ladder:
    """Orders of the finite elements on one mesh, one after the other, and the estimated error of each.

    What an order leaves is at most its change of a tensor times the reduction of that change against the order before;
    the truncation of the air comes on top.

    Parameters
    ----------
    places : (n, 3) m, of the dipoles whose own tensors are compared, plate's frame
    frequency : Hz
    rule, allowed : mesh, and relative error
    growing : compare fields that grow as e^{ωt} instead of phasors: half the memory, a quarter of the work
    watch : progress callback

    Raises
    ------
    MeshTooLargeError : not even order 3 is within `MOST_UNKNOWNS`
    """

    def __init__(
        self,
        plate: Plate,
        places: Array,
        frequency: float,
        rule: MeshRule,
        allowed: float,
        growing: bool = False,
        watch: Watch = unwatched,
    ) -> None:
        self.mesh = plate_mesh(plate.box.size, plate.conductivity, places, frequency, rule)
        cells = int(self.mesh.mesh.ne)
        orders = [p for p in range(3, HIGHEST_ORDER + 1) if cells * (3 * p * (p + 2) + 2 * p + 1) <= MOST_UNKNOWNS]
        if not orders:
            raise MeshTooLargeError(
                f"Input mesh must have at most {MOST_UNKNOWNS} unknowns; instead one of {cells} cells has more. Lower "
                "the frequency, allow a larger error, or take the infinite slab (model slab), which has no such limit."
            )
        self.highest = orders[-1]
        self.places, self.frequency, self.allowed, self.growing, self.watch = places, frequency, allowed, growing, watch
        self.reach = rule.reach * float(plate.box.size.max())
        self.order, self.unknowns, self.errors = 0, 0, np.full(len(places), np.inf)
        self.change = self.last = self.size = np.ones(len(places))
        self.truncation = np.zeros(len(places))
        self.tensors: ComplexArray = np.zeros((len(places), 3, 3), complex)
        self.climb()

    @property
    def error(self) -> float:
        return float(self.errors.max())

    def next_space(self) -> EddySpace:
        return EddySpace(self.mesh, self.order + 1)

    def climb(self) -> None:
        """Solve for the dipoles at the next order."""
        self.watch(f"error at order {self.order + 1}", 0.0)
        space, dipoles = self.next_space(), unit_dipoles(self.places)
        if self.growing:
            response = solve_shifted(space, 2 * np.pi * self.frequency, dipoles)
        else:
            response = solve_eddy(self.mesh, space.order, self.frequency, dipoles, space)
        induced = response.couplings_to([HomogeneousField(axis) for axis in np.eye(3)])
        moment = np.linalg.norm(induced.reshape(3, -1, 3), axis=(0, 2))
        # The induced moment against its image in the box of half edge `reach`.
        bound = MU_0 / (2 * np.pi * self.reach**3) * moment**2
        self.truncation = np.asarray((MODULUS if self.growing else 1.0) * bound)
        self.unknowns = response.coupling_unknowns
        self.take(response.couplings)

    def take(self, couplings: ComplexArray) -> None:
        """Take the dipoles' couplings at the next order, which need not come from `climb`."""
        previous, n = self.tensors, len(self.places)
        self.tensors = np.asarray(np.einsum("iaib->iab", couplings.reshape(n, 3, n, 3)))
        self.order += 1
        if self.order > 1:
            self.size = np.linalg.norm(self.tensors, axis=(1, 2))
            self.last, self.change = self.change, np.linalg.norm(self.tensors - previous, axis=(1, 2)) / self.size
            self.errors = self._left(self.change, self.change / self.last)

    def expected(self) -> float:
        """Error of the next order, if it helps as the last did; nothing is expected of the first two."""
        if self.order < 2 or self.error <= self.allowed:
            return np.inf if self.order < 2 else 0.0
        reduction = self.change / self.last
        return float(np.max(self._left(self.change * reduction, reduction)))

    def _left(self, change: Array, reduction: Array) -> Array:
        return np.asarray(change * np.clip(reduction, LEAST_REDUCTION, 1.0) + self.truncation / self.size)

    @property
    def hopeless(self) -> bool:
        """Whether higher orders on this mesh will not do."""
        out_of_reach = self.error * BEST_REDUCTION ** (self.highest - self.order) > self.allowed
        stalled = self.order > 2 and float(np.max(self.change / self.last)) > STALLED
        return self.order > 1 and self.error > self.allowed and (out_of_reach or stalled)

    def refuse(self) -> None:
        """Go on only where that can help. Raises AccuracyError: the mesh is too coarse."""
        if self.hopeless:
            raise AccuracyError(
                f"Input {OPTION} must be at least {self.error / MESH_SHARE:.2g} for the finite elements of this plate; "
                f"instead received {self.allowed / MESH_SHARE:g}. Ask for less, or take another model of it."
            )


@dataclass(frozen=True, eq=False)
class PlateReaction:
    """Reaction tensors of a plate, for dipoles at several places."""

    tensors: ComplexArray  # (n, 3, 3) T/(A m²): B = G m at the dipole's own place; laboratory frame
    error_estimate: Array  # (n,) estimated relative error of each (Frobenius norm), truncation included
    order: int = 0  # of the solution
    cells: int = 0
    coupling_unknowns: int = 0


def plate_reaction(
    plate: Plate,
    positions: ArrayLike,
    frequency: float,
    rtol: float = 1e-3,
    rule: MeshRule | None = None,
    refinements: int = 3,
) -> PlateReaction:
    """Reaction tensors of `plate` at `positions` (n, 3), m, and `frequency`, Hz, phasors e^{+iωt}.

    Raises ValueError: a position inside the plate, a size, a conductivity or a frequency out of range; AccuracyError:
    `rtol` not reached after all refinements of the mesh, or with `MOST_UNKNOWNS`.

    Parameters
    ----------
    plate : its box may have any pose; it is solved in its own frame
    positions : laboratory frame, outside the plate
    rtol : estimated relative error asked of every own tensor
    rule : first mesh
    refinements : how often the mesh may be refined
    """
    places = np.asarray(positions, float).reshape(-1, 3)
    if frequency == 0:
        return PlateReaction(np.zeros((len(places), 3, 3), complex), np.zeros(len(places)))
    body, rule, turn, best = plate.box.to_body(places), rule or MeshRule(), plate.box.rotation, np.inf
    for _ in range(refinements + 1):
        try:
            ladder = Ladder(plate, body, frequency, rule, rtol)
        except MeshTooLargeError:
            break
        while ladder.error > rtol and not ladder.hopeless:
            ladder.climb()
        best = min(best, ladder.error)
        if best <= rtol:
            cells = int(ladder.mesh.mesh.ne)
            return PlateReaction(turn @ ladder.tensors @ turn.T, ladder.errors, ladder.order, cells, ladder.unknowns)
        rule = rule.finer()
    depth = 1e3 * skin_depth(plate.conductivity, frequency)
    if best < 1:
        raise AccuracyError(
            f"Input rtol of the plate must be at least {best:.1e} at {frequency:g} Hz (skin depth {depth:.2g} mm); "
            f"instead received {rtol:.1e}."
        )
    raise AccuracyError(
        f"Input frequency_hz must be lower for finite elements with {MOST_UNKNOWNS} unknowns: a skin depth of "
        f"{depth:.2g} mm is too small for this plate; instead received {frequency:g}. The infinite slab (model slab) "
        "has no such limit."
    )
