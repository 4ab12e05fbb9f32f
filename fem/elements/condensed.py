"""Systems whose element-inner unknowns are condensed out: the factor holds the coupling ones only."""

from __future__ import annotations

from typing import Any, TypeVar

import ngsolve
import ngsolve as ng
import numpy as np
import scipy
from numpy.typing import NDArray

from ...geometry.basics import Array, ComputationError
from .open_boundary import OpenBoundary

Number = TypeVar("Number", np.float64, np.complex128)


def solve_condensed(form: ngsolve.BilinearForm, inverse: ngsolve.BaseMatrix, loads: NDArray[Number]) -> NDArray[Number]:
    """Solutions (n, unknowns), inner unknowns included, for loads (n, unknowns), real or complex as the form is.

    Parameters
    ----------
    form : assembled with `condense=True`
    inverse : of its matrix on the free coupling unknowns
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


class OpenFactor:
    """A factor that knows the open boundary: many loads, each at the price of one in the ball of air alone.

    It is made by a solution for each harmonic of the boundary; for a single load `solve_open` takes fewer.

    What the boundary adds to the matrix K is of low rank, P D Pᵀ, so that with U = K⁻¹P a solution is
    u - U (D⁻¹ + Pᵀ U)⁻¹ Pᵀ u of K u = f (Sherman, Morrison, Woodbury).

    Parameters
    ----------
    form : assembled with `condense=True`
    inverse : of its matrix on the free coupling unknowns
    boundary : whose harmonics are added
    """

    def __init__(self, form: ngsolve.BilinearForm, inverse: ngsolve.BaseMatrix, boundary: OpenBoundary) -> None:
        self._form, self._inverse = form, inverse
        self._loads, factors = boundary.lacking()
        answers = solve_condensed(form, inverse, self._loads)
        self._mixed = np.linalg.solve(np.diag(1 / factors) + self._loads @ answers.T, answers)

    def solve(self, loads: Array) -> Array:
        """Solutions (n, unknowns) for loads (n, unknowns)."""
        alone = solve_condensed(self._form, self._inverse, loads)
        return np.asarray(alone - (alone @ self._loads.T) @ self._mixed)


class ConvergenceError(ComputationError):
    """The linear solver did not reach its tolerance."""


def solve_open(stiffness: Any, inverse: Any, free_dofs: Any, load: Any, boundary: OpenBoundary) -> Any:
    """The potential, an NGSolve function.

    Parameters
    ----------
    stiffness, load : condensed forms, without what harmonics beyond the Robin term do at the boundary
    inverse : of the stiffness on the free unknowns
    free_dofs : the unknowns that are not zero, without those that are condensed

    Raises
    ------
    ConvergenceError : the iteration for the open boundary stalls
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
    full = scipy.sparse.linalg.LinearOperator(
        shape, matvec=lambda x: multiply(stiffness.mat, x) + np.where(free, boundary.apply(x), 0.0), dtype=float
    )
    preconditioner = scipy.sparse.linalg.LinearOperator(shape, matvec=lambda x: multiply(inverse, x), dtype=float)
    right_hand_side = np.where(free, load.vec.FV().NumPy(), 0.0)
    result, failed = scipy.sparse.linalg.cg(full, right_hand_side, rtol=1e-12, maxiter=100, M=preconditioner)
    if failed:
        raise ConvergenceError(f"The open boundary did not converge in {failed} iterations; use a larger ball of air.")
    potential.vec.FV().NumPy()[:] = result
    potential.vec.data += stiffness.harmonic_extension * potential.vec
    potential.vec.data += stiffness.inner_solve * load.vec
    return potential
