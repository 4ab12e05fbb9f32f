"""What a rotor is made of: uniformly polarised magnets and pieces of metal; and the three rotors of the article.

They are in the rotor's frame at t = 0; SI units, angles in rad.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .common import MU_0, Array, freeze, listed, millimetres
from .shapes import Box, rotation_matrix
from .solids import Solid, moved


@dataclass(frozen=True, eq=False)
class Magnet:
    """A permanent magnet: B = μ0 μ H + J inside, with J the remanent polarisation.

    Raises ValueError: two unlike permeabilities without a polarisation that gives the easy axis.
    """

    body: Solid  # shape and pose
    polarization: Array = field(metadata={"units": "T"})  # (3,) remanent, along the body axes; it turns with the body
    recoil_permeability: float = 1.0  # μr of the demagnetisation curve along the easy axis, that of the polarisation
    transverse_permeability: float | None = None  # μr across the easy axis; None: as along it
    conductivity: float | None = field(default=None, metadata={"units": "S/m"})  # None: no eddy currents are modelled
    # field against the polarisation at the knee of the demagnetisation curve, or None if not known
    coercivity: float | None = field(default=None, metadata={"units": "A/m"})

    def __post_init__(self) -> None:
        freeze(self, polarization=(3,))
        if not self.isotropic and not self.polarization.any():
            raise ValueError(
                "Input polarization must not be zero where the permeability has an easy axis; instead it is zero."
            )

    @property
    def box(self) -> Box:
        return self.body.box

    @property
    def rigid(self) -> "Magnet":
        """The magnet with the same remanence and μr = 1."""
        return replace(self, recoil_permeability=1.0, transverse_permeability=None)

    @property
    def magnetic(self) -> "Magnet":
        """The magnet without what its field does not depend on: equal fields, equal keys of kept tables."""
        across = None if self.isotropic else self.transverse_permeability
        return replace(self, transverse_permeability=across, conductivity=None, coercivity=None)

    @property
    def isotropic(self) -> bool:
        """Whether the permeability is the same along every axis."""
        return self.transverse_permeability in (None, self.recoil_permeability)

    @property
    def permeability_in_rotor(self) -> Array:
        """(3, 3) relative permeability μ in the rotor's frame."""
        if self.isotropic:
            return self.recoil_permeability * np.eye(3)
        easy = self.polarization_in_rotor / np.linalg.norm(self.polarization)
        across = float(self.transverse_permeability or 1.0)
        return np.asarray(across * np.eye(3) + (self.recoil_permeability - across) * np.outer(easy, easy))

    @property
    def contrast(self) -> float:
        """Largest deviation of the permeability from that of the vacuum."""
        return max(abs(self.recoil_permeability - 1), abs((self.transverse_permeability or 1.0) - 1))

    @property
    def polarization_in_rotor(self) -> Array:
        """(3,) remanent polarisation in the rotor's frame, T."""
        return self.body.rotation @ self.polarization

    @property
    def moment(self) -> Array:
        """(3,) moment J V/μ0 of the remanent polarisation alone, rotor's frame, A m²."""
        return self.polarization_in_rotor * self.body.volume / MU_0

    def __repr__(self) -> str:
        along = self.recoil_permeability
        permeability = f"{along:g}" if self.isotropic else f"{along:g} along, {self.transverse_permeability:g} across"
        polarization = listed(self.polarization_in_rotor)
        place = f"{self.body.described_size} at {millimetres(self.body.center)}"
        text = f"Magnet {place}, ({polarization}) T, μr {permeability}"
        return text if self.conductivity is None else f"{text}, {self.conductivity:.3g} S/m"


def polarizability(volume: float, permeability: float) -> float:
    """Moment (A m²) that a uniform field of 1 T induces in a sphere of a volume (m³)."""
    return 3 * volume / MU_0 * (permeability - 1) / (permeability + 2)


@dataclass(frozen=True, eq=False)
class Conductor:
    """A non-magnetic piece of metal that turns with the rotor."""

    body: Solid  # shape and pose in the rotor's frame
    conductivity: float  # S/m

    def __repr__(self) -> str:
        place = f"{self.body.described_size} at {millimetres(self.body.center)}"
        return f"Conductor {place}, {self.conductivity:.3g} S/m"


X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
Rotor = tuple[Magnet, ...]


def horizontal(displacement: float, body: float | Solid, *material: float | None) -> Rotor:
    """One cube (edge, or a body) `displacement` off along its +x; `material`: remanence (T), and μr along, across."""
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
