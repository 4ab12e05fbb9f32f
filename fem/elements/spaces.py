"""Mirror symmetry: any field as a sum of parts that are even or odd about each plane.

A mirror R = diag(±1) takes a polar vector field A to R A(R x).  With the planes of `mirrors` (axes) there are
2^n mirrors and 2^n parity classes; in class χ, R A(R x) = χ(R) A(x).  An odd class has no tangential
component on its plane: a Dirichlet condition for A there.  An even class has the natural condition.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import ngsolve
import ngsolve as ng
import numpy as np
import scipy
from numpy.typing import NDArray

from ...geometry.common import Array


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


def region_edges(mesh: ngsolve.Mesh, region: ngsolve.Region) -> NDArray[np.bool_]:
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
