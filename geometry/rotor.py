"""The three rotors of the article, as magnets in the rotor's frame at t = 0; SI units, angles in rad."""

import numpy as np

from ..basics import Box, Solid, moved, rotation_matrix
from .magnet import Magnet

X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
Rotor = tuple[Magnet, ...]


def _solid(body: float | Solid) -> Solid:
    """The cube of an edge about the origin, or the body that stands for it."""
    return Box(np.full(3, body)) if isinstance(body, int | float) else body


def horizontal(
    displacement: float,
    body: float | Solid,
    remanence: float,
    recoil_permeability: float,
    transverse_permeability: float | None = None,
) -> Rotor:
    """One cube magnetised along +x, `displacement` off the axis along +x; its edge, or a body in its place."""
    material = (recoil_permeability, transverse_permeability)
    return (Magnet(moved(_solid(body), displacement * X), remanence * X, *material),)


def vertical(
    displacement: float,
    body: float | Solid,
    remanence: float,
    recoil_permeability: float,
    transverse_permeability: float | None = None,
) -> Rotor:
    """A cube at the origin magnetised along +x and one `displacement` above it along +z; their edge, or a body."""
    material = (recoil_permeability, transverse_permeability)
    return (
        Magnet(moved(_solid(body), 0 * X), remanence * X, *material),
        Magnet(moved(_solid(body), displacement * Z), remanence * Z, *material),
    )


def tilt(
    angle: float,
    body: float | Solid,
    remanence: float,
    recoil_permeability: float,
    transverse_permeability: float | None = None,
) -> Rotor:
    """One cube at the origin, body and magnetisation turned to (cos angle, 0, sin angle); its edge, or a body."""
    turned = moved(_solid(body), 0 * X, rotation_matrix((0.0, -np.degrees(angle), 0.0)))
    return (Magnet(turned, remanence * X, recoil_permeability, transverse_permeability),)
