"""What an effect is: something that acts on the floater beyond the rotor's field on a rigid dipole.

All in the units of `Scales`, energies in M R²/T², along the axes that turn with the rotor.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, cast, runtime_checkable

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...fem.harmonics.expressions import CompiledField, FieldExpressions
from ...fem.harmonics.interior import Ball, BallField
from ...fem.rotor.table import DerivedField, FieldFormula, FieldTable
from ...geometry.common import Array
from .state import STEADY, Given, Parameter, State, Turn, Vector

ZERO = hy.expression(0.0)
NOTHING: Vector = (ZERO, ZERO, ZERO)
PARAMETERS = Given()
SMALLEST = 4  # Degree of the ball in which a body that is not round moves about an equilibrium, see `flights.balls`


@dataclass(frozen=True, eq=False)
class Motion:
    """The floater's motion, as expressions (3,) that effects are written with."""

    position: Vector  # the scaled state; moment is a unit vector
    velocity: Vector
    moment: Vector
    spin: Vector
    drift: Vector  # velocity and spin as seen from the rotor
    lag: Vector
    field: Vector  # the rotor's B (3) T and ∂B_i/∂x_j (3, 3) T/m at the floater's centre
    gradient: list[list[hy.expression]]
    turn: Turn = STEADY
    # (3, 3) whose columns are the body's axes, and (4,) the quaternion of it; None of a body that is round
    axes: list[list[hy.expression]] | None = None
    quaternion: Vector | None = None
    given: Given = PARAMETERS


@dataclass(frozen=True, eq=False)
class Added:
    """What an effect adds to the equations of motion."""

    force: Vector = NOTHING  # (3,) scaled accelerations of place and of spin
    torque: Vector = NOTHING
    pulled: Vector = NOTHING  # (3,) a moment on which the rotor's gradient acts: scaled force by a gradient of 1 T/m
    turning: Vector = NOTHING  # (3,) a field that turns the floater's moment: scaled torque by a unit moment across it
    more: float = 0.0  # A m² along the floater's moment, which it is larger by
    energy: hy.expression = ZERO  # term of the Jacobi integral
    power: hy.expression = ZERO  # rate of change of the Jacobi integral by this effect
    motor: hy.expression | None = None  # torque about the axis that it takes from the motor; None: that on the floater
    states: Vector = ()  # of its own, and their rates
    rates: Vector = ()


class Effect(Protocol):
    """Something that acts on the floater; a new effect is one class with these members."""

    @property
    def name(self) -> str:
        """Its name in results."""

    def added(self, motion: Motion) -> Added:
        """Its part of the equations of motion; it may use every runtime `Parameter`."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Many poses of the floater, scaled, with what is there."""

    position: Array  # (n, 3)
    moment: Array  # (n, 3) direction
    flux: Array  # (n, 3) T, the rotor's B
    values: Array  # (n, p) runtime parameters
    quaternion: Array | None = None  # (n, 4) of a body that is not round

    @property
    def places(self) -> Array:
        """(n, 3) m."""
        return self.position * self.values[:, [Parameter.LENGTH]]


@runtime_checkable
class Placeable(Effect, Protocol):
    """An effect of so long expressions that `Rates` has it at one pose, by numbers among the runtime parameters."""

    @property
    def count(self) -> int:
        """Of its numbers."""

    def placed(self, first: int) -> "Placeable":
        """The same with numbers from runtime parameter `first` on; it and its first derivatives hold at one pose."""

    def numbers(self, field: DerivedField, poses: Poses) -> Array:
        """(n, count) in the rotor's field."""


@runtime_checkable
class Fittable(Placeable, Protocol):
    """One that has a form of its own in balls."""

    def in_ball(self, ball: BallField, first: int) -> "Fittable":
        """The same with numbers from the runtime parameter `first` on, in a ball that other parameters tell."""

    def fit(self, ball: Ball, gradient: Array) -> tuple[Array, float]:
        """The numbers (count,) in a ball, where the rotor's gradient is ∇B0 (3, 3) T/m; the error by that allowed."""


@runtime_checkable
class Stateful(Effect, Protocol):
    """One that has states of its own in trajectories."""

    def states_at(self, state: State) -> Array:
        """Them (k,) in a state along the rotor's axes."""


@runtime_checkable
class Unsure(Effect, Protocol):
    """An effect with an error that it states."""

    def doubt(self, points: Array, field: Array) -> tuple[Array, Array]:
        """Errors of torque and force at points (n, 3) m in B0 (n, 3) T, over the moment: (n,) T and (n,) T/m."""


def dissipative(force: Vector, torque: Vector, motion: Motion) -> Added:
    """An effect without energy, from its accelerations `force` and `torque`: its power is what they do in `motion`."""
    work = [f * v for f, v in zip(force, motion.drift, strict=True)]
    turning = [t * w for t, w in zip(torque, motion.lag, strict=True)]
    return Added(force, torque, power=hy.sum(work) + hy.par[Parameter.INERTIA] * hy.sum(turning))


def conservative(energy: Callable[[Vector, Vector, Vector], hy.expression], motion: Motion) -> Added:
    """An effect by derivatives in `motion` of its `energy`, of scaled position, moment and the rotor's field (T)."""
    names = [f"{vector}_{k}" for vector in ("place", "pointing", "flux") for k in range(3)]
    given = hy.make_vars(*names)
    value = energy(given[:3], given[3:6], given[6:])
    slopes = hy.diff_tensors([value], diff_args=given, diff_order=1).gradient
    here = dict(zip(names, (*motion.position, *motion.moment, *motion.field), strict=True))
    stored, *slopes = hy.subs([value, *slopes], here)
    return Added(
        force=[-s for s in slopes[:3]],
        pulled=[-hy.par[Parameter.LENGTH] * s for s in slopes[6:]],
        turning=[-s / hy.par[Parameter.INERTIA] for s in slopes[3:6]],
        energy=stored,
    )


@dataclass(frozen=True, eq=False)
class Interaction:
    """A field table that also knows effects."""

    field: FieldFormula  # the rotor's field; a table where more than its expressions are asked for
    effects: tuple[Effect, ...] = ()  # what else acts on the floater
    turning: bool = False  # whether the floater is not round about its moment, so that its whole turn is in the motion

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        return self.field.expressions(position)

    @property
    def model(self) -> str:
        return self._table.model

    def evaluate(self, points: ArrayLike) -> tuple[Array, Array]:
        return self._table.evaluate(points)

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (n,) of B and its gradient, with what the effects' own errors are worth in them."""
        errors = self._table.relative_error(points)
        if not (unsure := [effect for effect in self.effects if isinstance(effect, Unsure)]):
            return errors
        field, gradient = self._table.evaluate(points)
        sizes = np.linalg.norm(field, axis=1), np.linalg.norm(gradient, axis=(1, 2))
        more = [effect.doubt(np.asarray(points, float).reshape(-1, 3), field) for effect in unsure]
        b, g = (e + np.sum(m, axis=0) / s for e, m, s in zip(errors, zip(*more, strict=True), sizes, strict=True))
        return b, g

    def in_range(self, points: ArrayLike) -> NDArray:  # type: ignore[type-arg]
        return self._table.in_range(points)

    def joined(self, *effects: Effect) -> "Interaction":
        """The same with further effects, those already known by their name left out."""
        known = {effect.name for effect in self.effects}
        return replace(self, effects=(*self.effects, *(e for e in effects if e.name not in known)))

    @property
    def _table(self) -> FieldTable:
        return cast(FieldTable, self.field)


def derived(field: FieldFormula) -> Any:
    """A field with its derivatives; one known by its expressions alone is compiled for itself."""
    return field if hasattr(field, "derivatives") else CompiledField(field.expressions)


def interaction_of(table: FieldFormula) -> Interaction:
    """A table as an interaction, itself if it is one."""
    return table if isinstance(table, Interaction) else Interaction(table)
