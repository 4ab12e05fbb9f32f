"""Conductors of revolution as coaxial rings over round coils: inductances of circles, nothing of the program.

The ring of a cell has the cell's mean radius; its own inductance is that of a circle and one at the geometric mean
distance of the cell's points from each other, 0.2235 (width + height) (Maxwell; Rosa and Grover, 1912).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ellipe, ellipk

MU_0 = 4e-7 * np.pi


def mutual(a, b, distance):
    """Mutual inductance (H) of circles of radii a and b at an axial distance, m; broadcast."""
    k = 4 * a * b / ((a + b) ** 2 + distance**2)
    root = np.sqrt(k)
    return MU_0 * np.sqrt(a * b) * ((2 / root - root) * ellipk(k) - 2 / root * ellipe(k))


@dataclass
class Rings:
    """A disc or tube of n × m rings, its middle at the origin."""

    inner: float
    outer: float
    height: float
    conductivity: float
    radial: int
    axial: int

    def __post_init__(self):
        width, tall = (self.outer - self.inner) / self.radial, self.height / self.axial
        radii = self.inner + width * (np.arange(self.radial) + 0.5)
        places = tall * (np.arange(self.axial) + 0.5) - self.height / 2
        self.radii, self.places = (part.ravel() for part in np.meshgrid(radii, places, indexing="ij"))
        # a ring's conductors are in parallel: σ h ∫ dr/(2πr)
        ratio = (self.radii + width / 2) / np.maximum(self.radii - width / 2, 1e-9)
        self.resistance = 2 * np.pi / (self.conductivity * tall * np.log(ratio))
        spacing = self.places[:, None] - self.places
        np.fill_diagonal(spacing, 0.2235 * (width + tall))
        self.inductance = mutual(self.radii[:, None], self.radii, spacing)

    def flux(self, coils, height, nodes=(16, 24)):
        """Flux (n,) Wb through each ring of coils with their currents, the conductor's middle at a height."""
        x, wx = np.polynomial.legendre.leggauss(nodes[0])
        y, wy = np.polynomial.legendre.leggauss(nodes[1])
        total = np.zeros(len(self.radii))
        for coil in coils:
            radii, levels = coil.radius + coil.width / 2 * x, coil.center[2] + coil.height / 2 * y
            each = mutual(self.radii[:, None, None], radii[:, None], (self.places + height)[:, None, None] - levels)
            total += coil.turns * coil.current * np.einsum("nij,i,j->n", each, wx, wy) / 4
        return total

    def mean_force(self, coils, height, frequency, step=1e-4):
        """Upward force (N) in the mean of a period at rest."""
        flux = self.flux(coils, height)
        ends = [self.flux(coils, height + s * step) for s in (-2, -1, 1, 2)]
        slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step)
        omega = 2j * np.pi * frequency
        currents = np.linalg.solve(np.diag(self.resistance) + omega * self.inductance, -omega * flux)
        return 0.5 * float(np.real(np.vdot(currents, slope)))
