"""The field of coils beside a rotor, on a magnet that floats below it.

That of steady currents about the rotor's axis stands still in the rotor's frame, too: it is part of the field there,
and all that the rotor's field does it does as well (`BesideCoils`). Any other is a force and torque on the dipole, in
the laboratory's axes (`CoilForce`). With U = -m·B, B = Σ I_k(t) b_k, the Jacobi integral changes by U's own change in
the rotor's frame, -W times the coils' torque about its axis on the floater, and Σ İ_k ∂U/∂I_k.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...fem.closed_forms.coil import Filaments
from ...fem.harmonics.expressions import FieldExpressions
from ...fem.harmonics.solid import tensors
from ...fem.rotor.table import FieldFormula, errors_of_sum, keeps_shape
from ...geometry.common import Array
from ...geometry.scene.contents import Coil, Scene
from .effect import ZERO, Added, Interaction, Motion, derived, interaction_of
from .state import Parameter, about_z, add, cross, dot

COILS = "coils off the axis, or with currents that change"
AFTER = 1e-13  # of a corner's time and a second: so long before it a table's line begins, for a step that begins there


@dataclass(frozen=True, eq=False)
class BesideCoils:
    """A rotor's field with that of steady coils about its axis."""

    table: Any  # the rotor's field
    coils: tuple[Coil, ...]
    nearest: float  # distance of a floater's centre from their windings, m

    @cached_property
    def _filaments(self) -> Filaments:
        return Filaments.of(self.coils, self.nearest)

    @cached_property
    def _currents(self) -> Array:
        return np.array([coil.current for coil in self.coils], float)

    @property
    def model(self) -> str:
        return str(self.table.model)

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        one, steep = self.table.expressions(position)
        other, steeper = self._filaments.expressions(position, self._currents.tolist())
        return add(one, other), [add(*rows) for rows in zip(steep, steeper, strict=True)]

    def derivatives(self, points: Array, order: int) -> Array:
        return np.asarray(
            self._own.derivatives(points, order) + self._filaments.derivatives(points, order, self._currents)
        )

    @cached_property
    def _own(self) -> Any:
        return derived(self.table)

    @keeps_shape
    def evaluate(self, points: Array) -> tuple[Array, Array]:
        field, gradient = self.table.evaluate(points)
        more, steeper = tensors(self._filaments.derivatives(points, 2, self._currents))
        return field + more, gradient + steeper

    @keeps_shape
    def relative_error(self, points: Array) -> tuple[Array, Array]:
        """See `FieldTable`; the rotor's errors by the whole field."""
        return errors_of_sum(self.table.relative_error(points), self.table.evaluate(points), self.evaluate(points))

    def in_range(self, points: ArrayLike) -> NDArray[np.bool_]:
        return np.asarray(self.table.in_range(points))


def with_coils(scene: Scene, table: FieldFormula) -> Interaction:
    """A table as an interaction, with the field of the scene's steady coils about the axis."""
    whole, coils = interaction_of(table), scene.axial_coils
    if not coils or isinstance(whole.field, BesideCoils):
        return whole
    return replace(whole, field=BesideCoils(whole.field, coils, scene.floater.inner_radius))


@dataclass(frozen=True, eq=False)
class CoilForce:
    """Force and torque of coils off the axis, or with currents that change, on the floater's dipole."""

    coils: tuple[Coil, ...]
    nearest: float  # as of `BesideCoils`
    name: str = COILS

    @classmethod
    def of(cls, scene: Scene) -> "CoilForce | None":
        coils = scene.other_coils
        return cls(coils, scene.floater.inner_radius) if coils else None

    def added(self, motion: Motion) -> Added:
        length, torque, inertia = (hy.par[p] for p in (Parameter.LENGTH, Parameter.TORQUE, Parameter.INERTIA))
        angle = motion.turn.angle
        place = [length * x for x in about_z(motion.position, angle, 1.0)]
        moment = about_z(motion.moment, angle, 1.0)
        currents, changes = zip(*(_current(coil, hy.par[Parameter.TIME]) for coil in self.coils), strict=True)
        field, gradient = Filaments.of(self.coils, self.nearest).expressions(place, currents)
        strength = torque * inertia
        pull = [strength * length * dot(moment, [gradient[i][j] for i in range(3)]) for j in range(3)]
        force = about_z(pull, angle, -1.0)
        turn = about_z([torque * t for t in cross(moment, field)], angle, -1.0)
        about = cross(motion.position, force)[2] + inertia * turn[2]
        power = -motion.turn.rate * about
        changing = [(coil, rate) for coil, rate in zip(self.coils, changes, strict=True) if not coil.steady]
        if changing:
            coils, rates = zip(*changing, strict=True)
            changed, _ = Filaments.of(coils, self.nearest).expressions(place, rates)
            power = power - strength * hy.par[Parameter.TIME] * dot(moment, changed)
        return Added(force, turn, energy=-strength * dot(moment, field), power=power, motor=ZERO)


def _current(coil: Coil, time_unit: hy.expression) -> tuple[hy.expression, hy.expression]:
    """A coil's current (A) and its rate (A/s) as expressions of the scaled time."""
    time = time_unit * hy.time
    if isinstance(coil.current, np.ndarray):
        times, values = coil.current.T
        bends = np.diff(np.concatenate([[0.0], np.diff(values) / np.diff(times), [0.0]])).tolist()
        since = [time - (start - AFTER * (1 + abs(start))) for start in times.tolist()]
        rising = [bend * hy.relu(s) for bend, s in zip(bends, since, strict=True)]
        return float(values[0]) + hy.sum(rising), hy.sum([b * hy.relup(s) for b, s in zip(bends, since, strict=True)])
    if not coil.frequency:
        return hy.expression(float(coil.current)), hy.expression(0.0)
    rate, size = 2 * np.pi * coil.frequency, float(coil.current)
    phase = rate * time + coil.phase
    return size * hy.sin(phase), size * rate * hy.cos(phase)
