"""The article's formulas: force along the axis, radius of the side mode, levitation distance.

J. M. Hermansen, F. L. Durhuus and R. Bjørk, Appl. Phys. Lett. 127 (2025) 012402, and its supplement.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ...geometry.common import MU_0, Array
from .article import CONFIGURATIONS, CONTACT, EDGE, FLOATER, REMANENCE

INTERACTION = 1e-7 * FLOATER.moment * REMANENCE * EDGE**3 / MU_0  # G = μ0 m_f m_r / 4π, N m⁴
FARTHEST = 0.12
"""From contact to here roots of the force are looked for, m; nearer, the side mode's radius has no bound."""


@dataclass(frozen=True)
class AxialForce:
    """Parts of the magnetic force along the axis, each like the distances: N, attraction upwards positive."""

    attracting: Array  # by the on-axis field, the terms with cos θ
    repelling: Array  # by the rotating field, the terms with sin θ
    polar_angle: Array  # θ of the floater, rad; NaN where the formula has no solution
    side: Array  # radius a of the side mode, m

    @property
    def total(self) -> Array:
        """Both parts, N."""
        return self.attracting + self.repelling


def field(configuration: str, value: float, distance: Array) -> tuple[Array, Array]:
    """|B⊥| and B_z (T) on the axis, by the formulas of the polar angle without a side mode.

    Parameters
    ----------
    configuration, value : of the rotor, as of `force`
    distance : (n,) m
    """
    across, along, _, _ = PARTS[configuration](CONFIGURATIONS[configuration].scale * value, distance, 0 * distance)
    unit = INTERACTION / FLOATER.moment
    return np.abs(unit * across), unit * along


def side_radius(distance: ArrayLike, frequency: ArrayLike) -> Array:
    """Radius a = 𝒢/(μ_f ω²) of the side mode, m (equation 5)."""
    distance, rate = np.asarray(distance, float), 2 * np.pi * np.asarray(frequency, float)
    return np.asarray(3 * INTERACTION / (distance**4 * FLOATER.mass * rate**2))


def force(configuration: str, value: float, distance: ArrayLike, frequency: float, simple: bool = False) -> AxialForce:
    """Force on the floater: the semi-analytic form, or the simple one for small angles.

    Parameters
    ----------
    configuration : "horizontal", "vertical" or "tilt"
    value : displacement, mm, or tilt, degrees
    distance : (n,) m
    frequency : Hz
    simple : whether θ = m_f B⊥/(I ω²), and no side mode in the tilted case; not for the vertical one
    """
    d, parameter = np.asarray(distance, float), CONFIGURATIONS[configuration].scale * value
    scale, a = 3 * INTERACTION / d**4, side_radius(d, frequency)
    stiffness = FLOATER.inertia * (2 * np.pi * frequency) ** 2
    if simple:
        angle = INTERACTION / (d**3 * stiffness)
        attracting = {"horizontal": 4 * (parameter - a) / d, "tilt": 2 * parameter + 0 * d}[configuration]
        return AxialForce(scale * attracting, -scale * angle, angle, a if configuration == "horizontal" else 0 * a)
    across, along, with_cosine, with_sine = PARTS[configuration](parameter, d, a)
    slack = stiffness - INTERACTION * along
    angle = np.where(slack > 0, INTERACTION * across / np.where(slack > 0, slack, 1.0), np.nan)
    return AxialForce(scale * with_cosine * np.cos(angle), scale * with_sine * np.sin(angle), angle, a)


def _horizontal(displacement: float, d: Array, a: Array) -> tuple[Array, Array, Array, Array]:
    u = (displacement - a) / d
    return (1 - 3 * u**2) / d**3, 3 * u / d**3, 4 * u, 5 * u**2 - 1


def _vertical(displacement: float, d: Array, a: Array) -> tuple[Array, Array, Array, Array]:
    u, far = a / d, d + displacement
    return (
        (1 - 3 * u**2) / d**3 + 3 * a / far**4,
        2 / far**3 - 3 * u / d**3,
        2 * (d / far) ** 4 - 4 * u,
        5 * u**2 - 1 - 4 * a * d**4 / far**5,
    )


def _tilt(angle: float, d: Array, a: Array) -> tuple[Array, Array, Array, Array]:
    u, cosine, sine = a / d, np.cos(angle), np.sin(angle)
    return (
        (cosine - 3 * u * (u * cosine - sine)) / d**3,
        (2 * sine - 3 * u * cosine) / d**3,
        2 * sine - 4 * u * cosine,
        (5 * u**2 - 1) * cosine - 4 * u * sine,
    )


PARTS = {"horizontal": _horizontal, "vertical": _vertical, "tilt": _tilt}
"""B⊥ and B_z by μ0 m_r/4π (1/m³), and the factors of cos θ and sin θ in the force, by 𝒢 (equations 7, 11 and 13)."""


def balanced(configuration: str, value: float, frequency: float, load: float) -> tuple[float, float]:
    """Distances (m) of the stable and of the unstable point at which the semi-analytic force is a load, else NaN.

    Unstable is the farthest place at which attraction falls below the load, stable the next nearer one.

    Parameters
    ----------
    configuration, value, frequency : as of `force`
    load : N
    """
    grid = np.geomspace(CONTACT, FARTHEST, 600)

    def excess(d: ArrayLike) -> Array:
        return force(configuration, value, d, frequency).total - load

    enough = excess(grid) >= 0
    steps = np.flatnonzero(enough[:-1] != enough[1:])
    roots = [float(scipy.optimize.brentq(excess, grid[k], grid[k + 1])) for k in steps[-2:]]
    if not len(roots):
        return np.nan, np.nan
    return (np.nan, roots[0]) if len(roots) == 1 else (roots[0], roots[1])


def analytic_distance(configuration: str, value: float, frequency: ArrayLike) -> Array:
    """Distance without gravity and for small angles, m: equations 17 and 36 of the supplement; NaN for vertical.

    Parameters
    ----------
    configuration, value : as of `force`
    frequency : (n,) Hz
    """
    rate = 2 * np.pi * np.asarray(frequency, float)
    parameter = CONFIGURATIONS[configuration].scale * value
    angular, linear = INTERACTION / (FLOATER.inertia * rate**2), INTERACTION / (FLOATER.mass * rate**2)
    if configuration == "horizontal":
        half = angular / (8 * parameter)
        return np.asarray(np.sqrt(half + np.sqrt(half**2 + 3 * linear / parameter)))
    return np.asarray(np.cbrt(angular / (2 * parameter))) if configuration == "tilt" else np.full(rate.shape, np.nan)
