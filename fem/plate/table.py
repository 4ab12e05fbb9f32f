"""A plate as a table: a passive network whose field functions are harmonic where the floater is."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry.basics import Array, frozen_array, millimetres
from ..closed_forms import ComplexArray
from ..plate_currents import Region
from ..plate_network import ENOUGH, refuse
from ..rotor_tables import RangeError
from .field_functions import Multipoles


@dataclass(frozen=True)
class PlateErrors:
    """Estimated relative errors of reaction tensors: finite elements, states left out, field functions."""

    mesh: float
    states: float
    functions: float

    @property
    def total(self) -> float:
        """Their sum."""
        return self.mesh + self.states + self.functions

    def check(self, rtol: float, conductor: str) -> None:
        """Refuse a table of a conductor, in words, that misses its tolerance.

        The states follow what is asked, while what the field functions miss hardly does: with more than the sum of
        both there are states enough.

        Raises
        ------
        AccuracyError : it names a tolerance that can be met
        """
        if self.total > rtol:
            refuse(rtol, ENOUGH * self.total, conductor)


@dataclass(frozen=True, eq=False)
class PlateTable:
    """Eddy currents of a plate as states p_i in the plate's own frame, √J:

        dp_i/dt = -λ_i (p_i - s_i),    s_i = b_i(x)·m + other sources,    y_i = p_i - s_i,

    with the currents y_i.  On a dipole m at x act the field B = Σ y_i b_i(x), hence the torque m × B, and the force
    Σ y_i ∇(m·b_i); the currents hold the energy ½ Σ y_i² and lose the power Σ λ_i y_i².  As the force is the exact
    gradient of the same b_i, work, stored energy and loss add up to nothing, always.  Phasors e^{+iωt}:

        B = G m,    G(x, ω) = -iω Σ b_i b_iᵀ / (λ_i + iω).

    The network is passive by construction.  There is no quasi-static remainder: added to the states left out, it was
    found to double their error at the highest frequency.

    Parameters
    ----------
    size : (3,) edges of the plate, m
    conductivity : S/m
    region : where the table knows the fields, in the frame of the plate (origin at its centre)
    frequencies : lowest and highest of the training, Hz; below the lowest the table stays right
    rates : (n,) λ_i, 1/s, positive
    multipoles : k harmonic functions
    weights : (n, k) of each in b_i, 1/√J: b_i is in T/√J
    errors : estimates
    provenance : how the table was made; texts and numbers
    """

    size: Array
    conductivity: float
    region: Region
    frequencies: tuple[float, float]
    rates: Array
    multipoles: Multipoles
    weights: Array
    errors: PlateErrors
    provenance: Mapping[str, str | float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", frozen_array(self.size, (3,)))
        object.__setattr__(self, "rates", frozen_array(self.rates, (len(self.rates),)))
        object.__setattr__(self, "weights", frozen_array(self.weights, (len(self.rates), len(self.multipoles.kinds))))

    def __repr__(self) -> str:
        lower, upper = millimetres(self.region.lower), millimetres(self.region.upper)
        slowest, fastest = 1e3 / self.rates.min(), 1e3 / self.rates.max()
        return "\n".join([
            f"PlateTable of {millimetres(self.size)}, {self.conductivity:.3g} S/m: {len(self.rates)} currents",
            f"  memory from {fastest:.2g} to {slowest:.3g} ms; {len(self.multipoles.kinds)} multipoles",
            f"  relative error {self.errors.total:.1e} up to {self.frequencies[1]:g} Hz",
            f"  from {lower} to {upper} from the plate's centre",
        ])  # fmt: skip

    def field_functions(self, points: ArrayLike) -> tuple[Array, Array]:
        """b_i (n, states, 3), T/√J, and ∂b_ia/∂x_c (n, states, 3, 3), T/(√J m), at points (n, 3), m.

        Raises
        ------
        RangeError : a point outside the region
        """
        points = np.asarray(points, float).reshape(-1, 3)
        known = self.in_range(points)
        if not known.all():
            where = ", ".join(f"{c * 1e3:.6g}" for c in points[int(np.argmin(known))])
            lower, upper = (np.round(bound * 1e3, 6).tolist() for bound in (self.region.lower, self.region.upper))
            raise RangeError(
                f"Input points must lie between {lower} and {upper} mm from the plate's centre, along its axes; "
                f"instead received ({where}) mm.  Make a table for a larger region."
            )
        b, gradient = self.multipoles.evaluate(points)
        return (
            np.asarray(np.tensordot(b, self.weights, (1, 1)).swapaxes(1, 2)),
            np.asarray(np.moveaxis(np.tensordot(gradient, self.weights, (1, 1)), -1, 1)),
        )

    def in_range(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which of the points (n, 3) m lie in the region: (n,)."""
        return self.region.contains(points)

    def reaction_tensor(self, points: ArrayLike, frequency: float) -> ComplexArray:
        """G (n, 3, 3), T/(A m²), at points (n, 3), m, and a frequency, Hz: symmetric and passive to round-off.

        Raises
        ------
        RangeError : a point outside the region, or a frequency not between 0 and the highest of the table
        """
        b, _ = self.field_functions(points)
        return np.asarray(np.einsum("nia,i,nib->nab", b, self._response(frequency), b, optimize=True))

    def reaction_gradient(self, points: ArrayLike, frequency: float) -> ComplexArray:
        """T (n, 3, 3, 3), T/(A m³): ∂_l B_i = T_lij m_j at the dipole's own place. Errors as `reaction_tensor`."""
        b, gradient = self.field_functions(points)
        return np.asarray(np.einsum("nkil,k,nkj->nlij", gradient, self._response(frequency), b, optimize=True))

    def _response(self, frequency: float) -> ComplexArray:
        if not 0 <= frequency <= self.frequencies[1]:
            raise RangeError(
                f"Input frequency_hz must be between 0 and {self.frequencies[1]:g}, for which the table was made; "
                f"instead received {frequency!r}."
            )
        omega = 2 * np.pi * frequency
        return np.asarray(-1j * omega / (self.rates + 1j * omega))
