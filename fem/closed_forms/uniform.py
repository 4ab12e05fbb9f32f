"""The field of one uniformly polarised magnet in any pose, accurate near and far."""

from collections.abc import Sequence
from functools import cached_property

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from ...geometry.bodies import Magnet
from ..harmonics import CompiledField, FieldExpressions, uniform_moments
from .cuboid import cuboid_field

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

    def rows(self, columns: Array) -> Array:
        """B (T) and its gradient (T/m), (12, n), at `columns` (3, n) m; 1e-13 of B at any distance."""
        far = self.is_far(columns)
        found = np.empty((12, columns.shape[1]))
        for chosen, field in ((~far, self._near), (far, self._far)):
            if chosen.any():
                found[:, chosen] = field.rows(np.ascontiguousarray(columns[:, chosen]))
        return found

    def is_far(self, columns: Array) -> NDArray[np.bool_]:
        """Which of `columns` (3, n) m are so far away that moments are the more exact: (n,)."""
        box = self.magnet.box
        return squared_distance(columns, box.center) > (FAR * box.circumradius) ** 2


def squared_distance(columns: Array, center: Array) -> Array:
    """Squared distances (n,) m² of `columns` (3, n) m from a point."""
    x, y, z = columns - center[:, None]
    return np.asarray(x * x + y * y + z * z)
