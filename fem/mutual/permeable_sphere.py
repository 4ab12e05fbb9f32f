"""A magnetised sphere with recoil permeability in any field: exact, degree by degree.

Inside, B = μ0 μr H + J with uniform J. Continuity of the potential and of B_n at the surface gives for an incident
potential of degree l the outer one -t_l (R/r)^(2l+1) times as large,

    t_l = l (μr - 1) / (l (μr + 1) + 1),

and for J the outer field of a dipole of moment (J V/μ0) 3/(μr + 2), with no field of another degree.
J. D. Jackson, Classical Electrodynamics (3rd ed. 1999), sections 4.4 and 5.11; W. R. Smythe, Static and Dynamic
Electricity (3rd ed. 1968), section 5.
"""

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Floater
from ..harmonics import Ball, Coefficients, dipole_sources, factorials


def reflection(permeability: float, degree: int) -> Array:
    """t_l (degree + 1,) of a sphere: 0 for μr = 1, and 1 for l ≥ 1 and μr → ∞."""
    l = np.arange(degree + 1)
    return np.asarray(l * (permeability - 1) / (l * (permeability + 1) + 1))


def induced_sources(incident: Coefficients, permeability: float) -> Coefficients:
    """c_lm (T) of what the incident field a_lm (T) induces in a sphere that fills the ball."""
    degree = len(incident) - 1
    return np.asarray(-reflection(permeability, degree)[:, None] * np.conj(incident) / factorials(degree))


def permanent_sources(floater: Floater, direction: Array, ball: Ball, degree: int) -> Coefficients:
    """c_lm (T) of the floater's remanent polarisation along a unit vector (3,): a dipole."""
    return dipole_sources(floater.moment * np.asarray(direction, float), ball, degree)
