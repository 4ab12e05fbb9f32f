"""Where there is no stable equilibrium: which frequency has one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.scenes import Scene
from ..motion import Rates, Scales, parameters
from ..steady import Balance, Equilibrium, is_stable, spectra
from .fixed_points import scattered
from .full_search import find_equilibria
from .search import SearchRange

FREQUENCY_RATIO, FREQUENCY_TRIALS = 1.08, 9
"""Steps in which a frequency that works is looked for: up and down by a factor of two."""
FARTHEST = 0.1
"""Of the equilibria that count, m."""


def way_out(scene: Scene, table: FieldTable, equilibria: Sequence[Equilibrium]) -> str:
    """What is wrong with a scene of which these are all equilibria, and what would help."""
    kinds = dict.fromkeys(f"{1e3 * e.distance:.2f} mm (grows e-fold in {1 / e.growth_per_s:.2g} s)" for e in equilibria)
    found = f"only unstable ones at {', '.join(kinds)}" if kinds else "nor any unstable one below the rotor"
    other = _levitating_frequency(scene, table)
    advice = f"About {other:.4g} Hz has one; or give" if other else "None was found within a factor of two; give"
    return f"At {scene.frequency:g} Hz the floater has no stable equilibrium, {found}. {advice} start.position_mm."


def _levitating_frequency(scene: Scene, table: FieldTable) -> float | None:
    """The nearest tried frequency at which there is a stable equilibrium, Hz."""
    rates = Rates.of(scene, table)
    for step in range(1, FREQUENCY_TRIALS + 1):
        for ratio in (FREQUENCY_RATIO**step, FREQUENCY_RATIO**-step):
            other = replace(scene, frequency=scene.frequency * ratio)
            if _may_levitate(other, rates) and any(e.stable for e in find_equilibria(other, table, rates=rates)):
                return other.frequency
    return None


def _may_levitate(scene: Scene, rates: Rates) -> bool:
    """Whether Newton's method finds a stable fixed point: a fifth of the work of finding all equilibria."""
    balance = Balance(rates, parameters(scene, Scales.of(scene), frozen_spin=True), 0.0)
    states = balance.states(*scattered(balance, SearchRange(scene, FARTHEST)))
    if not len(states):
        return False
    values, errors, _ = spectra(states, rates(states, balance.values)[1])
    return bool(np.any(is_stable(values, errors)))
