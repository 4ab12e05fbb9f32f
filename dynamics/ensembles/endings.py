"""How flights of an ensemble ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from ..motion import State


@dataclass(frozen=True, eq=False)
class Endings:
    """The ends of n flights.

    Parameters
    ----------
    ended_by : (n,) "duration", "contact" or "lost"
    levitated_s : (n,) when, s
    last : states (n, 3) then, along the rotor's axes, SI units
    changes : (n,) how often a floater went from one ball to another
    left_plate_table : (n,) whether it was ever beyond the range of the plate's table, where its field is a continuation
    """

    ended_by: NDArray[np.str_]
    levitated_s: Array
    last: State
    changes: NDArray[np.int_]
    left_plate_table: NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: Sequence[Endings]) -> Endings:
        """The parts one after the other."""
        vectors = zip(*(part.last.vectors for part in parts), strict=True)
        return cls(
            np.concatenate([part.ended_by for part in parts]),
            np.concatenate([part.levitated_s for part in parts]),
            State(*(np.concatenate(same) for same in vectors)),
            np.concatenate([part.changes for part in parts]),
            np.concatenate([part.left_plate_table for part in parts]),
        )

    def __repr__(self) -> str:
        counts = ", ".join(f"{np.sum(self.ended_by == end)} by {end}" for end in np.unique(self.ended_by))
        left = int(np.sum(self.left_plate_table))
        beyond = f"; {left} left the range of the plate's table" if left else ""
        return f"Endings of {len(self.ended_by)} flights: {counts}{beyond}"
