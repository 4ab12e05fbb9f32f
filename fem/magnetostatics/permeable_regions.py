"""What permeable bodies in a ball of air answer to a given field: one factorised matrix, many fields.

With the given field H0 (sources outside or remanence, in T) and μ0 H = H0 - ∇ψ,

    ∫ ∇v·μ∇ψ = ∫_bodies ∇v·(μ - 1) H0,        μ0 M = (μ - 1)(H0 - ∇ψ),

as in `solver`, and open space outside the ball. H0 enters and M leaves at integration points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np
import scipy

from ...geometry.basics import Array
from ..elements import IntegrationPoints, OpenBoundary, OpenFactor, require_memory, volume_points

BOUNDARY_DEGREE = 8
"""Harmonics up to this degree see an exactly open boundary; higher ones reach the bodies below 1e-8."""


@dataclass(frozen=True, eq=False)
class PermeableRegions:
    """Bodies, their matrix and its factors; made by `assemble_regions`.

    Parameters
    ----------
    susceptibility : (3, 3) μ - 1 of every body by region name
    points : integration points of every body, in the mesh's coordinates
    slopes : (3n, unknowns) gradients of the basis at the points of every body
    factor : of the matrix
    """

    susceptibility: Mapping[str, Array]
    points: Mapping[str, IntegrationPoints]
    slopes: Mapping[str, scipy.sparse.csr_matrix]
    factor: OpenFactor

    def magnetization(self, fields: Mapping[str, Array]) -> dict[str, Array]:
        """μ0 M (n, 3) T at the points of every body, for given fields H0 (n, 3) T there."""
        sources = {name: fields[name] @ chi for name, chi in self.susceptibility.items()}
        load = sum(
            self.slopes[name].T @ (source * self.points[name].weights[:, None]).ravel()
            for name, source in sources.items()
        )
        (potential,) = self.factor.solve(load[None])
        return {
            name: source - (self.slopes[name] @ potential).reshape(-1, 3) @ self.susceptibility[name]
            for name, source in sources.items()
        }


def assemble_regions(mesh: Any, permeability: Mapping[str, Array], ball_radius: float, order: int) -> PermeableRegions:
    """Assemble and factorise with elements of degree `order`.

    Parameters
    ----------
    mesh : NGSolve mesh of a ball about the origin with the boundary `outer`
    permeability : (3, 3) μ by region name; regions not named have μ = 1
    ball_radius : in the mesh's coordinates

    Raises
    ------
    TooLargeError : the memory does not hold the system
    """
    space = ng.H1(mesh, order=order)
    require_memory(space, space.FreeDofs(True), "Take elements of a lower degree")
    trial, test = space.TnT()
    tensors = {name: ng.CF(tuple(map(float, mu.ravel())), dims=(3, 3)) for name, mu in permeability.items()}
    boundary = OpenBoundary(mesh, space, ball_radius, BOUNDARY_DEGREE, order)
    stiffness = ng.BilinearForm(space, symmetric=True, condense=True)
    stiffness += (mesh.MaterialCF(tensors, default=ng.Id(3)) * ng.grad(trial)) * ng.grad(test) * ng.dx
    stiffness += boundary.robin * trial * test * ng.ds("outer")
    stiffness.Assemble()
    inverse = stiffness.mat.Inverse(space.FreeDofs(True), inverse="sparsecholesky")
    points = {name: volume_points(mesh, name, 2 * order - 2) for name in permeability}
    return PermeableRegions(
        susceptibility={name: mu - np.eye(3) for name, mu in permeability.items()},
        points=points,
        slopes={name: part.value_matrix(space, ng.grad(trial)) for name, part in points.items()},
        factor=OpenFactor(stiffness, inverse, boundary),
    )
