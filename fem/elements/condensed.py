"""Solutions of condensed finite-element systems, with their memory estimated beforehand, and open boundaries.

Element matrices with what static condensation keeps of them take Σ N² numbers, N the unknowns of an element.  The
factor of nested dissection is mostly that of its last separators, planes across the mesh: with s unknowns on such a
plane it takes about `SEPARATORS` s² numbers.  n unknowns on f faces of e elements put s = n e^(2/3)/f there.
Measured peaks were 0.9 to 1.0 of what is predicted here on rotors (orders 3 to 5, up to 1.1 GB), where some symmetry
leaves plates fewer unknowns 0.65 to 0.8 (orders 2 to 5).

A. George, SIAM J. Numer. Anal. 10, 345 (1973) (nested dissection).

Open boundary: outside a sphere of radius R a potential of degree l falls as r^-(l+1), so that -∂u/∂r = (l+1)/R u_l. A
Robin term 2/R is exact for l = 1; what other degrees lack is a matrix of low rank, (l-1)/R on each harmonic up to
`degree`. On a part of the sphere that mirror planes cut out, only harmonics of the potential's parity take part.
"""

import contextlib
import resource
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import ngsolve
import ngsolve as ng
import numpy as np
import psutil
import scipy
from numpy.typing import NDArray

from ...geometry.common import Array, ComputationError
from ..harmonics.solid import FOUR_PI, Coefficients, harmonic_parity, members, orthonormal, outer_coefficients
from .spaces import load_vector, surface_points

SEPARATORS = 34.0  # numbers in the factor over the square of the unknowns on a plane; 17 to 36 were measured
PEAK = 1.2  # the largest amount while the factor is made, over what is kept
HEAP = 300_000_000  # address space that NGSolve reserves while it assembles, bytes; most of it is never touched
GROUP = Path("/sys/fs/cgroup")  # where Linux gives the limits of a container or a batch job


class TooLargeError(ComputationError):
    """A system that the free memory does not hold."""


def memory_need(space: ngsolve.FESpace, free: ngsolve.BitArray) -> tuple[float, float]:
    """Bytes of a symmetric system on `free` unknowns: the matrix with what is condensed, and the factor."""
    mesh, number = space.mesh, 16 if space.is_complex else 8
    sizes = [sum(dof >= 0 for dof in space.GetDofNrs(ngsolve.ElementId(ngsolve.VOL, k))) for k in range(int(mesh.ne))]
    separator = free.NumSet() * mesh.ne ** (2 / 3) / max(mesh.nface, 1)
    return float(number * sum(n**2 for n in sizes)), float(SEPARATORS * number * separator**2)


def require_memory(space: ngsolve.FESpace, free: ngsolve.BitArray, way_out: str) -> None:
    """Refuse a system that the free memory does not hold, before anything of it is made.

    `space`, `free`: NGSolve space, and its unknowns that are solved for; `way_out`: what the user can do, for the
    message of the TooLargeError.
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


def solve_condensed(form: ngsolve.BilinearForm, inverse: ngsolve.BaseMatrix, loads: NDArray[Number]) -> NDArray[Number]:
    """Solutions (n, unknowns), inner ones included, of `loads` (n, unknowns), real or complex as the `form` is.

    `form`: assembled with `condense=True`; `inverse`: of its matrix on the free coupling unknowns.
    """
    right, solution = ngsolve.GridFunction(form.space), ngsolve.GridFunction(form.space)
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
