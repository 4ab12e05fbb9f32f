"""The levitating equilibrium of a rotor as a function of frequency, followed from where it is known for certain.

At high frequency the floater's moment hardly tilts, so that on the axis the static attraction alone carries its weight
at one far distance, an unstable equilibrium.  From there the branch goes down in frequency to its fold, where the far
equilibrium meets the near one, and up again along the near one until floater and rotor touch.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby

import numpy as np
import scipy

from ...fem.rotor.choice import rotor_table
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array
from ...geometry.scene.contents import AbsoluteStart, Scene
from ..equilibria.balance import CONVERGED_STEP, EVERY, solve
from ..equilibria.curves import SearchRange, scattered
from ..equilibria.equilibrium import FOLD, Equilibrium, EquilibriumError
from ..equilibria.path import Steps
from ..equilibria.search import find_equilibria
from ..motion.effects import with_effects
from ..motion.equations import parameters
from ..motion.events import rotor_gap
from ..motion.floater_currents import too_slow
from ..motion.plate import PlateMemory
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales
from .branch import BranchPoint, Family, follow_branch, frequencies

UP = np.array([0.0, 0.0, 1.0])
UNIT = 50.0
"""Hz over which the equilibrium moves by about a radius of the floater."""
SLOWEST = 10.0
"""Branches are followed down to this frequency, Hz: all of the article's rotors have their fold above it."""
REACH = (8e-3, 0.15)
"""Distances on the axis between which the attraction is looked at, m."""
SAME = 0.05
"""Farther than this (radii) from its neighbours on the branch, Newton's method has found another equilibrium."""


@dataclass(frozen=True, eq=False)
class Branch:
    """The two sides of a rotor's levitating branch.

    Parameters
    ----------
    family : the problem
    far, near : its points, by growing frequency; both begin at the fold
    """

    family: Family
    far: tuple[BranchPoint, ...]
    near: tuple[BranchPoint, ...]

    @property
    def fold(self) -> BranchPoint:
        """The lowest frequency at which there is an equilibrium."""
        return self.near[0]

    def side(self, name: str, grid: Array) -> list[BranchPoint | None]:
        """The equilibrium on a side ("near", "far") at each frequency of `grid` to round-off; None beyond its end."""
        points = {"near": self.near, "far": self.far}[name]
        return [self._at(points, float(frequency)) for frequency in grid]

    def _at(self, points: tuple[BranchPoint, ...], frequency: float) -> BranchPoint | None:
        known = np.array([point.parameter for point in points])
        if not known[0] <= frequency <= known[-1]:
            return None
        # Near the fold places go with the root of the distance to it.
        ahead = np.sqrt(np.maximum(known - known[0], 0.0))
        states = np.array([point.state for point in points])
        guess = np.array([np.interp(np.sqrt(frequency - known[0]), ahead, column) for column in states.T])
        moment = guess[6:9] / np.linalg.norm(guess[6:9])
        position, moments, size = solve(self.family.balance(frequency), guess[None, :3], moment[None], EVERY)
        if not size[0] < CONVERGED_STEP or np.linalg.norm(position[0] - guess[:3]) > SAME:
            return None
        return self.family.point(position[0], moments[0], frequency)


def by_frequency(scene: Scene, rates: Rates) -> Family:
    """A scene's equilibria against the frequency of the rotor."""
    return Family(rates, frequencies(scene), UNIT)


def levitating_branch(scene: Scene, table: FieldTable, rates: Rates, highest: float) -> Branch:
    """The branch of a scene's floater up to the frequency `highest` (Hz) or contact; gravity along the axis, s = 0.

    Raises
    ------
    EquilibriumError : no distance at which attraction carries the weight, or no fold above `SLOWEST`
    """
    family = by_frequency(scene, rates)
    start = _hanging(replace(scene, frequency=highest), table, family)

    def over(point: BranchPoint) -> bool:
        return rotor_gap(scene, point.position) < 0

    points = follow_branch(family, start, highest, SLOWEST, Steps(longest=0.1), over)
    folds = [k for k, point in enumerate(points) if point.kind == FOLD]
    if not folds:
        raise EquilibriumError(f"The levitating branch has no fold between {SLOWEST:g} and {highest:g} Hz.")
    end = folds[1] + 1 if len(folds) > 1 else len(points)
    return Branch(family, tuple(points[folds[0] :: -1]), tuple(points[folds[0] : end]))


def kicked(scene: Scene, point: BranchPoint, speed: float) -> Scene:
    """The scene at the frequency of an equilibrium, beginning there with `speed` (m/s) upwards."""
    there = replace(scene, frequency=point.parameter)
    state = Scales.of(there).unpack(point.state)
    start = AbsoluteStart(state.position, state.velocity + speed * UP, state.moment, state.spin)
    return replace(there, start=start)


def _hanging(scene: Scene, table: FieldTable, family: Family) -> Array:
    """Scaled state (12,) near the far equilibrium: on the axis, upright, where attraction carries the weight."""
    scales, upright = Scales.of(scene), UP[None]
    weight = scene.floater.mass * abs(float(scene.gravity[2]))

    def excess(distance: float) -> float:
        return scene.floater.moment * float(table.evaluate([[0.0, 0.0, -distance]])[1][0, 2, 2]) - weight

    grid = np.geomspace(*REACH, 60)
    nearest = next((d for d in grid if table.in_range([[0.0, 0.0, -d]])[0]), grid[-1])
    grid = grid[grid >= nearest]
    carried = [k for k, d in enumerate(grid) if excess(d) > 0]
    if not carried or carried[-1] == len(grid) - 1:
        raise EquilibriumError(
            f"Nowhere from {1e3 * nearest:.3g} to {1e3 * REACH[1]:.3g} mm does the attraction carry the weight."
        )
    distance = float(scipy.optimize.brentq(excess, grid[carried[-1]], grid[carried[-1] + 1]))
    return np.asarray(family.balance(scene.frequency).states(-distance / scales.length * upright, upright)[0])


def distance_error(scene: Scene, table: FieldTable, family: Family, point: BranchPoint) -> float:
    """What the errors that a table and its effects state may change of the distance along the axis, first order, m."""
    here = replace(scene, frequency=point.parameter)
    scales = Scales.of(here)
    values = parameters(here, scales, frozen_spin=True)
    place = point.position[None]
    (field, gradient), (of_field, of_gradient) = table.evaluate(place), table.relative_error(place)
    torque = values[Parameter.TORQUE] * of_field[0] * np.linalg.norm(field)
    size = of_gradient[0] * np.linalg.norm(gradient)
    force = np.prod(values[[Parameter.TORQUE, Parameter.INERTIA, Parameter.LENGTH]]) * size
    slope = family.balance(point.parameter)(point.state[None, :3], point.state[None, 6:9])[1][0]
    shares = np.abs(np.linalg.inv(slope)[2])
    return float(shares @ np.array([force] * 3 + [torque] * 2)) * scales.length


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


WIDEST = 2.0
"""Ratio of frequencies, up and down, within which one that works is looked for."""
INSIDE = 0.05
"""How far inside a window of frequencies the one that is named lies, as a part of the window."""
FARTHEST = 0.1
"""Of the equilibria that count, m."""
ADVICE_STEPS = Steps(longest=0.4, turn=0.3)
SAME_STATE = 1e-4
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
            if any(
                up == (end > begin) and begin == p.parameter and _apart(p.state, start) < SAME_STATE for up, p in seen
            ):
                continue
            try:
                branch = follow_branch(family, start, begin, end, ADVICE_STEPS)
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
