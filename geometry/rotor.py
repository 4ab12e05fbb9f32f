"""The three rotors of the article, as magnets in the rotor's frame at t = 0; SI units, angles in rad."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .common import Array, millimetres
from .magnets import Magnet
from .overlap import TOUCHING, body_overlap
from .shapes import Box, rotation_matrix
from .solids import Solid, moved

X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
Rotor = tuple[Magnet, ...]


def horizontal(displacement: float, body: float | Solid, *material: float | None) -> Rotor:
    """One cube magnetised along +x, `displacement` off the axis along +x; its edge, or a body in its place.

    Of its `material` the remanence (T), the recoil permeability and, if it is another, that across the easy axis.
    """
    return (_magnet(body, X, material, center=displacement * X),)


def vertical(displacement: float, body: float | Solid, *material: float | None) -> Rotor:
    """A cube at the origin magnetised along +x and one `displacement` above it along +z; `material` as `horizontal`."""
    return _magnet(body, X, material), _magnet(body, Z, material, center=displacement * Z)


def tilt(angle: float, body: float | Solid, *material: float | None) -> Rotor:
    """One cube at the origin, body and magnetisation turned to (cos angle, 0, sin angle); as `horizontal`."""
    return (_magnet(body, X, material, rotation=rotation_matrix((0.0, -np.degrees(angle), 0.0))),)


def _magnet(
    body: float | Solid, easy: Array, material: Sequence[Any], center: Array = 0 * X, rotation: Array | None = None
) -> Magnet:
    cube = Box(np.full(3, body)) if isinstance(body, int | float) else body
    return Magnet(moved(cube, center, rotation), material[0] * easy, *material[1:])


@dataclass(frozen=True, eq=False)
class Conductor:
    """A non-magnetic piece of metal that turns with the rotor."""

    body: Solid  # shape and pose in the rotor's frame
    conductivity: float  # S/m

    def __repr__(self) -> str:
        place = f"{self.body.described_size} at {millimetres(self.body.center)}"
        return f"Conductor {place}, {self.conductivity:.3g} S/m"


def separate_pieces(conductors: Sequence[Conductor]) -> list[tuple[Conductor, ...]]:
    """The conductors in groups among which no current can flow.

    Conductors that touch and have the same conductivity are one piece of metal, as a shaft with its flange; all others
    are taken as insulated from each other by their surfaces.
    """
    groups: list[list[Conductor]] = []
    for new in conductors:
        joined, others = [new], list[list[Conductor]]()
        for group in groups:
            metal = [known for known in group if known.conductivity == new.conductivity]
            touch = any(body_overlap(new.body, known.body) > -TOUCHING for known in metal)
            joined, others = (joined + group, others) if touch else (joined, [*others, group])
        groups = [*others, joined]
    return [tuple(group) for group in groups]
