"""Magnetostatics of permanent magnets by finite elements, with the scalar potential.

The unknown is ψ in H1, with μ0 H = H0 - ∇ψ (all in T). Two formulations share the same code:

- `split`: H0 is the closed form of the magnets with μ = 1, and only what their permeability adds is computed,
      ∫ ∇v·μ∇ψ = ∫_magnets ∇v·((μ - 1) H0 + J'),        M = (μ - 1)(H0 - ∇ψ) + J',
  J' being the remanence beyond that of the closed form, if the closed form is not that of all of it;
- `direct`: no closed form, H0 = 0,
      ∫ ∇v·μ∇ψ = ∫_magnets J·∇v,                   M = J - (μ - 1) ∇ψ.

M is the magnetisation μ0 M (T) that makes the outer field, in `split` beside the closed form. The space outside the
ball is exact (`elements.open_boundary`). Where the bodies have mirror planes the mesh is one side of them, and one
matrix serves polarisations of every parity: ψ = 0 on a plane where it is odd.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import netgen.meshing as netgen
import ngsolve as ng
import numpy as np

from ...geometry.basics import Array, MeshError
from ...geometry.bodies import Magnet
from ...geometry.meshes import MagnetMesh
from ..closed_forms import remanent_field
from ..elements import OpenBoundary, TooLargeError, require_memory, solve_open, volume_points

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
