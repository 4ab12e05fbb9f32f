"""Eddy currents by finite elements: the reaction potential A of sources with potentials A_s, phasors e^{+iωt},

    curl curl A + iωμ0σ A = -iωμ0σ A_s.

Nédélec elements of the second kind, full order; gradients are kept in the conductors only.  Sources enter by their
vector potential at the quadrature points of the conductors; mirror planes leave one factorisation for each parity
class. S. Zaglmayr, High order finite element methods for electromagnetic field computation, thesis, Linz 2006 (the
space).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import ngsolve
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import MU_0, Array, Watch, unwatched
from ...geometry.meshes.plate import MILLIMETRE, PLANES, ConductorMesh, MeshRule, plate_mesh, skin_depth
from ...geometry.scene.contents import Plate
from ...geometry.shapes import Box
from ..closed_forms.eddy_bodies import ComplexArray
from ..closed_forms.potentials import HomogeneousField, unit_dipoles
from ..elements import spaces
from ..elements.spaces import solve_condensed
from ..rotor.models import AccuracyError
from .table import OPTION

# ωμ0σL² below which the response is resistive: A = a0 + iω a1, with a0 (charges) and a1 (currents) real and constant.
# The slowest current of a plate decays in less than μ0σL²/100, so that this is exact to RESISTIVE²/1e4 = 1e-8.
RESISTIVE = 1e-2
SILENT = 1e-9  # Parity parts smaller than this share of the whole source are not solved for
CHUNK = 16  # Sources handled at a time: bounds the memory


class Source(Protocol):
    """Anything with a vector potential: a field applied from outside the conductors."""

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""


class EddySpace:
    """Space, quadrature and gauge on the mesh of `conductors` with an `order`, at least 1.

    Quadrature `points` (n, 3) m are in the conductors, `weights` (n,) σ times theirs, S m²; `root` (3n,) makes ∫ σ e·e'
    dV over the whole plate, with its mirror images, a plain product of rows.
    """

    def __init__(self, conductors: ConductorMesh, order: int) -> None:
        if order < 1:
            raise ValueError(f"Input order must be at least 1; instead received {order}.")
        self.conductors, self.order = conductors, order
        self.parity = spaces.Parity(conductors.mirrors)
        mesh = conductors.mesh
        self.sigma = mesh.MaterialCF(dict(conductors.conductivity), default=0.0)
        self.real = self.elements(complex_valued=False)
        # Exact for twice its order; of tetrahedra the rules of order 8 and less have few points.
        bricks = mesh[ngsolve.ElementId(ngsolve.VOL, 0)].type == ngsolve.ET.HEX
        rule_order = order + 2 if bricks else min(order + 1, max(order, 4))
        self.quadrature = spaces.volume_points(mesh, conductors.pattern, rule_order)
        self.region = self.quadrature.region
        self.points = self.quadrature.points * MILLIMETRE
        self.weights = self.quadrature.sample(self.sigma)[:, 0] * self.quadrature.weights * MILLIMETRE**3
        self.root = np.repeat(np.sqrt(self.weights * conductors.images), 3)
        self._edges = np.array([[v.nr for v in edge.vertices] for edge in mesh.edges], dtype=np.int64)
        self._conducting = spaces.region_edges(mesh, self.region)

    def elements(self, complex_valued: bool) -> ngsolve.FESpace:
        """The finite elements; real and complex ones have the same numbering."""
        mesh = self.conductors.mesh
        inside = [int(name in self.conductors.conductivity) for name in mesh.GetMaterials()]
        gradients = {"gradientdomains": inside, "gradientboundaries": [0] * len(mesh.GetBoundaries())}
        return ngsolve.HCurl(mesh, order=self.order, complex=complex_valued, dirichlet="far", **gradients)

    def class_images(self, sources: Sequence[Source]) -> NDArray[np.float64]:
        """(classes, sources, n, 3) parity parts of the sources' potentials at the quadrature points, T m."""
        return np.concatenate(list(source_images(self.parity, self.points, sources)), axis=1)

    def loads(self, potentials: Array) -> Array:
        """∫ σ A·v dV (sources, unknowns), S m³ T, of potentials (sources, n, 3) at the quadrature points, T m."""
        test, points = self.real.TestFunction(), self.quadrature
        parts = (self.sigma * points.function(one) * test * points.measure for one in potentials)
        return MILLIMETRE**3 * np.array([spaces.load_vector(self.real, one) for one in parts])

    def free_unknowns(self, parity_class: Sequence[int], space: ngsolve.FESpace) -> ngsolve.BitArray:
        """Coupling unknowns of one parity class: without odd planes, the far boundary and a spanning tree in air."""
        mesh = self.conductors.mesh
        odd = [PLANES[a] for a, sign in zip(self.parity.mirrors, parity_class, strict=True) if sign < 0]
        fixed = mesh.Boundaries("|".join(["far", *odd]))
        free = ngsolve.BitArray(space.FreeDofs(True))
        free &= ~space.GetDofs(fixed)
        for edge in spaces.tree_edges(self._edges, self._conducting | spaces.region_edges(mesh, fixed)):
            free[int(edge)] = False
        return free


def source_images(parity: spaces.Parity, points: Array, sources: Sequence[Source]) -> Iterator[Array]:
    """(classes, some sources, n, 3) parity parts of the sources' potentials at `points` (n, 3), T m."""
    flips = parity.flips
    mirrored = (points * flips[:, None]).reshape(-1, 3)
    for start in range(0, len(sources), CHUNK):
        some = [s.vector_potential(mirrored).reshape(len(flips), -1, 3) for s in sources[start : start + CHUNK]]
        yield parity.project(np.stack(some, axis=1) * flips[:, None, None])


class ShiftedSystem:
    """Condensed matrix of curl curl + s μ0 σ on a `space`, factorised once for each parity class.

    `shift`: s, rad/s, iω at a frequency; a real one needs half the memory and a quarter of the work.
    """

    def __init__(self, space: EddySpace, shift: complex) -> None:
        self.space, self.shift = space, shift
        self.fes = space.elements(complex_valued=True) if np.iscomplexobj(shift) else space.real
        way_out = "Allow a larger error of the plate (--plate-rtol, or --rtol of the command plate)"
        spaces.require_memory(self.fes, self.fes.FreeDofs(True), way_out)
        trial, test = self.fes.TnT()
        form = ngsolve.BilinearForm(self.fes, symmetric=True, condense=True)
        form += ngsolve.curl(trial) * ngsolve.curl(test) * ngsolve.dx
        form += shift * MU_0 * MILLIMETRE**2 * space.sigma * trial * test * ngsolve.dx(definedon=space.region)
        form.Assemble()
        self.form = form

    def solver(self, parity_class: Sequence[int]) -> tuple[Callable[[Array], NDArray[Any]], int]:
        """A class's factor, of loads to reactions -s (curl curl + s μ0 σ)⁻¹ μ0 ∫ σ A_s·v, and its unknowns."""
        free = self.space.free_unknowns(parity_class, self.fes)
        inverse = self.form.mat.Inverse(free, inverse="sparsecholesky")
        return lambda loads: solve_condensed(self.form, inverse, -self.shift * MU_0 / MILLIMETRE * loads), sum(free)


@dataclass(frozen=True, eq=False)
class ClassResponse:
    """One parity class: solutions (sources, unknowns), T m, with loads and potentials as `EddySpace` makes them."""

    potentials: Array
    loads: Array
    solutions: ComplexArray


@dataclass(frozen=True, eq=False)
class EddyResponse:
    """Eddy currents of several sources at one shift."""

    space: EddySpace  # the finite-element space
    shift: complex  # s, rad/s: iω at a frequency
    classes: dict[int, ClassResponse]  # responses by number of the parity class; silent ones are missing
    coupling_unknowns: int  # size of the factorised matrix, of the largest class

    @property
    def couplings(self) -> ComplexArray:
        """(sources, sources) ∫ J_j · A_i dV, J; for dipoles of 1 A m² it is B_i, T. Symmetric to round-off."""
        return self._sum({number: (c.potentials, c.loads) for number, c in self.classes.items()})

    def couplings_to(self, receivers: Sequence[Source]) -> ComplexArray:
        """(receivers, sources) ∫ J_j · A_i dV for other receivers, J."""
        images = self.space.class_images(receivers)
        return self._sum({number: (images[number], self.space.loads(images[number])) for number in self.classes})

    def _sum(self, tests: dict[int, tuple[Array, Array]]) -> ComplexArray:
        parts = []
        for number, (potentials, loads) in tests.items():
            c = self.classes[number]
            direct = np.einsum("q,iqa,jqa->ij", self.space.weights, potentials, c.potentials, optimize=True)
            parts.append(direct + loads @ c.solutions.T)
        return np.asarray(-self.shift * self.space.conductors.images * sum(parts))


def solve_eddy(
    conductors: ConductorMesh, order: int, frequency: float, sources: Sequence[Source], space: EddySpace | None = None
) -> EddyResponse:
    """Eddy currents of all `sources` at `frequency` (Hz) in `conductors`, with an `order`, or on a known `space`.

    Any frequency from 0 up is safe: below ωμ0σL² = 1e-2 the resistive limit is used, exact to 1e-8; at high ones the
    mesh must resolve the skin depth. Raises ValueError: frequency negative or not finite, order below 1, or no sources;
    TooLargeError: the memory does not hold the system.
    """
    if not (np.isfinite(frequency) and frequency >= 0):
        raise ValueError(f"Input frequency_hz must be finite and not negative; instead received {frequency!r}.")
    if not sources:
        raise ValueError("Input sources must hold at least one source; instead received none.")
    space = space or EddySpace(conductors, order)
    extent, conductivity = 2 * float(np.abs(space.points).max()), max(space.conductors.conductivity.values())
    solved = max(frequency, RESISTIVE / (2 * np.pi * MU_0 * conductivity * extent**2))
    response = solve_shifted(space, 2j * np.pi * solved, sources)
    scaled = {}
    for number, part in response.classes.items():
        scaled[number] = replace(part, solutions=part.solutions.real + 1j * part.solutions.imag * (frequency / solved))
    return replace(response, shift=2j * np.pi * frequency, classes=scaled)


def solve_shifted(space: EddySpace, shift: complex, sources: Sequence[Source]) -> EddyResponse:
    """Eddy currents of `sources` on `space` for iω = `shift`, rad/s, real if they grow. Raises TooLargeError."""
    system = ShiftedSystem(space, shift)
    images = space.class_images(sources)
    size = np.sqrt(np.einsum("csqa->cs", images**2 * space.weights[:, None]))
    classes, coupling = {}, 0
    for number, parity_class in enumerate(space.parity.classes):
        if np.all(size[number] <= SILENT * np.linalg.norm(size, axis=0)):
            continue
        loads = space.loads(images[number])
        solve, unknowns = system.solver(parity_class)
        classes[number] = ClassResponse(images[number], loads, solve(loads))
        coupling = max(coupling, unknowns)
    return EddyResponse(space, shift, classes, coupling)


def current_density(
    response: EddyResponse, applied: ComplexArray, amplitudes: ArrayLike, points: ArrayLike
) -> ComplexArray:
    """J = -iωσ(A_s + A) (n, 3), A/m², at `points` (n, 3), m; zero in air.

    `applied`: (n, 3) T m, A_s of the sources with their `amplitudes` there; `response`: to unit ones. Raises
    ValueError: a point outside the mesh.
    """
    points, space = np.asarray(points, float).reshape(-1, 3), response.space
    mirrors = list(space.parity.mirrors)
    flip = np.ones((len(points), 3))
    flip[:, mirrors] = np.where(points[:, mirrors] < 0, -1.0, 1.0)
    places = space.conductors.mesh(*(points * flip / MILLIMETRE).T)
    outside = places["nr"] < 0
    if outside.any():
        raise ValueError(f"Input points_m must lie in the meshed box; instead received {points[outside][0].tolist()}.")
    function = ngsolve.GridFunction(space.elements(complex_valued=True))
    total = np.array(applied, complex)
    for number, c in response.classes.items():
        function.vec.FV().NumPy()[:] = np.asarray(amplitudes, complex) @ c.solutions
        # In the octants that are not meshed a class has its sign about each plane that lies between.
        signs = np.prod(np.where(flip[:, mirrors] < 0, np.array(space.parity.classes[number]), 1.0), axis=1)
        total += signs[:, None] * flip * np.asarray(function(places), complex).reshape(-1, 3)
    sigma = np.asarray(space.sigma(places), float).reshape(-1, 1)
    return np.asarray(-response.shift * sigma * total)


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
REFINEMENTS = 3  # Of a mesh at most


class MeshTooLargeError(AccuracyError):
    """A mesh has more unknowns than are solved."""


class Ladder:
    """Orders of the finite elements on one mesh, one after the other, and the estimated error of each.

    What an order leaves is at most its change of a tensor times the reduction of that change, and the truncation of the
    air. `places` (n, 3) m are of the dipoles compared, in the frame of `plate`, at a `frequency` (Hz), with a mesh by
    `rule` and an error `allowed`; `growing`: by fields that grow as e^{ωt}: half the memory, a quarter of the work;
    `watch`: progress. Raises MeshTooLargeError: not even order 3 is within `MOST_UNKNOWNS`.
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
        self.mesh = plate_mesh(plate.body, plate.metal, places, frequency, rule)
        cells = int(self.mesh.mesh.ne)
        bricks = isinstance(plate.body, Box)  # else tetrahedra, of which few meet in a face
        each = {p: 3 * p * (p + 2) + 2 * p + 1 if bricks else p * (p + 2) for p in range(3, HIGHEST_ORDER + 1)}
        orders = [p for p, unknowns in each.items() if cells * unknowns <= MOST_UNKNOWNS]
        if not orders:
            raise MeshTooLargeError(
                f"Input mesh must have at most {MOST_UNKNOWNS} unknowns; instead one of {cells} cells has more. Lower "
                "the frequency, allow a larger error, or take the infinite slab (model slab), which has no such limit."
            )
        self.highest = orders[-1]
        self.places, self.frequency, self.allowed, self.growing, self.watch = places, frequency, allowed, growing, watch
        self.reach = rule.reach * float(plate.body.size.max())
        self.order, self.unknowns, self.errors = 0, 0, np.full(len(places), np.inf)
        self.change = self.last = self.size = np.ones(len(places))
        self.truncation = np.zeros(len(places))
        self.tensors: ComplexArray = np.zeros((len(places), 3, 3), complex)
        self.climb()

    @property
    def error(self) -> float:
        return float(self.errors.max())

    def climb(self) -> None:
        """Solve for the dipoles at the next order."""
        self.watch(f"error at order {self.order + 1}", 0.0)
        space, dipoles = EddySpace(self.mesh, self.order + 1), unit_dipoles(self.places)
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
    plate: Plate, positions: ArrayLike, frequency: float, rtol: float = 1e-3, rule: MeshRule | None = None
) -> PlateReaction:
    """Reaction tensors of `plate` at `positions` (n, 3), m, laboratory frame, and `frequency`, Hz, phasors e^{+iωt}.

    `rtol`: estimated relative error asked of every own tensor; `rule`: first mesh, which is refined `REFINEMENTS` times
    at most. Raises ValueError: an argument out of range; AccuracyError: `rtol` not reached after all of them, or
    with `MOST_UNKNOWNS`.
    """
    places = np.asarray(positions, float).reshape(-1, 3)
    if frequency == 0:
        return PlateReaction(np.zeros((len(places), 3, 3), complex), np.zeros(len(places)))
    body, rule, turn, best = plate.box.to_body(places), rule or MeshRule(), plate.box.rotation, np.inf
    for _ in range(REFINEMENTS + 1):
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
