"""Stability of a periodic motion: what small deviations have become after one turn (Floquet multipliers)."""

import numpy as np

from ...geometry.basics import Array
from .harmonic_balance import Orbit
from .stability import Modes, left_eigenvectors, tangent_spaces

STEPS, MOST = 24, 384
"""Steps in a turn, doubled once for the error, and again until it is small: so often at most."""
ENOUGH = 1e-8
"""Error of the multipliers that is small: 1e-6 /s of growth at 100 Hz."""
SHARE = 0.1
"""Of the change by the last doubling, as the error: of a method of order six it is a 63rd."""
NODES = np.array([0.5 - np.sqrt(15) / 10, 0.5, 0.5 + np.sqrt(15) / 10])
COLLOCATION = np.array(
    [
        [5 / 36, 2 / 9 - np.sqrt(15) / 15, 5 / 36 - np.sqrt(15) / 30],
        [5 / 36 + np.sqrt(15) / 24, 2 / 9, 5 / 36 - np.sqrt(15) / 24],
        [5 / 36 + np.sqrt(15) / 30, 2 / 9 + np.sqrt(15) / 15, 5 / 36],
    ]
)
WEIGHTS = np.array([5, 8, 5]) / 18
"""Gauss's method of order six (E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, 1996, ch. IV.5)."""


def floquet_modes(orbit: Orbit) -> Modes:
    """Small motions about an orbit that keep |m̂| and the body spin: growth and frequencies over a turn.

    A multiplier ρ leaves a frequency open to whole multiples of the rotor's; each mode is told at the one that is
    strongest in its motion along the rotor's axes.  The error is that of the steps (twice as long for comparison) and
    of round-off.  Of the plate's own modes, which only decay, the ten of the floater are told apart by their shapes.
    """
    size = orbit.derivatives.shape[1]
    tangent, projection = np.zeros((size, size - 2)), np.zeros((size - 2, size))
    tangent[:12, :10], projection[:10, :12] = (found[0] for found in tangent_spaces(orbit.states[:1]))
    tangent[12:, 10:] = projection[10:, 12:] = np.eye(size - 12)
    coarse, steps = _propagated(orbit.derivatives, STEPS)[-1], 2 * STEPS
    while True:
        matrices = _propagated(orbit.derivatives, steps)
        turn = projection @ matrices[-1] @ tangent
        multipliers, right = np.linalg.eig(turn)
        left = left_eigenvectors(right)
        own = np.argsort(-np.linalg.norm(right[:10], axis=0))[:10]
        stepped = SHARE * np.abs(np.einsum("ij,ji->i", left @ (turn - projection @ coarse @ tangent), right))
        if stepped[own].max() < ENOUGH or steps >= MOST:
            break
        coarse, steps = matrices[-1], 2 * steps
    condition = np.linalg.norm(left, axis=1) * np.linalg.norm(right, axis=0)
    rounded = 100 * np.finfo(float).eps * np.linalg.norm(turn) * condition
    rates = np.log(multipliers[own].astype(complex)) / (2 * np.pi)
    errors = (stepped + rounded)[own] / (2 * np.pi * np.abs(multipliers[own]))
    shapes = tangent @ right[:, own]
    return Modes(rates + 1j * _turns(matrices, shapes, rates), errors, shapes[:12])


def _propagated(derivatives: Array, steps: int) -> Array:
    """What unit deviations have become (steps + 1, s, s) after every step of a turn.

    The plate's states, each of which decays by itself, are eliminated from the equations of a step's stages: what is
    solved for are the floater's slopes alone.
    """
    count, size = derivatives.shape[:2]
    step = 2 * np.pi / steps
    spectrum = np.fft.rfft(derivatives, axis=0) / count
    spectrum[1:] *= 2
    instants = step * (np.arange(steps)[:, None] + NODES)
    slopes = np.tensordot(np.exp(1j * instants[..., None] * np.arange(len(spectrum))), spectrum, 1).real
    own, fields, driven = slopes[..., :12, :12], slopes[..., :12, 12:], slopes[..., 12:, :12]
    decay = -np.diagonal(slopes[0, 0, 12:, 12:])
    damped = np.linalg.inv(np.eye(3) + step * decay[:, None, None] * COLLOCATION)
    lag = step * COLLOCATION @ damped
    lagging = [(fields * lag[:, :, k].T[:, None]).reshape(steps, 36, size - 12) @ driven[:, k] for k in range(3)]
    pull = np.stack(lagging, axis=-2).reshape(steps, 3, 12, 3, 12)
    pull[:, range(3), :, range(3)] += own.swapaxes(0, 1)
    kept = fields * (1 - decay[:, None] * lag.sum(axis=2)).T[:, None]
    system = np.eye(36) - step * np.einsum("njxky,km->njxmy", pull, COLLOCATION).reshape(steps, 36, 36)
    right = np.concatenate([pull.sum(axis=3), kept], axis=-1).reshape(steps, 36, size)
    stages = np.linalg.solve(system, right).reshape(steps, 3, 12, size)
    heard = driven @ (np.eye(12, size) + step * np.einsum("km,nmxs->nkxs", COLLOCATION, stages))
    heard -= np.eye(size)[12:] * decay[:, None]
    moved = step * np.einsum("j,njxs->nxs", WEIGHTS, stages)
    remembered = step * sum(heard[:, k] * (WEIGHTS @ damped)[:, k, None] for k in range(3))
    found = [np.eye(size)]
    for change in np.concatenate([moved, remembered], axis=1):
        found.append(found[-1] + change @ found[-1])
    return np.array(found)


def _turns(matrices: Array, shapes: Array, rates: Array) -> Array:
    """The multiple of the rotor's frequency that is strongest in the periodic part of each mode."""
    steps = len(matrices) - 1
    times = 2 * np.pi * np.arange(steps) / steps
    motion = (matrices[:-1] @ shapes)[:, :12] * np.exp(-np.outer(times, rates))[:, None]
    strength = np.sum(np.abs(np.fft.fft(motion, axis=0)) ** 2, axis=1)
    return np.asarray(np.fft.fftfreq(steps, 1 / steps)[np.argmax(strength, axis=0)])
