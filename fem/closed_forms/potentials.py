"""A racetrack coil with rectangular cross-section and uniform current density: potential and field in free space.

The four straight bars have closed forms (potential of a uniform cuboid).  In the four quarter rings the current
follows the arc; their integral over the height is closed, and the other two are taken by Gauss quadrature:

    A = (μ0 j/4π) ∫∫ φ̂' [asinh(ζ/D)] ρ' dρ' dφ'     with D the horizontal distance and ζ from end to end.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import MU_0, Array, frozen_array
from .newton import attraction, newton_potential

RADIAL, ANGULAR = 8, 16
"""Gauss points across and along a quarter ring: 1e-8 at a distance of half the cross-section."""
QUARTERS = ((1, 1, 0.0), (-1, 1, np.pi / 2), (-1, -1, np.pi), (1, -1, 1.5 * np.pi))
"""Signs of the corner and where its arc begins."""


@dataclass(frozen=True, eq=False)
class Racetrack:
    """A rectangular coil with rounded corners, axis along z, current counter-clockwise seen from +z.

    Parameters
    ----------
    center : (3,) m
    outer : outer edge lengths along x and y, m
    height : length along z, m
    inner_radius, outer_radius : of the corners, m; their difference is the width of the winding
    ampere_turns : total current, A
    """

    center: Array
    outer: tuple[float, float]
    height: float
    inner_radius: float
    outer_radius: float
    ampere_turns: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen_array(self.center, (3,)))
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
        local = points - self.center
        total = np.zeros_like(local)
        for place, half_edges, direction in self._bars():
            total += newton_potential(local - place, half_edges)[:, None] * direction
        for place, weight, tangent in self._ring_elements():
            offset = local - place
            distance = np.hypot(offset[:, 0], offset[:, 1])
            upper, lower = offset[:, 2] + self.height / 2, offset[:, 2] - self.height / 2
            total += (weight * (np.arcsinh(upper / distance) - np.arcsinh(lower / distance)))[:, None] * tangent
        return MU_0 * self.current_density / (4 * np.pi) * total

    def flux_density(self, points: Array) -> Array:
        """B (n, 3), T, at points (n, 3), m, outside the corners' winding."""
        local = points - self.center
        total = np.zeros_like(local)
        for place, half_edges, direction in self._bars():
            total += np.cross(direction, attraction(local - place, half_edges))
        for place, weight, tangent in self._ring_elements():
            total += weight * np.cross(tangent, self._filament_attraction(local - place))
        return MU_0 * self.current_density / (4 * np.pi) * total

    def _filament_attraction(self, offset: Array) -> Array:
        """∫ r/r³ dz over the coil's height, 1/m times m."""
        square = offset[:, 0] ** 2 + offset[:, 1] ** 2
        upper, lower = offset[:, 2] + self.height / 2, offset[:, 2] - self.height / 2
        far, near = np.sqrt(square + upper**2), np.sqrt(square + lower**2)
        lateral = (upper / far - lower / near) / square
        return np.stack([offset[:, 0] * lateral, offset[:, 1] * lateral, 1 / near - 1 / far], axis=1)

    def _bars(self) -> Iterator[tuple[Array, Array, Array]]:
        """Centre, half edges and current direction of the straight parts."""
        for axis, side in ((0, 1), (0, -1), (1, 1), (1, -1)):
            along = 1 - axis
            length = self.outer[along] - 2 * self.outer_radius
            if length <= 0:
                continue
            place, half_edges, direction = np.zeros(3), np.zeros(3), np.zeros(3)
            place[axis] = side * (self.outer[axis] - self.width) / 2
            half_edges[[axis, along, 2]] = self.width / 2, length / 2, self.height / 2
            direction[along] = side if axis == 0 else -side
            yield place, half_edges, direction

    def _ring_elements(self) -> Iterator[tuple[Array, float, Array]]:
        """Axis, weight ρ dρ dφ and tangent of the quadrature elements of the corners."""
        radial, radial_weight = np.polynomial.legendre.leggauss(RADIAL)
        angular, angular_weight = np.polynomial.legendre.leggauss(ANGULAR)
        middle = np.array([*self.outer]) / 2 - self.outer_radius
        for sign_x, sign_y, start in QUARTERS:
            for s, ws in zip(angular, angular_weight, strict=True):
                angle = start + np.pi / 4 * (1 + s)
                outward, tangent = np.array([np.cos(angle), np.sin(angle), 0]), [-np.sin(angle), np.cos(angle), 0]
                for q, wq in zip(radial, radial_weight, strict=True):
                    radius = self.inner_radius + self.width * (1 + q) / 2
                    corner = np.array([sign_x * middle[0], sign_y * middle[1], 0.0])
                    weight = radius * ws * wq * np.pi / 4 * self.width / 2
                    yield corner + radius * outward, weight, np.array(tangent)
