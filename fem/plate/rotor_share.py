"""The rotor as a source of eddy currents in the plate: the vector potential of its field table.

Closed forms have a potential of their own.  A multipole part Ψ_l of degree l, with r from its centre, is homogeneous
of degree -(l+1), so that curl (r × ∇Ψ_l) = l ∇Ψ_l, and B = -∇Ψ is the curl of

    A = Σ_l r × B_l / l.

What the table knows of recoil permeability and mutual demagnetisation thus reaches the plate with all its moments.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...geometry.basics import MU_0, Array, Box, InputError, rotation_matrix
from ...geometry.bodies import Magnet
from ...geometry.scenes import Plate
from ..closed_forms import PolarizedCuboid, uniform_cells
from ..eddy_currents import Source
from ..harmonics import Coefficients, MultipoleExpansion, derivative, field_spectrum, outer_sums
from ..rotor_tables import RotorTable

DOWN = np.array([0.0, 0.0, -1.0])
CLOSEST = 0.1
"""Clearance of the plate, in radii of a round magnet, for which its moments are made at least."""
INAUDIBLE = 1e-7
"""Share of the rotor's field at the plate that is left out where no tolerance says another."""


@dataclass(frozen=True, eq=False)
class ExpansionSource:
    """The vector potential of a multipole expansion, in the frame of the expansion."""

    expansion: MultipoleExpansion

    @cached_property
    def _by_degree(self) -> list[Coefficients]:
        """Coefficients of the components of Σ B_l / l."""
        degrees = np.maximum(np.arange(self.expansion.degree + 1), 1)[:, None]
        return [-derivative(self.expansion.coefficients / degrees, axis) for axis in range(3)]

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""
        offset = points - self.expansion.center
        return np.cross(offset, outer_sums(self._by_degree, offset / self.expansion.radius))


@dataclass(frozen=True, eq=False)
class RotorSource:
    """The rotor at one angle, seen from a plate.

    Parameters
    ----------
    parts : in the rotor's frame
    turn : (3, 3) from the rotor's frame to the plate's
    center : (3,) m, of the plate in the rotor's frame
    """

    parts: Sequence[Source]
    turn: Array
    center: Array

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m, in the plate's frame."""
        places = self.center + points @ self.turn
        total = np.zeros(places.shape)  # a rotor without a field has no parts
        for part in self.parts:
            total = total + part.vector_potential(places)
        return np.asarray(total @ self.turn.T)


def rotor_parts(table: RotorTable, plate: Plate, inaudible: float = INAUDIBLE) -> list[Source]:
    """The parts of a rotor's table that the plate hears, in the rotor's frame.

    Parameters
    ----------
    inaudible : degrees whose field at the plate is below this share of the rotor's are left out

    Raises
    ------
    InputError : the plate comes so near that an expansion does not converge in it
    """
    parts: list[Source] = [
        PolarizedCuboid.of_magnet(magnet) for magnet in table.uniform if isinstance(magnet.body, Box)
    ]
    round_ones = [magnet for magnet in table.uniform if not isinstance(magnet.body, Box)]
    moments = [part for magnet in round_ones for part in uniform_cells(magnet, _clearance(magnet, plate))]
    for expansion in (*table.expansions, *moments):
        nearest = _nearest(expansion.center, plate)
        if nearest <= 1.001 * expansion.nearest:
            raise InputError(
                f"Input plate must stay farther than {expansion.nearest * 1e3:.4g} mm from the centres of the magnets' "
                f"pieces, where their moments converge; instead received {nearest * 1e3:.4g} mm. Move the plate away."
            )
        degrees = np.arange(expansion.degree + 1)
        sizes = field_spectrum(expansion.coefficients) * (expansion.radius / nearest) ** (degrees + 2)
        whole = MU_0 / (4 * np.pi) * np.linalg.norm(table.moment) / nearest**3
        heard = np.flatnonzero(sizes > inaudible * whole)
        if len(heard):
            end = heard[-1] + 1
            parts.append(ExpansionSource(replace(expansion, coefficients=expansion.coefficients[:end, :end])))
    return parts


def posed_rotor(parts: Sequence[Source], plate: Plate, angle: float, depth: float) -> RotorSource:
    """The rotor turned by `angle` (rad), seen from the plate `depth` (m) below its first place."""
    back = rotation_matrix((0.0, 0.0, -np.degrees(angle)))
    return RotorSource(parts, plate.box.rotation.T @ back.T, back @ (plate.box.center + depth * DOWN))


def _clearance(magnet: Magnet, plate: Plate) -> float:
    """A distance (m) from the surface of a turning magnet that the plate keeps, at least."""
    body = magnet.body
    return max(_nearest(body.center, plate) - body.circumradius, CLOSEST * body.circumradius)


def _nearest(place: Array, plate: Plate) -> float:
    """Smallest distance (m) of a turning place (3,) m of the rotor from the plate on its way."""
    angles = np.linspace(0.0, 2 * np.pi, 73)
    radius, height = np.hypot(place[0], place[1]), np.full(len(angles), place[2])
    circle = np.stack([radius * np.cos(angles), radius * np.sin(angles), height], axis=1)
    distance = plate.lowering.distance if plate.lowering else 0.0
    return min(float(plate.box.distance(circle - depth * DOWN).min()) for depth in np.linspace(0.0, distance, 25))
