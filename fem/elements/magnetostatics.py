"""Magnetostatics of permeable magnets in a ball of air, with open space outside, by parity.

With the field H0 (T) that is split off and μ0 H = H0 - ∇ψ,

    ∫ ∇v·μ∇ψ = ∫_bodies ∇v·(μ - 1) H0,        μ0 M = (μ - 1)(H0 - ∇ψ).

In the formulation "split" H0 is the closed form of the remanence; in "direct" it is 0, and the remanence J adds ∫ ∇v·J.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import netgen.meshing as netgen
import ngsolve as ng
import numpy as np

from ...geometry.common import Array, MeshError
from ...geometry.magnets import Magnet
from ...geometry.meshes.magnets import MagnetMesh
from ..closed_forms.uniform import remanent_field
from .condensed import OpenBoundary, TooLargeError, require_memory, solve_open
from .spaces import volume_points

BOUNDARY_DEGREE = 8  # harmonics up to this degree see an exactly open boundary; higher ones reach the bodies below 1e-8


Formulation = Literal["split", "direct"]
WAY_OUT = "Allow a larger error of the field (--rtol)"


@dataclass(frozen=True, eq=False)
class System:
    """The assembled left-hand side on one mesh."""

    # mesh, order: as given to `assemble`
    mesh: MagnetMesh
    order: int
    space: Any  # H1
    stiffness: Any  # condensed, with the Robin term of the outer sphere

    @property
    def unknowns(self) -> int:
        """Number of unknowns before static condensation."""
        return int(self.space.ndof)


@dataclass(frozen=True, eq=False)
class Solution:
    """A potential of one parity and what belongs to it."""

    # system, signs: as given to `solve`
    system: System
    signs: tuple[int, ...]
    potential: Any  # ψ, T times mesh unit (an NGSolve function)
    boundary: OpenBoundary  # the open boundary


def assemble(mesh: MagnetMesh, order: int) -> System:
    """Assemble ∫ ∇v·μ∇ψ with elements of degree `order`.

    Raises
    ------
    MeshError : layers of elements do not match
    TooLargeError : the memory does not hold the system
    """
    permeability = {f"magnet{k}": magnet.permeability_in_rotor for k, magnet in enumerate(mesh.magnets)}
    return System(mesh, order, *stiffness_of(mesh.mesh, permeability, mesh.ball_radius, order, WAY_OUT))


def stiffness_of(
    mesh: Any, permeability: Mapping[str, Array], ball_radius: float, order: int, way_out: str
) -> tuple[Any, Any]:
    """The space H1 and ∫ ∇v·μ∇ψ on it, condensed, with the Robin term of the sphere `outer`.

    Parameters
    ----------
    mesh : of NGSolve, with the boundary `outer`
    permeability : (3, 3) μ/μ0 by the name of a region; 1 in the others
    ball_radius : of that sphere, in the unit of the mesh
    order : of the elements
    way_out : what to do where memory is short, for the message

    Raises
    ------
    MeshError : layers of elements do not match
    TooLargeError : the memory does not hold the system
    """
    space = ng.H1(mesh, order=order)
    require_memory(space, space.FreeDofs(True), way_out)
    trial, test = space.TnT()
    stiffness = ng.BilinearForm(space, symmetric=True, condense=True)
    if all(np.array_equal(mu, mu[0, 0] * np.eye(3)) for mu in permeability.values()):
        factor = mesh.MaterialCF({name: float(mu[0, 0]) for name, mu in permeability.items()}, default=1.0)
    else:
        tensors = {name: ng.CF(tuple(map(float, mu.ravel())), dims=(3, 3)) for name, mu in permeability.items()}
        factor = mesh.MaterialCF(tensors, default=ng.Id(3))
    stiffness += (factor * ng.grad(trial)) * ng.grad(test) * ng.dx
    stiffness += 2 / ball_radius * trial * test * ng.ds("outer")
    try:
        stiffness.Assemble()
    except netgen.NgException as error:
        if "alloc" in str(error):
            raise TooLargeError(f"The memory ran out in elements of order {order}: {error}. {way_out}.") from error
        raise MeshError(str(error)) from error  # netgen refined a face otherwise from either side
    return space, stiffness


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
    system : made by `assemble`
    formulation : what of the remanence is solved for, see above
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
            test = space.TestFunction()
            if formulation == "direct":
                load += ng.CF(tuple(map(float, sources[k].polarization_in_rotor))) * ng.grad(test) * ng.dx(name)
                continue
            susceptibility = mesh.magnets[k].permeability_in_rotor - np.eye(3)
            own = np.zeros(3) if rest is None else rest[k]
            if susceptibility.any() or own.any():
                points = volume_points(mesh.mesh, name, 2 * system.order + 2)
                places = mesh.magnets[k].body.within(mesh.to_meter(points.points))
                source = remanent_field(sources, places) @ susceptibility + own
                for axis in range(3):
                    load += points.function(source[:, axis]) * ng.grad(test)[axis] * points.measure
    load.Assemble()
    free = space.FreeDofs(True)
    for plane, sign in zip(mesh.planes, signs, strict=True):
        if sign < 0:
            free = free & ~space.GetDofs(mesh.mesh.Boundaries(f"plane{plane}"))
    inverse = system.stiffness.mat.Inverse(free, inverse="sparsecholesky")
    potential = solve_open(system.stiffness, inverse, free, load, boundary)
    return Solution(system, signs, potential, boundary)
