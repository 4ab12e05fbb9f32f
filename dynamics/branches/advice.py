"""Where there is no stable equilibrium: which frequency has one."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..effects import too_slow, with_effects
from ..equilibria import SearchRange, Steps, find_equilibria, scattered
from ..motion import PlateMemory, Rates, Scales
from ..steady import Equilibrium, EquilibriumError
from .arclength import follow_branch
from .branch import BranchPoint, Family, frequencies

WIDEST = 2.0
"""Ratio of frequencies, up and down, within which one that works is looked for."""
INSIDE = 0.05
"""How far inside a window of frequencies the one that is named lies, as a part of the window."""
FARTHEST = 0.1
"""Of the equilibria that count, m."""
STEPS = Steps(longest=0.4, turn=0.3)
SAME = 1e-4
"""Equilibria nearer to each other than this, in radii and rad together, are one."""


def way_out(
    scene: Scene,
    table: FieldTable,
    equilibria: Sequence[Equilibrium],
    widest: float = WIDEST,
    memory: PlateMemory | None = None,
) -> str:
    """What is wrong with a scene of which these are all equilibria, and what would help.

    Without the plate branches are followed in frequency from these equilibria, and from those of one search at each
    end of what is looked at, up to `widest` times the scene's frequency and down to as small a part of it: of the
    frequencies between which one of them is stable the nearest ones count.  Where there is a plate, or gravity across
    the axis, a search with these has to find the equilibrium too before its frequency is named.

    Parameters
    ----------
    memory : the plate's currents, if they are modelled
    """
    kinds = dict.fromkeys(f"{1e3 * e.distance:.2f} mm (grows e-fold in {1 / e.growth_per_s:.2g} s)" for e in equilibria)
    found = f"only unstable ones at {', '.join(kinds)}" if kinds else "nor any unstable one below the rotor"
    other = _levitating_frequency(scene, table, equilibria, widest, memory)
    advice = f"About {other:.4g} Hz has one; or" if other else f"None was found within a factor of {widest:g};"
    return f"At {scene.frequency:g} Hz the floater has no stable equilibrium, {found}. {advice} give start.position_mm."


def _levitating_frequency(
    scene: Scene, table: FieldTable, equilibria: Sequence[Equilibrium], widest: float, memory: PlateMemory | None
) -> float | None:
    """A frequency (Hz) in the nearest window in which a branch is stable; not one that holds the scene's own."""
    rates, own = Rates(with_effects(scene, table)), scene.frequency
    where = SearchRange(scene, FARTHEST)

    def counts(point: BranchPoint) -> bool:
        return point.motion.stable and point.state[:3] in where and bool(table.in_range(point.position)[0])

    known = [Scales.of(scene).pack((e.without or e).state) for e in equilibria]
    branches = _branches(scene, Family(rates, frequencies(scene), own / 2), known, where, widest)
    windows = [window for branch in branches for window in _windows(branch, counts)]
    for low, high in sorted(windows, key=lambda window: abs(np.log(np.clip(own, *window) / own))):
        if low <= own <= high:  # there the floater is held, were it not for the plate or gravity across the axis
            continue
        near, far = (low, high) if low > own else (high, low)
        there = replace(scene, frequency=float(near + INSIDE * (far - near)))
        if _levitates(there, table, rates, memory):
            return there.frequency
    return None


def _levitates(scene: Scene, table: FieldTable, rates: Rates, memory: PlateMemory | None) -> bool:
    """Whether a scene on a stable branch has a stable equilibrium too with its plate and its whole gravity."""
    if too_slow(scene):
        return False
    if scene.plate is None and not np.any(scene.gravity[:2]):
        return True
    if memory is not None and scene.frequency > memory.table.frequencies[1]:
        return False
    found = find_equilibria(scene, table, rates=rates, memory=memory)
    return any(e.stable and (memory is None or e.currents is not None) for e in found)


def _branches(
    scene: Scene, family: Family, known: Sequence[Array], where: SearchRange, widest: float
) -> Iterator[list[BranchPoint]]:
    """Branches through known states (12,) both ways, and those through what is found at either end, each once."""
    own, ends = scene.frequency, (scene.frequency * widest, scene.frequency / widest)
    seen: list[tuple[bool, BranchPoint]] = []
    for begin, end in ((own, ends[0]), (own, ends[1]), ends, ends[::-1]):
        balance = family.balance(begin)
        for start in known if begin == own else balance.states(*scattered(balance, where)):
            if any(up == (end > begin) and begin == p.parameter and _apart(p.state, start) < SAME for up, p in seen):
                continue
            try:
                branch = follow_branch(family, start, begin, end, STEPS)
            except EquilibriumError:
                continue
            seen.append((branch[-1].parameter < (begin + end) / 2, branch[-1]))
            yield branch


def _apart(a: Array, b: Array) -> float:
    return float(np.linalg.norm((a - b)[[0, 1, 2, 6, 7, 8]]))


def _windows(branch: Sequence[BranchPoint], counts: Callable[[BranchPoint], bool]) -> list[tuple[float, float]]:
    """Frequencies between which the points of a branch count, up to where stability is lost."""
    found = list[tuple[float, float]]()
    for good, run in groupby(branch, lambda point: bool(point.kind) or counts(point)):
        points = list(run)
        if good and any(not point.kind for point in points):
            values = [point.parameter for point in points]
            found.append((min(values), max(values)))
    return found
