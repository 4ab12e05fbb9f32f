"""Vector potentials of sources in free space: dipole, uniformly polarised cuboid, uniform field."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import MU_0, Array, Box, frozen_array
from ...geometry.bodies import Magnet
from .newton import attraction


@dataclass(frozen=True, eq=False)
class Dipole:
    """A point dipole, A = (μ0/4π) m × r/r³.

    Parameters
    ----------
    position : (3,) m
    moment : (3,) A m²
    """

    position: Array
    moment: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen_array(self.position, (3,)))
        object.__setattr__(self, "moment", frozen_array(self.moment, (3,)))

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""
        offset = points - self.position
        distance = np.linalg.norm(offset, axis=1)[:, None]
        return np.asarray(MU_0 / (4 * np.pi) * np.cross(self.moment, offset) / distance**3)


@dataclass(frozen=True, eq=False)
class HomogeneousField:
    """A uniform field B (3,), T, with A = B × r / 2."""

    flux_density: Array

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""
        return np.cross(self.flux_density, points) / 2


@dataclass(frozen=True, eq=False)
class PolarizedCuboid:
    """A cuboid with uniform polarisation: A = (1/4π) J × ∫ r/r³ dV, exact outside and inside.

    Parameters
    ----------
    box : shape and pose
    polarization : (3,) T, in the frame in which the box is placed
    """

    box: Box
    polarization: Array

    @classmethod
    def of_magnet(cls, magnet: Magnet) -> Self:
        """The magnet with its remanent polarisation (μr = 1)."""
        return cls(magnet.box, magnet.polarization_in_rotor)

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""
        pull = attraction(self.box.to_body(points), self.box.half_edges) @ self.box.rotation.T
        return np.asarray(np.cross(self.polarization, pull) / (4 * np.pi))


def unit_dipoles(positions: ArrayLike) -> list[Dipole]:
    """Three dipoles of 1 A m², along x, y and z, at each of `positions` (n, 3), m."""
    return [Dipole(p, axis) for p in np.asarray(positions, float).reshape(-1, 3) for axis in np.eye(3)]
