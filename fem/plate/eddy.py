"""Time-harmonic eddy currents by finite elements: reduced vector potential, analytic sources.

With the source's potential A_s and the unknown reaction A, for all test functions v (phasors e^{+iωt})

    ∫ curl A · curl v + iωμ0 ∫ σ A · v = -iωμ0 ∫ σ A_s · v,     A × n = 0 far away.

The currents are J = -iωσ(A_s + A).  Their field at a receiver follows by reciprocity: for a dipole m'
whose potential is A' = A_s of m', m'·B = ∫ J · A', so that the coupling of a receiver and a source is

    -iω ∫ σ A' · (A_s + A) dV,

symmetric and superconvergent (its error is the square of the energy error).  A. Bossavit, Computational
Electromagnetism (1998), ch. 8; O. Bíró, Comput. Methods Appl. Mech. Engrg. 169 (1999) 391.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.basics import MU_0, Array
from ...geometry.meshes import ConductorMesh
from ..closed_forms import ComplexArray
from .shifted_system import ShiftedSystem
from .space import EddySpace, Source

RESISTIVE = 1e-2
"""ωμ0σL² below which the response is resistive: A = a0 + iω a1, with a0 (charges) and a1 (currents) real and constant.
The slowest current of a plate decays in less than μ0σL²/100, so that this is exact to RESISTIVE²/1e4 = 1e-8."""
SILENT = 1e-9
"""Parity parts smaller than this share of the whole source are not solved for."""


@dataclass(frozen=True, eq=False)
class ClassResponse:
    """One parity class: solutions (sources, unknowns), T m, with loads and potentials as `EddySpace` makes them."""

    potentials: Array
    loads: Array
    solutions: ComplexArray


@dataclass(frozen=True, eq=False)
class EddyResponse:
    """Eddy currents of several sources at one shift.

    Parameters
    ----------
    space : the finite-element space
    shift : s, rad/s: iω at a frequency
    classes : responses by number of the parity class; silent ones are missing
    coupling_unknowns : size of the factorised matrix, of the largest class
    """

    space: EddySpace
    shift: complex
    classes: dict[int, ClassResponse]
    coupling_unknowns: int

    @property
    def frequency(self) -> float:
        """Hz, of phasors e^{+iωt}."""
        return float(np.imag(self.shift)) / (2 * np.pi)

    @property
    def couplings(self) -> ComplexArray:
        """(sources, sources) ∫ J_j · A_i dV, J; for dipoles of 1 A m² it is B_i, T. Symmetric to round-off."""
        return self._sum({number: (c.potentials, c.loads) for number, c in self.classes.items()})

    def couplings_to(self, receivers: Sequence[Source]) -> ComplexArray:
        """(receivers, sources) ∫ J_j · A_i dV for other receivers, J."""
        images = self.space.class_images(receivers)
        return self._sum({number: (images[number], self.space.loads(images[number])) for number in self.classes})

    def _sum(self, tests: dict[int, tuple[Array, Array]]) -> ComplexArray:
        factor = -self.shift * self.space.conductors.images
        total: ComplexArray = np.zeros((0, 0), complex)
        for number, (potentials, loads) in tests.items():
            c = self.classes[number]
            direct = np.einsum("q,iqa,jqa->ij", self.space.weights, potentials, c.potentials, optimize=True)
            part = factor * (direct + loads @ c.solutions.T)
            total = part if total.size == 0 else total + part
        return total


def solve_eddy(
    conductors: ConductorMesh, order: int, frequency: float, sources: Sequence[Source], space: EddySpace | None = None
) -> EddyResponse:
    """Eddy currents of all `sources` at `frequency` (Hz), with one factorisation for each parity class that they touch.

    Any frequency from 0 up is safe: the gauge needs no parameter, and below ωμ0σL² = 1e-2 the resistive limit
    is used, exact to 1e-8.  At high frequency the mesh must resolve the skin depth; `plate_currents` estimates whether
    it does.

    Raises
    ------
    ValueError : frequency negative or not finite, order below 1, or no sources
    TooLargeError : the memory does not hold the system
    """
    if not (np.isfinite(frequency) and frequency >= 0):
        raise ValueError(f"Input frequency_hz must be finite and not negative; instead received {frequency!r}.")
    if not sources:
        raise ValueError("Input sources must hold at least one source; instead received none.")
    space = space or EddySpace(conductors, order)
    solved = max(frequency, _resistive_frequency(space))
    response = solve_shifted(space, 2j * np.pi * solved, sources)
    scaled = {
        number: replace(part, solutions=part.solutions.real + 1j * part.solutions.imag * (frequency / solved))
        for number, part in response.classes.items()
    }
    return replace(response, shift=2j * np.pi * frequency, classes=scaled)


def solve_shifted(space: EddySpace, shift: complex, sources: Sequence[Source]) -> EddyResponse:
    """The answers of all `sources` where iω is `shift`, rad/s: a real one is that of fields that grow as e^{st}.

    Raises
    ------
    TooLargeError : the memory does not hold the system
    """
    system = ShiftedSystem(space, shift)
    images = space.class_images(sources)
    size = np.sqrt(np.einsum("csqa->cs", images**2 * space.weights[:, None]))
    classes, coupling = {}, 0
    for number, parity_class in enumerate(space.parity.classes):
        if np.all(size[number] <= SILENT * np.linalg.norm(size, axis=0)):
            continue
        loads = space.loads(images[number])
        factor = system.factor(parity_class)
        classes[number] = ClassResponse(images[number], loads, factor.solve(loads))
        coupling = max(coupling, factor.unknowns)
    return EddyResponse(space, shift, classes, coupling)


def _resistive_frequency(space: EddySpace) -> float:
    extent = 2 * float(np.abs(space.points).max())
    conductivity = max(space.conductors.conductivity.values())
    return RESISTIVE / (2 * np.pi * MU_0 * conductivity * extent**2)
