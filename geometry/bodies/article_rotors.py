"""The three rotors of the article, as magnets in the rotor's frame at t = 0."""

import numpy as np

from ..basics import Array, Box, rotation_matrix
from .magnet import Magnet

X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
Rotor = tuple[Magnet, ...]


def _cube(edge: float, center: Array, polarization: Array, along: float, across: float | None) -> Magnet:
    return Magnet(Box(np.full(3, edge), center), polarization, along, across)


def horizontal(
    displacement: float,
    edge: float,
    remanence: float,
    recoil_permeability: float,
    transverse_permeability: float | None = None,
) -> Rotor:
    """One cube magnetised along +x, `displacement` off the axis along +x (SI units)."""
    return (_cube(edge, displacement * X, remanence * X, recoil_permeability, transverse_permeability),)


def vertical(
    displacement: float,
    edge: float,
    remanence: float,
    recoil_permeability: float,
    transverse_permeability: float | None = None,
) -> Rotor:
    """A cube at the origin magnetised along +x and one `displacement` above it along +z (SI units)."""
    return (
        _cube(edge, 0 * X, remanence * X, recoil_permeability, transverse_permeability),
        _cube(edge, displacement * Z, remanence * Z, recoil_permeability, transverse_permeability),
    )


def tilt(
    angle: float,
    edge: float,
    remanence: float,
    recoil_permeability: float,
    transverse_permeability: float | None = None,
) -> Rotor:
    """One cube at the origin, body and magnetisation turned to (cos angle, 0, sin angle); angle in rad."""
    box = Box(np.full(3, edge), rotation=rotation_matrix((0.0, -np.degrees(angle), 0.0)))
    return (Magnet(box, remanence * X, recoil_permeability, transverse_permeability),)
