"""Solution of a system whose element-inner unknowns are condensed out: the factor holds the coupling ones only."""

from typing import TypeVar

import ngsolve
import numpy as np
from numpy.typing import NDArray

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
