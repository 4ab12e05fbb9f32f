"""Fields inside a permeable sphere in a uniform field."""

import numpy as np

from spinlev.geometry.common import Array


def inner_field(incident: Array, permeability: float, polarization: Array) -> tuple[Array, Array]:
    """B and μ0 H (3,), T, in a sphere with remanent polarisation (3,) T in a uniform field (3,) T.

    μ0 H = (3 B0 - J)/(μr + 2), B = μr μ0 H + J.
    """
    h = (3 * np.asarray(incident, float) - np.asarray(polarization, float)) / (permeability + 2)
    return permeability * h + polarization, h
