"""The few patterns of current that a floater can drive in the rotor's metal.

The currents E_s that unit dipoles at places all around the rotor drive, each by its own size, span those of every
other place: a field without sources in the metal is told by its values on a surface about it.  Their Gram matrix
G = V Λ Vᵀ (`metal_currents`) gives the patterns w_k = Σ_s V_sk E_s / √Λ_k, orthonormal with σ dV, of which the first
few carry all but a small part of the dissipation.  By reciprocity a dipole m drives pattern k by the rate of m·c_k,
c_k the field of its currents: harmonic outside the metal.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array, Watch, unwatched, watched
from .dipole_potentials import of_places
from .metal_currents import Metal, flat

TOGETHER = 40
"""Places at a time."""


@dataclass(frozen=True, eq=False)
class CurrentPatterns:
    """Patterns of current in several pieces of metal.

    Parameters
    ----------
    metals : the pieces
    patterns : (points, 3, k) of w_k σ dV at the integration points of each
    """

    metals: tuple[Metal, ...]
    patterns: tuple[Array, ...]

    @property
    def count(self) -> int:
        """Number of patterns."""
        return int(self.patterns[0].shape[2])

    def fields(self, positions: Array, watch: Watch = unwatched) -> Array:
        """c_k (k, n, 3) at positions (n, 3) m, √W s/(A m²); `watch` hears of the progress."""
        found = []
        for start in watched(range(0, len(positions), TOGETHER), watch, "their fields"):
            sources = of_places(positions[start : start + TOGETHER])
            parts = [
                flat(pattern).T @ flat(sources(metal.places))
                for metal, pattern in zip(self.metals, self.patterns, strict=True)
            ]
            found.append(np.sum(parts, axis=0).reshape(self.count, -1, 3))
        return np.concatenate(found, axis=1)


def current_patterns(
    metals: Sequence[Metal], positions: Array, left_out: float, watch: Watch = unwatched
) -> CurrentPatterns:
    """Patterns that dipoles at `positions` (n, 3) m drive, but for a part `left_out` of the loss at any place.

    `watch` hears of the progress.
    """
    grams, loads, blocks = [], [], range(0, len(positions), TOGETHER)
    for metal in metals:
        parts = [metal.loads(of_places(positions[k : k + TOGETHER])) for k in watched(blocks, watch, "patterns")]
        loads.append(np.concatenate(parts))
        grams.append(metal.dissipation(of_places(positions), loads[-1]))
    gram = np.sum(grams, axis=0)
    scale = np.repeat(np.sqrt(1 / gram.diagonal().reshape(-1, 3).sum(axis=1)), 3)
    energy, vectors = np.linalg.eigh(scale[:, None] * gram * scale)
    energy, vectors = energy[::-1], vectors[:, ::-1]
    shares = np.sum((energy * vectors**2).reshape(len(positions), 3, -1), axis=1)
    missing = 1 - np.cumsum(shares, axis=1).min(axis=0)
    count = int(np.argmax(missing <= left_out)) + 1 if np.any(missing <= left_out) else len(energy)
    mix = scale[:, None] * vectors[:, :count] / np.sqrt(energy[:count])
    patterns = [_pattern(metal, load, positions, mix) for metal, load in zip(metals, loads, strict=True)]
    return CurrentPatterns(tuple(metals), tuple(patterns))


def _pattern(metal: Metal, loads: Array, positions: Array, mix: Array) -> Array:
    fields = -metal.gradients(metal.solutions(mix.T @ loads))
    for start in range(0, len(positions), TOGETHER):
        part = of_places(positions[start : start + TOGETHER])(metal.places)
        fields += part @ mix[3 * start : 3 * (start + TOGETHER)]
    return np.asarray(metal.weights[:, None, None] * fields)
