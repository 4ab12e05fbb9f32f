"""An effect of one part of the rotor, with the part's measure as a runtime parameter.

In the frame of the part nothing has changed: place, velocities, moment and field are told in it, and force and torque
are told back.  So one table serves a whole family.
"""

from dataclasses import dataclass, replace

import heyoka as hy
import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ..motion import Added, Effect, Motion, Parameter, Placeable, Placed, Vector
from .movable import Move, turned


@dataclass(frozen=True, eq=False)
class MovedEffect:
    """An effect that `Rates` has as a `Placed` one.

    Parameters
    ----------
    effect : of the part where it is at measure zero
    move : how the part moves
    alone : field of the part at measure zero
    name : in results
    """

    effect: Placeable
    move: Move
    alone: FieldTable
    name: str

    def added(self, motion: Motion) -> Added:
        """Its accelerations of place and spin."""
        return _moved(self.effect, self.move, motion)

    def placed(self, first: int) -> "MovedAtPlace":
        """The same about one pose."""
        return MovedAtPlace(self.effect.placed(first), self.move, self.alone, self.name)


@dataclass(frozen=True, eq=False)
class MovedAtPlace:
    """The same about one pose; members as above."""

    effect: Placed
    move: Move
    alone: FieldTable
    name: str

    @property
    def count(self) -> int:
        """Of the runtime parameters."""
        return self.effect.count

    def added(self, motion: Motion) -> Added:
        """Its accelerations of place and spin."""
        return _moved(self.effect, self.move, motion)

    def numbers(self, field: FieldTable, position: Array, moment: Array, values: Array) -> Array:
        """(n, count) for scaled positions and moments (n, 3), and runtime parameters (n, p)."""
        measure, length = values[:, Parameter.MEASURE], values[:, [Parameter.LENGTH]]
        place = np.transpose(self.move.place(list((position * length).T), measure)) / length
        return self.effect.numbers(self.alone, place, np.transpose(self.move.into(list(moment.T), measure)), values)


def _moved(effect: Effect, move: Move, motion: Motion) -> Added:
    measure, length = hy.par[Parameter.MEASURE], hy.par[Parameter.LENGTH]

    def into(vector: Vector) -> list[hy.expression]:
        return move.into(vector, measure)

    place = move.place([length * x for x in motion.position], measure)
    found = effect.added(
        Motion(
            position=[x / length for x in place],
            velocity=into(motion.velocity),
            moment=into(motion.moment),
            spin=into(motion.spin),
            drift=into(motion.drift),
            lag=into(motion.lag),
            field=into(motion.field),
            gradient=turned(motion.gradient, into),
        )
    )
    force, torque, pulled, turning = (
        move.back(vector, measure) for vector in (found.force, found.torque, found.pulled, found.turning)
    )
    return replace(found, force=force, torque=torque, pulled=pulled, turning=turning)
