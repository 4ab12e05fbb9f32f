"""Magnetostatics of permanent magnets by finite elements, with the scalar potential.

The unknown is ψ in H1, with μ0 H = H0 - ∇ψ (all in T). Two formulations share the same code:

- `split`: H0 is the closed form of the magnets with μr = 1, and only what their permeability adds is computed,
      ∫ μr ∇ψ·∇v = ∫_magnets (μr - 1) H0·∇v,        M = (μr - 1)(H0 - ∇ψ);
- `direct`: no closed form, H0 = 0,
      ∫ μr ∇ψ·∇v = ∫_magnets J·∇v,                   M = J + (μr - 1)(-∇ψ).

M is the magnetisation μ0 M (T) that makes the outer field, in `split` beside the closed form. The outer field is taken
from functionals of the solution, which converge twice as fast as its values: the moments of M in each magnet, or the
harmonics of ψ on the outer sphere. The space outside that sphere is exact (`open_boundary`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import ngsolve as ng
import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from ..geometry.box import Array
from ..geometry.magnet import Magnet
from ..geometry.mesh import MagnetMesh
from .harmonics import Coefficients
from .integration_points import surface_points, volume_points
from .multipole import moments_of_magnetization, uniform_moments
from .open_boundary import OpenBoundary
from .remanent import remanent_h, remanent_moments

Formulation = Literal["split", "direct"]


class ConvergenceError(RuntimeError):
    """The linear solver did not reach its tolerance."""


@dataclass(frozen=True, eq=False)
class Solution:
    """A potential and what belongs to it.

    Parameters
    ----------
    mesh, formulation, order : as given to `solve`
    potential : ψ, T times mesh unit (an NGSolve function)
    boundary : the open boundary
    unknowns : number of unknowns, and `coupling_unknowns` those left after static condensation
    iterations : of the conjugate gradients that put the open boundary on top of the factorised matrix
    """

    mesh: MagnetMesh
    formulation: Formulation
    order: int
    potential: Any
    boundary: OpenBoundary
    unknowns: int
    coupling_unknowns: int
    iterations: int


def solve(mesh: MagnetMesh, formulation: Formulation = "split", order: int = 3, boundary_degree: int = 8) -> Solution:
    """Solve for the potential with elements of degree `order`.

    Parameters
    ----------
    boundary_degree : harmonics up to this degree see an exactly open outer boundary

    Raises
    ------
    ConvergenceError : the iteration for the open boundary stalls
    """
    space = ng.H1(mesh.mesh, order=order)
    trial, test = space.TnT()
    permeability = mesh.mesh.MaterialCF(
        {f"magnet{k}": magnet.recoil_permeability for k, magnet in enumerate(mesh.magnets)}, default=1.0
    )
    boundary = OpenBoundary(mesh.mesh, space, mesh.ball_radius, boundary_degree, order)
    stiffness = ng.BilinearForm(space, symmetric=True, condense=True)
    stiffness += permeability * ng.grad(trial) * ng.grad(test) * ng.dx
    stiffness += boundary.robin * trial * test * ng.ds("outer")
    load = ng.LinearForm(space)
    for k, magnet in enumerate(mesh.magnets):
        _add_source(load, test, mesh, k, magnet, formulation, order)
    stiffness.Assemble()
    load.Assemble()
    potential, iterations = _solve_open(stiffness, load, space, boundary)
    coupling = sum(space.FreeDofs(True))
    return Solution(mesh, formulation, order, potential, boundary, space.ndof, coupling, iterations)


def _add_source(
    load: Any, test: Any, mesh: MagnetMesh, k: int, magnet: Magnet, formulation: Formulation, order: int
) -> None:
    name = f"magnet{k}"
    if formulation == "direct":
        load += ng.CF(tuple(map(float, magnet.polarization_in_rotor))) * ng.grad(test) * ng.dx(name)
        return
    points = volume_points(mesh.mesh, name, 2 * order + 2)
    source = (magnet.recoil_permeability - 1) * remanent_h(mesh.magnets, k, mesh.to_meter(points.points))
    for axis in range(3):
        load += points.function(source[:, axis]) * ng.grad(test)[axis] * points.measure


def _solve_open(stiffness: Any, load: Any, space: Any, boundary: OpenBoundary) -> tuple[Any, int]:
    """Static condensation, a sparse Cholesky factor, and conjugate gradients for the open boundary on top of it."""
    potential = ng.GridFunction(space)
    inverse = stiffness.mat.Inverse(space.FreeDofs(True), inverse="sparsecholesky")
    load.vec.data += stiffness.harmonic_extension_trans * load.vec
    free = np.array(space.FreeDofs(True))
    source, target = load.vec.CreateVector(), load.vec.CreateVector()

    def multiply(operator: Any, values: Array) -> Array:
        source.FV().NumPy()[:] = values
        target.data = operator * source
        return np.where(free, target.FV().NumPy(), 0.0)

    shape = (space.ndof, space.ndof)
    full = LinearOperator(shape, matvec=lambda x: multiply(stiffness.mat, x) + boundary.apply(x), dtype=float)
    preconditioner = LinearOperator(shape, matvec=lambda x: multiply(inverse, x), dtype=float)
    counted: list[int] = []
    right_hand_side = np.where(free, load.vec.FV().NumPy(), 0.0)
    result, failed = cg(
        full, right_hand_side, rtol=1e-12, maxiter=100, M=preconditioner, callback=lambda _: counted.append(1)
    )
    if failed:
        raise ConvergenceError(f"The open boundary did not converge in {failed} iterations; use a larger ball of air.")
    potential.vec.FV().NumPy()[:] = result
    potential.vec.data += stiffness.harmonic_extension * potential.vec
    potential.vec.data += stiffness.inner_solve * load.vec
    return potential, len(counted)


def trace_moments(solution: Solution) -> Coefficients:
    """Coefficients (T) of the outer field of ψ, read from the outer sphere, about its centre; radius `mesh.unit`."""
    return solution.boundary.expansion(solution.potential.vec.FV().NumPy())


def magnet_moments(solution: Solution, degree: int) -> tuple[Coefficients, ...]:
    """Coefficients (T) of M in every magnet about its own centre, with radius its circumradius.

    The closed part of M, (μr - 1) H0 or J, is integrated apart from the mesh, to round-off; only ∇ψ is a finite-element
    quantity, so that the error is of the order of (μr - 1)² times the square of the error of ∇ψ. Because the harmonics
    Υ_lm have no Laplacian, ∫ ∇ψ·∇Υ dV over a magnet equals the integral of ψ ∂Υ/∂n over its faces.
    """
    return tuple(_moments(solution, k, magnet, degree) for k, magnet in enumerate(solution.mesh.magnets))


def _moments(solution: Solution, k: int, magnet: Magnet, degree: int) -> Coefficients:
    box, mesh = magnet.box, solution.mesh
    susceptibility = magnet.recoil_permeability - 1
    if solution.formulation == "direct":
        closed = uniform_moments(magnet, degree).coefficients
    else:
        closed = susceptibility * remanent_moments(mesh.magnets, k, degree)
    points, weighted_normals = _faces(solution, k)
    shape = moments_of_magnetization(
        points, np.ones(len(points)), weighted_normals, box.center, box.circumradius, degree
    )
    return closed - susceptibility * shape


def _faces(solution: Solution, k: int) -> tuple[Array, Array]:
    """Integration points (n, 3) m on the faces of one magnet and ψ n dS there, T m³."""
    mesh, box = solution.mesh, solution.mesh.magnets[k].box
    surface = surface_points(mesh.mesh, "faces", 2 * solution.order + 4)
    points = mesh.to_meter(surface.points)
    mine = (surface.weights > 0) & (np.abs(box.distance(points)) < 1e-9 * box.circumradius)
    body = box.to_body(points[mine])
    axis = np.argmax(np.abs(body) / box.half_edges, axis=1)
    normals = box.rotation.T[axis] * np.sign(np.take_along_axis(body, axis[:, None], axis=1))
    potential = surface.sample(solution.potential)[mine, 0]
    return points[mine], (surface.weights[mine] * potential * mesh.unit**3)[:, None] * normals
