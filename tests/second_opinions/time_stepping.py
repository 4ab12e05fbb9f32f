"""Eddy currents step by step in time, on the finite elements themselves: the reference for a network's memory.

With the flux w = M A + f, where M = ∫ σ u·v is the mass in the conductors and f = ∫ σ A_s·v the load of the source,

    dw/dt = -K A,    K = ∫ curl u · curl v / μ0,

so that no time derivative of the source is needed.  It is integrated by a two-stage, second-order, L-stable diagonally
implicit Runge-Kutta method (R. Alexander, SIAM J. Numer. Anal. 14 (1977) 1006): each stage solves
(M + γ Δt K) A = W - f with one factor, and it holds in air too, where there is no mass.
"""

from collections.abc import Callable, Iterator, Sequence

import ngsolve
import numpy as np

from spinlev.fem.elements.spaces import solve_condensed
from spinlev.fem.plate.eddy import EddySpace, Source
from spinlev.geometry.common import MU_0, Array
from spinlev.geometry.meshes.plate import MILLIMETRE

GAMMA = 1 - np.sqrt(0.5)
"""Diagonal entry of the method, and time of its first stage."""
Motion = Callable[[float], Source]
"""The source at a time (s)."""


class TimeStepper:
    """Matrices of a space for steps of one length, factorised for every parity class.

    Parameters
    ----------
    space : finite elements
    step : Δt, s
    """

    def __init__(self, space: EddySpace, step: float) -> None:
        self.space, self.step = space, step
        trial, test = space.real.TnT()
        mass = space.sigma * trial * test
        self._form = ngsolve.BilinearForm(space.real, symmetric=True, condense=True)
        self._form += ngsolve.curl(trial) * ngsolve.curl(test) * ngsolve.dx
        rate = MU_0 * MILLIMETRE**2 / (GAMMA * step)
        self._form += rate * mass * ngsolve.dx(definedon=space.region)
        self._form.Assemble()
        self._mass = ngsolve.BilinearForm(space.real, symmetric=True)
        self._mass += mass * ngsolve.dx(definedon=space.region)
        self._mass.Assemble()
        free = [space.free_unknowns(c, space.real) for c in space.parity.classes]
        self._inverses = [self._form.mat.Inverse(f, inverse="sparsecholesky") for f in free]

    def march(self, source: Motion, start: float, steps: int) -> Iterator[tuple[float, Array]]:
        """Times (s) and reactions A (classes, unknowns), T m, from rest at `start`: no currents before it."""
        flux = self._load(source, start)
        yield start, np.zeros_like(flux)
        for number in range(1, steps + 1):
            time = start + (number - 1) * self.step
            load = self._load(source, time + GAMMA * self.step)
            slope = (self._massive(self._solve(flux - load)) + load - flux) / GAMMA
            middle = flux + (1 - GAMMA) * slope
            time = start + number * self.step
            load = self._load(source, time)
            reaction = self._solve(middle - load)
            flux = self._massive(reaction) + load
            yield time, reaction

    def _load(self, source: Motion, time: float) -> Array:
        """∫ σ A_s·v (classes, unknowns), S m³ T."""
        return self.space.loads(self.space.class_images([source(time)])[:, 0])

    def _solve(self, right: Array) -> Array:
        """A (classes, unknowns) of (M + γ Δt K) A = right."""
        loads = MU_0 / (GAMMA * self.step * MILLIMETRE) * right
        pairs = zip(self._inverses, loads, strict=True)
        return np.concatenate([solve_condensed(self._form, inverse, load[None]) for inverse, load in pairs])

    def _massive(self, reaction: Array) -> Array:
        mass = self._mass.mat
        vector, product = mass.CreateColVector(), mass.CreateColVector()
        found = np.zeros_like(reaction)
        for row, values in zip(found, reaction, strict=True):
            vector.FV().NumPy()[:] = values
            product.data = mass * vector
            row[:] = MILLIMETRE**3 * product.FV().NumPy()
        return found


def work_on(
    space: EddySpace, receivers: Sequence[Source], source: Motion, time: float, reactions: Sequence[Array], step: float
) -> Array:
    """∫ J·A' dV (receivers,), J, of the currents at `time` (s), from the reactions at five times `step` (s) apart.

    The derivative is that of a polynomial of degree 4 through the five.
    """
    weights = np.array([1, -8, 0, 8, -1]) / (12 * step)
    applied = sum(
        w * space.class_images([source(time + k * step)])[:, 0]
        for w, k in zip(weights, range(-2, 3), strict=True) if w
    )  # fmt: skip
    reaction = sum(w * a for w, a in zip(weights, reactions, strict=True))
    heard = space.class_images(receivers)
    total = np.zeros(len(receivers))
    for images, rate, change in zip(heard, applied, reaction, strict=True):
        direct = np.einsum("q,iqa,qa->i", space.weights, images, rate, optimize=True)
        total -= direct + space.loads(images) @ change
    return space.conductors.images * total
