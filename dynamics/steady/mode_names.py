"""Names of the small motions about an equilibrium, told from their shapes."""

from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from .stability import Modes

SIDE, TILT = ("side, backward", "side, forward"), ("precession", "nutation")
"""The slower and the faster of each kind, in the rotor's frame."""


@dataclass(frozen=True)
class Mode:
    """One small motion.

    Parameters
    ----------
    name : bounce (along the axis), side (across it; forward or backward of the rotor), precession or nutation (slower
        and faster turning of the moment)
    growth_per_s : 1/s; negative where it dies out
    frequency_hz : in the rotor's frame; 0 where it does not oscillate
    """

    name: str
    growth_per_s: float
    frequency_hz: float


def named_modes(modes: Modes, time: float) -> tuple[Mode, ...]:
    """The five motions of the floater, bounce first; of a pair that does not oscillate the one that grows more.

    Parameters
    ----------
    time : unit of time of the eigenvalues, s
    """
    values, shapes = modes.eigenvalues, np.abs(modes.shapes)
    chosen = [int(k) for k in np.argsort(-values.real) if values[k].imag >= 0]
    while len(chosen) > 5:  # drop what decays most of those that do not oscillate
        still = [k for k in chosen if abs(values[k].imag) <= modes.errors[k]]
        chosen.remove((still or chosen)[-1])
    bounce = max(chosen, key=lambda k: _axial(shapes[:, k]))
    others = sorted((k for k in chosen if k != bounce), key=lambda k: -_moving(shapes[:, k]))
    side, tilt = (sorted(part, key=lambda k: values[k].imag) for part in (others[:2], others[2:]))
    pairs = [("bounce", bounce), *zip(SIDE, side, strict=False), *zip(TILT, tilt, strict=False)]
    return tuple(
        Mode(name, float(values[k].real) / time, float(values[k].imag) / (2 * np.pi * time)) for name, k in pairs
    )


def _axial(shape: Array) -> float:
    return float(shape[2] / np.linalg.norm(shape[[0, 1, 2, 6, 7, 8]]))


def _moving(shape: Array) -> float:
    return float(np.linalg.norm(shape[:2]) / np.linalg.norm(shape[[0, 1, 2, 6, 7, 8]]))
