"""Where the sources of a map of B have their middle."""

import numpy as np
import scipy

from ...geometry.basics import Array
from .field_map import FieldMap, FieldMapError
from .harmonic_basis import HarmonicBasis

SUBSET = 2000
"""Map points that are enough to find a centre."""
EXPLAINED = 0.7
"""A dipole that leaves more than this part of the field's root mean square does not tell where its sources are."""


def find_center(field_map: FieldMap) -> Array:
    """Centre (1, 3) m of the dipole that fits a map best, sought from the origin.

    Raises
    ------
    FieldMapError : too few observations, or no dipole near the origin fits better than none
    """
    field_map.require_observations(6)
    some = field_map.where(np.linspace(0, len(field_map.points) - 1, min(len(field_map.points), SUBSET)).astype(int))
    observed = np.isfinite(some.field)
    values, scale = some.field.T[observed.T], float(np.abs(some.points).max())

    def residual(center: Array) -> Array:
        basis = HarmonicBasis(center[None] * scale, np.array([scale]), 1)
        columns = basis.columns(some.points)[:, observed.T].T
        return np.asarray(columns @ np.linalg.lstsq(columns, values, rcond=None)[0] - values)

    found = scipy.optimize.least_squares(residual, np.zeros(3), x_scale=0.1)
    if not np.linalg.norm(found.fun) < EXPLAINED * np.linalg.norm(values):
        raise FieldMapError("Input centers must be given; instead received None, and one dipole does not fit the map.")
    return np.asarray(found.x * scale).reshape(1, 3)
