"""Integration points of a mesh region as NumPy arrays, and the way back into NGSolve.

Functions that exist as NumPy code (closed forms, solid harmonics) enter and leave the finite elements here, so that no
formula has to be written a second time. Works on every element shape, those of hp-refinement included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np
import scipy

from ...geometry.basics import Array


@dataclass(frozen=True, eq=False)
class IntegrationPoints:
    """Points and weights of one region.

    Parameters
    ----------
    space : NGSolve space with one unknown per point
    region : NGSolve region
    measure : differential symbol that integrates over the region with exactly these points
    points : (n, 3) in the mesh's coordinates
    weights : (n,)
    """

    space: Any
    region: Any
    measure: Any
    points: Array
    weights: Array

    def sample(self, *functions: Any) -> Array:
        """Values (n, k) of k scalar NGSolve functions."""
        return _sample(self.space, self.region, functions)

    def function(self, values: Array) -> Any:
        """NGSolve function that takes `values` (n,) at the points; only for integrals with `measure`."""
        result = ng.GridFunction(self.space)
        result.vec.FV().NumPy()[:] = values
        return result

    def value_matrix(self, space: Any, basis: Any) -> scipy.sparse.csr_matrix:
        """(3n, unknowns) values here of a space's `basis` of three components, those of one point together."""
        return value_matrix(space, basis, self.space, lambda integrand: integrand * self.measure, self.weights)


def value_matrix(
    space: Any, basis: Any, points: Any, integral: Callable[[Any], Any], weights: Array
) -> scipy.sparse.csr_matrix:
    """(3n, unknowns) values at points of a `basis` of three components, those of one point together.

    Parameters
    ----------
    space : of the unknowns
    points : NGSolve space with one unknown per point
    integral : of a function, with exactly these points
    weights : (n,) of the points in it
    """
    components = points**3
    form = ng.BilinearForm(trialspace=space, testspace=components)
    form += integral(basis * ng.CF(tuple(components.TestFunction())))
    form.Assemble()
    rows, columns, values = (np.asarray(part) for part in form.mat.COO())
    component, point = np.divmod(rows, len(weights))
    return scipy.sparse.csr_matrix(
        (values / weights[point], (3 * point + component, columns)), shape=(form.mat.height, form.mat.width)
    )


def volume_points(mesh: Any, material: str, order: int) -> IntegrationPoints:
    """Points in a material, exact for polynomials up to `order` on straight elements."""
    region = mesh.Materials(material)
    space = ng.comp.IntegrationRuleSpace(mesh, order=order, definedon=region)
    return _collect(space, region, ng.dx(material, intrules=space.GetIntegrationRules()))


def surface_points(mesh: Any, boundary: str, order: int) -> IntegrationPoints:
    """Points on all surfaces of the mesh; those off the named boundary have weight zero."""
    region = mesh.Boundaries(boundary)
    space = ng.comp.IntegrationRuleSpaceSurface(mesh, order=order)
    return _collect(space, region, ng.ds(boundary, intrules=space.GetIntegrationRules()))


def _collect(space: Any, region: Any, measure: Any) -> IntegrationPoints:
    form = ng.LinearForm(space)
    form += space.TestFunction() * measure
    form.Assemble()
    weights = form.vec.FV().NumPy().copy()
    return IntegrationPoints(space, region, measure, _sample(space, region, (ng.x, ng.y, ng.z)), weights)


def _sample(space: Any, region: Any, functions: tuple[Any, ...]) -> Array:
    values = ng.GridFunction(space)
    columns = []
    for function in functions:
        values.Interpolate(function, definedon=region)
        columns.append(values.vec.FV().NumPy().copy())
    return np.stack(columns, axis=1)
