"""How large a plate's finite-element problem may be, and what is said of one that is larger."""

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
from .eddy import EddyResponse, EddySpace, solve_eddy, solve_shifted

OPTION = "--plate-rtol (plate_rtol in Python, --rtol of the command plate)"
"""What messages call the tolerance of a plate."""
HIGHEST_ORDER = 5
MOST_UNKNOWNS = 80_000
"""Coupling unknowns that are solved at most: beyond, one frequency takes many minutes and several GB."""


class MeshTooLargeError(AccuracyError):
    """A mesh has more unknowns than are solved."""


def highest_order(cells: int) -> int:
    """The highest order, at most `HIGHEST_ORDER`, within `MOST_UNKNOWNS` on a mesh of so many hexahedra.

    Raises
    ------
    MeshTooLargeError : it is below 3
    """
    found = [p for p in range(3, HIGHEST_ORDER + 1) if cells * (3 * p * (p + 2) + 2 * p + 1) <= MOST_UNKNOWNS]
    if not found:
        raise MeshTooLargeError(
            f"Input mesh must have at most {MOST_UNKNOWNS} unknowns; instead one of {cells} cells has more. Lower the "
            "frequency, allow a larger error, or take the infinite slab (model slab), which has no such limit."
        )
    return found[-1]


def refusal(plate: Plate, frequency: float, rtol: float, best: float) -> str:
    """What to say where `best` is the smallest relative error reached; infinite if nothing was solved."""
    depth = 1e3 * skin_depth(plate.conductivity, frequency)
    if best < 1:
        return (
            f"Input rtol of the plate must be at least {best:.1e} at {frequency:g} Hz (skin depth {depth:.2g} mm); "
            f"instead received {rtol:.1e}."
        )
    return (
        f"Input frequency_hz must be lower for finite elements with {MOST_UNKNOWNS} unknowns: a skin depth of "
        f"{depth:.2g} mm is too small for this plate; instead received {frequency:g}. The infinite slab (model slab) "
        "has no such limit."
    )


LEAST_REDUCTION = 0.2
"""The smallest error reduction from one order to the next that is believed without having seen the next."""
BEST_REDUCTION = 0.03
"""More than an order ever gains: where even this for all orders left does not do, none of them is solved."""
STALLED = 0.6
"""A weaker reduction than this says that the mesh is too coarse for its order."""


@dataclass(frozen=True, eq=False)
class PlateReaction:
    """The plate's answer to dipoles at several places.

    Parameters
    ----------
    frequency : Hz
    positions : (n, 3) m, laboratory frame
    mutual : (n, 3, n, 3) T/(A m²): B at place i along a, from a moment at place j along b; laboratory frame
    error_estimate : (n,) estimated relative error of each own tensor (Frobenius norm), truncation included
    order, cells, coupling_unknowns : of the solution
    """

    frequency: float
    positions: Array
    mutual: ComplexArray
    error_estimate: Array
    order: int
    cells: int
    coupling_unknowns: int

    @property
    def tensors(self) -> ComplexArray:
        """G (n, 3, 3), T/(A m²): B = G m at the dipole's own place."""
        return np.asarray(np.einsum("iaib->iab", self.mutual))


def plate_reaction(
    plate: Plate,
    positions: ArrayLike,
    frequency: float,
    rtol: float = 1e-3,
    rule: MeshRule | None = None,
    refinements: int = 3,
) -> PlateReaction:
    """Reaction tensors of `plate` at `positions` (n, 3), m, and `frequency`, Hz, phasors e^{+iωt}.

    Parameters
    ----------
    plate : its box may have any pose; it is solved in its own frame
    positions : laboratory frame, outside the plate
    rtol : estimated relative error asked of every own tensor
    rule : first mesh
    refinements : how often the mesh may be refined

    Raises
    ------
    ValueError : a position inside the plate, a size, a conductivity or a frequency out of range
    AccuracyError : `rtol` not reached after all refinements of the mesh, or with `MOST_UNKNOWNS`
    """
    places = np.asarray(positions, float).reshape(-1, 3)
    body = plate.box.to_body(places)
    rule = rule or MeshRule()
    if frequency == 0:
        silent = np.zeros((len(places), 3, len(places), 3), complex)
        return PlateReaction(0.0, places, silent, np.zeros(len(places)), 0, 0, 0)
    best = np.inf
    for _ in range(refinements + 1):
        try:
            response, error = raise_order(plate, body, frequency, rtol, rule)
        except MeshTooLargeError:
            break
        best = min(best, float(error.max()))
        if best <= rtol:
            mutual = _to_laboratory(response.couplings, plate.box.rotation)
            cells = response.space.conductors.mesh.ne
            return PlateReaction(
                frequency, places, mutual, error, response.space.order, cells, response.coupling_unknowns
            )
        rule = rule.finer()
    raise AccuracyError(refusal(plate, frequency, rtol, best))


def raise_order(plate: Plate, body: Array, frequency: float, rtol: float, rule: MeshRule) -> tuple[EddyResponse, Array]:
    """The response of the lowest order that meets `rtol` on one mesh, or of the last that helped, and its errors.

    Raises
    ------
    MeshTooLargeError : not even order 3 is within `MOST_UNKNOWNS`
    """
    mesh = plate_mesh(plate.box.size, plate.conductivity, body, frequency, rule)
    highest = highest_order(mesh.mesh.ne)
    sources = unit_dipoles(body)
    response = solve_eddy(mesh, 1, frequency, sources)
    tensors, change = own_tensors(response.couplings), np.ones(len(body))
    error = change
    for order in range(2, highest + 1):
        response = solve_eddy(mesh, order, frequency, sources)
        previous, tensors = tensors, own_tensors(response.couplings)
        size = np.linalg.norm(tensors, axis=(1, 2))
        last, change = change, np.linalg.norm(tensors - previous, axis=(1, 2)) / size
        error = order_error(change, last) + truncation_error(response, rule.reach * plate.box.size.max()) / size
        hopeless = error.max() * BEST_REDUCTION ** (highest - order) > rtol
        if error.max() <= rtol or hopeless or (order > 2 and np.max(change / last) > STALLED):
            break
    return response, error


def order_error(change: Array, last: Array) -> Array:
    """Error left by an order, from its change of the tensors and that of the order before."""
    return np.asarray(change * np.clip(change / last, LEAST_REDUCTION, 1.0))


def own_tensors(couplings: ComplexArray) -> ComplexArray:
    """G (n, 3, 3), T/(A m²), from the couplings of `unit_dipoles`, each at its own place."""
    n = len(couplings) // 3
    return np.asarray(np.einsum("iaib->iab", couplings.reshape(n, 3, n, 3)))


def truncation_error(response: EddyResponse, reach: float) -> Array:
    """Error bound (n,) of the own tensors, T/(A m²): induced moment against the box of half edge `reach`, m."""
    induced = response.couplings_to([HomogeneousField(axis) for axis in np.eye(3)])
    moment = np.linalg.norm(induced.reshape(3, -1, 3), axis=(0, 2))
    return np.asarray(MU_0 / (2 * np.pi * reach**3) * moment**2)


def _to_laboratory(couplings: ComplexArray, rotation: Array) -> ComplexArray:
    n = len(couplings) // 3
    blocks = couplings.reshape(n, 3, n, 3)
    return np.asarray(np.einsum("ca,iajb,db->icjd", rotation, blocks, rotation, optimize=True))


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
