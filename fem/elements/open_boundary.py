"""The open space outside a sphere: exact Dirichlet-to-Neumann map by spherical harmonics.

Outside a sphere of radius R a potential of degree l falls as r^-(l+1), so that -∂u/∂r = (l+1)/R u_l. A Robin term 2/R
is exact for l = 1; what other degrees lack is a matrix of low rank, (l-1)/R on each harmonic up to `degree`. On a part
of the sphere that mirror planes cut out, only harmonics of the potential's parity take part.
"""

from typing import Any

import ngsolve as ng
import numpy as np

from ...geometry.common import Array
from ..harmonics.solid import FOUR_PI, Coefficients, harmonic_parity, members, orthonormal, outer_coefficients
from .spaces import surface_points


class OpenBoundary:
    """Dirichlet-to-Neumann map of the outside of the sphere `outer` about the origin.

    Parameters
    ----------
    mesh : NGSolve mesh with the boundary `outer`
    space : H1 space of the potential
    radius : of the sphere
    degree : highest degree that is treated exactly; higher ones see the Robin term
    order : of the elements
    planes, signs : mirror planes of the mesh, and whether the potential is even (+1) or odd (-1) there

    Attribute `area_error` is the relative error of the area of the meshed sphere, which measures its roundness.
    """

    def __init__(
        self,
        mesh: Any,
        space: Any,
        radius: float,
        degree: int,
        order: int,
        planes: tuple[int, ...] = (),
        signs: tuple[int, ...] = (),
    ) -> None:
        surface = surface_points(mesh, "outer", 2 * order + 4)
        used = surface.weights > 0
        self.radius, self.degree, self.copies = radius, degree, 2 ** len(planes)
        self.area_error = abs(float(surface.weights.sum()) * self.copies / (FOUR_PI * radius**2) - 1)
        self.keys = [
            key
            for key in members(degree)
            if all(harmonic_parity(key, axis) == sign for axis, sign in zip(planes, signs, strict=True))
        ]
        harmonics = np.zeros((len(used), len(self.keys)))
        harmonics[used] = orthonormal(self.keys, surface.points[used])
        self._size = int(space.ndof)
        self.unknowns = np.nonzero(np.array(space.GetDofs(mesh.Boundaries("outer"))))[0]
        columns = []
        for values in harmonics.T:
            form = ng.LinearForm(space)
            form += surface.function(values) * space.TestFunction() * surface.measure
            form.Assemble()
            columns.append(form.vec.FV().NumPy()[self.unknowns])
        self._projection = np.stack(columns, axis=1)
        self._degrees = np.array([l for l, _, _ in self.keys], float)

    def apply(self, potential: Array) -> Array:
        """What the map adds to the Robin term, as a load vector (unknowns,)."""
        amplitudes = self.copies * (self._projection.T @ potential[self.unknowns])
        result = np.zeros_like(potential)
        result[self.unknowns] = self._projection @ ((self._degrees - 1) / self.radius**3 * amplitudes)
        return result

    def lacking(self) -> tuple[Array, Array]:
        """Load vectors (k, unknowns) p and factors (k,) d, none of them 0, of the same map Σ d p pᵀ."""
        factors = self.copies * (self._degrees - 1) / self.radius**3
        used = factors != 0
        loads = np.zeros((int(used.sum()), self._size))
        loads[:, self.unknowns] = self._projection[:, used].T
        return loads, factors[used]

    def expansion(self, potential: Array) -> Coefficients:
        """Coefficients c_lm of the potential Σ c_lm Θ_lm outside, from its values on the sphere."""
        amplitudes = self.copies * (self._projection.T @ potential[self.unknowns]) / self.radius**2
        return outer_coefficients(amplitudes * self.radius ** (self._degrees + 1), self.keys, self.degree)
