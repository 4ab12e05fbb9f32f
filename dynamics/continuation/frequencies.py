"""The levitating equilibrium of a rotor as a function of frequency, followed from where it is known for certain.

At high frequency the floater's moment hardly tilts, so that on the axis the static attraction alone carries its weight
at one far distance, an unstable equilibrium.  From there the branch goes down in frequency to its fold, where the far
equilibrium meets the near one, and up again along the near one until floater and rotor touch.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby

import numpy as np
import scipy

from ...fem.rotor.choice import rotor_table
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array
from ...geometry.scene.contents import AbsoluteStart, Scene
from ..equilibria.equilibrium import FOLD, MARGINAL, Equilibrium, EquilibriumError
from ..equilibria.path import Steps
from ..equilibria.search import find_equilibria
from ..motion.effects import mean_over_turns, with_effects
from ..motion.equations import parameters
from ..motion.events import rotor_gap
from ..motion.floater_effects import too_slow
from ..motion.plate import PlateMemory
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales
from .branch import BranchPoint, Family, LockedFamily, follow_branch, frequencies
from .map import surveys

UNIT = 50.0  # Hz over which the equilibrium moves by about a radius of the floater
SLOWEST = 10.0  # Branches are followed down to this frequency, Hz: all of the article's rotors have their fold above it
REACH = (8 / 6.35, 150 / 6.35)  # Distances on the axis between which the attraction is looked at, floater's radii
LOWEST, HIGHEST = 25.0, 400.0  # Frequencies between which is looked for ranges of stability, Hz
# Ends of a range beside those that `follow_branch` marks: the floater touches the rotor; nobody looked beyond.
CONTACT, BORDER = "contact", "border"
# Along a branch, and along one that is known from one that is near.
STEPS, LONG_STEPS = Steps(longest=0.1, turn=0.15), Steps(longest=0.4, turn=0.3)
TRACKED = 0.4  # Along a branch, how far an end of stability is looked for from where a like branch has it
WIDEST = 2.0  # Ratio of frequencies, up and down, within which one that works is looked for
FREQUENCIES = 81  # That are looked at there, 1.7 % apart
INSIDE = 0.05  # How far inside a window of frequencies the one that is named lies, as a part of the window


@dataclass(frozen=True, eq=False)
class Branch:
    """The two sides of a rotor's levitating branch."""

    scene: Scene
    rates: Rates  # of the scene, whose frequency is left open
    far: tuple[BranchPoint, ...]  # its points, by growing frequency, both sides from the fold on
    near: tuple[BranchPoint, ...]

    @property
    def fold(self) -> BranchPoint:
        """The lowest frequency at which there is an equilibrium."""
        return self.near[0]

    def side(self, name: str, grid: Array) -> list[BranchPoint | None]:
        """The equilibrium on a side ("near", "far") at each frequency of `grid`, to round-off; None beyond its end."""
        return on_branch(self.scene, self.rates, {"near": self.near, "far": self.far}[name], grid, LONG_STEPS)


def by_frequency(scene: Scene, rates: Rates, spin: float = 0.0) -> Family:
    """Equilibria of a `scene`, with `rates` and body `spin`, by frequency, Hz; locked ones of a body not round."""
    return (LockedFamily if rates.turning else Family)(rates, frequencies(scene, spin), UNIT, scene.floater.spin_ratio)


def levitating_branch(scene: Scene, table: FieldTable, rates: Rates, highest: float) -> Branch:
    """The branch of a `scene`'s floater up to the frequency `highest` (Hz) or contact; gravity along the axis, s = 0.

    `rates` are those in the field of `table`. Raises EquilibriumError where attraction carries the weight at no
    distance, or there is no fold above `SLOWEST`.
    """
    family = by_frequency(scene, rates)
    start = _hanging(replace(scene, frequency=highest), table, family)
    steps, contact = Steps(longest=0.1), lambda p: rotor_gap(scene, p.position, p.state[6:9]) < 0
    points = follow_branch(family, start, highest, SLOWEST, steps, contact)
    if not (folds := [k for k, point in enumerate(points) if point.kind == FOLD]):
        raise EquilibriumError(f"The levitating branch has no fold between {SLOWEST:g} and {highest:g} Hz.")
    end = folds[1] + 1 if len(folds) > 1 else len(points)
    return Branch(scene, rates, tuple(points[folds[0] :: -1]), tuple(points[folds[0] : end]))


def kicked(scene: Scene, point: BranchPoint, speed: float) -> Scene:
    """The `scene` at the frequency of an equilibrium, a `point`, beginning there with `speed` (m/s) upwards."""
    there = replace(scene, frequency=point.parameter)
    state = Scales.of(there).unpack(point.state)
    start = AbsoluteStart(state.position, state.velocity + speed * np.eye(3)[2], state.moment, state.spin)
    return replace(there, start=start)


def _hanging(scene: Scene, table: FieldTable, family: Family) -> Array:
    """Scaled state (12,) near the far equilibrium: on the axis, upright, where attraction carries the weight."""
    upright, distance = np.eye(3)[2:], hanging_distance(scene, table) / Scales.of(scene).length
    return np.asarray(family.balance(scene.frequency).states(-distance * upright, upright)[0])


def hanging_distance(scene: Scene, table: FieldTable) -> float:
    """Farthest distance on the axis, m, where upright attraction carries the weight. Raises EquilibriumError."""
    weight = scene.floater.mass * abs(float(scene.gravity[2]))

    def excess(distance: float) -> float:
        return scene.floater.moment * float(table.evaluate([[0.0, 0.0, -distance]])[1][0, 2, 2]) - weight

    grid = scene.floater.radius * np.geomspace(*REACH, 60)
    nearest = next((d for d in grid if table.in_range([[0.0, 0.0, -d]])[0]), grid[-1])
    grid = grid[grid >= nearest]
    above = [k for k, d in enumerate(grid) if excess(d) > 0]
    if not above or above[-1] == len(grid) - 1:
        raise EquilibriumError(
            f"Nowhere from {1e3 * nearest:.3g} to {1e3 * grid[-1]:.3g} mm does the attraction carry the weight."
        )
    return float(scipy.optimize.brentq(excess, grid[above[-1]], grid[above[-1] + 1]))


def distance_error(scene: Scene, table: FieldTable, family: Family, point: BranchPoint) -> float:
    """Error of the distance on the axis, m, of a `point` of a `scene`'s `family`, to first order by that of `table`."""
    here = replace(scene, frequency=point.parameter)
    scales = Scales.of(here)
    values = parameters(here, scales, frozen_spin=True)
    place = point.position[None]
    (field, gradient), (of_field, of_gradient) = table.evaluate(place), table.relative_error(place)
    torque = values[Parameter.TORQUE] * of_field[0] * np.linalg.norm(field)
    size = of_gradient[0] * np.linalg.norm(gradient)
    force = np.prod(values[[Parameter.TORQUE, Parameter.INERTIA, Parameter.LENGTH]]) * size
    slope = family.balance(point.parameter)(point.state[None, :3], point.state[None, 6:9])[1][0]
    return float(np.abs(np.linalg.inv(slope)[2]) @ np.array([force] * 3 + [torque] * 2)) * scales.length


@dataclass(frozen=True, eq=False)
class StableRange:
    """An interval of frequencies in which an equilibrium is stable."""

    low: BranchPoint  # the equilibria at its ends; `kind` says what is there
    high: BranchPoint
    points: tuple[BranchPoint, ...]  # the equilibria between them, by ascending frequency

    def near(self, frequency: float) -> BranchPoint:
        return min(self.points, key=lambda point: abs(point.parameter - frequency))


def reference_state(scene: Scene) -> tuple[Array, float]:
    """Scaled state (12,) and frequency, Hz, of stable point dipoles amid those from the fold on."""
    table = rotor_table(scene.rotor, "dipole")
    if not (found := levitating_ranges(scene, table, Rates(with_effects(scene, table)))):
        raise EquilibriumError("Point dipoles levitate stably at none of the frequencies that are looked at.")
    lowest = found[0]
    middle = lowest.near((lowest.low.parameter + lowest.high.parameter) / 2)
    return middle.state, middle.parameter


def levitating_ranges(scene: Scene, table: FieldTable, rates: Rates) -> list[StableRange]:
    """Intervals of stability on the `levitating_branch` of a `scene`, ascending; `table`, `rates`, errors as there."""
    bare, family = replace(scene, plate=None), by_frequency(scene, rates)
    hanging = _hanging(replace(bare, frequency=HIGHEST), table, family)
    for steps in (LONG_STEPS, STEPS):  # of the far side nothing but where it turns is asked for

        def ended(point: BranchPoint) -> bool:
            return point.tangent[6] > 0 or rotor_gap(bare, point.position, point.state[6:9]) < 0

        last = follow_branch(family, hanging, HIGHEST, SLOWEST, steps, ended)[-1]
        if last.tangent[6] > 0 and not is_over(bare, last):
            return stable_ranges(branch_through(bare, rates, last.state, last.parameter))
    raise EquilibriumError(f"The levitating branch has no fold between {SLOWEST:g} and {HIGHEST:g} Hz.")


def branch_through(scene: Scene, rates: Rates, start: Array, frequency: float, spin: float = 0.0) -> list[BranchPoint]:
    """The branch through an equilibrium, both ways to the first fold, contact with the rotor or border.

    Raises EquilibriumError: there is no equilibrium near `start`. `scene`: gravity along the axis; `rates`: its
    equations of motion; `start`: scaled state (12,) of the equilibrium; `frequency`: where it is, Hz; `spin`: body
    spin.
    """
    walk = partial(one_way, replace(scene, plate=None), by_frequency(scene, rates, spin), start, frequency)
    below = walk(LOWEST if frequency > LOWEST else frequency / WIDEST)
    return [*below[:0:-1], *walk(HIGHEST if frequency < HIGHEST else frequency * WIDEST)]


def stable_ranges(points: Sequence[BranchPoint]) -> list[StableRange]:
    """Intervals of stability on a branch, its `points` in order and marked."""
    runs: list[list[BranchPoint]] = [[]]
    for point in points:
        runs[-1].append(point)
        if point.kind:
            runs.append([point])
    inner = [[point for point in run if not point.kind] for run in runs]
    return [
        StableRange(run[0], run[-1], tuple(run))
        for run, points in zip(runs, inner, strict=True)
        if points and all(levitates(point) for point in points)
    ]


def nearest_range(points: Sequence[BranchPoint], hz: float) -> StableRange | None:
    """The interval of stability on a branch that holds a frequency or is nearest to it; None without any."""
    return min(stable_ranges(points), key=lambda r: max(r.low.parameter - hz, hz - r.high.parameter), default=None)


def stable_range(scene: Scene, rates: Rates, start: Array, frequency: float) -> StableRange:
    """The `nearest_range` to a `frequency` on the `branch_through` `start`; `scene`, `rates`, errors as there."""
    if (found := nearest_range(branch_through(scene, rates, start, frequency), frequency)) is None:
        raise EquilibriumError("There is no stable levitation on the branch of the point dipoles.")
    return found


def at_frequency(
    scene: Scene,
    rates: Rates,
    near: BranchPoint,
    frequency: float,
    steps: Steps = STEPS,
    tolerated: float = MARGINAL,
) -> BranchPoint:
    """The equilibrium of a `scene` with its `rates` at a `frequency` (Hz) on the branch through another, `near` it.

    `steps` and `tolerated` are as for `follow_branch`. Raises EquilibriumError where the branch does not reach it.
    """
    family = by_frequency(scene, rates, near.spin)
    if frequency == near.parameter:
        return family.point(near.state[:3], near.state[6:9], frequency)
    last = follow_branch(family, near.state, near.parameter, frequency, steps, tolerated=tolerated)[-1]
    if last.parameter != frequency:
        raise EquilibriumError(f"The branch of equilibria ends before {frequency:g} Hz.")
    return last


def on_branch(
    scene: Scene, rates: Rates, points: Sequence[BranchPoint], grid: Array, steps: Steps = STEPS
) -> list[BranchPoint | None]:
    """Equilibria at a `grid` (n,) Hz, or None, by `steps` from `points` of a branch of the `scene` with its `rates`."""
    ordinary = [point for point in points if point.kind != FOLD]  # a fold has no way towards other frequencies
    ends = [point.parameter for point in points]
    found: list[BranchPoint | None] = []
    for frequency in map(float, grid):
        known = None
        if ordinary and min(ends) <= frequency <= max(ends):
            near = min(ordinary, key=lambda point: abs(point.parameter - frequency))
            with suppress(EquilibriumError):  # between the last ordinary point and a fold
                known = at_frequency(scene, rates, near, frequency, steps)
        found.append(known)
    return found


def tracked_end(scene: Scene, family: Family, end: BranchPoint, moved: float = 0.0) -> BranchPoint | None:
    """The `end` of another scene's branch on a `scene`'s `family`, `moved` about so far, Hz; None: none is near."""
    expected = end.parameter + (0.0 if end.kind == BORDER else moved)
    pose = np.concatenate([end.position / family.problem(expected)[0][Parameter.LENGTH], end.state[6:-3]])
    if end.kind == BORDER:
        there = family.solution(pose, end.parameter)
        return None if there is None else replace(family.at(there, end.tangent, end.parameter), kind=BORDER)
    begun = np.append(pose, expected / family.unit) - TRACKED * end.tangent

    def measure(way: float) -> float:
        point = family.after(begun, end.tangent, way + TRACKED)
        if end.kind == FOLD:
            return float(point.tangent[-1])
        if end.kind == CONTACT:
            return rotor_gap(scene, point.position, point.orientation)
        return point.excess(MARGINAL)

    try:
        low, high, width = measure(0.0), np.nan, TRACKED / 20
        while not low * high <= 0 and width < TRACKED:
            for way in (width, -width):
                if low * (high := measure(way)) <= 0:
                    break
            width *= 4
        if not low * high <= 0:
            return None
        root = float(scipy.optimize.brentq(measure, 0.0, way, xtol=1e-10)) if low else 0.0
        return replace(family.after(begun, end.tangent, root + TRACKED), kind=end.kind)
    except EquilibriumError:
        return None


def is_over(scene: Scene, point: BranchPoint) -> bool:
    """Whether a branch ends at a point: in a fold, or as the floater touches the rotor."""
    return point.kind == FOLD or rotor_gap(scene, point.position, point.orientation) < 0


def levitates(point: BranchPoint) -> bool:
    return point.excess(MARGINAL) <= 0


def one_way(
    scene: Scene, family: Family, start: Array, frequency: float, end: float, steps: Steps = STEPS
) -> list[BranchPoint]:
    """The `scene`'s `family` from `start` at `frequency` to its first marked end before `end` (Hz), in `steps`."""
    points = follow_branch(family, start, frequency, end, steps, partial(is_over, scene), MARGINAL)
    for k, point in enumerate(points):
        if point.kind == FOLD:
            return points[: k + 1]
        if k and rotor_gap(scene, point.position, point.orientation) < 0:
            before = points[k - 1]
            walk = partial(follow_branch, family, before.state, before.parameter, steps=STEPS, tolerated=MARGINAL)
            ends = before.parameter + 1e-9 * (point.parameter - before.parameter), point.parameter
            touching = scipy.optimize.brentq(
                lambda f, walk=walk: rotor_gap(scene, (p := walk(f)[-1]).position, p.orientation), *ends, xtol=1e-6
            )
            return [*points[:k], replace(walk(float(touching))[-1], kind=CONTACT)]
    return [*points[:-1], replace(points[-1], kind=points[-1].kind or BORDER)]


def way_out(
    scene: Scene, table: FieldTable, equilibria: Sequence[Equilibrium], memory: PlateMemory | None = None
) -> str:
    """Message for a `scene` with unstable `equilibria` in `table` and with `memory`: a frequency with a stable one."""
    times = [f"{1 / g:.2g} s" if g < 10 else f"{1e3 / g:.2g} ms" for g in [e.growth_per_s for e in equilibria]]
    pairs = zip(equilibria, times, strict=True)
    kinds = dict.fromkeys(f"{1e3 * e.distance:.2f} mm (e-folding time {time})" for e, time in pairs)
    found = f"only unstable ones: {', '.join(kinds)}" if kinds else "nor an unstable one below the rotor"
    if not scene.floater.round:
        scene, _, table = mean_over_turns(scene, table)
    own, (other, computed) = scene.frequency, _levitating_frequency(scene, table, memory)
    advice = f"None was found from {own / WIDEST:.4g} to {own * WIDEST:.4g} Hz either."
    if other is not None:
        without = "" if computed else " without eddy currents in the plate, which are not computed there"
        advice = f"Stable levitation is possible at about {other:.4g} Hz{without}."
    said = f"At {own:g} Hz there is no stable equilibrium, {found}. {advice}"
    return f"{said} To simulate anyway, set start.position_mm."


def _levitating_frequency(scene: Scene, table: FieldTable, memory: PlateMemory | None) -> tuple[float | None, bool]:
    """A frequency (Hz) in the nearest other window with a stable equilibrium, and whether with the plate's currents."""
    # A map without plate, in upright gravity, finds the windows; with all that acts a search has to find one too.
    own, rates = scene.frequency, Rates(with_effects(scene, table))
    upright = replace(scene, plate=None, gravity=np.array([0.0, 0.0, scene.gravity[2]]))
    tried = [replace(upright, frequency=float(f)) for f in own * WIDEST ** np.linspace(-1, 1, FREQUENCIES)]
    places = np.arange(FREQUENCIES)[:, None]
    found = surveys(tried, [table] * FREQUENCIES, np.zeros(FREQUENCIES), places, [rates] * FREQUENCIES)
    holding = [any(e.stable for e in survey.equilibria) for survey, _ in found]
    windows = []
    for stable, run in groupby(range(FREQUENCIES), lambda k: holding[k]):
        values = [tried[k].frequency for k in run]
        if stable and not values[0] <= own <= values[-1]:  # in one that does, the plate or tilted gravity is to blame
            windows.append(values if values[0] > own else values[::-1])
    alone: float | None = None
    for window in sorted(windows, key=lambda window: abs(np.log(window[0] / own))):
        near, far = window[0], window[-1]
        there = replace(scene, frequency=float(near + INSIDE * (far - near)))
        if too_slow(there):
            continue
        if there.plate is None and not np.any(there.gravity[:2]):
            return there.frequency, True
        tabulated = memory is None or there.frequency <= memory.table.frequencies[1]
        found_there = find_equilibria(there, table, rates=rates, memory=memory if tabulated else None)
        stable = [e for e in found_there if e.stable]
        if any(memory is None or e.currents is not None for e in stable):
            return there.frequency, True
        alone = alone or (there.frequency if stable else None)
    return alone, False
