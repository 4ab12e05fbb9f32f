"""Factors of the eddy-current problem at one shift, by parity classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import ngsolve
import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import MU_0, Array
from ...geometry.meshes import MILLIMETRE
from ..elements import require_memory, solve_condensed
from .space import EddySpace


class ShiftedSystem:
    """Condensed matrix of curl curl + s μ0 σ, factorised once for each parity class.

    Parameters
    ----------
    space : finite elements
    shift : s, rad/s: iω at a frequency; a real one needs half the memory and a quarter of the work
    """

    def __init__(self, space: EddySpace, shift: complex) -> None:
        self.space, self.shift = space, shift
        self.fes = space.complex_space() if np.iscomplexobj(shift) else space.real
        require_memory(
            self.fes,
            self.fes.FreeDofs(True),
            "Allow a larger error of the plate (--plate-rtol, or --rtol of the command plate)",
        )
        trial, test = self.fes.TnT()
        form = ngsolve.BilinearForm(self.fes, symmetric=True, condense=True)
        form += ngsolve.curl(trial) * ngsolve.curl(test) * ngsolve.dx
        form += shift * MU_0 * MILLIMETRE**2 * space.sigma * trial * test * ngsolve.dx(definedon=space.region)
        form.Assemble()
        self.form = form

    def factor(self, parity_class: Sequence[int]) -> ClassFactor:
        """The factor of one parity class."""
        free = self.space.free_unknowns(parity_class, self.fes)
        inverse = self.form.mat.Inverse(free, inverse="sparsecholesky")
        return ClassFactor(self.form, inverse, self.shift, sum(free))


@dataclass(frozen=True, eq=False)
class ClassFactor:
    """Factorised matrix of one shift and parity class, with the number of its coupling unknowns."""

    form: ngsolve.BilinearForm
    inverse: ngsolve.BaseMatrix
    shift: complex
    unknowns: int

    def solve(self, loads: Array) -> NDArray[Any]:
        """Reactions A = -s (curl curl + s μ0 σ)⁻¹ μ0 ∫ σ A_s·v (sources, unknowns), T m; complex as the shift is."""
        return solve_condensed(self.form, self.inverse, -self.shift * MU_0 / MILLIMETRE * loads)
