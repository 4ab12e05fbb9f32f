"""A magnetised sphere with recoil permeability in any field: exact, degree by degree.

Inside, B = μ0 μr H + J with uniform J. Continuity of the potential and of B_n at the surface gives for an incident
potential of degree l the outer one -t_l (R/r)^(2l+1) times as large,

    t_l = l (μr - 1) / (l (μr + 1) + 1),

and for J the outer field of a dipole of moment (J V/μ0) 3/(μr + 2), with no field of another degree.
Of two charges at a and b (radii from the centre) one has in the answer to the other the energy Σ t_l P_l (ab)^-(l+1);
with t_l = t (1 - Σ w β^l), nearly, these are images' 1/√(a²b² - 2β a·b + β²), the degrees 0 and 1 taken off.
J. D. Jackson, Classical Electrodynamics (3rd ed. 1999), sections 4.4 and 5.11; W. R. Smythe, Static and Dynamic
Electricity (3rd ed. 1968), section 5.
"""

from collections.abc import Sequence
from typing import Any

import heyoka as hy
import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Floater
from ..harmonics import Ball, Coefficients, dipole_sources, factorials

IMAGES, FITTED = (0.95, 0.73, 0.3), 14
"""β of the images, and the degree up to which their weights are fitted from 2 on: to 7e-4 of t_l."""


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


def image_weights(permeability: float) -> Array:
    """w (3,) of the images that stand for the degrees of a sphere's answer."""
    l = np.arange(2, FITTED)
    share = reflection(permeability, FITTED)[2:FITTED] * (permeability + 1) / (permeability - 1)
    return np.asarray(np.linalg.lstsq(np.array([beta**l for beta in IMAGES]).T, share - 1, rcond=None)[0])


def answer_to_charge(a: Sequence[Any], b: Sequence[Any], weights: Sequence[Any]) -> hy.expression:
    """Σ_{l≥2} (t_l/t) P_l(cos) (ab)^-(l+1), t = (μr - 1)/(μr + 1), for places a and b (three expressions, radii)."""
    square = hy.sum([x * x for x in a]) * hy.sum([x * x for x in b])
    along = hy.sum([x * y for x, y in zip(a, b, strict=True)])
    far = 1.0 / hy.sqrt(square)
    parts = [1.0 / hy.sqrt(square - 2.0 * along + 1.0)]
    for beta, weight in zip(IMAGES, weights, strict=True):
        parts.append(weight / hy.sqrt(square - (2.0 * beta) * along + beta * beta))
    flat = sum(weights, start=1.0)
    steep = sum((beta * weight for beta, weight in zip(IMAGES, weights, strict=True)), start=1.0)
    return hy.sum(parts) - far * (flat + steep * along * (far * far))


def field_of_answer(a: Sequence[Any], b: Sequence[Any], weights: Sequence[Any]) -> list[hy.expression]:
    """Its gradient (3) by b: the field at b of what the sphere answers to a charge at a."""
    given = hy.make_vars("b_x", "b_y", "b_z")
    slope = hy.diff_tensors([answer_to_charge(a, given, weights)], diff_args=given, diff_order=1).gradient
    names = {str(v): value for v, value in zip(given, b, strict=True)}
    return [hy.subs(part, names) for part in slope]
