"""Reaction of a box-shaped plate in any pose to dipoles, by finite elements to a wanted accuracy.

The order is raised on one mesh until the estimated error meets the tolerance; where raising it does not help, the
mesh is too coarse and is refined.  With d_p the change of G from order p-1 to p, the error left at order p is
estimated as d_p times the last observed reduction d_p/d_(p-1), taken as at least a fifth.  To it comes the
truncation: a sphere of radius R without normal field answers a moment with the uniform field μ0 m/(2πR³), which acts
on the plate's induced moment α m, so that G is off by up to |α|² μ0/(2πR³), with R the half edge of the air box.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import MU_0, Array
from ...geometry.meshes import MeshRule, plate_mesh
from ...geometry.scenes import Plate
from ..closed_forms import ComplexArray, HomogeneousField, unit_dipoles
from ..eddy_currents import EddyResponse, solve_eddy
from ..rotor_tables import AccuracyError
from .limits import MeshTooLargeError, highest_order, refusal

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
