"""The three rotors of the article, as magnets in the rotor's frame at t = 0."""

from __future__ import annotations

import numpy as np

from .box import Box, rotation_matrix
from .magnet import Magnet

Rotor = tuple[Magnet, ...]


def horizontal(displacement: float, edge: float, remanence: float, recoil_permeability: float) -> Rotor:
    """One cube magnetised along +x, `displacement` off the axis along +x (SI units)."""
    box = Box((edge,) * 3, (displacement, 0.0, 0.0))
    return (Magnet(box, (remanence, 0.0, 0.0), recoil_permeability),)


def vertical(displacement: float, edge: float, remanence: float, recoil_permeability: float) -> Rotor:
    """A cube at the origin magnetised along +x and one `displacement` above it along +z (SI units)."""
    return (
        Magnet(Box((edge,) * 3), (remanence, 0.0, 0.0), recoil_permeability),
        Magnet(Box((edge,) * 3, (0.0, 0.0, displacement)), (0.0, 0.0, remanence), recoil_permeability),
    )


def tilt(angle: float, edge: float, remanence: float, recoil_permeability: float) -> Rotor:
    """One cube at the origin, body and magnetisation turned to (cos angle, 0, sin angle); angle in rad."""
    box = Box((edge,) * 3, rotation=rotation_matrix((0.0, -np.degrees(angle), 0.0)))
    return (Magnet(box, (remanence, 0.0, 0.0), recoil_permeability),)
