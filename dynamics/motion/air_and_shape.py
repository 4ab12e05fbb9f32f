"""What air does to a real sphere beyond Stokes' drag, by its Reynolds number and the rotor's frequency.

Stokes' drag is 6πηRv and Stokes' torque 8πηR³Ω (G. Kirchhoff, 1876); three things make the real ones larger.

A steady spin throws off a jet at the equator.  With Re = ΩR²/ν the torque is ½ρΩ²R⁵ C, C = 6.45/√Re + 32.1/Re for
20 ≤ Re ≤ 1000 (S. C. R. Dennis, S. N. Singh and D. B. Ingham, J. Fluid Mech. 101 (1980) 257: computed for 1 to 100, in
agreement with measurements; the first term is that of the boundary layer, so that laminar flow reaches further).
Stokes is C = 16π/Re; the two meet at Re = 7.9, and the larger one is taken.  E. Loth's fit of other data (AIAA J. 46
(2008) 801), 1 + 5/(64π) (4 Re)^0.6 times Stokes, is 11 % higher at Re = 20 and agrees within 5 % from 100 to 2000.

A small swing at the rotor's rate ω moves a layer of depth δ = √(2ν/ω), 0.28 mm at 60 Hz and 0.14 mm at 250 Hz.
Exactly, to first order in its angle (L. D. Landau and E. M. Lifshitz, Fluid Mechanics, section 24, problem on the
oscillating sphere), the part of the torque that is in phase with Ω is, over Stokes' and with q = R/δ,

    h = (3 + 6q + 6q² + 2q³) / (3 (1 + 2q + 2q²)),

eight at 60 Hz for the article's floater.  Seen from the laboratory a floater in step with the rotor spins steadily
about the rotor's axis and swings across it once a turn: f is applied to Ω_z and h to the part of Ω across the axis.

A fast way through the air separates the flow: with Re = 2Rv/ν the drag is 1 + 0.15 Re^0.687 times Stokes', within 5 %
up to Re = 800 (L. Schiller and A. Naumann, Z. VDI 77 (1933) 318; R. Clift, J. R. Grace and M. E. Weber, Bubbles, Drops,
and Particles, 1978, table 5.2).  Left out is the memory of the layer in translation, which damps a small shaking at
frequency f by 1 + R/δ(f) times Stokes', ten at 10 Hz.  The air is far from walls, and the rotor does not stir it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.rotor.floater import FloaterSources, force_and_torque
from ...fem.rotor.table import FieldFormula, FieldTable
from ...geometry.common import Array
from ...geometry.scene.contents import AIR_VISCOSITY, Floater
from .effect import Added, Motion, dissipative
from .state import Parameter, cross, dot

REAL_AIR = "air beyond Stokes"
AIR_DENSITY = 1.19  # kg/m³ at 20-25 °C
BOUNDARY_LAYER, REST = 6.45, 32.1
# Reynolds number at which a steady spin begins to feel more than Stokes' torque.
STOKES_UP_TO = ((16 * np.pi - REST) / BOUNDARY_LAYER) ** 2
# Reynolds number that is added in square to that of translation, so that its power is smooth at rest: 3 % there.
SLOW = 0.1
Value = TypeVar("Value", Array, hy.expression)


def reynolds(radius: float, angular_velocity: ArrayLike) -> Array:
    """ΩR²/ν in air of a sphere (m) that spins (rad/s)."""
    return np.asarray(np.abs(np.asarray(angular_velocity, float)) * radius**2 * AIR_DENSITY / AIR_VISCOSITY)


def spinning(reynolds_number: ArrayLike) -> Array:
    """Torque of a steady spin over Stokes' 8πηR³Ω, at Re = ΩR²/ν: 1 up to 7.9, about 4.7 at 1000."""
    return np.asarray(_beyond(np.maximum(np.asarray(reynolds_number, float), STOKES_UP_TO)))


def swinging(reynolds_number: ArrayLike) -> Array:
    """Torque in phase with a small swing at ω over Stokes' 8πηR³Ω, at ωR²/ν: 1 if slow, about 8 at 1000."""
    return np.asarray(_layered(np.sqrt(np.asarray(reynolds_number, float) / 2)))


def moving(reynolds_number: ArrayLike) -> Array:
    """Drag of a steady way over Stokes' 6πηRv, at Re = 2Rv/ν: 1 if slow, about 5.6 at 150."""
    return np.asarray(_separated(np.asarray(reynolds_number, float) ** 2))


@dataclass(frozen=True)
class RealAir:
    """What air does beyond the Stokes drag that the runtime parameters hold."""

    name: str = REAL_AIR

    def added(self, motion: Motion) -> Added:
        length, time, spin, moment = hy.par[Parameter.LENGTH], hy.par[Parameter.TIME], motion.spin, motion.moment
        unit = length * length / time * (AIR_DENSITY / AIR_VISCOSITY)  # Reynolds number of unit spin or speed
        fast = hy.relu(spin[2]) + hy.relu(-spin[2])
        steady = _beyond(STOKES_UP_TO + hy.relu(unit * fast - STOKES_UP_TO)) - 1.0
        swing = _layered(hy.sqrt(0.5 * unit * hy.par[Parameter.RATE])) - 1.0
        torque = [-swing * spin[0], -swing * spin[1], -steady * spin[2]]
        tilt, along = hy.par[Parameter.TILT_DRAG], hy.par[Parameter.SPIN_DRAG]
        excess = (along - tilt) * dot(torque, moment)
        speed = 4.0 * unit * unit * dot(motion.velocity, motion.velocity)
        push = hy.par[Parameter.LINEAR_DRAG] * (1.0 - _separated(speed + SLOW**2))
        force = [push * v for v in motion.velocity]
        return dissipative(force, [tilt * torque[i] + excess * moment[i] for i in range(3)], motion)


def _beyond(number: Value) -> Value:
    return (BOUNDARY_LAYER * number**0.5 + REST) / (16 * np.pi)


def _layered(q: Value) -> Value:
    return (3.0 + 6.0 * q + 6.0 * q * q + 2.0 * q * q * q) / (3.0 * (1.0 + 2.0 * q + 2.0 * q * q))


def _separated(square: Value) -> Value:
    return 1.0 + 0.15 * square ** (0.687 / 2)


FLOATER_SHAPE = "the floater's shape"
HEIGHTS = np.array([0.3, 0.6, 0.9])  # Of the dipoles off the centre, in half heights of the floater


@dataclass(frozen=True, eq=False)
class FloaterShape:
    """What the shape of a cylinder polarised along its axis adds to the dipole at its centre."""

    field: FieldFormula  # the rotor's
    heights: Array  # (k,) m along the moment; the first is zero
    dipoles: Array  # (k,) by the moment of the equations
    floater: Floater  # whose shape it is
    sources: FloaterSources
    name: str = FLOATER_SHAPE

    @classmethod
    def of(cls, floater: Floater, sources: FloaterSources, field: FieldFormula) -> FloaterShape:
        """The dipoles with the multipoles of a floater's sources, less the one that the equations have."""
        half = floater.solid.half_edges[2]
        heights = half * np.array([0.0, *HEIGHTS, *-HEIGHTS])
        degrees = 2 * np.arange(len(HEIGHTS) + 1) + 1
        powers = (heights / half) ** (degrees[:, None] - 1)
        wanted = sources.axial_moments(int(degrees[-1]))[degrees - 1] / (degrees * half ** (degrees - 1))
        dipoles = np.linalg.pinv(powers) @ wanted / (floater.moment or 1.0)
        return cls(field, heights, dipoles - (heights == 0) * bool(floater.moment), floater, sources)

    def added(self, motion: Motion) -> Added:
        length, torque, inertia = (hy.par[p] for p in (Parameter.LENGTH, Parameter.TORQUE, Parameter.INERTIA))
        moment, force, turn = motion.moment, [hy.expression(0.0)] * 3, [hy.expression(0.0)] * 3
        energy = hy.expression(0.0)
        for height, dipole in zip(self.heights, self.dipoles, strict=True):
            place = [length * x + float(height) * m for x, m in zip(motion.position, moment, strict=True)]
            field, gradient = self.field.expressions(place) if height else (motion.field, motion.gradient)
            strength = float(dipole) * torque
            pull = [strength * inertia * length * dot(moment, [gradient[i][j] for i in range(3)]) for j in range(3)]
            force = [a + b for a, b in zip(force, pull, strict=True)]
            arm = [float(height) / length / inertia * m for m in moment]
            turns = zip(cross(moment, field), cross(arm, pull), strict=True)
            turn = [a + strength * b + c for a, (b, c) in zip(turn, turns, strict=True)]
            energy = energy - strength * inertia * dot(moment, field)
        return Added(force, turn, energy=energy)

    def missed(self, table: FieldTable, position: Array, moment: Array) -> Array:
        """(n, 2) what the dipoles miss of torque and force over the moment, T and T/m, at (n, 3) m and (n, 3)."""
        axes = np.array([self.floater.axes(m) for m in moment])
        force, torque = force_and_torque(self.sources, table, position, axes)
        for height, dipole in zip(self.heights, self.dipoles + (self.heights == 0), strict=True):
            field, gradient = table.evaluate(position + height * moment)
            strength = dipole * self.floater.moment
            pull = strength * np.einsum("nj,nji->ni", moment, gradient)
            force -= pull
            torque -= strength * np.cross(moment, field) + height * np.cross(moment, pull)
        return np.asarray(np.linalg.norm([torque, force], axis=2).T / (self.floater.moment or 1.0))
