"""A uniformly polarised permanent magnet."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from .common import MU_0, Array, frozen_array, listed, millimetres
from .shapes import Box
from .solids import Solid


@dataclass(frozen=True, eq=False)
class Magnet:
    """A permanent magnet: B = μ0 μ H + J inside, with J the remanent polarisation.

    Parameters
    ----------
    body : shape and pose
    polarization : (3,) remanent polarisation along the body axes, T; it turns with the body
    recoil_permeability : μr of the demagnetisation curve, along the easy axis, which is that of the polarisation
    transverse_permeability : μr across the easy axis; None: as along it
    conductivity : S/m, or None where its eddy currents are not modelled
    coercivity : field (A/m) against the polarisation at the knee of the demagnetisation curve, or None if not known

    Raises
    ------
    ValueError : two unlike permeabilities without a polarisation that gives the easy axis
    """

    body: Solid
    polarization: Array = field(metadata={"units": "T"})
    recoil_permeability: float = 1.0
    transverse_permeability: float | None = None
    conductivity: float | None = field(default=None, metadata={"units": "S/m"})
    coercivity: float | None = field(default=None, metadata={"units": "A/m"})

    def __post_init__(self) -> None:
        object.__setattr__(self, "polarization", frozen_array(self.polarization, (3,)))
        if not self.isotropic and not self.polarization.any():
            raise ValueError(
                "Input polarization must not be zero where the permeability has an easy axis; instead it is zero."
            )

    @property
    def box(self) -> Box:
        """The box about the body, along its axes: the body itself where it is a cuboid."""
        return self.body.box

    @property
    def rigid(self) -> Magnet:
        """The magnet with the same remanence and μr = 1."""
        return replace(self, recoil_permeability=1.0, transverse_permeability=None)

    @property
    def magnetic(self) -> Magnet:
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
