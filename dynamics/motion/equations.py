"""Equations of motion of the floater, in the frame that turns with the rotor.

With unit length R (the floater's radius) and unit time T (`Scales`), position r, velocity v and spin Ω as seen from
the laboratory but along the rotor's axes, unit moment m̂ and the rotor's rate W = ωT about z:

    ṙ = v - W × r                         m̂' = (Ω - W) × m̂
    v̇ = F + g - c v - W × v               Ω̇ = τ - γ Ω⊥ - γ_s Ω∥ - W × Ω

F = (m T²/M R) ∇(m̂·B) and τ = (m T²/I) m̂ × B: exact for a rigidly magnetised sphere; what another shape adds is an
effect.  A body that is round about its moment, in shape, field and inertia, is turned as its moment says: nothing
depends on its turn about it.  Any other has a unit quaternion q instead, from its own axes to the rotor's, and its spin
along its own axes, those of its principal moments of inertia I.  With its rotation matrix R(q),

    q̇ = ½ q (Ω - Rᵀ W),                   I Ω̇ = Rᵀ τ - Ω × I Ω.

Where these are equal, as a cube's, trajectories have its spin as a round body's, for Ω × I Ω vanishes, and instead of
q its moment and a direction ê across it, with ê' = (Ω - W) × ê: 123 instead of 149 products of variables.

Without drag and with gravity along the axis everything is autonomous, and the Jacobi integral

    J = v²/2 + i Ω²/2 - i (m T²/I) m̂·B - g·r - W·(r × v + i Ω),   i = I/(M R²)   (unit: M R²/T²)

is conserved.  What drag and a horizontal part of gravity do in the rotating frame is integrated along as the last
state, `work`, so that J - work never changes.  With a drive W changes in time, and dJ/dt = -Ẇ ẑ·(r × v + iΩ).  What the
rotor does to the floater, and a plate to the rotor, the motor gives: its angular momentum and its work, W times the
torque, are two more states.  A rotor that is moved has an angular velocity W across its axis, too, and an origin with a
velocity; positions are seen from there, and all of gravity is in `work`, as what moves the rotor does work that the
motor does not.

Effects (`effect`) add what else acts on the floater: accelerations of position and spin, their energy to J, their
power to `work`; so does a plate, whose currents are further states (`memory_terms`).  Every number that a sweep may
change is a runtime parameter; only the tables' own geometry is compiled in.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import heyoka as hy
import numpy as np

from ...fem.closed_forms.eddy_bodies import thin_field_torque
from ...fem.rotor.table import FieldFormula
from ...geometry.common import MU_0, Array
from ...geometry.scene.contents import Scene
from .effect import NOTHING, PARAMETERS, ZERO, Motion, interaction_of
from .plate import PlateMemory, memory_terms
from .state import HALF, STEADY, Given, Parameter, Scales, Turn, Vector, about_z, add, cross, dot, rotation_of, subtract

Matrix = list[list[hy.expression]]
CENTRE = tuple(f"{vector}_{axis}" for vector in ("position", "velocity") for axis in "xyz")
ROUND_NAMES = tuple(f"{vector}_{axis}" for vector in ("moment", "spin") for axis in "xyz")
NAMES = (*CENTRE, *ROUND_NAMES)
EVEN_NAMES = (*ROUND_NAMES[:3], *(f"side_{axis}" for axis in "xyz"), *ROUND_NAMES[3:])
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


def round_attitude(moment: Vector, spin: Vector, rotor: Turn) -> Attitude:
    """That of a body that is round about its `moment` (3,), with the integrated `spin` (3,), seen from a `rotor`."""
    lag, tilt, along = rotor.lag(spin), hy.par[Parameter.TILT_DRAG], hy.par[Parameter.SPIN_DRAG]
    excess = (tilt - along) * dot(spin, moment)
    brake = [excess * m - tilt * s for m, s in zip(moment, spin, strict=True)]

    def rates(torque: Vector) -> list[hy.expression]:
        return [*cross(lag, moment), *subtract(add(torque, brake), rotor.swept(spin))]

    return Attitude(moment, spin, 0.5 * dot(spin, spin), spin, dot(brake, lag), rates)


def turning_attitude(quaternion: Vector, spin: Vector, rotor: Turn, given: Given) -> Attitude:
    """That of any body: `quaternion` (4,), `spin` (3,) along its axes, seen from a `rotor`, by parameters `given`."""
    w, *vector = quaternion
    axes = rotation_of(quaternion)
    ratios = [given[p] for p in (Parameter.INERTIA_X, Parameter.INERTIA_Y, Parameter.INERTIA_Z)]
    pointing = [given[p] for p in (Parameter.POINTING_X, Parameter.POINTING_Y, Parameter.POINTING_Z)]
    turning = [a * s for a, s in zip(ratios, spin, strict=True)]  # angular momentum
    lag = [s - rotor.rate * a for s, a in zip(spin, axes[2], strict=True)]
    for rate, row in zip(rotor.across, axes, strict=False):
        lag = [s - rate * a for s, a in zip(lag, row, strict=True)]
    brake, half = [-given[Parameter.TILT_DRAG] * s for s in spin], [0.5 * s for s in lag]

    def rates(torque: Vector) -> list[hy.expression]:
        own = add([dot(torque, column) for column in zip(*axes, strict=True)], brake)
        stiff = [(ratios[1] - ratios[2]), (ratios[2] - ratios[0]), (ratios[0] - ratios[1])]
        across = [spin[1] * spin[2], spin[2] * spin[0], spin[0] * spin[1]]
        return [
            -dot(vector, half),
            *(w * h + c for h, c in zip(half, cross(vector, half), strict=True)),
            *((t + s * c) / a for t, s, c, a in zip(own, stiff, across, ratios, strict=True)),
        ]

    moment, outer, momentum = ([dot(row, own) for row in axes] for own in (pointing, spin, turning))
    energy, braking = 0.5 * dot(spin, turning), dot(brake, lag)
    return Attitude(moment, outer, energy, momentum, braking, rates, axes, quaternion)


def even_attitude(turn: Vector, halved: Vector, rotor: Turn, given: Given, frame: Array) -> Attitude:
    """That of a body of equal moments of inertia, from its moment and half a direction across it, `turn` (6,).

    Its spin is `halved` (3,), too, see `Scales` for both and for `frame`; seen from a `rotor`. `given` are the runtime
    parameters.
    """
    moment, half, spin = turn[:3], turn[3:], [s / HALF for s in halved]
    side, lag = [s / HALF for s in half], rotor.lag(spin)
    brake = [-given[Parameter.TILT_DRAG] * s for s in spin]

    def rates(torque: Vector) -> list[hy.expression]:
        own = [HALF * t for t in add(torque, brake)]
        return [*cross(lag, moment), *cross(lag, half), *subtract(own, rotor.swept(halved))]

    columns = [side, cross(moment, side), moment]
    axes = [[dot(row, column) for row in frame.tolist()] for column in zip(*columns, strict=True)]
    return Attitude(moment, spin, 0.5 * dot(spin, spin), spin, dot(brake, lag), rates, axes)


@dataclass(frozen=True, eq=False)
class Equations:
    """The equations of motion as heyoka expressions."""

    variables: Vector  # the floater's, those of effects, the plate's, and with a drive what the motor has given
    rates: Vector  # their derivatives with respect to scaled time
    # the terms of the Jacobi integral: motion, turning, magnet, weight, swirl, effects, and the plate's energy
    jacobi: Vector
    power: hy.expression  # its rate of change, by drag, by gravity across the axis, by effects and by the plate


def parameters(scene: Scene, scales: Scales, frozen_spin: bool = False) -> Array:
    """Runtime parameters of a `scene` in units `scales`; `frozen_spin` takes the drag off the spin about the moment."""
    floater, drag, (length, time) = scene.floater, scene.drag, (scales.length, scales.time)
    root_energy = np.sqrt(floater.mass) * length / time
    values = np.zeros(len(Parameter))
    values[Parameter.RATE] = scene.angular_velocity * time
    values[Parameter.LENGTH] = length
    values[Parameter.TORQUE] = floater.moment * time**2 / floater.inertia
    values[Parameter.INERTIA] = floater.inertia / (floater.mass * length**2)
    values[Parameter.GRAVITY_X : Parameter.GRAVITY_Z + 1] = scene.gravity * (time**2 / length)
    values[Parameter.LINEAR_DRAG] = drag.linear * time / floater.mass
    values[Parameter.TILT_DRAG] = drag.angular * time / floater.inertia
    values[Parameter.SPIN_DRAG] = 0.0 if frozen_spin else values[Parameter.TILT_DRAG] / floater.spin_ratio
    if floater.conductivity:
        values[Parameter.TILT_EDDY] = thin_field_torque(floater.radius, floater.conductivity) * time / floater.inertia
        values[Parameter.SPIN_EDDY] = 0.0 if frozen_spin else values[Parameter.TILT_EDDY]
        values[Parameter.SLOWNESS] = MU_0 * floater.conductivity * floater.radius**2 / time
    values[Parameter.TIME] = time
    values[Parameter.PLATE_MOMENT] = floater.moment / root_energy
    values[Parameter.PLATE_SHARE] = 1 / root_energy
    values[Parameter.INDUCED] = floater.polarizability / root_energy
    values[Parameter.INERTIA_X : Parameter.INERTIA_Z + 1] = floater.principal_inertia / floater.inertia
    values[Parameter.POINTING_X : Parameter.POINTING_Z + 1] = floater.pointing
    return values


def equations_of_motion(
    table: FieldFormula,
    tilted_gravity: bool = False,
    memory: PlateMemory | None = None,
    first: int = len(Parameter),
    rotor: Turn = STEADY,
    given: Given = PARAMETERS,
    frame: Array | None = None,
) -> Equations:
    """Rates of the scaled state in the field of a table.

    The `table` is the rotor's field, with effects if it is an `Interaction`. `tilted_gravity`: gravity has a part
    across the axis; it turns in this frame, so that time enters. `memory` is of the plate's currents, if they are
    modelled, and `first` the number of the first of their runtime parameters, which are `given`. The `rotor` is
    `STEADY`, `DRIVEN` or `moved`. `frame` is that of `Scales`.
    """
    whole, about, driven, moving = interaction_of(table), rotor, rotor is not STEADY, bool(rotor.velocity)
    rotor = rotor if driven else replace(STEADY, rate=given[Parameter.RATE])
    names = EVEN_NAMES if frame is not None else TURNING_NAMES if whole.turning else ROUND_NAMES
    variables = list(hy.make_vars(*CENTRE, *names))
    position, velocity, turn_states, spin_states = variables[:3], variables[3:6], variables[6:-3], variables[-3:]
    if frame is not None:
        attitude = even_attitude(turn_states, spin_states, rotor, given, frame)
    elif whole.turning:
        attitude = turning_attitude(turn_states, spin_states, rotor, given)
    else:
        attitude = round_attitude(turn_states, spin_states, rotor)
    moment, spin = attitude.moment, attitude.spin
    length, torque, inertia, linear = (
        given[p] for p in (Parameter.LENGTH, Parameter.TORQUE, Parameter.INERTIA, Parameter.LINEAR_DRAG)
    )
    field, gradient = table.expressions([length * p for p in position])
    force, turn, lateral = NOTHING, NOTHING, NOTHING
    axial: Vector = [ZERO, ZERO, hy.par[Parameter.GRAVITY_Z]]
    if moving:
        axial, lateral = NOTHING, rotor.gravity
    elif tilted_gravity:
        lateral = about_z([hy.par[Parameter.GRAVITY_X], hy.par[Parameter.GRAVITY_Y], ZERO], rotor.angle, -1.0)
    push = [lateral[i] - linear * velocity[i] for i in range(3)]
    drift = subtract(velocity, rotor.swept(position))
    drift = subtract(drift, rotor.velocity) if moving else drift
    lag = rotor.lag(spin)
    momenta = [a + inertia * b for a, b in zip(cross(position, velocity), attitude.momentum, strict=True)]
    jacobi = [
        0.5 * dot(velocity, velocity),
        inertia * attitude.energy,
        ZERO,  # of the magnet, below
        -axial[2] * position[2],
        -rotor.rate * momenta[2],
    ]
    power = dot(push, drift) + inertia * attitude.braking
    motion = Motion(
        position, velocity, moment, spin, drift, lag, field, gradient, rotor, attitude.axes, attitude.quaternion, given
    )
    parts = [effect.added(motion) for effect in whole.effects]
    if memory is not None:
        parts.append(memory_terms(memory, first, position, moment, about))
    states = [state for added in parts for state in added.states]
    state_rates = [rate for added in parts for rate in added.rates]
    if more := sum(added.more for added in parts):
        torque = torque + given[Parameter.PLATE_SHARE] * given[Parameter.PLATE_SHARE] / inertia * more
    pulled, turning = [torque * inertia * length * m for m in moment], [torque * b for b in field]
    jacobi[2] = -inertia * torque * dot(moment, field)
    for added in parts:
        force, turn = add(force, added.force), add(turn, added.torque)
        pulled, turning = add(pulled, added.pulled), add(turning, added.turning)
        jacobi.append(added.energy)
        power = power + added.power
    force = [dot(pulled, [row[j] for row in gradient]) + f for j, f in enumerate(force)]
    turn = add(cross(moment, turning), turn)
    if moving:
        # E - W·L of a frame whose origin has a velocity c: c·F + W·(c × v) beside what there is without
        (x, y), whirl = rotor.across, [*rotor.across, rotor.rate]
        jacobi.append(-(x * momenta[0] + y * momenta[1]))
        power = power + dot(rotor.velocity, add(force, push)) + dot(whirl, cross(rotor.velocity, velocity))
        power = power - rotor.rate * (y * momenta[0] - x * momenta[1])
    if driven:
        power = power - rotor.acceleration * momenta[2]
        drive = cross(position, force)[2] + inertia * turn[2]
        for added in parts:
            if added.motor is not None:
                drive = drive + added.motor - cross(position, added.force)[2] - inertia * added.torque[2]
        states = [*states, *hy.make_vars("motor_momentum", "motor_work")]
        state_rates = [*state_rates, drive, rotor.rate * drive]
    acceleration = subtract(add(force, axial, push), rotor.swept(velocity))
    rates = [*drift, *acceleration, *attitude.rates(turn), *state_rates]
    return Equations([*variables, *states], rates, jacobi, power)


# Position, moment, its two tangents, and body spin s: what balances are functions of.
GIVEN = ("x", "y", "z", "m_x", "m_y", "m_z", "t_x", "t_y", "t_z", "u_x", "u_y", "u_z", "body_spin")
TILTS = ("tilt_t", "tilt_u")


def balances(equations: Equations, still: bool = False) -> tuple[list[hy.expression], list[hy.expression]]:
    """The balances (5,) of a motion with their derivatives (5 × 5, row by row), and their variables (13,).

    Of a body `still` in the rotor's frame the body spin is the given one times the cosine of the polar angle.
    """
    given, tilts = list(hy.make_vars(*GIVEN)), list(hy.make_vars(*TILTS))
    position, tangents, spin = given[:3], (given[6:9], given[9:12]), given[12]
    moment = [given[3 + i] + tilts[0] * tangents[0][i] + tilts[1] * tangents[1][i] for i in range(3)]
    spin = spin * moment[2] if still else spin
    rate = hy.par[Parameter.RATE]
    along = rate * (spin - moment[2])
    turning = [along * moment[0], along * moment[1], along * moment[2] + rate]
    state = [*position, -rate * position[1], rate * position[0], hy.expression(0.0), *moment, *turning]
    rates = hy.subs(list(equations.rates[:12]), dict(zip(NAMES, state, strict=True)))
    force, torque = rates[3:6], rates[9:12]
    values = [*force, *(dot(tangent, torque) for tangent in tangents)]
    slopes = np.asarray(hy.diff_tensors(values, diff_args=[*position, *tilts], diff_order=1).jacobian).reshape(5, 5)
    for k in (3, 4):
        slopes[k, k] = slopes[k, k] - dot(moment, torque)  # the tangents turn with the moment
    return hy.subs([*values, *slopes.ravel()], {name: hy.expression(0.0) for name in TILTS}), given


def still_balances(equations: Equations) -> tuple[list[hy.expression], list[hy.expression]]:
    """`balances` of a body at rest in the rotor's frame."""
    return balances(equations, still=True)


# Position, quaternion and small turns about the rotor's axes: what those of a frequency-locked body are functions of.
LOCKED = ("x", "y", "z", "q_w", "q_x", "q_y", "q_z")
TURNS = ("by_x", "by_y", "by_z")


def locked_balances(equations: Equations) -> tuple[list[hy.expression], list[hy.expression]]:
    """Balances (6,) of a body at rest in the rotor's frame, slopes (6 × 6) by place and small turns, variables (7,)."""
    given, turns = list(hy.make_vars(*LOCKED)), list(hy.make_vars(*TURNS))
    position, (w, *own), half = given[:3], given[3:], [0.5 * t for t in turns]
    quaternion = [w - dot(half, own), *add(own, [w * h for h in half], cross(half, own))]
    rate = hy.par[Parameter.RATE]
    spin = [rate * part for part in rotation_of(quaternion)[2]]
    velocity = [-rate * position[1], rate * position[0], hy.expression(0.0)]
    state = dict(zip((*CENTRE, *TURNING_NAMES), [*position, *velocity, *quaternion, *spin], strict=True))
    rates = hy.subs(list(equations.rates[:13]), state)
    values = [*rates[3:6], *rates[10:13]]
    slopes = hy.diff_tensors(values, diff_args=[*position, *turns], diff_order=1).jacobian
    return hy.subs([*values, *np.asarray(slopes).ravel()], {name: hy.expression(0.0) for name in TURNS}), given
