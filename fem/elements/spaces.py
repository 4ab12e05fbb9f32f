"""Finite-element spaces: their mirrors and points; systems on them, with their memory; and open boundaries.

A mirror R = diag(±1) takes a polar vector field A to R A(R x).  With the planes of `mirrors` (axes) there are
2^n mirrors and 2^n parity classes; in class χ, R A(R x) = χ(R) A(x).  An odd class has no tangential component on its
plane: a Dirichlet condition for A there.  An even class has the natural condition.

Element matrices with what static condensation keeps of them take Σ N² numbers, N the unknowns of an element.  The
factor of nested dissection (A. George, SIAM J. Numer. Anal. 10, 345 (1973)) is mostly that of its last separators,
planes across the mesh: with s unknowns on such a plane it takes about `SEPARATORS` s² numbers.  n unknowns on f faces
of e elements put s = n e^(2/3)/f there.  Measured peaks were 0.9 to 1.0 of what is predicted here on rotors, on plates
with mirror planes 0.65 to 0.8.

Outside a sphere of radius R a potential of degree l falls as r^-(l+1), so that -∂u/∂r = (l+1)/R u_l. A Robin term 2/R
is exact for l = 1; what other degrees lack is a matrix of low rank, (l-1)/R on each harmonic up to `degree`. On a part
of the sphere that mirror planes cut out, only harmonics of the potential's parity take part.
"""

import contextlib
import resource
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, TypeVar

import ngsolve as ng
import numpy as np
import psutil
import scipy
from numpy.typing import NDArray

from ...geometry.common import Array, ComputationError
from ..harmonics.solid import FOUR_PI, Coefficients, harmonic_parity, members, orthonormal, outer_coefficients

SEPARATORS = 34.0  # numbers in the factor over the square of the unknowns on a plane; 17 to 36 were measured
PEAK = 1.2  # the largest amount while the factor is made, over what is kept
HEAP = 300_000_000  # address space that NGSolve reserves while it assembles, bytes; most of it is never touched
GROUP = Path("/sys/fs/cgroup")  # where Linux gives the limits of a container or a batch job


@dataclass(frozen=True)
class Parity:
    """The mirrors of a geometry."""

    mirrors: tuple[int, ...]  # axes whose plane through the origin is a mirror

    @property
    def flips(self) -> Array:
        """(2^n, 3) diagonals of the mirrors R."""
        found = np.ones((2 ** len(self.mirrors), 3))
        found[:, list(self.mirrors)] = list(product((1, -1), repeat=len(self.mirrors)))
        return found

    @property
    def classes(self) -> list[tuple[int, ...]]:
        """Sign (+1 even, -1 odd) of each class about each of `mirrors`."""
        return list(product((1, -1), repeat=len(self.mirrors)))

    def project(self, images: Array) -> Array:
        """Parts (2^n classes, ...) of fields given as R A(R x) for each mirror (2^n mirrors, ...)."""
        mirrored = self.flips[:, list(self.mirrors)] < 0
        odd = np.array(self.classes).reshape(len(self.classes), -1) < 0
        characters = (-1.0) ** (odd.astype(int) @ mirrored.astype(int).T)  # χ(R) by class and mirror
        return np.tensordot(characters, images, axes=1) / len(self.flips)


@dataclass(frozen=True, eq=False)
class IntegrationPoints:
    """Points and weights of one region."""

    space: Any  # NGSolve space with one unknown per point
    region: Any  # NGSolve region
    measure: Any  # differential symbol that integrates over the region with exactly these points
    weights: Array  # (n,)

    @cached_property
    def points(self) -> Array:
        """(n, 3) in the mesh's coordinates."""
        return self.sample(ng.x, ng.y, ng.z)

    def sample(self, *functions: Any) -> Array:
        """Values (n, k) of k scalar NGSolve functions."""
        values, columns = ng.GridFunction(self.space), []
        for function in functions:
            values.Interpolate(function, definedon=self.region)
            columns.append(values.vec.FV().NumPy().copy())
        return np.stack(columns, axis=1)

    def function(self, values: Array) -> Any:
        """NGSolve function that takes `values` (n,), or (n, 3), at the points; only for integrals with `measure`."""
        if values.ndim > 1:
            return ng.CF(tuple(map(self.function, values.T)))
        result = ng.GridFunction(self.space)
        result.vec.FV().NumPy()[:] = values
        return result

    def value_matrix(self, space: Any, basis: Any) -> scipy.sparse.csr_matrix:
        """(3n, unknowns) values here of a space's `basis` of three components, those of one point together."""
        components = self.space**3
        tested = basis * ng.CF(tuple(components.TestFunction()))
        # Not vectorised: NGSolve's vectorised integrals are wrong for elements of many points (order 4 on).
        integral = ng.SymbolicBFI(tested, definedon=self.region, simd_evaluate=False)
        for element, rule in self.space.GetIntegrationRules().items():
            integral.SetIntegrationRule(element, rule)
        form = ng.BilinearForm(trialspace=space, testspace=components)
        form += integral
        form.Assemble()
        # integrals with one point each: the weight taken off, they are the basis's values there
        rows, columns, values = (np.asarray(part) for part in form.mat.COO())
        component, point = np.divmod(rows, len(self.weights))
        places = 3 * point + component, columns
        return scipy.sparse.csr_matrix((values / self.weights[point], places), (form.mat.height, form.mat.width))


def volume_points(mesh: Any, material: str, order: int) -> IntegrationPoints:
    """Points in a `material` of a `mesh`, exact for polynomials up to `order` on straight elements."""
    region = mesh.Materials(material)
    space = ng.comp.IntegrationRuleSpace(mesh, order=order, definedon=region)
    return _collect(space, region, ng.dx(material, intrules=space.GetIntegrationRules()))


def surface_points(mesh: Any, boundary: str, order: int) -> IntegrationPoints:
    """Points on all surfaces of the `mesh`, for polynomials up to `order`; those off the `boundary` weigh nothing."""
    region = mesh.Boundaries(boundary)
    space = ng.comp.IntegrationRuleSpaceSurface(mesh, order=order)
    return _collect(space, region, ng.ds(boundary, intrules=space.GetIntegrationRules()))


def _collect(space: Any, region: Any, measure: Any) -> IntegrationPoints:
    return IntegrationPoints(space, region, measure, load_vector(space, space.TestFunction() * measure))


def load_vector(space: Any, integral: Any) -> Array:
    """Numbers (unknowns,) of an integral with a space's test functions."""
    form = ng.LinearForm(space)
    form += integral
    form.Assemble()
    return np.array(form.vec.FV().NumPy())


IntArray = NDArray[np.int64]


def region_edges(mesh: ng.Mesh, region: ng.Region) -> NDArray[np.bool_]:
    """Which edges belong to a volume or boundary region."""
    found = np.zeros(mesh.nedge, bool)
    for element in region.Elements():
        found[[edge.nr for edge in element.edges]] = True
    return found


def tree_edges(edges: IntArray, shrunk: NDArray[np.bool_]) -> IntArray:
    """Numbers of the `edges` (n, 2) of a spanning tree of the graph in which all `shrunk` ones (n,) have no length."""
    vertices = int(edges.max()) + 1
    joined = scipy.sparse.coo_matrix((np.ones(int(shrunk.sum())), edges[shrunk].T), shape=(vertices, vertices))
    count, label = scipy.sparse.csgraph.connected_components(joined, directed=False)
    ends = np.sort(label[edges], axis=1)
    numbers = np.flatnonzero(ends[:, 0] != ends[:, 1])
    _, first = np.unique(ends[numbers], axis=0, return_index=True)
    numbers = numbers[first]
    graph = scipy.sparse.coo_matrix((numbers + 1.0, ends[numbers].T), shape=(count, count))
    return np.asarray(np.rint(scipy.sparse.csgraph.minimum_spanning_tree(graph.tocsr()).data).astype(np.int64) - 1)


class TooLargeError(ComputationError):
    """A system that the free memory does not hold."""


def memory_need(space: ng.FESpace, free: ng.BitArray) -> tuple[float, float]:
    """Bytes of a symmetric system on `free` unknowns: the matrix with what is condensed, and the factor."""
    mesh, number = space.mesh, 16 if space.is_complex else 8
    sizes = [sum(dof >= 0 for dof in space.GetDofNrs(ng.ElementId(ng.VOL, k))) for k in range(int(mesh.ne))]
    separator = free.NumSet() * mesh.ne ** (2 / 3) / max(mesh.nface, 1)
    return float(number * sum(n**2 for n in sizes)), float(SEPARATORS * number * separator**2)


def require_memory(space: ng.FESpace, free: ng.BitArray, way_out: str) -> None:
    """Refuse a system with `free` unknowns of `space` that the free memory does not hold, before it is made.

    Raises TooLargeError, whose message has the user's `way_out`.
    """
    need, there = PEAK * sum(memory_need(space, free)), free_memory()
    if need > there:
        needed, given = (f"{size / 1e9:.2g} GB" if size < 1e10 else f"{size / 1e9:.0f} GB" for size in (need, there))
        raise TooLargeError(
            f"The finite elements of order {space.globalorder} need about {needed} of memory for "
            f"{free.NumSet()} coupled unknowns; {given} are free. {way_out}, or use a machine with more."
        )


def free_memory(group: Path = GROUP) -> float:
    """Bytes that this process can still have: of the machine, of its container or batch job, of its own limit."""
    own, _ = resource.getrlimit(resource.RLIMIT_AS)
    limits = [float(psutil.virtual_memory().available)]
    with contextlib.suppress(OSError):  # no control group
        limit = (group / "memory.max").read_text().strip()
        used = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
        if limit != "max":
            limits.append(float(int(limit) - int(used["anon"])))
    if own != resource.RLIM_INFINITY:
        limits.append(float(own - psutil.Process().memory_info().vms - HEAP))
    return max(min(limits), 0.0)


class OpenBoundary:
    """Dirichlet-to-Neumann map of the outside of the sphere `outer` about the origin.

    `space`: H1 space of the potential, on a mesh with the boundary `outer`; `radius`: of the sphere; `degree`: highest
    degree that is treated exactly, higher ones see the Robin term; `planes`, `signs`: mirror planes of the mesh, and
    whether the potential is even (+1) or odd (-1) there. Attribute `area_error` is the relative error of the area of
    the meshed sphere, which measures its roundness.
    """

    def __init__(
        self, space: Any, radius: float, degree: int, planes: Sequence[int] = (), signs: Sequence[int] = ()
    ) -> None:
        surface = surface_points(space.mesh, "outer", 2 * space.globalorder + 4)
        used = surface.weights > 0
        self.radius, self.degree, self.copies = radius, degree, 2 ** len(planes)
        self.area_error = abs(float(surface.weights.sum()) * self.copies / (FOUR_PI * radius**2) - 1)
        parities = list(zip(planes, signs, strict=True))
        self.keys = [key for key in members(degree) if all(harmonic_parity(key, axis) == p for axis, p in parities)]
        harmonics = np.zeros((len(used), len(self.keys)))
        harmonics[used] = orthonormal(self.keys, surface.points[used])
        self.unknowns = np.nonzero(np.array(space.GetDofs(space.mesh.Boundaries("outer"))))[0]
        parts = (surface.function(values) * space.TestFunction() * surface.measure for values in harmonics.T)
        self.projection = np.stack([load_vector(space, one)[self.unknowns] for one in parts], axis=1)
        self.degrees = np.array([l for l, _, _ in self.keys], float)

    def apply(self, potential: Array) -> Array:
        """What the map adds to the Robin term, as a load vector (unknowns,)."""
        amplitudes = self.copies * (self.projection.T @ potential[self.unknowns])
        result = np.zeros_like(potential)
        result[self.unknowns] = self.projection @ ((self.degrees - 1) / self.radius**3 * amplitudes)
        return result

    def expansion(self, potential: Array) -> Coefficients:
        """Coefficients c_lm of the potential Σ c_lm Θ_lm outside, from its values on the sphere."""
        amplitudes = self.copies * (self.projection.T @ potential[self.unknowns]) / self.radius**2
        return outer_coefficients(amplitudes * self.radius ** (self.degrees + 1), self.keys, self.degree)


Number = TypeVar("Number", np.float64, np.complex128)


def solve_condensed(form: ng.BilinearForm, inverse: ng.BaseMatrix, loads: NDArray[Number]) -> NDArray[Number]:
    """Solutions (n, unknowns), inner ones included, of `loads` (n, unknowns), real or complex as the `form` is.

    `form`: assembled with `condense=True`; `inverse`: of its matrix on the free coupling unknowns.
    """
    right, solution = ng.GridFunction(form.space), ng.GridFunction(form.space)
    condensed = right.vec.CreateVector()
    found = np.zeros_like(loads)
    for row, load in zip(found, loads, strict=True):
        right.vec.FV().NumPy()[:] = load
        condensed.data = right.vec + form.harmonic_extension_trans * right.vec
        solution.vec.data = inverse * condensed
        solution.vec.data += form.inner_solve * right.vec
        solution.vec.data += form.harmonic_extension * solution.vec
        row[:] = solution.vec.FV().NumPy()
    return found


class ConvergenceError(ComputationError):
    """The linear solver did not reach its tolerance."""


def solve_open(stiffness: Any, inverse: Any, free_dofs: Any, load: Any, boundary: OpenBoundary) -> Any:
    """The potential, an NGSolve function, of `load` and `stiffness`, condensed and with the Robin term alone.

    `inverse`: of the stiffness on `free_dofs`, the unknowns that are neither zero nor condensed; `boundary`: of open
    space. Raises ConvergenceError: the iteration for that stalls.
    """
    potential = ng.GridFunction(stiffness.space)
    load.vec.data += stiffness.harmonic_extension_trans * load.vec
    free = np.array(free_dofs)
    source, target = load.vec.CreateVector(), load.vec.CreateVector()

    def multiply(operator: Any, values: Array) -> Array:
        source.FV().NumPy()[:] = values
        target.data = operator * source
        return np.where(free, target.FV().NumPy(), 0.0)

    shape = (len(free), len(free))
    operators = (
        lambda x: multiply(stiffness.mat, x) + np.where(free, boundary.apply(x), 0.0), lambda x: multiply(inverse, x)
    )  # fmt: skip
    full, preconditioner = (scipy.sparse.linalg.LinearOperator(shape, matvec=f, dtype=float) for f in operators)
    # the factor of the ball with the Robin term is nearly the inverse: some ten iterations
    right_hand_side = np.where(free, load.vec.FV().NumPy(), 0.0)
    result, failed = scipy.sparse.linalg.cg(full, right_hand_side, rtol=1e-12, maxiter=100, M=preconditioner)
    if failed:
        raise ConvergenceError(f"The open boundary did not converge in {failed} iterations; use a larger ball of air.")
    potential.vec.FV().NumPy()[:] = result
    potential.vec.data += stiffness.harmonic_extension * potential.vec
    potential.vec.data += stiffness.inner_solve * load.vec
    return potential
