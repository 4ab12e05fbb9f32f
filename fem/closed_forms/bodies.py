"""H and magnetisation inside and around magnets and a magnetised sphere, by closed forms."""

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import MU_0, Array
from ...geometry.bodies import Magnet
from .demagnetization import remanent_field

Fields = tuple[Array, Array]
"""H and M, each (n, 3) A/m; B = μ0 (H + M)."""


def fields_of_magnets(magnets: Sequence[Magnet], points: Array) -> Fields:
    """H and M of cuboids at points (n, 3) m off their edges.

    H is that of the remanent polarisation J alone, M = J/μ0 + (μr - 1) H inside. The H of the second part of M is
    left out: of the order of μr - 1, relative to H (`closed_form_error`). Exact for μr = 1.
    """
    h = remanent_field(magnets, points) / MU_0
    magnetization = np.zeros_like(h)
    for magnet in magnets:
        inside = magnet.body.distance(points) <= 0
        magnetization[inside] = magnet.polarization_in_rotor / MU_0
        magnetization[inside] += h[inside] @ (magnet.permeability_in_rotor - np.eye(3)).T
    return h, magnetization


def closed_form_error(magnets: Sequence[Magnet]) -> float:
    """Estimated error of `fields_of_magnets`, relative to the field: the largest μr - 1."""
    return max((magnet.contrast for magnet in magnets), default=0.0)


def fields_of_sphere(moment: Array, center: Array, radius: float, points: Array) -> Fields:
    """H and M of a sphere magnetised uniformly with `moment` (3,) A m²: a dipole's outside, H = -M/3 inside; exact."""
    away = points - center
    distance = np.linalg.norm(away, axis=1)[:, None]
    within = distance <= radius
    magnetization = np.where(within, moment / (4 / 3 * np.pi * radius**3), 0.0)
    unit = away / np.maximum(distance, radius)  # of length 1 outside, where it is used
    outside = (3 * unit * (unit @ moment)[:, None] - moment) / (4 * np.pi * np.maximum(distance, radius) ** 3)
    return np.where(within, -magnetization / 3, outside), magnetization
