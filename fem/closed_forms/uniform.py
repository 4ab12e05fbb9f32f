"""The field of one uniformly polarised magnet in any pose, accurate near and far."""

from collections.abc import Sequence
from functools import cached_property

import heyoka as hy
import numpy as np

from ...geometry.common import MU_0, Array, InputError
from ...geometry.magnets import Magnet
from ...geometry.shapes import Box, Cylinder, Ring, Sphere
from ...geometry.solids import Part, Solid
from ..harmonics.expansion import turned_expressions, turned_field, uniform_moments
from ..harmonics.expressions import CompiledField, FieldExpressions, Number
from .cuboid import attraction, cuboid_field, cuboid_tensor
from .round import resolved_distance, round_slope, round_tensor, segments_field

FAR = 5.0  # from this many circumradii on, moments are as exact as the closed form, whose terms cancel more and more
FAR_DEGREE = 17  # the first moments left out are of degree 19 (the even ones of a box vanish): 5^-19 is 5e-14


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
        # to optimise the code of a round magnet's segments takes a second (cylinder) or three (ring)
        return CompiledField(self.expressions, seldom=isinstance(self.magnet.body, Cylinder | Ring))

    @cached_property
    def _far(self) -> CompiledField:
        return CompiledField(uniform_moments(self.magnet, FAR_DEGREE).expressions, seldom=True)

    def rows(self, columns: Array) -> Array:
        """B (T) outside, μ0 H inside, and its gradient (T/m), (12, n), at `columns` (3, n) m; 1e-13 at any distance.

        Of cylinders and rings 1e-10, but for places in or beside them.
        """
        body = self.magnet.body
        far = squared_distance(columns, body.center) > (FAR * body.circumradius) ** 2
        close = np.zeros(columns.shape[1], bool)
        if not isinstance(body, Box | Part):  # in a round magnet, or so near that its segments do not do
            close = body.distance(columns.T) < (0.0 if isinstance(body, Sphere) else resolved_distance(body))
        found = np.empty((12, columns.shape[1]))
        for chosen, field in ((~far & ~close, self._near), (far, self._far)):
            if chosen.any():
                found[:, chosen] = field.rows(np.ascontiguousarray(columns[:, chosen]))
        if close.any():
            assert not isinstance(body, Box | Part)
            points, polarization = columns[:, close].T, self.magnet.polarization_in_rotor
            found[:3, close] = (round_tensor(body, points) @ polarization).T
            found[3:, close] = (round_slope(body, points) @ polarization).reshape(len(points), 9).T
        return found


def squared_distance(columns: Array, center: Array) -> Array:
    """Squared distances (n,) m² of `columns` (3, n) m from a point."""
    x, y, z = columns - center[:, None]
    return np.asarray(x * x + y * y + z * z)


def demagnetizing_tensor(body: Solid, points: Array) -> Array:
    """(n, 3, 3): H = T J (T) at points (n, 3) m, off the body's edges, of a polarisation J; frame of the points."""
    if isinstance(body, Part):
        raise InputError(
            "Input rotor must have no part from a file where closed forms are asked for; instead it has one. "
            "Choose --model fem and --interaction rigid."
        )
    if isinstance(body, Box):
        tensor = cuboid_tensor(body.to_body(points), body.half_edges)
        return np.asarray(body.rotation @ tensor @ body.rotation.T)
    return round_tensor(body, points)


def remanent_field(magnets: Sequence[Magnet], points: Array) -> Array:
    """μ0 H (n, 3) T of magnets with μr = 1 at points (n, 3) m, off their edges."""
    known = [magnet for magnet in magnets if magnet.polarization.any()]
    fields = [demagnetizing_tensor(m.body, points) @ m.polarization_in_rotor for m in known]
    return np.asarray(np.sum([np.zeros_like(points), *fields], axis=0))


def remanent_potential(magnets: Sequence[Magnet], points: Array) -> Array:
    """Potential (n,) T m of cuboids with μr = 1 at points (n, 3) m; continuous everywhere, as t log t at an edge."""
    boxes = [attraction(m.box.to_body(points), m.box.half_edges) @ m.polarization for m in magnets]
    return np.asarray(sum(boxes)) / (4 * np.pi)


Fields = tuple[Array, Array]  # H and M, each (n, 3) A/m; B = μ0 (H + M)


def fields_of_magnets(magnets: Sequence[Magnet], points: Array) -> Fields:
    """H and M of cuboids at points (n, 3) m off their edges.

    H is that of the remanent polarisation J alone, M = J/μ0 + (μr - 1) H inside. The H of the second part of M is
    left out: of the order of μr - 1, relative to H (`closed_form_error`). Exact for μr = 1.
    """
    h = remanent_field(magnets, points) / MU_0
    magnetization = np.zeros_like(h)
    for magnet in magnets:
        inside = magnet.body.distance(points) <= 0
        magnetization[inside] = magnet.polarization_in_rotor / MU_0
        magnetization[inside] += h[inside] @ (magnet.permeability_in_rotor - np.eye(3)).T
    return h, magnetization


def closed_form_error(magnets: Sequence[Magnet]) -> float:
    """Estimated error of `fields_of_magnets`, relative to the field: the largest μr - 1."""
    return max((magnet.contrast for magnet in magnets), default=0.0)


def fields_of_sphere(moment: Array, center: Array, radius: float, points: Array) -> Fields:
    """H and M of a sphere magnetised uniformly: a dipole's outside, H = -M/3 inside; exact.

    Parameters
    ----------
    moment : (3,) A m²
    center, radius : m
    points : (n, 3) m
    """
    away = points - center
    distance = np.linalg.norm(away, axis=1)[:, None]
    within = distance <= radius
    magnetization = np.where(within, moment / (4 / 3 * np.pi * radius**3), 0.0)
    unit = away / np.maximum(distance, radius)  # of length 1 outside, where it is used
    outside = (3 * unit * (unit @ moment)[:, None] - moment) / (4 * np.pi * np.maximum(distance, radius) ** 3)
    return np.where(within, -magnetization / 3, outside), magnetization
