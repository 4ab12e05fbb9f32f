"""The floater: a permanent magnet, a sphere or another solid, that hangs below the rotor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..basics import MU_0, Array, Box, Cylinder, InputError, Sphere, moved
from ..bodies import Magnet, polarizability


@dataclass(frozen=True)
class Floater:
    """The floating magnet; a sphere, rigidly magnetised, is exactly a dipole, seen and seeing.

    Parameters
    ----------
    radius : of the sphere, or of the smallest one about another body's centre that holds it, m
    remanence : remanent polarisation, T
    recoil_permeability : μr
    density : kg/m³
    conductivity : S/m, or None where its own eddy currents are not modelled
    body : its shape about the origin where it is no sphere; it is polarised along its z
    """

    radius: float
    remanence: float
    recoil_permeability: float
    density: float
    conductivity: float | None = None
    body: Box | Cylinder | None = None

    @property
    def shape(self) -> str:
        """ "sphere", "cuboid" or "cylinder"."""
        if self.body is None:
            return "sphere"
        return "cuboid" if isinstance(self.body, Box) else "cylinder"

    @property
    def solid(self) -> Box | Cylinder | Sphere:
        """Its body about the origin."""
        return self.body or Sphere(self.radius)

    @cached_property
    def inner_radius(self) -> float:
        """Radius of the largest sphere about its centre that it holds, m."""
        return self.radius if self.body is None else float(self.body.half_edges.min())

    @property
    def volume(self) -> float:
        """Volume, m³."""
        return 4 / 3 * np.pi * self.radius**3 if self.body is None else self.body.volume

    @property
    def mass(self) -> float:
        """Mass, kg."""
        return self.density * self.volume

    @property
    def principal_inertia(self) -> Array:
        """(3,) moments of inertia about its axes, kg m²; about every axis 2/5 M R² of a sphere."""
        if self.body is None:
            return np.full(3, 0.4 * self.mass * self.radius**2)
        square = self.body.size**2 / np.where([isinstance(self.body, Box)] * 3, 12.0, [16.0, 16.0, 12.0])
        return np.asarray(self.mass * (square.sum() - square))

    @property
    def inertia(self) -> float:
        """Moment of inertia about an axis across the magnetic moment, kg m²."""
        return 0.4 * self.mass * self.radius**2 if self.body is None else float(self.principal_inertia[0])

    @property
    def spin_ratio(self) -> float:
        """Moment of inertia about the magnetic moment over that across it."""
        return 1.0 if self.body is None else float(self.principal_inertia[2]) / self.inertia

    @property
    def moment(self) -> float:
        """Magnetic moment of the free body, A m²: (Br V/μ0) 3/(μr + 2) of a sphere, Br V/μ0 of another."""
        factor = 3 / (self.recoil_permeability + 2) if self.body is None else 1.0
        return self.remanence * self.volume / MU_0 * factor

    @property
    def polarizability(self) -> float:
        """Moment that a uniform field of 1 T induces in a sphere of its volume, A m²."""
        return polarizability(self.volume, self.recoil_permeability)

    def axes(self, moment: Array) -> Array:
        """(3, 3) body axes as columns where the moment points along (3,); turned about it as little as can be."""
        across = np.eye(3)[int(np.argmin(np.abs(moment)))] if abs(moment[0]) > 0.99 else np.eye(3)[0]
        first = across - (across @ moment) * moment / (moment @ moment)
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(moment, first), moment], axis=1)

    def placed(self, position: Array, moment: Array) -> Box | Cylinder | Sphere:
        """Its body with its centre at (3,) m and its moment along a unit vector (3,)."""
        turn = np.eye(3) if self.body is None else self.axes(moment)
        return moved(self.solid, position, turn)  # type: ignore[return-value]

    def magnet(self, position: Array, moment: Array) -> Magnet:
        """It as a magnet in its place."""
        body = self.placed(position, moment)
        return Magnet(body, self.remanence * (body.rotation.T @ moment), self.recoil_permeability)

    def must_be(self, *shapes: str, where: str, instead: str) -> None:
        """Raises InputError for a floater of another shape than `where` needs; `instead` is a way out."""
        if self.shape not in shapes:
            rule = " or ".join(f'"{shape}"' for shape in shapes)
            raise InputError(f'Input floater.shape must be {rule} {where}; instead received "{self.shape}". {instead}')

    def __repr__(self) -> str:
        size = f"Ø {self.radius * 2e3:.4g} mm" if self.body is None else f"{self.shape} {self.body.described_size}"
        text = f"Floater {size}, {self.mass * 1e3:.4g} g, {self.moment:.4g} A m², μr {self.recoil_permeability:g}"
        return text if self.conductivity is None else f"{text}, {self.conductivity:.3g} S/m"
