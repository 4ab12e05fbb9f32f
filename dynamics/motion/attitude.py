"""How a floater is turned, and what torques do to its turning: the part of the equations that bodies differ in.

A body that is round about its moment, in shape, field and inertia, is turned as its moment says: nothing depends on its
turn about it. The integrated spin is L/I, with so much of the true one along the moment as there is inertia about it.

Any other body has a unit quaternion q, from its own axes to the rotor's, and its spin Ω along its own axes, those of
its principal moments of inertia I. With its rotation matrix R(q), the rotor's rate W about z and a torque τ,

    q̇ = ½ q (Ω - Rᵀ W),        I Ω̇ = Rᵀ τ - Ω × I Ω.
"""

from collections.abc import Callable
from dataclasses import dataclass

import heyoka as hy

from .state import Parameter, Vector, cross, dot, rotation_of, subtract, turned

Matrix = list[list[hy.expression]]
ROUND_NAMES = tuple(f"{vector}_{axis}" for vector in ("moment", "spin") for axis in "xyz")
TURNING_NAMES = (*(f"turn_{part}" for part in "wxyz"), *(f"spin_{axis}" for axis in "xyz"))


@dataclass(frozen=True, eq=False)
class Attitude:
    """The states of a body's turning, and what the equations are made of, as expressions along the rotor's axes."""

    moment: Vector  # (3,) unit vector
    spin: Vector  # (3,) as seen from the laboratory
    energy: hy.expression  # of the turning, by the inertia of `parameters`
    momentum: Vector  # (3,) angular momentum, by the same
    braking: hy.expression  # power of the viscous torque as seen from the rotor, by the same
    rates: Callable[[Vector], list[hy.expression]]  # of the states, from the torque (3,) by the same
    axes: Matrix | None = None  # whose columns are the body's axes; None of a round body
    quaternion: Vector | None = None  # (4,) of these axes


def round_attitude(moment: Vector, spin: Vector, rate: hy.expression, across: Vector = ()) -> Attitude:
    """That of a body that is round about its `moment` (3,), with the integrated `spin` (3,), in a frame of a `rate`.

    See `turned` for a rate `across` its axis.
    """
    lag = lag_of(spin, rate, across)
    tilt, along = hy.par[Parameter.TILT_DRAG], hy.par[Parameter.SPIN_DRAG]
    excess = (tilt - along) * dot(spin, moment)
    brake = [excess * moment[i] - tilt * spin[i] for i in range(3)]

    def rates(torque: Vector) -> list[hy.expression]:
        return [*cross(lag, moment), *subtract([torque[i] + brake[i] for i in range(3)], turned(spin, rate, across))]

    return Attitude(moment, spin, 0.5 * dot(spin, spin), spin, dot(brake, lag), rates)


def lag_of(spin: Vector, rate: hy.expression, across: Vector = ()) -> list[hy.expression]:
    """A spin (3,) as seen from a frame of a `rate` about z and one `across` it."""
    x, y = [s - a for s, a in zip(spin[:2], across, strict=True)] if across else spin[:2]
    return [x, y, spin[2] - rate]


def turning_attitude(quaternion: Vector, spin: Vector, rate: hy.expression, across: Vector = ()) -> Attitude:
    """That of any body, from its `quaternion` (4,) and its `spin` (3,) along its own axes, in a frame of a `rate`.

    See `turned` for a rate `across` its axis.
    """
    w, x, y, z = quaternion
    axes = rotation_of(quaternion)
    ratios = [hy.par[p] for p in (Parameter.INERTIA_X, Parameter.INERTIA_Y, Parameter.INERTIA_Z)]
    pointing = [hy.par[p] for p in (Parameter.POINTING_X, Parameter.POINTING_Y, Parameter.POINTING_Z)]
    turning = [a * s for a, s in zip(ratios, spin, strict=True)]  # angular momentum
    lag = [s - rate * a for s, a in zip(spin, axes[2], strict=True)]
    if across:
        lag = [s - across[0] * a - across[1] * b for s, a, b in zip(lag, axes[0], axes[1], strict=True)]
    brake = [-hy.par[Parameter.TILT_DRAG] * s for s in spin]

    def rates(torque: Vector) -> list[hy.expression]:
        own = [dot(torque, [axes[i][k] for i in range(3)]) + brake[k] for k in range(3)]
        stiff = [(ratios[1] - ratios[2]), (ratios[2] - ratios[0]), (ratios[0] - ratios[1])]
        across = [spin[1] * spin[2], spin[2] * spin[0], spin[0] * spin[1]]
        half = [0.5 * s for s in lag]
        return [
            -dot([x, y, z], half),
            w * half[0] + y * half[2] - z * half[1],
            w * half[1] + z * half[0] - x * half[2],
            w * half[2] + x * half[1] - y * half[0],
            *((t + s * c) / a for t, s, c, a in zip(own, stiff, across, ratios, strict=True)),
        ]

    return Attitude(
        moment=[dot(row, pointing) for row in axes],
        spin=[dot(row, spin) for row in axes],
        energy=0.5 * dot(spin, turning),
        momentum=[dot(row, turning) for row in axes],
        braking=dot(brake, lag),
        rates=rates,
        axes=axes,
        quaternion=quaternion,
    )
