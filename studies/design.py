"""Scenes that meet goals within bounds: SciPy's SLSQP over equilibria with their derivatives.

What is the least of several numbers, as the margin below and above the frequency and the decay of each mode, counts as
all of them, each of which is smooth; to make it large, a bound below all of them is raised (its epigraph).  Equilibria
are followed from one scene to the next by Newton's method; the last scene is searched anew.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import scipy
import xarray as xr
from matplotlib.figure import Figure

from ..dynamics.continuation.frequencies import levitates
from ..dynamics.equilibria.equilibrium import MARGINAL, Equilibrium, EquilibriumError, nearest_of
from ..geometry.common import Array, ComputationError, InputError, SpinlevError, check_names
from ..geometry.files import write_whole
from ..geometry.scene.files import changed, load_scene, scene_numbers, scene_text, toml_tables
from .candidates import OF_SCENE, Candidate, Limits, Search, survey_near
from .cli.console import note, to_json
from .cli.options import Answer, FieldModel, Models, PlateModel, Requested, documented, is_number, refused, wrong
from .figures.style import PALETTE, drawn, panels, plot_branch, save_figures
from .gradient import Gradient
from .levitation import Levitation, branch_of
from .nearby_scenes import unknown_over_plate
from .plan import SceneLike
from .result import label_of_key, variable, write_dataset

# What a scene may be asked for: unit and label
MEASURES: Mapping[str, tuple[str, str]] = {
    "margin": ("1", "least relative change of the frequency that ends stable levitation"),
    "decay_per_s": ("1/s", "decay rate of the least stable mode"),
    "frequency_hz": ("Hz", "frequency of the rotor"),
    "distance_mm": ("mm", "levitation distance"),
    "lateral_offset_mm": ("mm", "distance from the axis of rotation"),
    "polar_angle_deg": ("deg", "polar angle of the moment"),
    "gap_mm": ("mm", "gap between floater and rotor"),
    "floater_mass_g": ("g", "mass of the floater"),
    "rotor_mass_g": ("g", "mass of the rotor's magnets"),
}
# Goals with what they are of, and whether it shall be large (1) or small (-1)
GOALS = {
    "largest margin": ("margin", 1),
    "shortest damping time": ("decay_per_s", 1),
    "lowest frequency": ("frequency_hz", -1),
    "heaviest floater": ("floater_mass_g", 1),
    "lightest rotor": ("rotor_mass_g", -1),
}
NO_GOAL = "", 1  # to meet the limits alone
LEAST = ("margin", "decay_per_s")  # those that are the least of several numbers
# Limits, unless others are given; of the growth that is tolerated round-off leaves no more than this
ALWAYS = {"decay_per_s": (-0.99 * MARGINAL, np.inf), "gap_mm": (0.0, np.inf)}
MET = 1e-6  # by which a limit may be missed, in what its measure is at first
AGAIN = 3  # designs after which ends of stability are looked for anew
FAILED = 1e3  # what a scene without equilibrium misses everything by, so that a line search comes back
STEPS, TOLERANCE = 60, 1e-6  # of SLSQP
SETTLED, PATIENCE = 1e-4, 40  # part of a goal, by its size, that so many scenes must gain together
NEARER, MISSING = 0.1, 12  # part of what limits are missed by that so many scenes must take away before one meets them
CURVE = 81  # points of a branch that is kept
# Models that are searched at once; and by how much limits are missed, in their sizes, with which others need no search
SIMPLE, ROUGH = (("dipole", "none"), ("cuboid", "none")), 0.1
Best = tuple[Candidate, Array]  # a scene and its numbers


def _range(name: str, value: object) -> tuple[float, float]:
    ends = list(value) if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str) else [value] * 2
    if len(ends) == 2:
        low, high = (side if end is None else end for end, side in zip(ends, (-np.inf, np.inf), strict=True))
        good = all(is_number(end) or (isinstance(end, float) and np.isinf(end)) for end in (low, high))
        if good and float(low) <= float(high) and float(low) < np.inf and float(high) > -np.inf:  # type: ignore[arg-type]
            return float(low), float(high)  # type: ignore[arg-type]
    raise refused(name, "be a number, or two in order, least and most, of which inf leaves an end open", value)


class _SettledError(ComputationError):
    """Nothing better is found any more; what is best so far is the answer."""


class _Problem:
    """A goal within limits as SLSQP sees it: numbers from 0 to 1, measures by their sizes, and a bound to raise."""

    def __init__(self, search: Search, goal: tuple[str, int], limits: Limits) -> None:
        self.search, (self.name, self.sense), self.limits = search, goal, limits
        self.raised = self.name in LEAST and self.sense > 0  # a bound below all of them, the last of the unknowns
        self.width = search.high - search.low
        self.sizes = {one: self._size(one) for one in {self.name, *limits} if one}
        # measure, its end, 1 where that is the least and -1 where it is the most, and whether it is both
        self.rows = [
            (one, end, sign, low == high)
            for one, (low, high) in limits.items()
            for end, sign in ((low, 1), (high, -1))[: 1 if low == high else 2]
            if np.isfinite(end)
        ]
        self.best: list[tuple[float, Candidate, Array]] = []  # scenes that meet all limits, with how well
        self.kept = search.looked_at  # scenes when one was better by more than `SETTLED` or `NEARER`
        self.by = ""  # models, for a message
        self.missed = np.inf  # by how much limits were missed then, before one met them
        self.nearest = np.inf, ""  # by how much the limits are missed at least, and which

    def _size(self, name: str) -> float:
        ends = [abs(end) for end in self.limits.get(name, ()) if np.isfinite(end)]
        return max([0.1 if name == "margin" else float(np.abs(self.search.near.values(name)).min()), *ends, 1e-2])

    def numbers(self, z: Array) -> Array:
        low, high = self.search.low, self.search.high
        return np.asarray(np.clip(low + z[: len(self.width)] * self.width, low, high))

    def values(self, z: Array, name: str, sign: int = 1) -> Array | None:
        """What a measure is the least of, by its size; None where there is no such scene."""
        known = self.search.at(self.numbers(z))
        if known is not None and not name:
            return np.zeros(1)
        try:
            found = None if known is None else known.values(name) / self.sizes[name]
        except EquilibriumError:  # as the margin of what is not stable
            return None
        return found if found is None or sign > 0 else found[[int(np.argmin(found))]]

    def slopes(self, z: Array, name: str, sign: int = 1) -> Array:
        """Derivatives of the same; from here on equilibria are followed from this scene."""
        numbers = self.numbers(z)
        known = self.search.at(numbers)
        if known is None:  # SLSQP came back from there as near as it could
            raise _SettledError
        self.search.go_on_from(known, numbers)
        try:
            found = known.slopes(name) * self.width / self.sizes[name]
        except EquilibriumError:
            raise _SettledError from None
        found = found if sign > 0 else found[[int(np.argmin(known.values(name)))]]
        return np.column_stack([found, np.zeros(len(found))]) if self.raised else found

    def objective(self, z: Array) -> float:
        if self.search.looked_at - self.kept > (PATIENCE if self.best else MISSING):
            raise _SettledError
        if (value := self.values(z, self.name)) is None:
            return FAILED
        self.keep(z)
        return float(-z[-1] if self.raised else -self.sense * value[0])

    def objective_by(self, z: Array) -> Array:
        if not self.name:
            return np.zeros(len(z))
        return -np.eye(len(z))[-1] if self.raised else np.asarray(-self.sense * self.slopes(z, self.name)[0])

    def excess(self, z: Array, name: str, end: float | None, sign: int, equal: bool) -> Array:
        """By how much a measure is more than its end, or, without one, than the bound that is raised."""
        if (value := self.values(z, name, sign)) is None:
            count = {"margin": 2, "decay_per_s": len(self.search.start.known.modes)}.get(name, 1) if sign > 0 else 1
            return np.full(count, FAILED if equal else -FAILED)
        return sign * (value - (z[-1] if end is None else end / self.sizes[name]))

    def keep(self, z: Array) -> None:
        """Remember a scene that meets all limits, or else how near it comes to that."""
        known = self.search.at(self.numbers(z))
        value = self.values(z, self.name)
        if known is None or value is None:
            return
        each = ((self.excess(z, *row), row) for row in self.rows)
        missed = [(float(np.max(np.abs(far) if equal else -far)), name) for far, (name, _, _, equal) in each]
        worst, which = max([(0.0, ""), *missed])
        if worst < MET:
            reached = self.sense * float(value.min() if self.sense > 0 else value[0])
            if not self.best or reached > self.best[-1][0] + SETTLED * max(1.0, abs(reached)):
                self.kept = self.search.looked_at
            if not self.best or reached > self.best[-1][0]:
                self.best.append((reached, known, self.numbers(z)))
        elif worst < self.nearest[0]:
            if not self.best and worst < (1 - NEARER) * self.missed:
                self.kept, self.missed = self.search.looked_at, worst
            self.nearest = worst, f": {which} is {known.values(which).min():.4g} where it is nearest to them"

    def solved(self) -> Best:
        search = self.search
        z = (search.at_near - search.low) / self.width
        if self.raised:
            z = np.append(z, float(search.near.values(self.name).min()) / self.sizes[self.name])
        raised = np.eye(len(z))[-1]
        constraints = [
            {
                "type": "eq" if equal else "ineq",
                "fun": lambda z, row=(name, end, sign, equal): self.excess(z, *row),
                "jac": lambda z, row=(name, end, sign): row[2] * self.slopes(z, *row[::2]) - raised * (row[1] is None),
            }
            for name, end, sign, equal in [*self.rows, *[(self.name, None, 1, False)] * self.raised]
        ]
        self.keep(z)
        with suppress(_SettledError):
            scipy.optimize.minimize(
                self.objective, z, jac=self.objective_by, constraints=constraints, method="SLSQP",
                bounds=[(0.0, 1.0)] * len(self.width) + [(None, None)] * self.raised,
                options={"maxiter": STEPS, "ftol": TOLERANCE},
            )  # fmt: skip
        if not self.best:
            raise ComputationError(
                f"No scene that was looked at{self.by} meets all limits{self.nearest[1]}. Give wider bounds, or other "
                "limits."
            )
        _, known, numbers = self.best[-1]
        search.go_on_from(known, numbers)
        return known, numbers


def optimised(search: Search, goal: tuple[str, int], limits: Limits) -> Best:
    """The best scene of a `search` for a `goal` within `limits`; ComputationError where none meets them."""
    begun = search.near, search.at_near
    try:
        if "margin" in (goal[0], *limits):
            search.near.values("margin")
        found, numbers = _Problem(search, goal, limits).solved()
    except ComputationError:  # as there is no margin of what is not stable, or a long step led nowhere
        search.go_on_from(*begun)
        low, high = limits.get("decay_per_s", (0.0, np.inf))
        stable = {"decay_per_s": (max(low, -MARGINAL / 2), high)}
        # the nearest that meets the limits
        _Problem(search, NO_GOAL, {k: ends for k, ends in limits.items() if k != "margin"} | stable).solved()
        found, numbers = _Problem(search, goal, limits).solved()
    for _ in range(AGAIN if "margin" in (goal[0], *limits) else 0):
        whole = Candidate(found.levitation, found.known, found.keys)
        if np.allclose(whole.values("margin"), found.values("margin"), atol=MET):
            break
        search.begin_at(whole, numbers)  # ends that were followed are not the first that are met
        found, numbers = _Problem(search, goal, limits).solved()
    return found, numbers


def _front(search: Search, goals: Sequence[tuple[str, int]], limits: Limits, points: int) -> list[Best]:
    """Scenes from the best by the first of two goals to the best by the second, that of the second in equal steps."""
    (first, (name, sense)), found = goals, [optimised(search, goals[0], limits)]
    last = optimised(search, (name, sense), limits)
    ends = [float(one.values(name).min()) for one in (found[0][0], last[0])]
    search.go_on_from(*found[0])
    for level in np.linspace(ends[0], ends[1], points)[1:-1]:
        low, high = limits.get(name, (-np.inf, np.inf))
        there = {name: (max(low, level), high) if sense > 0 else (low, min(high, level))}
        found.append(optimised(search, first, {**limits, **there}))
    return [*found, last]


@documented
def design(
    scene: SceneLike,
    goals: str | Sequence[str],
    free: Mapping[str, Sequence[float]],
    limits: Mapping[str, Any] | None = None,
    points: int = 7,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    progress: bool | None = None,
    **requested: Unpack[Requested],
) -> xr.Dataset:
    """The scene that meets a goal best, its numbers within bounds; of two goals the scenes between (Pareto curve).

    Parameters
    ----------
    goals : str or list of 2 str
        "largest margin" (of the frequency, to where stable levitation ends), "shortest damping time", "lowest
        frequency", "heaviest floater", "lightest rotor" (magnets of 7500 kg/m³).
    free : dict of str to (float, float)
        Bounds of the numbers that may change, by dotted key of the scene file.
    limits : dict, optional
        A number, or least and most (None or inf: open), of "margin" (a part of the frequency), "decay_per_s",
        "frequency_hz", "distance_mm", "lateral_offset_mm", "polar_angle_deg", "gap_mm", "floater_mass_g" and
        "rotor_mass_g". Left out, nothing grows by more than 0.004 /s and the bodies do not touch.
    points : int
        Of the curve of two goals, 2 to 100.

    Returns
    -------
    xarray.Dataset
        Over `point`: `number` by `key`, `value` by `measure` (of a search of the scene anew), and `scene`, its file;
        `first_number` and `first_value` are those of the scene given.

    Raises
    ------
    EquilibriumError
        Neither the scene nor others within the bounds have an equilibrium.
    ComputationError
        No scene that was looked at meets the limits.

    Examples
    --------
    >>> free, limits = {"frequency_hz": (60.0, 130.0)}, {"gap_mm": (0.0, 12.0)}
    >>> found = sl.design(scene, "lowest frequency", free, limits, model="dipole")
    >>> round(float(found.number.sel(key="frequency_hz")[0]), 2)
    93.21
    """
    levitation = Levitation(scene, Models(model, plate_model, **requested), spin)
    return designed(levitation, *checked_goals(levitation, goals, free, limits, points), points)


def checked_goals(
    levitation: Levitation, goals: object, free: object, limits: object, points: object
) -> tuple[list[str], Limits, Limits]:
    """Goals, bounds of free numbers and limits as they are used. Raises InputError; the arguments are of `design`."""
    wanted = [goals] if isinstance(goals, str) else list(goals) if isinstance(goals, Sequence) else []
    if not 1 <= len(wanted) <= 2 or len(set(map(str, wanted))) < len(wanted):
        raise refused("goals", f"be one or two of {', '.join(GOALS)}", goals)
    check_names(wanted, GOALS, "goals", "goals")
    if isinstance(points, bool) or not isinstance(points, int) or not 2 <= points <= 100:
        raise refused("points", "be a number from 2 to 100", points)
    given = {} if limits is None else limits
    if not isinstance(given, Mapping):
        raise refused("limits", "be ranges by what a scene can be asked for", limits)
    check_names(given, MEASURES, "limits", "what a scene can be asked for")
    ends = {name: _range(f"limits.{name}", value) for name, value in given.items()}
    return [str(one) for one in wanted], checked_free(free, levitation), {**ALWAYS, **ends}


def checked_free(free: object, levitation: Levitation) -> Limits:
    """Bounds of free numbers, which hold those of a `levitation` and have derivatives in it. Raises InputError."""
    if not isinstance(free, Mapping) or not free:
        raise refused("free", "be least and most by key of the scene file", free)
    bounds = {str(key): _range(f"free.{key}", value) for key, value in free.items()}
    for key, (low, high) in bounds.items():
        if not low < high or not np.isfinite([low, high]).all():
            raise refused(f"free.{key}", "be two finite numbers in order, least and most", free[key])
    gradient, plate = Gradient(levitation), levitation.scene.plate is not None
    for key in gradient.checked_keys(list(bounds), "free"):
        number, (low, high) = gradient.numbers[key], bounds[key]
        if not low <= number <= high:
            rule = f"be a range that holds the scene's own number, {number:g}"
            raise wrong(f"free.{key}", rule, f"received [{low:g}, {high:g}].")
        if plate and levitation.models.plate_model != "none" and unknown_over_plate(key):
            raise InputError(f"Input free must name what has derivatives; instead {key}: {unknown_over_plate(key)}.")
    return bounds


def designed(levitation: Levitation, goals: Sequence[str], bounds: Limits, limits: Limits, points: int) -> xr.Dataset:
    """The Dataset of `design` for a `levitation`, checked `goals`, `bounds`, `limits`; `points` are of a curve."""
    if (levitation.models.model, levitation.models.plate_model) not in SIMPLE:
        _check_reach(levitation, bounds, limits)
    search = Search(levitation, bounds)
    kinds = [GOALS[goal] for goal in goals]
    found = [optimised(search, kinds[0], limits)] if len(kinds) == 1 else _front(search, kinds, limits, points)
    note("The scene that was found, searched anew ...")
    begun = replace(levitation.models, model=search.models.model)
    given = scene_numbers(levitation.scene)[1]
    numbers = [np.array([given[key] for key in search.keys]), *(numbers for _, numbers in found)]
    rows, curves, texts = [], [], list[str]()
    for k, one in enumerate(numbers):
        scene = changed(search.scene, dict(zip(search.keys, one.tolist(), strict=True)))
        there = levitation if k == 0 else Levitation(scene, begun, search.spin)
        near = search.at(one) if k else None
        if near is not None and (survey := survey_near(there, *(v[None] for v in near.bare.start.vectors[:3:2]))):
            there.adopt(survey)
        known = nearest_of(there.equilibria, near.known.position if near else np.zeros(3))
        rows.append(_measured(there, known, search.keys))
        curves.append(_curve(there, known))
        texts.append(scene_text(levitation.scene if k == 0 else scene))
    units = [label_of_key(key)["units"] for key in search.keys]
    ends = [limits.get(name, (-np.inf, np.inf)) for name in MEASURES]
    axes = {"key": list(search.keys), "unit": ("key", units), "measure": list(MEASURES), "end": ["least", "most"]}
    axes["measure_unit"] = ("measure", [unit for unit, _ in MEASURES.values()])
    values, over = np.array(rows), ("curve", "step")
    return xr.Dataset(
        {
            "number": variable(("point", "key"), np.array(numbers[1:]), "as the key", "number of the scene"),
            "first_number": variable(("key",), numbers[0], "as the key", "number of the scene given"),
            "bound": variable(("key", "end"), [bounds[key] for key in search.keys], "as the key", "its bounds"),
            "value": variable(("point", "measure"), values[1:], "as the measure", "measure"),
            "first_value": variable(("measure",), values[0], "as the measure", "measure of the scene given"),
            "limit": variable(("measure", "end"), ends, "as the measure", "its limits"),
            "followed_frequency": variable(over, [c[0] for c in curves], "Hz", "frequency, without the plate"),
            "followed_distance": variable(over, [c[1] for c in curves], "m", "levitation distance, without the plate"),
            "followed_stable": variable(over, [c[2] for c in curves], "1", "whether it is stable, or marginal"),
            "scene": (("point",), texts[1:]),
        },
        axes,
        {"study": "designed", "goals": ", ".join(goals), "scene": texts[0], **search.near.levitation.labels},
    )


def _check_reach(levitation: Levitation, bounds: Limits, limits: Limits) -> None:
    """ComputationError where not even point dipoles, of which a search takes seconds, come near the limits."""
    quick = Levitation(levitation.scene, Models("dipole", "none", interaction="rigid"), levitation.spin)
    known = {name: ends for name, ends in limits.items() if name not in LEAST}
    with suppress(EquilibriumError):
        problem = _Problem(Search(quick, bounds), NO_GOAL, known | {"decay_per_s": (-MARGINAL / 2, np.inf)})
        problem.by = " by point dipoles without the plate"
        try:
            problem.solved()
        except ComputationError:
            if problem.nearest[0] > ROUGH:
                raise


def _measured(levitation: Levitation, known: Equilibrium | None, keys: tuple[str, ...]) -> list[float]:
    found = []
    for name in MEASURES:
        try:
            whole = levitation.stability if known is None else known
            found.append(float(Candidate(levitation, whole, keys).values(name).min()))
        except SpinlevError:
            found.append(OF_SCENE[name](levitation.scene) if name in OF_SCENE else np.nan)
    return found


def _curve(levitation: Levitation, known: Equilibrium | None) -> Array:
    found = np.full((3, CURVE), np.nan)
    points = branch_of(levitation, known.without or known) if known and levitation.scene.floater.round else ()
    if points:
        chosen = np.unique(np.linspace(0, len(points) - 1, CURVE).round().astype(int))
        some = [(points[k].parameter, points[k].distance, levitates(points[k])) for k in chosen]
        found[:, : len(some)] = np.array(some).T
    return found


def _lines(result: xr.Dataset) -> list[str]:
    lines = []
    for k in range(result.sizes["point"]):
        one = result.isel(point=k)
        changes = zip(result["key"].values, one["number"].values, result["unit"].values, strict=True)
        lines.append("; ".join(f"{key} = {number:.5g} {unit}".removesuffix(" 1") for key, number, unit in changes))
        rows = zip(MEASURES, one["value"].values, result["first_value"].values, strict=True)
        said = [f"{name} {value:.4g} (was {was:.4g})" for name, value, was in rows if np.isfinite(value)]
        lines.append(f"  {', '.join(said)}")
    return lines


@drawn
def design_figure(result: xr.Dataset) -> Figure:
    """Free numbers within their bounds and the branch of equilibria before and after; of two goals their curve."""
    figure, ((left, right),) = panels(1, 2, 2.9)
    goals = [GOALS[name] for name in str(result.attrs["goals"]).split(", ")]
    count, (low, high) = result.sizes["point"], result["bound"].values.T
    places = np.arange(result.sizes["key"])[::-1]
    if count > 1:
        along, up = (result["value"].sel(measure=name) for name, _ in goals[::-1])
        words, other = (f"{MEASURES[name][1]} ({MEASURES[name][0]})" for name, _ in goals[::-1])
        left.plot(along, up, "o-", color=PALETTE[0])
        left.set(xlabel=words, ylabel=other)
        parts = (result["number"].values - low) / (high - low)
        for key, part, color in zip(result["key"].values, parts.T, PALETTE * 3, strict=False):
            right.plot(along, part, "o-", color=color, label=str(key))
        right.set(xlabel=words, ylabel="number, from its least to its most")
        return figure
    after = (result["number"].isel(point=0).values - low) / (high - low)
    left.hlines(places, 0, 1, color="0.85", lw=4)
    first = (result["first_number"].values - low) / (high - low)
    left.plot(first, places, "o", mfc="none", color=PALETTE[1], label="given")
    left.plot(after, places, "o", color=PALETTE[0], label="found")
    keys = zip(result["key"].values, result["unit"].values, strict=True)
    left.set_yticks(places, [f"{key} ({unit})" for key, unit in keys])
    left.set_xticks([0, 1], ["least", "most"])
    left.set_ylim(-0.7, len(places) - 0.3)
    for curve, color in ((0, PALETTE[1]), (1, PALETTE[0])):
        some = result.isel(curve=curve).dropna("step")
        frequency, distance, stable = (some[f"followed_{name}"] for name in ("frequency", "distance", "stable"))
        plot_branch(right, frequency, 1e3 * distance, stable.values == 1, color=color)
        values = result["first_value"] if curve == 0 else result["value"].isel(point=0)
        right.plot(values.sel(measure="frequency_hz"), values.sel(measure="distance_mm"), "o", color=color, ms=4)
    right.set(xlabel="rotor frequency (Hz)", ylabel="levitation distance (mm)")
    return figure


def design_job(path: Path, requested: Models, out: Path) -> Answer:
    """The scene that a file of goals asks for, written as design.toml with design.nc, .json and its figure."""
    table = {"points": 7, **toml_tables(path, "goals")}
    check_names(table, ("scene", "goals", "free", "limits", "points"), "goals", f"keys of {path}")
    if not isinstance(table.get("scene"), str):
        raise refused("scene", f"be the path of a scene file, in {path}", table.get("scene"))
    levitation = Levitation(load_scene(path.parent / table["scene"]), requested)
    wanted = checked_goals(levitation, *map(table.get, ("goals", "free", "limits", "points")))
    result = designed(levitation, *wanted, table["points"])
    count, files = result.sizes["point"], list[str]()
    for k, text in enumerate(result["scene"].values):
        files.append(str(out / ("design.toml" if count == 1 else f"design-{k + 1}.toml")))
        write_whole(Path(files[-1]), str(text).encode())
    names = {str(name): result["value"].sel(measure=name).values for name in result["measure"].values}
    keys = result["key"].values.tolist()
    values: dict[str, Any] = {
        "scene": files[0] if count == 1 else files,
        **{name: float(row[0]) if count == 1 else row for name, row in names.items()},
        "numbers": [dict(zip(keys, row, strict=True)) for row in result["number"].values.tolist()],
        "goals": wanted[0], **levitation.labels,
    }  # fmt: skip
    write_dataset(result, out / "design.nc")
    write_whole(out / "design.json", f"{to_json(values)}\n".encode())
    save_figures({"design": design_figure(result)}, out)
    said = f"Scene{'s' if count > 1 else ''} in {', '.join(files)}; figure and numbers in"
    return values, [*_lines(result), f"{said} {out}/design.png, .pdf, .nc and .json"]
