"""Runtime parameters of the equations of motion, and vectors and quaternions of expressions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ...geometry.solids import frame_about

Vector = Sequence[hy.expression]


# Places of the runtime parameters; free of units but LENGTH (m), TORQUE (1/T), TIME (s) and the last ones.
# PLATE_MOMENT is the floater's moment by the root of the unit of energy (A m²/√J), PLATE_SHARE one by that root. RATE,
# ANGLE and PLATE_DEPTH are those at t = 0, had ACCELERATION and PLATE_SPEED always been as they are. INDUCED is the
# moment that 1 T induces in the floater, by the same root, A m²/(T √J). TILT_EDDY and SPIN_EDDY are the floater's own
# eddy currents, 1/T²: accelerations by unit field and relative turn; SLOWNESS is μ0σR² of it in units of time.
# INERTIA_X to _Z are principal moments of inertia over that of INERTIA, POINTING_X to _Z the moment's direction along
# the body's axes: those of a body that is not round about its moment. Of a rotor that is moved: TILT_X, _Y is the
# direction across its axis about which that turns, at TILT_RATE, by TILT at t = 0, MOVE_X to _Z its velocity; these
# and gravity along the axes that it had, before its turn, where TILT is 0. TABLE is the number of a row's table where
# there are several (`Rates.among`), on the way to that of NEXT by the part BETWEEN.
Parameter = IntEnum(
    "Parameter",
    "RATE LENGTH TORQUE INERTIA GRAVITY_X GRAVITY_Y GRAVITY_Z LINEAR_DRAG TILT_DRAG SPIN_DRAG LOST_DISTANCE "
    "PLATE_DEPTH PLATE_SPEED TIME PLATE_MOMENT PLATE_SHARE INDUCED TILT_EDDY SPIN_EDDY SLOWNESS "
    "INERTIA_X INERTIA_Y INERTIA_Z POINTING_X POINTING_Y POINTING_Z TABLE NEXT BETWEEN ACCELERATION ANGLE "
    "TILT_X TILT_Y TILT TILT_RATE MOVE_X MOVE_Y MOVE_Z",
    start=0,
)


# That nothing changes during a trajectory at one frequency; in those that are `WHOLE` a number that nearly is, is one
FIXED = {
    *(Parameter.LENGTH, Parameter.TORQUE, Parameter.INERTIA, Parameter.LINEAR_DRAG, Parameter.TILT_DRAG),
    *(Parameter.PLATE_MOMENT, Parameter.PLATE_SHARE, Parameter.INDUCED),
}
OF_BODY = range(Parameter.INERTIA_X, Parameter.POINTING_Z + 1)
WHOLE = {Parameter.RATE, *OF_BODY}
SAME = 1e-12  # By which moments of inertia over their mean may differ that are taken as equal, and a moment's direction


@dataclass(frozen=True, eq=False)
class Given:
    """The runtime parameters as expressions; where `values` are known, those that nothing changes as numbers.

    In Taylor's method a product with an expression of parameters costs as much as one of two variables, a product with
    a number a sixteenth, and one with 0 or 1 nothing. Code with numbers in it serves one floater alone.
    """

    values: Array | None = None

    def __getitem__(self, which: Parameter) -> hy.expression:
        if self.values is None or which not in {*FIXED, *WHOLE}:
            return hy.par[which]
        value = float(self.values[which])
        whole = which in WHOLE and abs(value - round(value)) < SAME
        return hy.expression(float(round(value)) if whole else value)


@dataclass(frozen=True, eq=False)
class Turn:
    """The rotor's turn as scaled expressions."""

    rate: hy.expression
    angle: hy.expression
    acceleration: hy.expression
    pace: hy.expression  # the rate's size, smooth where it passes through zero
    # of a rotor that is moved, along its own axes: the part of its angular velocity across its axis (2), the velocity
    # of its origin (3), and gravity (3)
    across: Vector = ()
    velocity: Vector = ()
    gravity: Vector = ()

    def swept(self, vector: Vector) -> list[hy.expression]:
        """W × vector: what the frame's rotation adds to the rate of a vector fixed in the laboratory."""
        about_z = [-(self.rate * vector[1]), self.rate * vector[0], hy.expression(0.0)]
        return add(about_z, cross([*self.across, hy.expression(0.0)], vector)) if self.across else about_z

    def lag(self, spin: Vector) -> list[hy.expression]:
        """A spin (3,) as seen from the frame, Ω - W."""
        x, y = [s - a for s, a in zip(spin[:2], self.across, strict=True)] if self.across else spin[:2]
        return [x, y, spin[2] - self.rate]


RATE, ACCELERATION = hy.par[Parameter.RATE], hy.par[Parameter.ACCELERATION]
NOW = RATE + ACCELERATION * hy.time
REST = 1e-4  # Rate that is added in square to that of a drive: of a square root each derivative must be finite
STEADY = Turn(RATE, RATE * hy.time, hy.expression(0.0), RATE)
DRIVEN = Turn(
    NOW,
    hy.par[Parameter.ANGLE] + (RATE + 0.5 * ACCELERATION * hy.time) * hy.time,
    ACCELERATION,
    hy.sqrt(NOW * NOW + REST**2),
)


def moved() -> Turn:
    """That of a rotor that is driven and moved."""
    x, y, rate = (hy.par[p] for p in (Parameter.TILT_X, Parameter.TILT_Y, Parameter.TILT_RATE))
    tilt = hy.par[Parameter.TILT] + rate * hy.time
    cosine, sine, axis = hy.cos(tilt), hy.sin(tilt), [x, y, hy.expression(0.0)]

    def seen(first: Parameter) -> list[hy.expression]:
        # by Rodrigues' formula, turned back by the tilt
        vector = [hy.par[first + k] for k in range(3)]
        along, side = (1.0 - cosine) * dot(axis, vector), cross(axis, vector)
        back = [cosine * v - sine * s + along * a for v, s, a in zip(vector, side, axis, strict=True)]
        return about_z(back, DRIVEN.angle, -1.0)

    about = about_z([rate * a for a in axis], DRIVEN.angle, -1.0)
    return replace(DRIVEN, across=about[:2], velocity=seen(Parameter.MOVE_X), gravity=seen(Parameter.GRAVITY_X))


def dotted(a: Vector, b: Vector) -> hy.expression:
    """Sum of the products of components, of vectors of any one length."""
    return hy.sum([x * y for x, y in zip(a, b, strict=True)])


def dot(a: Vector, b: Vector) -> hy.expression:
    """Scalar product of the first three components."""
    return hy.sum([a[i] * b[i] for i in range(3)])


def cross(a: Vector, b: Vector) -> list[hy.expression]:
    """Vector product of the first three components."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def about_z(vector: Vector, angle: hy.expression, sense: float) -> list[hy.expression]:
    """A vector (3) turned about z by an angle, or, with the sense -1, by as much the other way."""
    cosine, sine = hy.cos(angle), sense * hy.sin(angle)
    x, y, z = vector
    return [cosine * x - sine * y, sine * x + cosine * y, z]


def add(*vectors: Vector) -> list[hy.expression]:
    """Sum of vectors of as many components."""
    return [sum(rest, first) for first, *rest in zip(*vectors, strict=True)]


def subtract(a: Vector, b: Vector) -> list[hy.expression]:
    """Difference of the first three components."""
    return [a[i] - b[i] for i in range(3)]


HALF = 0.5  # See `Scales.even`
WEIGHTLESS = 1e-9  # Gravity, m/s², that sets no unit of time


@dataclass(frozen=True, eq=False)
class State:
    """Motion of the floater at one instant (3,) or at many (n, 3), in SI units.

    Velocity and spin are those seen from the laboratory; only their components are along the axes of the
    laboratory or of the frame that turns with the rotor.
    """

    position: Array  # of the centre from the rotor's origin, m
    velocity: Array  # m/s
    moment: Array  # direction of the magnetic moment, a unit vector fixed in the body
    spin: Array  # angular velocity of the body, rad/s
    # (3, 3) or (n, 3, 3) whose columns are the axes of the floater's frame; None of a body that is round about its
    # moment, where nothing depends on its turn about it
    axes: Array | None = None

    def __getitem__(self, chosen: Any) -> "State":
        """One of many states, or some."""
        return self.each(lambda part: part[chosen])

    def each(self, change: Callable[[Array], Array]) -> "State":
        """Its vectors and axes changed."""
        return replace(State(*map(change, self.vectors)), axes=None if self.axes is None else change(self.axes))

    def to_rotor(self, angle: ArrayLike) -> "State":
        """Components along the rotor's axes, from those along the laboratory's; `angle` of the rotor in rad."""
        return self.to_lab(-np.asarray(angle, float))

    def to_lab(self, angle: ArrayLike) -> "State":
        """Components along the laboratory's axes, from those along the rotor's; `angle` of the rotor in rad."""
        axes = self.axes
        if axes is not None:
            axes = turned_about_z(axes.swapaxes(-1, -2), np.asarray(angle, float)[..., None]).swapaxes(-1, -2)
        return replace(State(*(turned_about_z(v, angle) for v in self.vectors)), axes=axes)

    def moved(self, center: Array, axes: Array) -> "State":
        """In the laboratory, from along axes (n, 3, 3) with an origin at (n, 3) m; velocities are the same."""
        position, *rest = (np.einsum("nij,nj->ni", axes, vector) for vector in self.vectors)
        return replace(State(position + center, *rest), axes=None if self.axes is None else axes @ self.axes)

    @property
    def orientation(self) -> Array:
        """What is known of how the body is turned: its axes, or (…, 3) the direction of its moment."""
        return self.moment if self.axes is None else self.axes

    @property
    def vectors(self) -> tuple[Array, Array, Array, Array]:
        return self.position, self.velocity, self.moment, self.spin


def polar_angle(vectors: Array) -> Array:
    """Angle (...) to +z, rad, of vectors (..., 3)."""
    return np.asarray(np.arctan2(np.hypot(vectors[..., 0], vectors[..., 1]), vectors[..., 2]))


def turned_about_z(vectors: ArrayLike, angle: ArrayLike) -> Array:
    """Turn `vectors` (..., 3) by `angle` (...) in rad about +z."""
    vectors = np.asarray(vectors, float)
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z + 0 * cosine], axis=-1)


@dataclass(frozen=True)
class Scales:
    """Units of the integrated state, chosen so that all its components are of order one."""

    length: float  # radius of the floater, m
    # 1/ω of the rotor at its fastest, s; at rest the time of a fall through `length`, or one second without gravity
    time: float
    # moment of inertia about the magnetic moment over that across it; the integrated spin is L/I, which has so much of
    # the true one along the moment
    spin_ratio: float = 1.0
    # direction of the moment along the axes of a body that is not round about it, whose states are a quaternion and the
    # true spin along these axes; None of a round one
    pointing: tuple[float, float, float] | None = None
    # whether that body's moments of inertia are equal and its states those of a round one with a direction across the
    # moment. This and the spin have half their size: their terms would decide the length of Taylor's steps, by which
    # energy would gain nothing
    even: bool = False

    @classmethod
    def of(cls, scene: Scene) -> "Scales":
        floater, weight = scene.floater, float(np.linalg.norm(scene.gravity))
        x, y, z = floater.pointing.tolist()
        turning = (floater.spin_ratio, None) if floater.round else (1.0, (x, y, z))
        if scene.fastest:
            return cls(floater.radius, 1 / (2 * np.pi * scene.fastest), *turning)
        time = float(np.sqrt(floater.radius / weight)) if weight > WEIGHTLESS else 1.0
        return cls(floater.radius, time, *turning)

    @property
    def size(self) -> int:
        """Number of the floater's own states."""
        return 12 if self.pointing is None else 15 if self.even else 13

    @property
    def frame(self) -> Array | None:
        """(3, 3) across the moment, across both, and along it, as columns along the axes of an `even` body."""
        return np.round(frame_about(np.array(self.pointing)), 15) if self.even else None

    def off_unit(self, scaled: Array) -> float:
        """By how much moments or quaternions of states (n, 12 or more) are not of unit length, at most."""
        return float(np.abs(np.linalg.norm(scaled[:, 6 : 10 if self.size == 13 else 9], axis=1) - 1).max())

    def pack(self, state: State) -> Array:
        """Scaled state (..., 12): position, velocity, moment, spin; or (..., 13 or 15) with another turn and spin."""
        speed = self.length / self.time
        if self.pointing is None:
            turn, spin = state.moment, _stretched(state.spin, state.moment, self.spin_ratio)
        elif self.frame is not None:
            assert state.axes is not None
            turns = state.axes @ self.frame
            turn, spin = np.concatenate([turns[..., 2], HALF * turns[..., 0]], axis=-1), HALF * state.spin
        else:
            assert state.axes is not None
            turn, spin = quaternions_of(state.axes), np.einsum("...ij,...i->...j", state.axes, state.spin)
        parts = state.position / self.length, state.velocity / speed, turn, spin * self.time
        return np.concatenate(parts, axis=-1)

    def unpack(self, scaled: Array) -> State:
        """The state of `scaled` (..., 12 or more) in SI units, along the same axes."""
        position, velocity = scaled[..., :3] * self.length, scaled[..., 3:6] * (self.length / self.time)
        turn, spin = scaled[..., 6 : self.size - 3], scaled[..., self.size - 3 : self.size]
        if self.pointing is None:
            return State(position, velocity, turn + 0.0, _stretched(spin, turn, 1 / self.spin_ratio) / self.time)
        if self.frame is not None:
            moment, side, spin = turn[..., :3], turn[..., 3:] / HALF, spin / HALF
            axes = np.stack([side, np.cross(moment, side), moment], axis=-1) @ self.frame.T
            return State(position, velocity, moment + 0.0, spin / self.time, axes)
        axes = matrices_of(turn)
        return State(
            position, velocity, axes @ np.array(self.pointing), (axes @ spin[..., None])[..., 0] / self.time, axes
        )


def _stretched(spin: Array, moment: Array, ratio: float) -> Array:
    """A spin (..., 3) with its part along the moment (..., 3) times a ratio."""
    if ratio == 1:
        return spin
    return np.asarray(spin + (ratio - 1) * np.sum(spin * moment, axis=-1, keepdims=True) * moment)


# Unit quaternions of rotations, w first, for arrays and for expressions


def rotation_of(quaternion: Sequence[Any]) -> list[list[Any]]:
    """(3, 3) rotation by a unit quaternion (4,), w first."""
    w, x, y, z = (2.0 * part for part in quaternion)
    _, b, c, d = quaternion
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * b, y * c, z * d, x * c, x * d, y * d, w * b, w * c, w * d
    return [
        [1.0 - (yy + zz), xy - wz, xz + wy],
        [xy + wz, 1.0 - (xx + zz), yz - wx],
        [xz - wy, yz + wx, 1.0 - (xx + yy)],
    ]


def matrices_of(quaternions: Array) -> Array:
    """(..., 3, 3) rotations by unit quaternions (..., 4), w first."""
    rows = rotation_of(list(np.moveaxis(quaternions, -1, 0)))
    return np.moveaxis(np.array([[entry + 0 * quaternions[..., 0] for entry in row] for row in rows]), (0, 1), (-2, -1))


def rotation_slopes(quaternions: Array) -> Array:
    """(..., 4, 3, 3) derivatives of `matrices_of` by quaternions (..., 4)."""
    # of second degree in them, so that a difference is the derivative
    return np.stack([matrices_of(quaternions + e) - matrices_of(quaternions - e) for e in np.eye(4)], axis=-3) / 2


def quaternions_of(matrices: Array) -> Array:
    """(..., 4) of rotations, w first, not negative (I. Y. Bar-Itzhack, J. Guid. Control Dyn. 23 (2000) 1085)."""
    m = np.asarray(matrices, float)
    squares = np.empty((*m.shape[:-2], 4, 4))
    squares[..., 0, 0] = np.trace(m, axis1=-2, axis2=-1)
    squares[..., 1:, 1:] = m + m.swapaxes(-1, -2) - squares[..., 0, 0, None, None] * np.eye(3)
    screw = np.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], axis=-1)
    squares[..., 0, 1:] = squares[..., 1:, 0] = screw
    found = np.linalg.eigh(squares)[1][..., -1]
    return np.asarray(found * np.where(found[..., :1] < 0, -1.0, 1.0))


def left_product(vector: Sequence[Any], quaternion: Sequence[Any]) -> list[Any]:
    """A vector (3) as a pure quaternion times a quaternion (4): twice its rate by that spin along the outer axes."""
    (a, b, c), (w, x, y, z) = vector, quaternion
    return [-a * x - b * y - c * z, a * w + b * z - c * y, b * w + c * x - a * z, c * w + a * y - b * x]
