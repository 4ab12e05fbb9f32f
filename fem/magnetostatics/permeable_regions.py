"""What permeable bodies in a ball of air answer to a given field: one factorised matrix, many fields.

With the given field H0 (sources outside or remanence, in T) and μ0 H = H0 - ∇ψ,

    ∫ ∇v·μ∇ψ = ∫_bodies ∇v·(μ - 1) H0,        μ0 M = (μ - 1)(H0 - ∇ψ),

as in `solver`, and open space outside the ball. H0 enters and M leaves at integration points.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np

from ...geometry.basics import Array
from ..elements import IntegrationPoints, OpenBoundary, require_memory, solve_open, volume_points

BOUNDARY_DEGREE = 8
"""Harmonics up to this degree see an exactly open boundary; higher ones reach the bodies below 1e-8."""


@dataclass(frozen=True, eq=False)
class PermeableRegions:
    """Bodies, their matrix and its factors; made by `assemble_regions`.

    Parameters
    ----------
    susceptibility : (3, 3) μ - 1 of every body by region name
    points : integration points of every body, in the mesh's coordinates
    """

    susceptibility: Mapping[str, Array]
    points: Mapping[str, IntegrationPoints]
    space: Any
    stiffness: Any
    inverse: Any
    boundary: OpenBoundary

    def magnetization(self, fields: Mapping[str, Array]) -> dict[str, Array]:
        """μ0 M (n, 3) T at the points of every body, for given fields H0 (n, 3) T there.

        Raises
        ------
        ConvergenceError : the iteration for the open boundary stalls
        """
        load, test = ng.LinearForm(self.space), self.space.TestFunction()
        for name, points in self.points.items():
            source = fields[name] @ self.susceptibility[name]
            for axis in range(3):
                load += points.function(source[:, axis]) * ng.grad(test)[axis] * points.measure
        load.Assemble()
        free = self.space.FreeDofs(True)
        slope = ng.grad(solve_open(self.stiffness, self.inverse, free, load, self.boundary))
        result = {}
        for name, points in self.points.items():
            own = points.sample(*(slope[axis] for axis in range(3)))
            result[name] = (fields[name] - own) @ self.susceptibility[name]
        return result


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
    return PermeableRegions(
        susceptibility={name: mu - np.eye(3) for name, mu in permeability.items()},
        points={name: volume_points(mesh, name, 2 * order - 2) for name in permeability},
        space=space,
        stiffness=stiffness,
        inverse=stiffness.mat.Inverse(space.FreeDofs(True), inverse="sparsecholesky"),
        boundary=boundary,
    )
