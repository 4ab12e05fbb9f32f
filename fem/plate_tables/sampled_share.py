"""The rotor's share of a plate's states from samples at angles of a turn and depths of the plate's way."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from ...geometry.basics import Array, Watch, unwatched, watched
from ...geometry.scenes import Plate
from ..eddy_currents import Source
from ..rotor_tables import AccuracyError, RotorTable
from .rotor_source import posed_rotor, rotor_parts
from .share import RotorShare, turn_harmonics

MOST_TERMS = 15
"""Highest number of harmonics, and of points along the way."""
UNHEARD = 1e-2
"""Share of the tolerance for degrees of the rotor's multipoles that the plate does not hear."""
TOGETHER = 12
"""Places whose signals are asked for at once."""
NOISE = 1e-10
"""Amplitudes below this share of the largest signal are what symmetry forbids."""


class Network(Protocol):
    """Currents as states that listen to sources."""

    def couplings(self, sources: Sequence[Source]) -> list[Array]:
        """s_i, √J, of sources in the plate's frame: (sources, states) for each group of states."""


def rotor_share(
    network: Network,
    plate: Plate,
    rotor: RotorTable,
    tolerance: float = 1e-4,
    most: int = MOST_TERMS,
    watch: Watch = unwatched,
) -> RotorShare:
    """Signals of a rotor for the pose and the way of `plate`.

    Parameters
    ----------
    network : of a plate of the same size and conductivity, or of what stands for it
    tolerance : for the estimated error; harmonics and depths are added until it is met
    most : highest number of either
    watch : hears of the progress

    Raises
    ------
    AccuracyError : the tolerance is not met with the most terms
    """
    listen = _listener(network, plate, rotor_parts(rotor, plate, UNHEARD * tolerance), watch)
    distance = plate.lowering.distance if plate.lowering else 0.0
    angles, depths = 12, 4 if distance else 1
    while True:
        series, samples = _sampled(listen, distance, angles, depths)
        size = np.abs(samples).max()
        if not size:  # a rotor without a field
            return RotorShare(distance, series[:3, :, :1] * 0.0, 0.0)
        turns = float(np.abs(series[-4:]).max() / size)  # of two harmonics: symmetry may forbid one
        ways = float(np.abs(series[..., -1]).max() / size) if distance else 0.0
        if max(turns, ways) <= tolerance / 2:
            return _trimmed(distance, series, turns + ways, tolerance / 2, float(size))
        if max(angles // 2, depths) > most:
            raise AccuracyError(
                f"Input tolerance must be at least {turns + ways:.1e} for this rotor and this way; instead received "
                f"{tolerance:.1e}."
            )
        angles *= 1 + (turns > tolerance / 2)  # so that none is asked for twice
        depths += 2 * (ways > tolerance / 2)


def _trimmed(distance: float, series: Array, error: float, tolerance: float, size: float) -> RotorShare:
    """The share without its highest harmonics, whose sum no signal misses by more than the tolerance."""
    tails = np.cumsum(np.abs(series).sum(axis=2).max(axis=1)[::-1])[::-1] / size
    kept = max(3, int(np.argmax(np.append(tails, 0.0) <= tolerance)) | 1)
    part = series[:kept]
    small = np.abs(part) < NOISE * size
    return RotorShare(distance, np.where(small, 0.0, part), error + float(np.append(tails, [0.0, 0.0])[kept]))


def _listener(network: Network, plate: Plate, parts: Sequence[Source], watch: Watch) -> Callable[[Array, Array], Array]:
    """Signals (depths × angles, states) of the rotor at ways (m) and angles (rad); each place is asked for once."""
    known: dict[tuple[float, float], Array] = {}

    def listen(ways: Array, angles: Array) -> Array:
        places = [(float(way), float(angle)) for way in ways for angle in angles]
        new = [place for place in places if place not in known]
        groups = [new[first : first + TOGETHER] for first in range(0, len(new), TOGETHER)]
        for some in watched(groups, watch, f"signals of the rotor at {len(new)} places"):
            sources = [posed_rotor(parts, plate, angle, way) for way, angle in some]
            known.update(zip(some, np.concatenate(network.couplings(sources), axis=1), strict=True))
        return np.array([known[place] for place in places])

    return listen


def _sampled(listen: Callable[[Array, Array], Array], distance: float, turns: int, depths: int) -> tuple[Array, Array]:
    """Series (2H+1, states, depths) through samples (depths, turns, states) at equidistant angles, Chebyshev depths."""
    nodes = np.cos(np.pi * (np.arange(depths) + 0.5) / depths)
    angles = 2 * np.pi * np.arange(turns) / turns
    samples = listen(distance * (1 + nodes) / 2, angles).reshape(depths, turns, -1)
    fourier = np.linalg.pinv(np.array([turn_harmonics(angle, turns - 1) for angle in angles]))
    chebyshev = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, depths - 1))
    return np.einsum("ha,kn,nas->hsk", fourier, chebyshev, samples, optimize=True), samples
