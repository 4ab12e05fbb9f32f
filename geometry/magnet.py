"""A uniformly polarised permanent magnet in the shape of a box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .box import Array, Box, frozen_array

MU_0 = 4e-7 * np.pi
"""Vacuum permeability, T m/A (the value before 2019; the relative difference is 5e-10)."""


@dataclass(frozen=True, eq=False)
class Magnet:
    """A permanent magnet: B = μ0 μr H + J inside, with J the remanent polarisation.

    Parameters
    ----------
    box : shape and pose
    polarization : (3,) remanent polarisation along the body axes, T; it turns with the body
    recoil_permeability : μr of the demagnetisation curve, the same along every axis
    """

    box: Box
    polarization: Array
    recoil_permeability: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "polarization", frozen_array(self.polarization, (3,)))

    @property
    def polarization_in_rotor(self) -> Array:
        """(3,) remanent polarisation in the rotor's frame, T."""
        return self.box.rotation @ self.polarization

    @property
    def moment(self) -> Array:
        """(3,) moment J V/μ0 of the remanent polarisation alone, rotor's frame, A m²."""
        return self.polarization_in_rotor * self.box.volume / MU_0
