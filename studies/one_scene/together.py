"""Levitations of many points at once: scenes with one rotor share its table, compiled equations and equilibria."""

from collections.abc import Sequence

import numpy as np

from ...dynamics.maps import surveys
from ...dynamics.steady import Indices
from ...geometry.basics import SpinlevError
from .levitation import Levitation


def share(levitations: Sequence[Levitation], places: Sequence[tuple[int, ...]], equilibria: bool) -> None:
    """Let scenes whose rotors have the same field share what it takes; each ends as it would alone.

    Parameters
    ----------
    levitations : of the points
    places : their coordinates in the grid of what is varied
    equilibria : whether those without the plate shall be found together, the neighbours' as guesses
    """
    groups: dict[str, list[int]] = {}
    for k, levitation in enumerate(levitations):
        groups.setdefault(levitation.equations_key, []).append(k)
    for members in groups.values():
        alike = [levitations[k] for k in members]
        for other in alike[1:]:
            other.share(alike[0])
        if equilibria and len(alike) > 1:
            _find_together(alike, np.array([places[k] for k in members]))


def _find_together(alike: Sequence[Levitation], places: Indices) -> None:
    """What cannot be found here is left to each scene, which says why."""
    turning = [k for k, levitation in enumerate(alike) if levitation.scene.frequency]
    chosen = [alike[k] for k in turning]
    if not chosen:
        return
    near = np.array([np.unique(column, return_inverse=True)[1] for column in places[turning].T]).T
    spin = np.array([levitation.spin for levitation in chosen])
    try:
        first = chosen[0]
        found = surveys([one.scene for one in chosen], first.interaction, spin, near, first.rates)
    except SpinlevError:
        return
    for levitation, (survey, searched) in zip(chosen, found, strict=True):
        levitation.adopt(survey, searched)
