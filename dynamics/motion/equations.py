"""Equations of motion of the floater, in the frame that turns with the rotor.

With unit length R (the floater's radius) and unit time T (`Scales`), position r, velocity v and spin Ω as seen from
the laboratory but along the rotor's axes, unit moment m̂ and the rotor's rate W = ωT about z:

    ṙ = v - W × r                         m̂' = (Ω - W) × m̂
    v̇ = F + g - c v - W × v               Ω̇ = τ - γ Ω⊥ - γ_s Ω∥ - W × Ω

F = (m T²/M R) ∇(m̂·B) and τ = (m T²/I) m̂ × B: exact for a rigidly magnetised sphere.  Without drag and with gravity
along the axis everything is autonomous, and the Jacobi integral

    J = v²/2 + i Ω²/2 - i (m T²/I) m̂·B - g·r - W·(r × v + i Ω),   i = I/(M R²)   (unit: M R²/T²)

is conserved: the energy less ω times the angular momentum about the axis.  What drag and a horizontal part of gravity
do in the rotating frame is integrated along as the last state, `work`, so that J - work never changes.
With a drive W changes in time, and dJ/dt = -Ẇ ẑ·(r × v + iΩ); velocity and spin are those seen from the laboratory, so
that nothing else changes.  What the rotor does to the floater, and a plate to the rotor, the motor gives: its angular
momentum and its work, W times the torque, are integrated along as two more states.
Effects (`effect`) add what else acts on the floater: accelerations of position and spin, their energy to J, their
power to `work`.  A plate adds its currents as further states (`memory_terms`) and their energy to J.  Every number that
a sweep may change is a runtime parameter; only the tables' own geometry is compiled in.
"""

from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.closed_forms.eddy_sphere import thin_field_torque
from ...fem.rotor.table import FieldFormula
from ...geometry.common import MU_0, Array
from ...geometry.scene.contents import Scene
from .effect import Motion, interaction_of
from .plate import PlateMemory, memory_terms
from .state import DRIVEN, STEADY, Parameter, Scales, Vector, cross, dot, subtract, turned

FORCE_ALONE = "spinlev.floater_force gives force and torque on it; for a motion take a cylinder or a sphere."
NAMES = tuple(f"{vector}_{axis}" for vector in ("position", "velocity", "moment", "spin") for axis in "xyz")


@dataclass(frozen=True, eq=False)
class Equations:
    """The equations of motion as heyoka expressions."""

    variables: Vector  # the twelve of the floater, then the plate's, and with a drive what the motor has given
    rates: Vector  # their derivatives with respect to scaled time
    # the terms of the Jacobi integral: motion, turning, magnet, weight, swirl, effects, and the plate's energy
    jacobi: Vector
    power: hy.expression  # its rate of change, by drag, by gravity across the axis, by effects and by the plate


def parameters(scene: Scene, scales: Scales, frozen_spin: bool = False) -> Array:
    """Runtime parameters of a `scene` in units `scales`; `frozen_spin` takes the drag off the spin about the moment.

    Raises InputError: the floater is a cuboid, whose turn about its own moment the equations do not have.
    """
    scene.floater.must_be("sphere", "cylinder", where="where it moves", instead=FORCE_ALONE)
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
    return values


def equations_of_motion(
    table: FieldFormula,
    tilted_gravity: bool = False,
    memory: PlateMemory | None = None,
    first: int = len(Parameter),
    driven: bool = False,
) -> Equations:
    """Rates of the scaled state in the field of a table.

    Parameters
    ----------
    table : the rotor's field, with effects if it is an `Interaction`
    tilted_gravity : whether gravity has a part across the axis; it turns in this frame, so that time enters
    memory, first : the plate's currents, if they are modelled, and the first of their runtime parameters
    driven : whether the rotor's rate changes in time
    """
    variables, rotor = list(hy.make_vars(*NAMES)), DRIVEN if driven else STEADY
    position, velocity, moment, spin = (variables[i : i + 3] for i in (0, 3, 6, 9))
    length, torque, inertia, linear = (
        hy.par[p] for p in (Parameter.LENGTH, Parameter.TORQUE, Parameter.INERTIA, Parameter.LINEAR_DRAG)
    )
    field, gradient = table.expressions([length * p for p in position])
    strength = torque * inertia * length
    force, turn = [hy.expression(0.0)] * 3, [hy.expression(0.0)] * 3
    pulled, turning = [strength * m for m in moment], [torque * b for b in field]
    axial, lateral = _gravity(tilted_gravity, rotor.angle)
    push = [lateral[i] - linear * velocity[i] for i in range(3)]
    drift = subtract(velocity, turned(position, rotor.rate))
    lag = [spin[0], spin[1], spin[2] - rotor.rate]
    brake = _angular_drag(moment, spin)
    momentum = cross(position, velocity)[2] + inertia * spin[2]
    jacobi = [
        0.5 * dot(velocity, velocity),
        0.5 * inertia * dot(spin, spin),
        -inertia * torque * dot(moment, field),
        -axial[2] * position[2],
        -rotor.rate * momentum,
    ]
    power = dot(push, drift) + inertia * dot(brake, lag)
    motion = Motion(position, velocity, moment, spin, drift, lag, field, gradient, rotor)
    parts = [effect.added(motion) for effect in interaction_of(table).effects]
    states: list[hy.expression] = []
    state_rates: Vector = []
    if memory is not None:
        states = [hy.expression(f"plate_{i}") for i in range(len(memory.table.rates))]
        by_plate, state_rates = memory_terms(memory, first, position, moment, states, driven)
        parts.append(by_plate)
    for added in parts:
        force = [a + b for a, b in zip(force, added.force, strict=True)]
        turn = [a + b for a, b in zip(turn, added.torque, strict=True)]
        pulled = [a + b for a, b in zip(pulled, added.pulled, strict=True)]
        turning = [a + b for a, b in zip(turning, added.turning, strict=True)]
        jacobi.append(added.energy)
        power = power + added.power
    force = [dot(pulled, [gradient[i][j] for i in range(3)]) + f for j, f in enumerate(force)]
    turn = [a + b for a, b in zip(cross(moment, turning), turn, strict=True)]
    if driven:
        power = power - rotor.acceleration * momentum
        given = cross(position, force)[2] + inertia * turn[2]
        for added in parts:
            if added.motor is not None:
                given = given + added.motor - cross(position, added.force)[2] - inertia * added.torque[2]
        states = [*states, *hy.make_vars("motor_momentum", "motor_work")]
        state_rates = [*state_rates, given, rotor.rate * given]
    rates = [
        *drift,
        *subtract([force[i] + axial[i] + push[i] for i in range(3)], turned(velocity, rotor.rate)),
        *cross(lag, moment),
        *subtract([turn[i] + brake[i] for i in range(3)], turned(spin, rotor.rate)),
    ]
    return Equations([*variables, *states], [*rates, *state_rates], jacobi, power)


def _gravity(tilted: bool, angle: hy.expression) -> tuple[Vector, Vector]:
    """Gravity along the axis and across it, both along the rotor's axes."""
    zero = hy.expression(0.0)
    axial = [zero, zero, hy.par[Parameter.GRAVITY_Z]]
    if not tilted:
        return axial, [zero, zero, zero]
    x, y = hy.par[Parameter.GRAVITY_X], hy.par[Parameter.GRAVITY_Y]
    return axial, [hy.cos(angle) * x + hy.sin(angle) * y, hy.cos(angle) * y - hy.sin(angle) * x, zero]


def _angular_drag(moment: Vector, spin: Vector) -> Vector:
    tilt, along = hy.par[Parameter.TILT_DRAG], hy.par[Parameter.SPIN_DRAG]
    excess = (tilt - along) * dot(spin, moment)
    return [excess * moment[i] - tilt * spin[i] for i in range(3)]


# Position, moment, its two tangents, and body spin s: what balances are functions of.
GIVEN = ("x", "y", "z", "m_x", "m_y", "m_z", "t_x", "t_y", "t_z", "u_x", "u_y", "u_z", "body_spin")
TILTS = ("tilt_t", "tilt_u")


def balances(equations: Equations) -> tuple[list[hy.expression], list[hy.expression]]:
    """The balances (5,) of a motion with their derivatives (5 × 5, row by row), and their variables (13,)."""
    given, tilts = list(hy.make_vars(*GIVEN)), list(hy.make_vars(*TILTS))
    position, tangents, spin = given[:3], (given[6:9], given[9:12]), given[12]
    moment = [given[3 + i] + tilts[0] * tangents[0][i] + tilts[1] * tangents[1][i] for i in range(3)]
    rates = hy.subs(list(equations.rates[:12]), dict(zip(NAMES, _state(position, moment, spin), strict=True)))
    force, torque = rates[3:6], rates[9:12]
    values = [*force, *(dot(tangent, torque) for tangent in tangents)]
    free = [*position, *tilts]
    slopes = np.asarray(hy.diff_tensors(values, diff_args=free, diff_order=1).jacobian).reshape(5, 5)
    for k in (3, 4):
        slopes[k, k] = slopes[k, k] - dot(moment, torque)  # the tangents turn with the moment
    untilted = {name: hy.expression(0.0) for name in TILTS}
    return hy.subs([*values, *slopes.ravel()], untilted), given


def _state(position: Vector, moment: Vector, spin: hy.expression) -> list[hy.expression]:
    rate = hy.par[Parameter.RATE]
    along = rate * (spin - moment[2])
    velocity = [-rate * position[1], rate * position[0], hy.expression(0.0)]
    return [*position, *velocity, *moment, along * moment[0], along * moment[1], along * moment[2] + rate]
