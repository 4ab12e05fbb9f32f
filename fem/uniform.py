"""The field of one uniformly polarised magnet in any pose, accurate near and far."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import heyoka as hy
import numpy as np

from ..geometry.box import Array
from ..geometry.magnet import Magnet
from .compiled import CompiledField, FieldExpressions
from .cuboid import cuboid_field
from .multipole import uniform_moments

FAR = 5.0
"""From this many circumradii on, moments are as exact as the closed form, whose terms cancel more and more."""

FAR_DEGREE = 17
"""The first moments left out are of degree 19 (the even ones of a box vanish): 5^-19 is 5e-14."""


class UniformField:
    """B and its gradient of a magnet with exactly its remanent polarisation (μr = 1), rotor's frame."""

    def __init__(self, magnet: Magnet) -> None:
        self.magnet = magnet

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        """Closed form at a position (three expressions, m), turned from the magnet's axes into the rotor's."""
        box, axes = self.magnet.box, self.magnet.box.rotation
        shifted = [position[i] - float(box.center[i]) for i in range(3)]
        if np.array_equal(axes, np.eye(3)):
            return cuboid_field(shifted, box.half_edges, self.magnet.polarization)
        body = [hy.sum([float(axes[i, a]) * shifted[i] for i in range(3)]) for a in range(3)]
        b, g = cuboid_field(body, box.half_edges, self.magnet.polarization)
        field = [hy.sum([float(axes[i, a]) * b[a] for a in range(3)]) for i in range(3)]
        half = [[hy.sum([float(axes[j, c]) * g[a][c] for c in range(3)]) for j in range(3)] for a in range(3)]
        gradient = [[hy.sum([float(axes[i, a]) * half[a][j] for a in range(3)]) for j in range(3)] for i in range(3)]
        return field, gradient

    @cached_property
    def _near(self) -> CompiledField:
        return CompiledField(self.expressions)

    @cached_property
    def _far(self) -> CompiledField:
        return CompiledField(uniform_moments(self.magnet, FAR_DEGREE).expressions)

    def evaluate(self, points: Array) -> tuple[Array, Array]:
        """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m; 1e-13 of B at any distance."""
        box = self.magnet.box
        far = np.linalg.norm(points - box.center, axis=1) > FAR * box.circumradius
        if not far.any():
            return self._near(points)
        if far.all():
            return self._far(points)
        b, g = np.empty((len(points), 3)), np.empty((len(points), 3, 3))
        b[~far], g[~far] = self._near(points[~far])
        b[far], g[far] = self._far(points[far])
        return b, g
