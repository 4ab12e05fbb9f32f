"""The floater's state, the two frames it is told in, and the units in which it is integrated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from ...geometry.scenes import Scene

WEIGHTLESS = 1e-9
"""Gravity, m/s², that sets no unit of time."""


@dataclass(frozen=True, eq=False)
class State:
    """Motion of the floater at one instant (3,) or at many (n, 3), in SI units.

    Velocity and spin are those seen from the laboratory; only their components are taken along the axes of the
    laboratory or of the frame that turns with the rotor.

    Parameters
    ----------
    position : of the centre from the rotor's origin, m
    velocity : m/s
    moment : direction of the magnetic moment, a unit vector fixed in the body
    spin : angular velocity of the body, rad/s
    """

    position: Array
    velocity: Array
    moment: Array
    spin: Array

    def to_rotor(self, angle: ArrayLike) -> State:
        """Components along the rotor's axes, from those along the laboratory's; `angle` of the rotor in rad."""
        return State(*(turned_about_z(v, -np.asarray(angle, float)) for v in self.vectors))

    def to_lab(self, angle: ArrayLike) -> State:
        """Components along the laboratory's axes, from those along the rotor's; `angle` of the rotor in rad."""
        return State(*(turned_about_z(v, angle) for v in self.vectors))

    @property
    def vectors(self) -> tuple[Array, Array, Array, Array]:
        """Position, velocity, moment, spin."""
        return self.position, self.velocity, self.moment, self.spin


def turned_about_z(vectors: ArrayLike, angle: ArrayLike) -> Array:
    """Turn `vectors` (..., 3) by `angle` (...) in rad about +z."""
    vectors = np.asarray(vectors, float)
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z + 0 * cosine], axis=-1)


@dataclass(frozen=True)
class Scales:
    """Units of the integrated state, chosen so that all its components are of order one.

    Parameters
    ----------
    length : radius of the floater, m
    time : 1/ω of the rotor, s; of a rotor at rest the time of a fall through `length`, or one second without gravity
    spin_ratio : moment of inertia about the magnetic moment over that across it; the integrated spin is L/I, which has
        so much of the true one along the moment
    """

    length: float
    time: float
    spin_ratio: float = 1.0

    @classmethod
    def of(cls, scene: Scene) -> Scales:
        """Units that suit a scene."""
        radius, weight = scene.floater.radius, float(np.linalg.norm(scene.gravity))
        ratio = scene.floater.spin_ratio
        if scene.frequency:
            return cls(radius, 1 / abs(scene.angular_velocity), ratio)
        return cls(radius, float(np.sqrt(radius / weight)) if weight > WEIGHTLESS else 1.0, ratio)

    def pack(self, state: State) -> Array:
        """Scaled state (..., 12): position, velocity, moment, spin."""
        speed = self.length / self.time
        spin = _stretched(state.spin, state.moment, self.spin_ratio)
        parts = state.position / self.length, state.velocity / speed, state.moment, spin * self.time
        return np.concatenate(parts, axis=-1)

    def unpack(self, scaled: Array) -> State:
        """The state of `scaled` (..., 12 or more) in SI units, along the same axes."""
        position, velocity, moment, spin = (scaled[..., i : i + 3] for i in (0, 3, 6, 9))
        spin = _stretched(spin, moment, 1 / self.spin_ratio)
        return State(position * self.length, velocity * (self.length / self.time), moment + 0.0, spin / self.time)


def _stretched(spin: Array, moment: Array, ratio: float) -> Array:
    """A spin (..., 3) with its part along the moment (..., 3) times a ratio."""
    if ratio == 1:
        return spin
    return np.asarray(spin + (ratio - 1) * np.sum(spin * moment, axis=-1, keepdims=True) * moment)
