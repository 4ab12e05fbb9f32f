"""Potentials of sources in free space: dipole, uniformly polarised cuboid, uniform field."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import MU_0, Array, freeze
from ...geometry.shapes import Box
from ..harmonics.solid import gauss_legendre
from .uniform import attraction, newton_potential


@dataclass(frozen=True, eq=False)
class Dipole:
    """A point dipole, A = (μ0/4π) m × r/r³."""

    position: Array  # (3,) m
    moment: Array  # (3,) A m²

    def __post_init__(self) -> None:
        freeze(self, position=(3,), moment=(3,))

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""
        offset = points - self.position
        square = np.einsum("na,na->n", offset, offset)[:, None]
        turned = offset @ np.cross(MU_0 / (4 * np.pi) * self.moment, np.eye(3))  # m × r, row by row
        return np.asarray(turned / (square * np.sqrt(square)))


def unit_dipole_fields(points: Array, places: Array) -> Array:
    """Fields (3 p, n, 3) T at points (n, 3) m of unit moments along x, y, z at each of the places (p, 3) m."""
    d = points - places[:, None]
    inverse = 1 / np.einsum("pna,pna->pn", d, d)
    cube = MU_0 / (4 * np.pi) * inverse * np.sqrt(inverse)
    fields = np.empty((len(places), 3, len(points), 3))
    for a in range(3):
        np.multiply((3 * cube * inverse * d[..., a])[..., None], d, out=fields[:, a])
        fields[:, a, :, a] -= cube
    return fields.reshape(-1, len(points), 3)


def unit_dipole_potentials(points: Array, places: Array) -> Array:
    """Potentials ψ (n, 3 p) T m, b = -∇ψ, of the fields of `unit_dipole_fields` at points (n, 3) m."""
    d = points[:, None] - places
    square = np.einsum("npa,npa->np", d, d)
    return np.asarray((d * (MU_0 / (4 * np.pi) / (square * np.sqrt(square)))[..., None]).reshape(len(points), -1))


@dataclass(frozen=True, eq=False)
class HomogeneousField:
    """A uniform field B (3,), T, with A = B × r / 2."""

    flux_density: Array

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""
        return np.cross(self.flux_density, points) / 2


@dataclass(frozen=True, eq=False)
class PolarizedCuboid:
    """A cuboid with uniform polarisation: A = (1/4π) J × ∫ r/r³ dV, exact outside and inside."""

    box: Box  # shape and pose
    polarization: Array  # (3,) T, in the frame in which the box is placed

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""
        pull = attraction(self.box.to_body(points), self.box.half_edges) @ self.box.rotation.T
        return np.asarray(pull @ np.cross(self.polarization / (4 * np.pi), np.eye(3)))


def unit_dipoles(positions: ArrayLike) -> list[Dipole]:
    """Three dipoles of 1 A m², along x, y and z, at each of `positions` (n, 3), m."""
    return [Dipole(p, axis) for p in np.asarray(positions, float).reshape(-1, 3) for axis in np.eye(3)]


RADIAL, ANGULAR = 8, 16  # gauss points across and along a quarter ring: 1e-8 at a distance of half the cross-section
# Signs of the corner and where its arc begins
QUARTERS = ((1, 1, 0.0), (-1, 1, np.pi / 2), (-1, -1, np.pi), (1, -1, 1.5 * np.pi))


@dataclass(frozen=True, eq=False)
class Racetrack:
    """A rectangular coil with rounded corners, axis along z, current counter-clockwise seen from +z."""

    center: Array  # (3,) m
    outer: tuple[float, float]  # outer edge lengths along x and y, m
    height: float  # length along z, m
    # inner_radius, outer_radius: of the corners, m; their difference is the width of the winding
    inner_radius: float
    outer_radius: float
    ampere_turns: float  # total current, A

    def __post_init__(self) -> None:
        freeze(self, center=(3,))
        if not 0 <= self.inner_radius < self.outer_radius <= min(self.outer) / 2:
            raise ValueError(
                "Input outer_radius_m must lie between inner_radius_m and half the coil's shortest outer edge; "
                f"instead received {self.outer_radius!r}."
            )

    @property
    def width(self) -> float:
        """Width of the winding, m."""
        return self.outer_radius - self.inner_radius

    @property
    def current_density(self) -> float:
        """A/m²."""
        return self.ampere_turns / (self.width * self.height)

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""

        def of_filament(offset: Array, tangent: Array) -> Array:
            distance = np.hypot(offset[:, 0], offset[:, 1])
            upper, lower = (np.arcsinh((offset[:, 2] + end) / distance) for end in (self.height / 2, -self.height / 2))
            return (upper - lower)[:, None] * tangent

        return self._total(points, lambda d, half, way: newton_potential(d, half)[:, None] * way, of_filament)

    def flux_density(self, points: Array) -> Array:
        """B (n, 3), T, at points (n, 3), m, outside the corners' winding."""

        def of_filament(offset: Array, tangent: Array) -> Array:
            square = offset[:, 0] ** 2 + offset[:, 1] ** 2
            upper, lower = offset[:, 2] + self.height / 2, offset[:, 2] - self.height / 2
            far, near = np.sqrt(square + upper**2), np.sqrt(square + lower**2)
            lateral = (upper / far - lower / near) / square
            pull = np.stack([offset[:, 0] * lateral, offset[:, 1] * lateral, 1 / near - 1 / far], axis=1)
            return np.cross(tangent, pull)

        return self._total(points, lambda d, half, way: np.cross(way, attraction(d, half)), of_filament)

    def _total(
        self, points: Array, of_bar: Callable[..., Array], of_filament: Callable[[Array, Array], Array]
    ) -> Array:
        """Sum over the straight parts, and over filaments as high as the coil that stand for the corners."""
        local, total = points - self.center, np.zeros(points.shape)
        middle = np.array([*self.outer]) / 2 - self.outer_radius
        for (axis, along), side in product(((0, 1), (1, 0)), (1, -1)):
            if middle[along] > 0:
                place, half_edges, direction = np.zeros((3, 3))
                place[axis] = side * (self.outer[axis] - self.width) / 2
                half_edges[[axis, along, 2]] = self.width / 2, middle[along], self.height / 2
                direction[along] = side if axis == 0 else -side
                total += of_bar(local - place, half_edges, direction)
        rules = (zip(*gauss_legendre(count), strict=True) for count in (ANGULAR, RADIAL))
        for (*signs, start), (s, ws), (q, wq) in product(QUARTERS, *rules):
            angle, radius = start + np.pi / 4 * (1 + s), self.inner_radius + self.width * (1 + q) / 2
            outward = np.array([np.cos(angle), np.sin(angle), 0.0])
            place, tangent = np.array([*signs * middle, 0.0]) + radius * outward, np.cross([0.0, 0.0, 1.0], outward)
            total += radius * ws * wq * np.pi / 4 * self.width / 2 * of_filament(local - place, tangent)
        return MU_0 * self.current_density / (4 * np.pi) * total
