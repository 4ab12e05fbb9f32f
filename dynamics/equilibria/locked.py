"""Frequency-locked equilibria of a body that is not round about its moment: at rest in the rotor's frame.

Six balances of six unknowns: place and turn.  They are looked for from those of the body's mean over a turn about its
moment, which has a torque about it nowhere, from several such turns.  Equilibria that a symmetry of the body makes of
each other are one.
"""

import numpy as np

from ...geometry.common import Array
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales, left_product, matrices_of, quaternions_of
from .balance import CONVERGED_STEP, DUPLICATE_DISTANCE, place_error
from .equilibrium import LOCKED, Equilibrium, eigenmodes

TURNS = 16  # about the moment from which each is looked for
STEPS = 60  # of Newton's method at most
REACH = 0.2  # longest of its steps, in radii and rad


def locked_poses(rates: Rates, values: Array, points: Array, axes: Array) -> tuple[Array, Array]:
    """Scaled positions (k, 3) and quaternions (k, 4) of equilibria, by Newton's method.

    Parameters
    ----------
    rates, values : of the equations, and the runtime parameters (p,)
    points, axes : (n, 3) scaled positions and (n, 3, 3) axes of the body from which they are looked for
    """
    position, quaternion = points.copy(), quaternions_of(axes)
    active, met = np.arange(len(points)), np.zeros(len(points), bool)
    for _ in range(STEPS):
        if not len(active):
            break
        with np.errstate(all="ignore"):
            value, slope = rates.locked_balance(position[active], quaternion[active], values)
        good = np.isfinite(slope).all(axis=(1, 2)) & np.isfinite(value).all(axis=1)
        active, value, slope = active[good], value[good], slope[good]
        if not len(active):
            break
        step = -(np.linalg.pinv(slope) @ value[..., None])[..., 0]
        size = np.maximum(np.linalg.norm(step[:, :3], axis=1), np.linalg.norm(step[:, 3:], axis=1))
        step *= (REACH / np.maximum(size, REACH))[:, None]
        position[active] += step[:, :3]
        turns = left_product(list(step[:, 3:].T), list(quaternion[active].T))
        turned: Array = quaternion[active] + 0.5 * np.stack(turns, axis=1)
        quaternion[active] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        met[active] = size < CONVERGED_STEP
        active = active[(size > 1e-11) & (np.linalg.norm(position[active] - points[active], axis=1) < 2.0)]
    found: list[int] = []
    for k in np.flatnonzero(met):
        pairs = ((position[k] - position[j], abs(quaternion[k] @ quaternion[j])) for j in found)
        if not any(np.linalg.norm(way) < DUPLICATE_DISTANCE and turn > 1 - DUPLICATE_DISTANCE for way, turn in pairs):
            found.append(int(k))
    return position[found], quaternion[found]


def locked_equilibrium(
    scales: Scales, rates: Rates, values: Array, position: Array, quaternion: Array, doubt: Array
) -> Equilibrium:
    """The equilibrium in a pose of `locked_poses`, with its modes.

    Parameters
    ----------
    scales : of the scene
    rates : of a body that is not round
    values : (p,) of the parameters
    position : (3,) scaled
    quaternion : (4,)
    doubt : (2 + 12 c,) of the field there, T and T/m, see `field_doubts`
    """
    rate = float(values[Parameter.RATE])
    axes = matrices_of(quaternion)
    velocity = rate * np.array([-position[1], position[0], 0.0])
    state = np.concatenate([position, velocity, quaternion, rate * axes[2]])
    value, slope = (part[0] for part in rates.locked_balance(position[None], quaternion[None], values))
    jacobian = rates(state[None], values)[1][0]
    tangents, projections = np.zeros((13, 12)), np.zeros((12, 13))
    tangents[:6, :6] = projections[:6, :6] = np.eye(6)
    tangents[10:, 9:] = projections[9:, 10:] = np.eye(3)
    by_turn = 0.5 * np.stack(left_product(list(np.eye(3)), list(quaternion[:, None] * np.ones(3))))
    tangents[6:10, 6:9], projections[6:9, 6:10] = by_turn, 4 * by_turn.T
    found = eigenmodes(projections @ jacobian @ tangents, tangents)
    gravity = abs(float(values[Parameter.GRAVITY_Z]))
    unpacked = scales.unpack(state)
    return Equilibrium(
        state=unpacked,
        spin=float(unpacked.moment[2]),
        residual=float(np.abs(value).max() / (gravity or 1.0)),
        position_error=place_error(np.linalg.pinv(slope), value, values, doubt, axes[:, 2], axes.T) * scales.length,
        **found.in_seconds(scales.time),
        kind=LOCKED,
        slope=slope,
        jacobian=jacobian,
    )


def without_twins(found: list[Equilibrium]) -> list[Equilibrium]:
    """Of those in one place with one moment and the same modes the first: a symmetry of the body makes the others."""
    kept: list[Equilibrium] = []
    for one in found:
        unlike = [
            np.linalg.norm(one.position - other.position) > 1e-6 * np.linalg.norm(one.position)
            or np.linalg.norm(one.state.moment - other.state.moment) > 1e-5
            or len(one.frequencies_hz) != len(other.frequencies_hz)
            or not np.allclose(one.frequencies_hz, other.frequencies_hz, rtol=1e-4, atol=1e-4)
            or one.stable != other.stable
            for other in kept
        ]
        if all(unlike):
            kept.append(one)
    return kept
