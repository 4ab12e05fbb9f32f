"""What permeable bodies in a ball of air answer to a given field: one factorised matrix, many fields.

With the given field H0 (sources outside or remanence, in T) and μ0 H = H0 - ∇ψ,

    ∫ ∇v·μ∇ψ = ∫_bodies ∇v·(μ - 1) H0,        μ0 M = (μ - 1)(H0 - ∇ψ),

as in `solver`, and open space outside the ball. H0 enters and M leaves at integration points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import netgen.meshing as netgen
import ngsolve as ng
import numpy as np
import scipy

from ...geometry.common import Array, MeshError
from ...geometry.magnets import Magnet
from ...geometry.meshes.magnets import MagnetMesh
from ..closed_forms.uniform import remanent_field
from .condensed import OpenFactor, TooLargeError, require_memory, solve_open
from .open_boundary import OpenBoundary
from .spaces import IntegrationPoints, volume_points

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


Formulation = Literal["split", "direct"]
WAY_OUT = "Allow a larger error of the field (--rtol)"


@dataclass(frozen=True, eq=False)
class System:
    """The assembled left-hand side on one mesh.

    Parameters
    ----------
    mesh, order : as given to `assemble`
    space : H1
    stiffness : condensed, with the Robin term of the outer sphere
    """

    mesh: MagnetMesh
    order: int
    space: Any
    stiffness: Any

    @property
    def unknowns(self) -> int:
        """Number of unknowns before static condensation."""
        return int(self.space.ndof)


@dataclass(frozen=True, eq=False)
class Solution:
    """A potential of one parity and what belongs to it.

    Parameters
    ----------
    system, signs : as given to `solve`
    potential : ψ, T times mesh unit (an NGSolve function)
    boundary : the open boundary
    """

    system: System
    signs: tuple[int, ...]
    potential: Any
    boundary: OpenBoundary


def assemble(mesh: MagnetMesh, order: int) -> System:
    """Assemble ∫ ∇v·μ∇ψ with elements of degree `order`.

    Raises
    ------
    MeshError : layers of elements do not match
    TooLargeError : the memory does not hold the system
    """
    space = ng.H1(mesh.mesh, order=order)
    require_memory(space, space.FreeDofs(True), WAY_OUT)
    trial, test = space.TnT()
    stiffness = ng.BilinearForm(space, symmetric=True, condense=True)
    matrices = {f"magnet{k}": magnet.permeability_in_rotor for k, magnet in enumerate(mesh.magnets)}
    if all(magnet.isotropic for magnet in mesh.magnets):
        permeability = mesh.mesh.MaterialCF({name: float(mu[0, 0]) for name, mu in matrices.items()}, default=1.0)
    else:
        tensors = {name: ng.CF(tuple(map(float, mu.ravel())), dims=(3, 3)) for name, mu in matrices.items()}
        permeability = mesh.mesh.MaterialCF(tensors, default=ng.Id(3))
    stiffness += (permeability * ng.grad(trial)) * ng.grad(test) * ng.dx
    stiffness += 2 / mesh.ball_radius * trial * test * ng.ds("outer")
    try:
        stiffness.Assemble()
    except netgen.NgException as error:
        if "alloc" in str(error):
            raise TooLargeError(f"The memory ran out in elements of order {order}: {error}. {WAY_OUT}.") from error
        raise MeshError(str(error)) from error  # netgen refined a face otherwise from either side
    return System(mesh, order, space, stiffness)


def solve(
    system: System,
    sources: Sequence[Magnet],
    formulation: Formulation = "split",
    boundary_degree: int = 8,
    signs: tuple[int, ...] = (),
    rest: Array | None = None,
) -> Solution:
    """Solve for the potential.

    Parameters
    ----------
    sources : magnets whose remanent polarisation acts; in `direct` those of the mesh
    boundary_degree : harmonics up to this degree see an exactly open outer boundary
    signs : parity of the potential (+1 or -1) at each of the mesh's planes
    rest : in `split`, J' (n, 3) T of each of the mesh's magnets; by default none

    Raises
    ------
    ConvergenceError : the iteration for the open boundary stalls
    """
    mesh, space = system.mesh, system.space
    boundary = OpenBoundary(mesh.mesh, space, mesh.ball_radius, boundary_degree, system.order, mesh.planes, signs)
    load = ng.LinearForm(space)
    for name in mesh.mesh.GetMaterials():
        if name != "air":
            k = int(name.removeprefix("magnet"))
            _add_source(load, system, k, sources, formulation, np.zeros(3) if rest is None else rest[k])
    load.Assemble()
    free = space.FreeDofs(True)
    for plane, sign in zip(mesh.planes, signs, strict=True):
        if sign < 0:
            free = free & ~space.GetDofs(mesh.mesh.Boundaries(f"plane{plane}"))
    inverse = system.stiffness.mat.Inverse(free, inverse="sparsecholesky")
    potential = solve_open(system.stiffness, inverse, free, load, boundary)
    return Solution(system, signs, potential, boundary)


def _add_source(
    load: Any, system: System, k: int, sources: Sequence[Magnet], formulation: Formulation, rest: Array
) -> None:
    mesh, name, test = system.mesh, f"magnet{k}", system.space.TestFunction()
    if formulation == "direct":
        load += ng.CF(tuple(map(float, sources[k].polarization_in_rotor))) * ng.grad(test) * ng.dx(name)
        return
    susceptibility = mesh.magnets[k].permeability_in_rotor - np.eye(3)
    if not susceptibility.any() and not rest.any():
        return
    points = volume_points(mesh.mesh, name, 2 * system.order + 2)
    places = mesh.magnets[k].body.within(mesh.to_meter(points.points))
    source = remanent_field(sources, places) @ susceptibility + rest
    for axis in range(3):
        load += points.function(source[:, axis]) * ng.grad(test)[axis] * points.measure
