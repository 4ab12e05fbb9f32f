"""What permeability adds to the field in and next to magnets: finite elements of growing order, kept once solved."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import Array, InputError
from ...geometry.cutting import CONVERGENCE
from ...geometry.magnets import Magnet
from ...geometry.meshes.magnets import MeshSettings
from ...geometry.solids import Part, Solid
from ..closed_forms.moments import carriers_of
from ..closed_forms.uniform import UniformField
from ..elements.ladder import RotorSolution, in_ball, potential_slopes, refinement_of, solve_rotor, strongest
from .models import Accuracy, fem_table
from .table import RotorTable, keeps_shape

LOWEST = 3  # order of the elements at first
# At the edges; one more with every order up to here, as a step between equal layers does not tell what they leave
MOST_LAYERS = 5
SLOWEST = 0.3  # least ratio of two steps that is believed
# Share of the root mean square of the last step that is added to it, whose zeros are not those of the error
SPREAD = 2.0
# Distance from a face, in edges of a cube of the magnet's volume, from which on the mesh finds the side of a place: at
# order 6 it took one that was 0.34 µm inside a cube of 10 mm, 3.4e-5, for one outside; 1 µm inside it did not
BESIDE_FACE = 5e-4
OUTSIDE = 1e-5  # relative accuracy of what lies outside the ball of the elements


class NearElements:
    """Finite elements of `magnets`, of any order that is asked for; closed forms of `carriers` are split off."""

    def __init__(self, magnets: Sequence[Magnet]) -> None:
        self.magnets = tuple(magnets)
        self.carriers = carriers_of(magnets)
        self._solution = cache(self._solved)
        self._outside = cache(lambda rtol: fem_table(self.magnets, Accuracy(rtol)))

    def reaction(self, points: Array, allowed: float, highest: int) -> tuple[Array, Array, Array, Array, int]:
        """-∇ψ, what the permeability adds to the carriers' μ0 H.

        The field (n, 3) T, its slope (n, 3, 3) T/m, the estimated errors (n,) of both, and the order of the elements, 0
        where none were needed, at `points` (n, 3) m. An order is taken that agrees with the one before to `allowed`
        (T), or the `highest`.
        """
        field, slope, error, steep = (np.zeros((len(points), *shape)) for shape in ((3,), (3, 3), (), ()))
        order = 0
        if not len(points) or not any(one.contrast or isinstance(one.body, Part) for one in self.magnets):
            return field, slope, error, steep, order
        inside = in_ball(self._solution(LOWEST), points)
        if inside.any():
            first, second, error[inside], steep[inside], order = self._climbed(points[inside], allowed, highest)
            field[inside], slope[inside] = -first, -second
        if not inside.all():  # the expansions of a table of the outer field
            largest = largest_remanence(self.magnets)
            rtol = min(allowed / largest, OUTSIDE) if largest else OUTSIDE
            table, places = self._outside(rtol), points[~inside]
            for expansion in table.expansions:
                outer, its_slope = expansion.evaluate(places)
                field[~inside] += outer
                slope[~inside] += its_slope
            error[~inside], steep[~inside] = table.absolute_error(places)
        return field, slope, error, steep, order

    def _solved(self, order: int) -> RotorSolution:
        refinement = refinement_of(order, MeshSettings(), strongest(self.magnets))
        if not any(isinstance(magnet.body, Part) for magnet in self.magnets):
            layers = max(refinement.mesh.hp_layers, min(order - LOWEST + 1, MOST_LAYERS))
            refinement = replace(refinement, mesh=replace(refinement.mesh, hp_layers=layers))
        return solve_rotor(self.magnets, refinement, "split", 1, carriers=self.carriers)

    def _climbed(self, points: Array, allowed: float, highest: int) -> tuple[Array, Array, Array, Array, int]:
        beside, steps, order = self._off_faces(points), np.zeros((2, len(points))), LOWEST
        errors = np.full(steps.shape, np.inf)
        first, second = potential_slopes(self._solution(LOWEST), points, beside)
        while order < highest and errors[0].max() > allowed:
            before, order = (first, second), order + 1
            first, second = potential_slopes(self._solution(order), points, beside)
            # a step that is small by chance does not tell the error: the one before it has a say
            sizes = np.linalg.norm(first - before[0], axis=1), np.linalg.norm(second - before[1], axis=(1, 2))
            steps = np.maximum(sizes, SLOWEST * steps)
            errors = steps + SPREAD * np.sqrt(np.mean(steps**2, axis=1))[:, None]
        return first, second, errors[0], errors[1], order

    def _off_faces(self, points: Array) -> Array:
        """Points (n, 3) m, those next to a magnet's face moved away from it on their side."""
        moved = points.copy()
        for magnet in self.magnets:
            apart = BESIDE_FACE * magnet.body.volume ** (1 / 3)
            depth = magnet.body.distance(points)
            near = np.abs(depth) < apart
            way = np.where(depth[near] < 0, -apart, apart) - depth[near]
            moved[near] += way[:, None] * _normals(magnet.body, points[near])
        astray = owners(self.magnets, moved) != owners(self.magnets, points)  # across a gap narrower than that
        moved[astray] = points[astray]
        return moved


HIGHEST = 8  # order of the elements
NEAR_RTOL = 1e-4  # error of B asked for, relative to the largest remanence
CONTINUED = ("cuboid", "surface", "fem")  # models whose field is known inside the magnets, too
ON_EDGE = 1e-7  # distance (m) from an edge below which the field counts as that on the edge
OFF_FACE = 1e-10  # distance (m) from a face below which a point counts as just outside of it


@dataclass(frozen=True, eq=False)
class NearField:
    """B, H and M at points."""

    flux_density: Array  # B (n, 3) T
    field: Array  # μ0 H (n, 3) T
    gradient: Array  # ∂B_i/∂x_j (n, 3, 3) T/m, of one side on a face
    error: Array  # estimated error (n,) of B and of μ0 H, T
    gradient_error: Array  # estimated error (n,) of the gradient (Frobenius norm), T/m
    magnet: NDArray[np.intp]  # number of the magnet (n,) in which a point lies, -1 in air and on faces
    order: int  # of the elements; 0 where none were needed

    @property
    def magnetization(self) -> Array:
        """μ0 M (n, 3) T."""
        return self.flux_density - self.field


def near_field(
    magnets: Sequence[Magnet],
    points: ArrayLike,
    rtol: float = NEAR_RTOL,
    highest: int = HIGHEST,
    elements: NearElements | None = None,
) -> NearField:
    """B, H and M at `points` (n, 3) m anywhere but on the edges of magnets; on a face, those just outside.

    `rtol` is the error of B asked for, relative to the largest remanence, by the last step of the elements' order, at
    most the `highest`. `elements` are those of the `magnets`, if some are solved already. Raises InputError: a point on
    an edge.
    """
    places = np.asarray(points, float).reshape(-1, 3)
    refuse_edges(magnets, places)
    given, places = places, places.copy()
    for magnet in magnets:  # H jumps at a face: points on it are moved out
        on = np.abs(magnet.body.distance(given)) < OFF_FACE
        if on.any():
            places[on] += OFF_FACE * _normals(magnet.body, given[on])
    solved = elements or NearElements(magnets)
    closed = [UniformField(one).evaluate(places) for one in solved.carriers if one.polarization.any()]
    field, slope, error, steep, order = solved.reaction(places, rtol * largest_remanence(magnets), highest)
    owner = owners(magnets, places)
    for outer, outer_slope in closed:
        field, slope = field + outer, slope + outer_slope
    flux, gradient = field.copy(), slope.copy()
    for k, magnet in enumerate(magnets):
        mine, mu = owner == k, magnet.permeability_in_rotor
        flux[mine] = field[mine] @ mu + magnet.polarization_in_rotor
        gradient[mine] = mu @ slope[mine]
        for doubt in (error, steep):
            doubt[mine] *= max(magnet.recoil_permeability, magnet.transverse_permeability or 1.0)
    return NearField(flux, field, gradient, error, steep, owner, order)


def _normals(body: Solid, points: Array) -> Array:
    """Gradients (n, 3) of the distance from a body's surface at points (n, 3) m."""
    steps = ON_EDGE / 2 * np.eye(3)
    return np.transpose([body.distance(points + s) - body.distance(points - s) for s in steps]) / ON_EDGE


def largest_remanence(magnets: Sequence[Magnet]) -> float:
    """The largest |J|, T."""
    return max((float(np.linalg.norm(magnet.polarization)) for magnet in magnets), default=0.0)


def owners(magnets: Sequence[Magnet], points: Array) -> NDArray[np.intp]:
    """Number of the magnet (n,) in which points (n, 3) m lie; -1: none."""
    owner = np.full(len(points), -1)
    for k, magnet in enumerate(magnets):
        owner[(owner < 0) & (magnet.body.distance(points) < -OFF_FACE / 2)] = k
    return owner


def refuse_edges(magnets: Sequence[Magnet], points: Array) -> None:
    """Raises InputError where one of the points (n, 3) m lies on an edge of a magnet."""
    for k, magnet in enumerate(magnets):
        close = magnet.body.edge_distance(points)
        if len(points) and close.min() < ON_EDGE:
            where = ", ".join(f"{c * 1e3:.6g}" for c in points[int(np.argmin(close))])
            raise InputError(
                "Input points must not lie on an edge of a magnet, where the field is infinite; instead "
                f"({where}) mm is on one of magnet {k + 1}. Move the point by 0.001 mm or more."
            )


@dataclass(frozen=True, eq=False, repr=False)
class CompleteTable(RotorTable):
    """A table of closed forms or finite elements that knows the field everywhere but on edges; made by `complete`.

    Where the outer field does not reach, or series leave more than `near_rtol` of B by the largest remanence,
    `near_field` continues it, by elements that are solved when first asked for. The motion's expressions are those of
    the outer field.
    """

    near_rtol: float = NEAR_RTOL

    @cached_property
    def _elements(self) -> NearElements:
        """Of the magnets whose field is the table's: those of closed forms have μr = 1."""
        return NearElements(self.magnets if self.model != "cuboid" else [magnet.rigid for magnet in self.magnets])

    def fields(self, points: ArrayLike) -> NearField:
        """B, H, M and the gradient at points (n, 3) m, with their errors. Raises InputError on edges."""
        places = np.asarray(points, float).reshape(-1, 3)
        refuse_edges(self.magnets, places)
        reached, count = self.in_range(places), len(places)
        slow = self._slow_series(places[reached])
        flux, gradient, error, steep = (np.zeros((count, *shape)) for shape in ((3,), (3, 3), (), ()))
        error[reached], steep[reached] = slow * super().absolute_error(places[reached])
        reached[reached] = (slow == 1) | (error[reached] <= self.near_rtol * largest_remanence(self.magnets))
        flux[reached], gradient[reached] = super().evaluate(places[reached])
        field, owner, order = flux.copy(), np.full(count, -1), 0
        if not reached.all():
            rest, elements = ~reached, self._elements
            near = near_field(elements.magnets, places[rest], self.near_rtol, elements=elements)
            flux[rest], field[rest], gradient[rest] = near.flux_density, near.field, near.gradient
            error[rest], steep[rest], order = near.error, near.gradient_error, near.order
            owner = owners(self.magnets, places)
        return NearField(flux, field, gradient, error, steep, owner, order)

    @keeps_shape
    def evaluate(self, places: Array) -> tuple[Array, Array]:
        """`RotorTable.evaluate`, in magnets, too. Raises InputError: a point lies on an edge of a magnet."""
        if self._all_reached(places):
            refuse_edges(self.magnets, places)
            return super().evaluate(places)
        found = self.fields(places)
        return found.flux_density, found.gradient

    @keeps_shape
    def absolute_error(self, places: Array) -> tuple[Array, Array]:
        """Estimated errors (...,) of B (T) and of its gradient (T/m)."""
        if self._all_reached(places):
            return super().absolute_error(places)
        found = self.fields(places)
        return found.error, found.gradient_error

    def _all_reached(self, places: Array) -> bool:
        return bool(self.in_range(places).all() and (self._slow_series(places) == 1).all())

    def _slow_series(self, points: Array) -> Array:
        """Factor (n,) on the stated errors near the magnets: what series leave out grows there as 1/(q² - 1)."""
        factor = np.ones(len(points))
        clear = Accuracy().clearance(self.magnets)
        beside = np.min([magnet.body.distance(points) for magnet in self.magnets], axis=0) < clear
        for part in self.expansions if self.model != "cuboid" else ():
            if part.nearest and beside.any():
                square = (np.linalg.norm(points[beside] - part.center, axis=1) / part.nearest) ** 2
                slower = (CONVERGENCE**2 - 1) / np.maximum(square - 1, np.finfo(float).tiny)
                factor[beside] = np.maximum(factor[beside], slower)
        return factor


def complete(table: RotorTable, near_rtol: float = NEAR_RTOL) -> RotorTable:
    """The table with the field in its magnets and near them; one of another model than `CONTINUED` as it is."""
    if table.model not in CONTINUED:
        return table
    parts = {part.name: getattr(table, part.name) for part in fields(RotorTable)}
    return CompleteTable(**parts, near_rtol=near_rtol)
