"""Rotors whose field is hard to compute, and how fine an independent solution must be to judge a table of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...fem.rotor_tables import Accuracy
from ...geometry.basics import Array, Box, Cylinder, Ring, rotation_matrix
from ...geometry.bodies import Magnet, horizontal, tilt, vertical
from ...geometry.meshes import MeshSettings

CUBE = (0.01, 0.01, 0.01)
REMANENCE, PERMEABILITY = 1.305, 1.05
CONTACT = 0.00635
"""The floater's radius (m): it touches a face of the cube when their centres are 11.35 mm apart."""
OTHER_MESH = MeshSettings(ball_radius=1.2, magnet_size=0.6, hp_layers=2, hp_factor=0.2, curve_order=8)
MORE_LAYERS = replace(OTHER_MESH, hp_layers=4, hp_factor=0.15, magnet_size=0.4)
"""Near an edge of a very permeable magnet the field grows as r^-1/3, not as log r."""
BESIDE_EACH_OTHER = replace(OTHER_MESH, magnet_size=0.8, air_size=0.4)
"""Small elements in the air between magnets, where layers at their edges must match."""


@dataclass(frozen=True)
class HardCase:
    """A rotor, and the reference that judges its table.

    Parameters
    ----------
    magnets : of the rotor
    nearest : distance from the faces from which on the tolerance holds, m; None: `Accuracy`'s own
    order : of the reference's elements; 0: Coulomb's law in 80-bit numbers (all permeabilities are 1)
    mesh : of the reference
    extensions : look along the extensions of edges and faces instead of all around
    quick : short enough for a quick run
    """

    magnets: tuple[Magnet, ...]
    nearest: float | None = None
    order: int = 5
    mesh: MeshSettings = OTHER_MESH
    extensions: bool = False
    quick: bool = False

    @property
    def clearance(self) -> float:
        """Distance from the faces from which on the tolerance holds, m."""
        return Accuracy(nearest=self.nearest).clearance(self.magnets)


def _box(size: Sequence[float], center: Sequence[float] = (0.0, 0.0, 0.0), rotation: Array | None = None) -> Box:
    return Box(np.array(size, float), np.array(center, float), np.eye(3) if rotation is None else rotation)


def _magnet(box: Box, polarization: Sequence[float], along: float, across: float | None = None) -> Magnet:
    return Magnet(box, np.array(polarization, float), along, across)


def _round(body: Cylinder | Ring, polarization: tuple[float, float, float]) -> tuple[Magnet, ...]:
    return (Magnet(body, np.array(polarization), PERMEABILITY),)


def _cube(permeability: float) -> tuple[Magnet, ...]:
    return horizontal(0.002, 0.01, REMANENCE, permeability)


def _pair(distance: float) -> tuple[Magnet, ...]:
    return vertical(distance, 0.01, REMANENCE, PERMEABILITY)


def _plate(polarization: tuple[float, float, float]) -> tuple[Magnet, ...]:
    return (_magnet(_box((0.02, 0.02, 0.0005)), polarization, PERMEABILITY),)


EDGE_WITHIN_A_FACE = (
    _magnet(_box(CUBE), (1, 0, 0), PERMEABILITY),
    _magnet(_box((0.006,) * 3, (0.001, 0.0015, 0.008), rotation_matrix((0, 0, 30))), (0, 0.5, 1), PERMEABILITY),
)
EIGHT = tuple(
    _magnet(
        _box((0.006,) * 3, (0.012 * np.cos(a), 0.012 * np.sin(a), 0.001 * k), rotation_matrix((10 * k, 20, 30))),
        (1.2 + 0.01 * k, 0.1 * k, 0),
        PERMEABILITY,
    )
    for k, a in enumerate(np.arange(8) * np.pi / 4)
)
OBLIQUE = (_magnet(_box(CUBE, rotation=rotation_matrix((15, 40, 70))), (1, 0, 0), 1.05, 1.15),)
DISC, THIN_RING = Cylinder(10e-3, 1e-3), Ring(10e-3, 9e-3, 5e-3)
LONG = (_magnet(_box((0.005, 0.005, 0.04)), (1.3, 0, 0), PERMEABILITY),)
CASES = {
    "contact distance": HardCase(_cube(PERMEABILITY), CONTACT, quick=True),
    "extensions of edges and faces": HardCase(_cube(PERMEABILITY), extensions=True),
    "extensions, μr = 1": HardCase(_cube(1.0), order=0, extensions=True, quick=True),
    "μr = 1 + 1e-9": HardCase(_cube(1 + 1e-9)),
    "μr = 5": HardCase(_cube(5.0), order=8, mesh=MORE_LAYERS),
    "μr = 1000": HardCase(_cube(1000.0), order=8, mesh=MORE_LAYERS),
    "flat, across": HardCase(_plate((0, 0, 1.3)), CONTACT, order=4),
    "flat, along": HardCase(_plate((1.3, 0, 0)), CONTACT, order=4),
    "long": HardCase(LONG, CONTACT),
    "disc of 20 : 1, across": HardCase(_round(DISC, (0, 0, 1.3)), CONTACT, order=4),
    "disc of 20 : 1, along": HardCase(_round(DISC, (1.3, 0, 0)), CONTACT, order=4),
    "thin ring": HardCase(_round(THIN_RING, (1.3, 0, 0)), CONTACT, order=4),
    "touching": HardCase(_pair(0.01)),
    "gap of 1 µm": HardCase(_pair(0.010001)),
    "gap of 50 µm": HardCase(_pair(0.01005), order=4),
    "any angle": HardCase(tilt(0.3, 0.01, REMANENCE, PERMEABILITY), quick=True),
    "anisotropic, any angle": HardCase(OBLIQUE),
    "an edge within a face": HardCase(EDGE_WITHIN_A_FACE, order=4),
    "eight magnets": HardCase(EIGHT, order=4, mesh=BESIDE_EACH_OTHER),
    "no polarisation": HardCase((_magnet(_box(CUBE), (0, 0, 0), PERMEABILITY),), quick=True),
}
"""By name, in the order of the figure."""
