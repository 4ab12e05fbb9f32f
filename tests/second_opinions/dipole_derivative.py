"""The derivative of a dipole's vector potential by its place."""

from dataclasses import dataclass

import numpy as np

from spinlev.geometry.common import MU_0, Array, frozen_array


@dataclass(frozen=True, eq=False)
class DipoleDerivative:
    """What a dipole's potential changes by per metre of its displacement along `direction`.

    As a receiver it measures direction · ∇(m · B), the force along that direction.

    Parameters
    ----------
    position : (3,) m
    moment : (3,) A m²
    direction : (3,) unit vector
    """

    position: Array
    moment: Array
    direction: Array

    def __post_init__(self) -> None:
        for name in ("position", "moment", "direction"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), (3,)))

    def vector_potential(self, points: Array) -> Array:
        """∂A/∂s (n, 3), T, at points (n, 3), m."""
        offset = points - self.position
        distance = np.linalg.norm(offset, axis=1)[:, None]
        along = (offset @ self.direction)[:, None]
        turned = 3 * along * np.cross(self.moment, offset) / distance**2 - np.cross(self.moment, self.direction)
        return np.asarray(MU_0 / (4 * np.pi) * turned / distance**3)
