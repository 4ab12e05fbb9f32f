"""Finite-element space of the eddy-current problem and the loads of its sources.

Nédélec elements of the second kind, full order.  Gradients are kept in the conductors only.  Sources enter by
their vector potential at the quadrature points of the conductors, so that any function of position will do.

S. Zaglmayr, High order finite element methods for electromagnetic field computation, thesis, Linz 2006 (the space).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import ngsolve
import numpy as np
import scipy
from numpy.typing import NDArray

from ...geometry.basics import Array
from ...geometry.meshes import MILLIMETRE, PLANES, ConductorMesh
from ..elements import Parity, edge_vertices, region_edges, tree_edges, value_matrix


class Source(Protocol):
    """Anything with a vector potential: a field applied from outside the conductors."""

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""


class EddySpace:
    """Space, quadrature and gauge on one mesh with one order.

    Parameters
    ----------
    conductors : mesh and conductivities
    order : polynomial order, at least 1

    Attributes
    ----------
    points : (n, 3) quadrature points in the conductors, m
    weights : (n,) σ times quadrature weights, S m²
    """

    def __init__(self, conductors: ConductorMesh, order: int) -> None:
        if order < 1:
            raise ValueError(f"Input order must be at least 1; instead received {order}.")
        self.conductors, self.order = conductors, order
        self.parity = Parity(conductors.mirrors)
        mesh = conductors.mesh
        self.region = mesh.Materials(conductors.pattern)
        self.sigma = mesh.MaterialCF(dict(conductors.conductivity), default=0.0)
        self.real = self._space(complex_valued=False)
        scalar = ngsolve.comp.IntegrationRuleSpace(mesh, order=order + 2, definedon=self.region)
        self._rules = scalar.GetIntegrationRules()
        self._carrier = ngsolve.GridFunction(scalar**3)
        self._carrier.Interpolate(ngsolve.CF((ngsolve.x, ngsolve.y, ngsolve.z)), definedon=self.region)
        self.points = np.stack([c.vec.FV().NumPy() for c in self._carrier.components], axis=1) * MILLIMETRE
        weight = ngsolve.LinearForm(scalar)
        weight += self.sigma * scalar.TestFunction() * ngsolve.dx(definedon=self.region, intrules=self._rules)
        weight.Assemble()
        self.weights = np.array(weight.vec.FV().NumPy()) * MILLIMETRE**3
        self._edges = edge_vertices(mesh)
        self._conducting = region_edges(mesh, self.region)

    def _space(self, complex_valued: bool) -> ngsolve.FESpace:
        mesh = self.conductors.mesh
        inside = [int(name in self.conductors.conductivity) for name in mesh.GetMaterials()]
        return ngsolve.HCurl(
            mesh,
            order=self.order,
            complex=complex_valued,
            gradientdomains=inside,
            gradientboundaries=[0] * len(mesh.GetBoundaries()),
            dirichlet="far",
        )

    def complex_space(self) -> ngsolve.FESpace:
        """The same space with complex coefficients and the same numbering."""
        return self._space(complex_valued=True)

    def class_images(self, sources: Sequence[Source]) -> NDArray[np.float64]:
        """(classes, sources, n, 3) parity parts of the sources' potentials at the quadrature points, T m."""
        flips = self.parity.flips
        images = [[flip * s.vector_potential(self.points * flip) for s in sources] for flip in flips]
        return self.parity.project(np.array(images))

    def loads(self, potentials: Array) -> Array:
        """∫ σ A·v dV (sources, unknowns), S m³ T, of potentials (sources, n, 3) at the quadrature points, T m."""
        test = self.real.TestFunction()
        form = ngsolve.LinearForm(self.real)
        form += self.sigma * self._carrier * test * ngsolve.dx(definedon=self.region, intrules=self._rules)
        found = np.zeros((len(potentials), self.real.ndof))
        for row, potential in zip(found, potentials, strict=True):
            for component, values in zip(self._carrier.components, potential.T, strict=True):
                component.vec.FV().NumPy()[:] = values
            form.Assemble()
            row[:] = form.vec.FV().NumPy() * MILLIMETRE**3
        return found

    def point_values(self, function: ngsolve.GridFunction) -> Array:
        """(n, 3) values of a real function of this space at the quadrature points."""
        self._carrier.Interpolate(function, definedon=self.region)
        return np.stack([c.vec.FV().NumPy() for c in self._carrier.components], axis=1)

    def value_matrix(self, space: ngsolve.FESpace, basis: ngsolve.CoefficientFunction) -> scipy.sparse.csr_matrix:
        """(3n, unknowns) values of a space's `basis` at the quadrature points, the components of one point together."""
        points = ngsolve.comp.IntegrationRuleSpace(self.conductors.mesh, order=self.order + 2, definedon=self.region)

        def integral(integrand: Any) -> Any:
            # Not vectorised: NGSolve's vectorised integrals are wrong beyond 256 points an element (order 4 on).
            found = ngsolve.SymbolicBFI(self.sigma * integrand, definedon=self.region, simd_evaluate=False)
            for element, rule in self._rules.items():
                found.SetIntegrationRule(element, rule)
            return found

        return value_matrix(space, basis, points, integral, self.weights / MILLIMETRE**3)

    def free_unknowns(self, parity_class: Sequence[int], space: ngsolve.FESpace) -> ngsolve.BitArray:
        """Coupling unknowns of one parity class: without odd planes, the far boundary and a spanning tree in air."""
        mesh = self.conductors.mesh
        odd = [PLANES[a] for a, sign in zip(self.parity.mirrors, parity_class, strict=True) if sign < 0]
        fixed = mesh.Boundaries("|".join(["far", *odd]))
        free = ngsolve.BitArray(space.FreeDofs(True))
        free &= ~space.GetDofs(fixed)
        for edge in tree_edges(self._edges, self._conducting | region_edges(mesh, fixed)):
            free[int(edge)] = False
        return free
