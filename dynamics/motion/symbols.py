"""Runtime parameters of the equations of motion, and vectors of expressions."""

from collections.abc import Sequence
from enum import IntEnum, auto

import heyoka as hy

Vector = Sequence[hy.expression]


class Parameter(IntEnum):
    """Places of the runtime parameters; free of units but LENGTH (m), TORQUE (1/T), TIME (s) and the last ones.

    PLATE_MOMENT is the floater's moment by the root of the unit of energy (A m²/√J), PLATE_SHARE one by that root.
    INDUCED is the moment that 1 T induces in the floater, by the same root, A m²/(T √J).
    TILT_EDDY and SPIN_EDDY are the floater's own eddy currents, 1/T²: accelerations by unit field and relative turn;
    SLOWNESS is μ0σR² of it in units of time.
    MEASURE is that of a rotor whose shape is a parameter, m or rad (`rotor_family`); no other rotor has it.
    """

    RATE = 0
    LENGTH = auto()
    TORQUE = auto()
    INERTIA = auto()
    GRAVITY_X = auto()
    GRAVITY_Y = auto()
    GRAVITY_Z = auto()
    LINEAR_DRAG = auto()
    TILT_DRAG = auto()
    SPIN_DRAG = auto()
    LOST_DISTANCE = auto()
    PLATE_DEPTH = auto()
    PLATE_SPEED = auto()
    TIME = auto()
    PLATE_MOMENT = auto()
    PLATE_SHARE = auto()
    INDUCED = auto()
    TILT_EDDY = auto()
    SPIN_EDDY = auto()
    SLOWNESS = auto()
    MEASURE = auto()


def dotted(a: Vector, b: Vector) -> hy.expression:
    """Σ a · b of vectors of any length."""
    return hy.sum([x * y for x, y in zip(a, b, strict=True)])


def dot(a: Vector, b: Vector) -> hy.expression:
    """Scalar product of two vectors of expressions."""
    return hy.sum([a[i] * b[i] for i in range(3)])


def cross(a: Vector, b: Vector) -> list[hy.expression]:
    """Vector product of two vectors of expressions."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def turned(vector: Vector) -> list[hy.expression]:
    """W × vector: what the frame's rotation adds to the rate of a vector fixed in the laboratory."""
    return [-hy.par[Parameter.RATE] * vector[1], hy.par[Parameter.RATE] * vector[0], hy.expression(0.0)]


def subtract(a: Vector, b: Vector) -> list[hy.expression]:
    """Difference of two vectors of expressions."""
    return [a[i] - b[i] for i in range(3)]
