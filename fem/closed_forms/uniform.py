"""The field of one uniformly polarised magnet in any pose, accurate near and far."""

from collections.abc import Sequence
from functools import cached_property

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array, Box, Cylinder, Part, Ring, Sphere
from ...geometry.bodies import Magnet
from ..harmonics import CompiledField, FieldExpressions, Number, turned_expressions, turned_field, uniform_moments
from .cuboid import cuboid_field
from .round_magnets import round_slope, round_tensor
from .segments import resolved_distance, segments_field

FAR = 5.0
"""From this many circumradii on, moments are as exact as the closed form, whose terms cancel more and more."""
FAR_DEGREE = 17
"""The first moments left out are of degree 19 (the even ones of a box vanish): 5^-19 is 5e-14."""


class UniformField:
    """B and its gradient of a magnet with exactly its remanent polarisation (μr = 1), rotor's frame."""

    def __init__(self, magnet: Magnet) -> None:
        self.magnet = magnet

    def expressions(self, position: Sequence[hy.expression], number: Number = float) -> FieldExpressions:
        """Closed form at a position (three expressions, m), turned from the magnet's axes into the rotor's."""
        body, axes = self.magnet.body, self.magnet.body.rotation
        if isinstance(body, Sphere):
            return uniform_moments(self.magnet, 1).expressions(position, number)
        shifted = [position[i] - number(body.center[i]) for i in range(3)]
        if np.array_equal(axes, np.eye(3)):
            return self._in_body(shifted, number)
        return turned_field(axes, self._in_body(turned_expressions(axes.T, shifted, number), number), number)

    def _in_body(self, position: Sequence[hy.expression], number: Number) -> FieldExpressions:
        """Closed form in the magnet's own axes."""
        body, polarization = self.magnet.body, self.magnet.polarization
        if isinstance(body, Box):
            return cuboid_field(position, body.half_edges, polarization, number)
        assert isinstance(body, Cylinder | Ring)
        return segments_field(position, body, polarization)

    @cached_property
    def _near(self) -> CompiledField:
        return CompiledField(self.expressions, seldom=self.is_long)

    @property
    def is_long(self) -> bool:
        """Whether its closed form is so long that to optimise its code takes a second (cylinder) or three (ring)."""
        return isinstance(self.magnet.body, Cylinder | Ring)

    @cached_property
    def _far(self) -> CompiledField:
        return CompiledField(uniform_moments(self.magnet, FAR_DEGREE).expressions, seldom=True)

    def rows(self, columns: Array) -> Array:
        """B (T) outside, μ0 H inside, and its gradient (T/m), (12, n), at `columns` (3, n) m; 1e-13 at any distance.

        Of cylinders and rings 1e-10, but for places that `is_close`.
        """
        far, close = self.is_far(columns), self.is_close(columns)
        found = np.empty((12, columns.shape[1]))
        for chosen, field in ((~far & ~close, self._near), (far, self._far)):
            if chosen.any():
                found[:, chosen] = field.rows(np.ascontiguousarray(columns[:, chosen]))
        if close.any():
            found[:, close] = self._beside(columns[:, close].T)
        return found

    def _beside(self, points: Array) -> Array:
        """As `rows`, beside the surface of a round magnet."""
        body, polarization = self.magnet.body, self.magnet.polarization_in_rotor
        assert not isinstance(body, Box | Part)
        field, slope = round_tensor(body, points) @ polarization, round_slope(body, points) @ polarization
        return np.concatenate([field.T, slope.reshape(len(points), 9).T])

    def is_close(self, columns: Array) -> NDArray[np.bool_]:
        """Which of `columns` (3, n) m are in a round magnet or so near that the expressions do not do: (n,)."""
        body = self.magnet.body
        if isinstance(body, Box | Part):
            return np.zeros(columns.shape[1], bool)
        nearest = 0.0 if isinstance(body, Sphere) else resolved_distance(body)
        return np.asarray(body.distance(columns.T) < nearest)

    def is_far(self, columns: Array) -> NDArray[np.bool_]:
        """Which of `columns` (3, n) m are so far away that moments are the more exact: (n,)."""
        body = self.magnet.body
        return squared_distance(columns, body.center) > (FAR * body.circumradius) ** 2


def squared_distance(columns: Array, center: Array) -> Array:
    """Squared distances (n,) m² of `columns` (3, n) m from a point."""
    x, y, z = columns - center[:, None]
    return np.asarray(x * x + y * y + z * z)
