"""From all states of a plate to the fewer ones of a ball, and back.

The states that are integrated are p̃ = y + s, currents and signals (`plate_terms`).  With y = V z those of the ball are
Vᵀp; all of them are V(Vᵀp) + (1 - VVᵀ)s, since currents that the ball does not tell are taken for zero.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array


@dataclass(frozen=True, eq=False)
class Reduction:
    """The states of a ball.

    Parameters
    ----------
    directions : (all, n) V
    signals : s (all,) of the floater, at a scaled time in a scaled state (12 or more,)
    """

    directions: Array
    signals: Callable[[float, Array], Array]

    def own(self, state: Array) -> Array:
        """The ball's state (12 + n + 1,), from one with all states (12 + all + 1,)."""
        return np.concatenate([state[:12], state[12:-1] @ self.directions, state[-1:]])

    def whole(self, time: float, state: Array) -> Array:
        """A state with all of the plate's, from the ball's at a scaled time."""
        signals = self.signals(time, state)
        currents = self.directions @ (state[12:-1] - signals @ self.directions)
        return np.concatenate([state[:12], currents + signals, state[-1:]])
