"""From which to which frequency of the rotor a floater levitates stably, and what ends it at either side."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import scipy

from ...fem.rotor_tables import FieldTable, rotor_table
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..effects import with_effects
from ..equilibria import Steps
from ..motion import Rates, rotor_gap
from ..steady import EquilibriumError
from .arclength import follow_branch
from .branch import FOLD, BranchPoint, Family
from .levitation_branch import by_frequency, levitating_branch

LOWEST, HIGHEST = 25.0, 400.0
"""Frequencies between which is looked, Hz."""
CONTACT, BORDER = "contact", "border"
"""Ends beside those of `branch`: the floater touches the rotor; the end of what was looked at."""
TOLERATED = 0.02
"""Growth that counts as stable, 1/s: more than what the error of finite elements makes of undamped motion."""
STEPS, LONG_STEPS = Steps(longest=0.1, turn=0.15), Steps(longest=0.4, turn=0.3)
"""Along a branch, and along one that is known from one that is near."""


@dataclass(frozen=True, eq=False)
class StableRange:
    """An interval of frequencies in which an equilibrium is stable.

    Parameters
    ----------
    low, high : the equilibria at its ends; `kind` says what is there
    points : the equilibria between them, by ascending frequency
    """

    low: BranchPoint
    high: BranchPoint
    points: tuple[BranchPoint, ...]

    def near(self, frequency: float) -> BranchPoint:
        """The point that is nearest in frequency."""
        return min(self.points, key=lambda point: abs(point.parameter - frequency))


def reference_state(scene: Scene) -> tuple[Array, float]:
    """Scaled state (12,) and frequency (Hz) of a stable equilibrium of point dipoles, amid those from the fold on.

    Raises
    ------
    EquilibriumError : there is none up to `HIGHEST`
    """
    table = rotor_table(scene.rotor, "dipole")
    found = levitating_ranges(scene, table, Rates(with_effects(scene, table)))
    if not found:
        raise EquilibriumError("Point dipoles levitate stably at none of the frequencies that are looked at.")
    lowest = found[0]
    middle = lowest.near((lowest.low.parameter + lowest.high.parameter) / 2)
    return middle.state, middle.parameter


def levitating_ranges(scene: Scene, table: FieldTable, rates: Rates) -> list[StableRange]:
    """All intervals of stability on the branch that levitates below the rotor, by ascending frequency.

    The branch is found without a search, see `levitation_branch`.  Raises EquilibriumError where there is no branch.
    """
    bare = replace(scene, plate=None)
    near = levitating_branch(bare, table, rates, HIGHEST).near
    start = near[len(near) // 2]
    return stable_ranges(bare, rates, start.state, start.parameter)


def stable_ranges(scene: Scene, rates: Rates, start: Array, frequency: float) -> list[StableRange]:
    """All intervals of stability on the branch through the equilibrium near `start` (12,) at `frequency` (Hz).

    The branch is followed both ways to its first fold, contact with the rotor or the border. Frequencies of the ends
    are good to round-off in the table's field.
    """
    walk = partial(_side, replace(scene, plate=None), by_frequency(scene, rates), start, frequency)
    below, above = walk(LOWEST), walk(HIGHEST)
    runs: list[list[BranchPoint]] = [[]]
    for point in [*below[:0:-1], *above]:
        runs[-1].append(point)
        if point.kind:
            runs.append([point])
    return [StableRange(run[0], run[-1], tuple(run)) for run in runs if _holds(run)]


def stable_range(scene: Scene, rates: Rates, start: Array, frequency: float) -> StableRange:
    """The one of these intervals that holds the frequency or is nearest to it. Raises EquilibriumError without any."""
    found = stable_ranges(scene, rates, start, frequency)
    if not found:
        raise EquilibriumError("There is no stable levitation on the branch of the point dipoles.")
    return min(found, key=lambda run: max(run.low.parameter - frequency, frequency - run.high.parameter))


def at_frequency(scene: Scene, rates: Rates, near: BranchPoint, frequency: float, steps: Steps = STEPS) -> BranchPoint:
    """The equilibrium at one frequency (Hz) on the branch through another.

    Raises EquilibriumError where the branch does not reach it.
    """
    family = by_frequency(scene, rates)
    if frequency == near.parameter:
        return family.point(near.state[:3], near.state[6:9], frequency)
    last = follow_branch(family, near.state, near.parameter, frequency, steps, tolerated=TOLERATED)[-1]
    if last.parameter != frequency:
        raise EquilibriumError(f"The branch of equilibria ends before {frequency:g} Hz.")
    return last


def stability_end(
    scene: Scene, family: Family, start: Array, frequency: float, towards: float, steps: Steps = STEPS
) -> BranchPoint:
    """The first fold, change of stability, contact or border that is met from `frequency` towards another (Hz)."""
    return next(point for point in _side(scene, family, start, frequency, towards, steps) if point.kind)


def levitates(point: BranchPoint) -> bool:
    """Whether no small motion grows faster than what is tolerated."""
    return point.growth_per_s <= max(TOLERATED, point.doubt_per_s)


def _holds(run: Sequence[BranchPoint]) -> bool:
    inner = [point for point in run if not point.kind]
    return bool(inner) and all(levitates(point) for point in inner)


def _side(
    scene: Scene, family: Family, start: Array, frequency: float, end: float, steps: Steps = STEPS
) -> list[BranchPoint]:
    """The branch from `frequency` towards `end`, to its first fold, contact or the border, which is marked."""

    def over(point: BranchPoint) -> bool:
        return point.kind == FOLD or rotor_gap(scene, point.position) < 0

    points = follow_branch(family, start, frequency, end, steps, over, TOLERATED)
    for k, point in enumerate(points):
        if point.kind == FOLD:
            return points[: k + 1]
        if k and rotor_gap(scene, point.position) < 0:
            return [*points[:k], replace(_touching(scene, family, points[k - 1], point), kind=CONTACT)]
    return [*points[:-1], replace(points[-1], kind=points[-1].kind or BORDER)]


def _touching(scene: Scene, family: Family, before: BranchPoint, after: BranchPoint) -> BranchPoint:
    def there(frequency: float) -> BranchPoint:
        return follow_branch(family, before.state, before.parameter, frequency, STEPS, tolerated=TOLERATED)[-1]

    ends = before.parameter, after.parameter
    inside = ends[0] + 1e-9 * (ends[1] - ends[0])
    return there(
        float(scipy.optimize.brentq(lambda f: rotor_gap(scene, there(f).position), inside, ends[1], xtol=1e-6))
    )
