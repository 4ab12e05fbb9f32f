"""The field of magnets anywhere: in gaps, at faces, inside the circumscribed spheres and in the magnets themselves.

    μ0 H = H0 - ∇ψ,        B = μ μ0 H + J in a magnet,  B = μ0 H outside,        μ0 M = B - μ0 H.

H0 is the closed form of the carriers, ψ of finite elements whose order grows until two of them agree.  The table of
the outer field (`RotorTable`) stays what the motion uses.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry.basics import Array, InputError, Part, edge_distance
from ...geometry.bodies import Magnet
from ...geometry.meshes import MeshSettings
from ..closed_forms import UniformField, carrier
from ..magnetostatics import RotorSolution, in_ball, potential_slopes, refinement_of, solve_rotor, strongest
from .accuracy import Accuracy
from .fem_model import fem_table
from .table import RotorTable

LOWEST, HIGHEST = 3, 8
"""Orders of the elements."""
CONTINUED = ("cuboid", "fem")
"""Models whose field is known inside the magnets, too."""
SPREAD = 2.0
"""Share of the root mean square of the last step that is added to it, whose zeros are not those of the error."""
ON_EDGE = 1e-7
"""Distance (m) from an edge below which the field counts as that on the edge."""


@dataclass(frozen=True, eq=False)
class NearField:
    """B, H and M at points.

    Parameters
    ----------
    flux_density : B (n, 3) T
    field : μ0 H (n, 3) T
    gradient : ∂B_i/∂x_j (n, 3, 3) T/m, of one side on a face
    error : estimated error (n,) of B and of μ0 H, T
    magnet : number of the magnet (n,) in which a point lies, -1 in air
    order : of the elements; 0 where none were needed
    """

    flux_density: Array
    field: Array
    gradient: Array
    error: Array
    magnet: NDArray[np.intp]
    order: int

    @property
    def magnetization(self) -> Array:
        """μ0 M (n, 3) T."""
        return self.flux_density - self.field


def field_anywhere(table: RotorTable, points: ArrayLike, rtol: float = 1e-4) -> NearField:
    """A table's field at points (n, 3) m, and where it does not reach that of `near_field`.

    A table of closed forms (μr = 1) is continued by them.

    Raises
    ------
    RangeError : the table is of another model, and does not reach a point
    InputError : a point lies on an edge
    """
    places = np.asarray(points, float).reshape(-1, 3)
    reached = table.in_range(places)
    if table.model not in CONTINUED or reached.all():
        flux, gradient = table.evaluate(places)
        return NearField(flux, flux, gradient, table.absolute_error(places)[0], np.full(len(places), -1), 0)
    magnets = table.magnets if table.model == "fem" else tuple(magnet.rigid for magnet in table.magnets)
    found = near_field(magnets, places[~reached], rtol)
    parts = [np.zeros((len(places), *np.shape(value)[1:])) for value in (found.field, found.gradient, found.error)]
    field, gradient, error = parts
    field[reached], gradient[reached] = table.evaluate(places[reached])
    error[reached] = table.absolute_error(places[reached])[0]
    flux, owner = field.copy(), np.full(len(places), -1)
    flux[~reached], field[~reached], gradient[~reached] = found.flux_density, found.field, found.gradient
    error[~reached], owner[~reached] = found.error, found.magnet
    return NearField(flux, field, gradient, error, owner, found.order)


def near_field(magnets: Sequence[Magnet], points: ArrayLike, rtol: float = 1e-4, highest: int = HIGHEST) -> NearField:
    """B, H and M anywhere but on the edges of magnets.

    Parameters
    ----------
    points : (n, 3) m, rotor's frame
    rtol : error of B asked for, relative to the largest remanence; the last step of the elements' order tells it
    highest : order of the elements that is not exceeded, even if `error` is larger then

    Raises
    ------
    InputError : a point lies on an edge, where the field is infinite
    """
    places = np.asarray(points, float).reshape(-1, 3)
    refuse_edges(magnets, places)
    carriers = [carrier(magnet) for magnet in magnets]
    rows = sum(UniformField(one).rows(np.ascontiguousarray(places.T)) for one in carriers if one.polarization.any())
    closed = np.zeros((12, len(places))) + rows
    field, slope = closed[:3].T, np.moveaxis(closed[3:].reshape(3, 3, -1), -1, 0)
    error, order = np.zeros(len(places)), 0
    if any(magnet.contrast or isinstance(magnet.body, Part) for magnet in magnets):
        reaction, steep, error, order = _reaction(tuple(magnets), carriers, places, rtol, highest)
        field, slope = field + reaction, slope + steep
    owner = owners(magnets, places)
    flux, gradient = field.copy(), slope.copy()
    for k, magnet in enumerate(magnets):
        mine, mu = owner == k, magnet.permeability_in_rotor
        flux[mine] = field[mine] @ mu + magnet.polarization_in_rotor
        gradient[mine] = mu @ slope[mine]
        error[mine] *= max(magnet.recoil_permeability, magnet.transverse_permeability or 1.0)
    return NearField(flux, field, gradient, error, owner, order)


def owners(magnets: Sequence[Magnet], points: Array) -> NDArray[np.intp]:
    """Number of the magnet (n,) in which points (n, 3) m lie, on the surface included; -1: none."""
    owner = np.full(len(points), -1)
    for k, magnet in enumerate(magnets):
        owner[(owner < 0) & (magnet.body.distance(points) <= 0)] = k
    return owner


def _reaction(
    magnets: tuple[Magnet, ...], carriers: Sequence[Magnet], points: Array, rtol: float, highest: int
) -> tuple[Array, Array, Array, int]:
    """-∇ψ (n, 3) T, its slope, its estimated error (n,) T, and the order of the elements."""
    allowed = rtol * max(float(np.linalg.norm(magnet.polarization)) for magnet in magnets)
    found, slope = np.zeros_like(points), np.zeros((len(points), 3, 3))
    error, before, order = np.zeros(len(points)), None, LOWEST
    settings = MeshSettings()
    inside = None
    for order in range(LOWEST, highest + 1):
        refinement = refinement_of(order, settings, strongest(magnets))
        solution: RotorSolution = solve_rotor(magnets, refinement, "split", 1, carriers=carriers)
        inside = in_ball(solution, points)
        if not inside.any():
            break
        first, second = potential_slopes(solution, points[inside])
        found[inside], slope[inside] = -first, -second
        if before is not None:
            step = np.linalg.norm(first - before, axis=1)
            error[inside] = step + SPREAD * float(np.sqrt(np.mean(step**2)))
            if error.max() <= allowed:
                break
        before = first
    outside = ~inside if inside is not None else np.ones(len(points), bool)
    if outside.any():
        table = fem_table(magnets, Accuracy(min(rtol, 1e-5)))
        part = [expansion.evaluate(points[outside]) for expansion in table.expansions]
        found[outside] = sum((b for b, _ in part), np.zeros((outside.sum(), 3)))
        slope[outside] = sum((g for _, g in part), np.zeros((outside.sum(), 3, 3)))
        error[outside] = table.absolute_error(points[outside])[0]
    return found, slope, error, order


def refuse_edges(magnets: Sequence[Magnet], points: Array) -> None:
    """Raises InputError where one of the points (n, 3) m lies on an edge of a magnet."""
    for k, magnet in enumerate(magnets):
        close = edge_distance(magnet.body, points)
        if len(points) and close.min() < ON_EDGE:
            where = ", ".join(f"{c * 1e3:.6g}" for c in points[int(np.argmin(close))])
            raise InputError(
                "Input points must not lie on an edge of a magnet, where the field is infinite; instead "
                f"({where}) mm is on one of magnet {k + 1}. Move the point by 0.001 mm or more."
            )
