"""Stability of a periodic motion: what small deviations have become after one turn (Floquet multipliers)."""

import numpy as np

from ...geometry.basics import Array
from .harmonic_balance import Orbit
from .stability import Modes, tangent_spaces

STEPS = 48
"""Steps in a turn, doubled once for the error."""
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
    strongest in its motion along the rotor's axes.  The error is that of the steps (half as long for comparison) and of
    round-off.  Of the plate's own modes, which only decay, the ten of the floater are told apart by their shapes.
    """
    size = orbit.derivatives.shape[1]
    tangent, projection = np.zeros((size, size - 2)), np.zeros((size - 2, size))
    tangent[:12, :10], projection[:10, :12] = (found[0] for found in tangent_spaces(orbit.states[:1]))
    tangent[12:, 10:] = projection[10:, 12:] = np.eye(size - 12)
    coarse = _propagated(orbit.derivatives, STEPS)[-1]
    matrices = _propagated(orbit.derivatives, 2 * STEPS)
    turn = projection @ matrices[-1] @ tangent
    multipliers, right = np.linalg.eig(turn)
    left = np.linalg.pinv(right)
    stepped = np.abs(np.einsum("ij,jk,ki->i", left, turn - projection @ coarse @ tangent, right))
    condition = np.linalg.norm(left, axis=1) * np.linalg.norm(right, axis=0)
    rounded = 100 * np.finfo(float).eps * np.linalg.norm(turn) * condition
    own = np.argsort(-np.linalg.norm(right[:10], axis=0))[:10]
    rates = np.log(multipliers[own].astype(complex)) / (2 * np.pi)
    errors = (stepped + rounded)[own] / (2 * np.pi * np.abs(multipliers[own]))
    shapes = tangent @ right[:, own]
    return Modes(rates + 1j * _turns(matrices, shapes, rates), errors, shapes[:12])


def _propagated(derivatives: Array, steps: int) -> Array:
    """What unit deviations have become (steps + 1, s, s) after every step of a turn."""
    count, size = derivatives.shape[:2]
    step = 2 * np.pi / steps
    spectrum = np.fft.rfft(derivatives, axis=0) / count
    spectrum[1:] *= 2
    found = [np.eye(size)]
    for start in step * np.arange(steps):
        phases = np.exp(1j * np.outer(start + step * NODES, np.arange(len(spectrum))))
        slopes = np.tensordot(phases, spectrum, 1).real
        system = np.eye(3 * size) - step * np.einsum("ij,ixy->ixjy", COLLOCATION, slopes).reshape(3 * size, 3 * size)
        stages = np.linalg.solve(system, slopes.reshape(3 * size, size)).reshape(3, size, size)
        found.append(found[-1] + step * np.tensordot(WEIGHTS, stages, 1) @ found[-1])
    return np.array(found)


def _turns(matrices: Array, shapes: Array, rates: Array) -> Array:
    """The multiple of the rotor's frequency that is strongest in the periodic part of each mode."""
    steps = len(matrices) - 1
    times = 2 * np.pi * np.arange(steps) / steps
    motion = (matrices[:-1] @ shapes)[:, :12] * np.exp(-np.outer(times, rates))[:, None]
    strength = np.sum(np.abs(np.fft.fft(motion, axis=0)) ** 2, axis=1)
    return np.asarray(np.fft.fftfreq(steps, 1 / steps)[np.argmax(strength, axis=0)])
