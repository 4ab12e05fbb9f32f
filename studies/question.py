"""Levitations of many points at once: scenes with one rotor share its table, compiled equations and equilibria.

Trajectories that begin in one field are simulated in SIMD batches (`dynamics/flights/batch.py`).
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from ..dynamics.continuation.map import surveys
from ..dynamics.flights.balls import is_long
from ..dynamics.flights.batch import simulate_together
from ..dynamics.flights.flight import initial_state
from ..fem.cache import key_of
from ..fem.rotor.models import of_true_moment
from ..geometry.common import Array, InputError, SpinlevError
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import changed, scene_digest, scene_text, startless_text
from .cli.options import NAMES, Models, Quantity, positive
from .compare import compared_models
from .levitation import Levitation
from .plan import check_coils, sources
from .result import AXIS, found_dataset, label_of_key, variable
from .study import Point
from .words import kind_of_flight


def _find_together(members: Sequence[tuple[Levitation, tuple[int, ...]]]) -> None:
    """Search scenes whose equations have the same code, each with its place in the grid of what is varied."""
    same: dict[str, list[Levitation]] = {}  # scenes that differ in where a trajectory begins have one survey
    chosen = []
    for one, place in members:
        with suppress(SpinlevError):
            check_coils(one.scene)
            one.interaction  # noqa: B018  # equations are shared, the limits of what acts in each scene are not
            key = f"{startless_text(one.scene)} {one.spin!r}"
            chosen += [] if key in same else [(one, one.rates, place)]
            same.setdefault(key, []).append(one)
    if not chosen:
        return
    firsts, rates, places = zip(*chosen, strict=True)
    near = np.array([np.unique(column, return_inverse=True)[1] for column in np.array(places).T]).T
    spin, tables = np.array([one.spin for one in firsts]), [one.interaction for one in firsts]
    found = surveys([one.scene for one in firsts], tables, spin, near, rates)
    for some, (survey, searched) in zip(same.values(), found, strict=True):
        for one in some:
            one.adopt(survey, searched)


def _simulate_together(levitations: Sequence[Levitation], duration: float) -> None:
    """Simulate `duration` (s) of motion in SIMD batches of scenes with one field, without plate or balls."""
    groups: dict[tuple[object, ...], list[Levitation]] = {}
    for one in levitations:
        with suppress(SpinlevError):
            scene, floater = one.scene, one.scene.floater
            still = (scene.plate is None or one.models.plate_model == "none") and not scene.other_coils
            if still and is_long(one.interaction):
                shape = "" if floater.is_sphere else key_of("equilibria", floater.bodies, floater.round)
                kind = one.interaction_model, bool(np.any(scene.gravity[:2])), bool(scene.drive)
                groups.setdefault((one.equations_key, shape, *kind), []).append(one)
    for alike in groups.values():
        ready, starts = list[Levitation](), []
        for one in alike if len(alike) > 1 else ():
            with suppress(SpinlevError):
                known = () if one.absolute else one.equilibria
                starts.append(initial_state(one.scene, one.interaction, known)[0])
                ready.append(one)
        with suppress(SpinlevError):
            simulated = simulate_together([one.scene for one in ready], alike[0].interaction, starts, duration)
            for one, flight in zip(ready, simulated, strict=True):
                if flight is not None:
                    one.simulated[duration] = flight


CHOICES = (*NAMES, "spin")  # what can be varied beside the keys of the scene file
ROTOR = ("rotor", "model", "interaction", "floater")  # how keys begin whose values need a table of their own
# How many points are answered together at most, and lost together if the program is killed among them.
LARGEST: Mapping[Quantity, int] = {"equilibria": 60, "flight": 32, "field": 60}
COMPARED = {
    "dipole": "the point dipole, without the plate",
    "true_moment": "the dipole of the true moment, without the plate",
    "true": "the model of the sweep, without the plate",
}
PARTS = 4  # batches of a small sweep: as many workers share it


@dataclass(frozen=True)
class Question:
    """A quantity of a scene that is asked for at every point of a sweep."""

    scene: Scene  # whose parameters are varied
    source: str  # its name in messages
    ask: Quantity
    models: Models  # of the field and of the plate
    spin: float  # body spin of the equilibria
    duration: float  # of a trajectory, s
    place: tuple[float, ...]  # of the field, m, rotor's frame

    def __post_init__(self) -> None:
        if self.ask not in ANSWERS:
            raise InputError(f"Input ask must be one of {', '.join(ANSWERS)}; instead received {self.ask}.")
        positive("duration_s", self.duration)

    @property
    def settings(self) -> Point:
        """All that decides the answers, in types that JSON knows: not how the scene's file is called."""
        requested = vars(self) | {"scene": scene_digest(self.scene), "models": asdict(self.models)}
        return {key: value for key, value in requested.items() if key != "source"}

    def levitation(self, point: Point) -> Levitation:
        """The scene of a point with the models of a point. Raises SceneError, and InputError for an unknown model."""
        chosen = {key: point[key] for key in CHOICES if key in point}
        spin = float(chosen.pop("spin", self.spin))
        keys = {key: value for key, value in point.items() if key not in CHOICES}
        return Levitation(changed(self.scene, keys, self.source), replace(self.models, **chosen), spin)

    def __call__(self, point: Point) -> xr.Dataset:
        """The answer at a point: a dataset over `case`, whose coordinates are the values varied."""
        levitation = self.levitation(point)
        return self._answer(point, levitation, self._dipoles(point, levitation))

    def _dipoles(self, point: Point, levitation: Levitation) -> tuple[Levitation, ...]:
        if self.ask != "equilibria" or "model" in point or levitation.table.model == "dipole":
            return ()
        models, rotor = replace(levitation.models, model="dipole", interaction="rigid"), levitation.scene.rotor
        true = of_true_moment(rotor, sources(levitation.table))
        return levitation.elsewhere(models), levitation.elsewhere(models, rotor=true)

    def prepared(self, points: Sequence[Point]) -> list[Callable[[], xr.Dataset]]:
        """Functions that compute the points, which share what they can; one that cannot be raises when called."""
        jobs: list[Callable[[], xr.Dataset]] = [partial(self, point) for point in points]
        axes = {key: sorted({point[key] for point in points}) for key in points[0]}
        made, families = list[Levitation](), dict[Any, list[tuple[Levitation, tuple[int, ...]]]]()
        for k, point in enumerate(points):
            with suppress(SpinlevError):  # what cannot be made or found here is left to each scene, which says why
                one = self.levitation(point)
                if made:
                    one.share(made[0])
                dipoles = self._dipoles(point, one)
                jobs[k] = partial(self._answer, point, one, dipoles)
                made.append(one)
                # Trajectories begin at equilibria, or have a plate whose table is made about one.
                begins = self.ask == "flight" and (one.scene.plate is not None or not one.absolute)
                requested = self.ask == "equilibria" or begins
                place = tuple(axis.index(point[name]) for name, axis in axes.items())
                for role, each in enumerate((one, *dipoles)):
                    if requested and each.scene.frequency and each.scene.floater.is_sphere:
                        key = role, each.table.model, len(each.scene.rotor), each.rates.code
                        families.setdefault(key, []).append((each, place))
        for members in families.values():
            if len(members) > 1:
                with suppress(SpinlevError):
                    _find_together(members)
        if self.ask == "flight":
            _simulate_together(made, self.duration)
        return jobs

    def batches(self, points: Mapping[int, Point]) -> list[list[int]]:
        """Points that are answered together: neighbours with the same rotor, the same ones whoever computes them."""
        keys = [key for key in next(iter(points.values())) if key.startswith(ROTOR)]
        order = sorted(points, key=lambda k: [points[k][key] for key in keys])
        size = min(max(-(-len(order) // PARTS), 6), LARGEST[self.ask])
        return [order[k : k + size] for k in range(0, len(order), size)]

    def _answer(self, point: Point, levitation: Levitation, dipoles: Sequence[Levitation]) -> xr.Dataset:
        answer = ANSWERS[self.ask](self, levitation)
        if dipoles:
            answer = answer.assign(_beside(levitation, dipoles))
        return answer.expand_dims("case").assign_coords({key: ("case", [value]) for key, value in point.items()})

    def gather(self, parts: Sequence[xr.Dataset], values: Mapping[str, Sequence[Any]]) -> xr.Dataset:
        """The points on the grid of the `values`; NaN, or not stable, where a point failed or has fewer equilibria."""
        nothing = {"stable": False}
        how: dict[str, Any] = {"data_vars": "all", "coords": "different", "compat": "equals"}
        alike: dict[tuple[int, ...], list[xr.Dataset]] = {}
        for part in parts:  # of one size first: filling what is missing takes xarray 5 ms a point
            alike.setdefault(tuple(part.sizes.values()), []).append(part)
        same = [xr.concat(some, "case", join="exact", combine_attrs="drop_conflicts", **how) for some in alike.values()]
        joined = xr.concat(same, "case", join="outer", fill_value=nothing, combine_attrs="drop_conflicts", **how)
        grid = joined.set_index(case=list(values))
        grid = grid.unstack("case", fill_value=nothing) if len(values) > 1 else grid.rename(case=next(iter(values)))
        joined = grid.reindex({key: list(chosen) for key, chosen in values.items()}, fill_value=nothing)
        for name, column in joined.data_vars.items():
            if column.dtype == object:
                joined[name] = column.fillna("").astype(str)
        names = {key: key.replace(".", "_") for key in values}  # what `result.frequency_hz` and `sel(...)` take
        joined = joined.rename(names)
        for key, name in names.items():
            joined[name].attrs |= label_of_key(key)
        requested = {f"asked_{name}": value for name, value in asdict(self.models).items()}
        return joined.assign_attrs(scene=scene_text(self.scene), ask=self.ask, varied=list(names.values()), **requested)


def _equilibria(question: Question, levitation: Levitation) -> xr.Dataset:
    found_by = "search" if levitation.searched else "neighbours"
    unknown = variable((), float(len(levitation.survey.unknown)), "1", "equilibria that could not be computed")
    found = found_dataset(levitation.equilibria).assign(found_by=((), found_by), unknown=unknown)
    return found.assign_attrs(levitation.labels)


def _beside(levitation: Levitation, dipoles: Sequence[Levitation]) -> dict[str, xr.Variable]:
    found: Mapping[str, Any] = {}
    with suppress(SpinlevError):
        rough, moment, best = (one.without_plate for one in (*dipoles, levitation))
        found = compared_models(rough, moment, best, levitation.table.model) or {}
    distances = {
        f"{name}_distance": variable((), 1e-3 * value, "m", f"levitation distance by {words}")
        for name, words in COMPARED.items()
        for value in [found.get(f"{name}_distance_mm") or np.nan]
    }
    kinds = {f"{name}_stability": ((), found.get(f"{name}_stability") or "") for name in ("dipole", "true")}
    return distances | {name: xr.Variable(*kind) for name, kind in kinds.items()}


def _flight(question: Question, levitation: Levitation) -> xr.Dataset:
    flight = levitation.flight(question.duration)
    height, memory = flight.lab.position[:, 2], levitation.flight_plate
    lost = np.nan if flight.lost_at_hz is None else flight.lost_at_hz
    of_drive = {"lost_at": variable((), lost, "Hz", "frequency at the loss")} if flight.given is not None else {}
    return xr.Dataset(
        {
            **of_drive,
            "levitated": variable((), flight.levitated_s, "s", "levitation time"),
            "ended_by": ((), flight.ended_by),
            "kind": ((), kind_of_flight(levitation, flight)),
            "mean_height": variable((), height.mean(), "m", "mean height"),
            "height_spread": variable((), np.ptp(height), "m", "highest less lowest height"),
            "energy_error": variable((), flight.energy_error, "1", "violation of the energy balance"),
            "left_plate_table": variable((), flight.left_plate_table, "1", "whether it left the plate's table"),
            "plate_error": variable((), memory.error if memory else 0.0, "1", "relative error of the plate's response"),
        },
        attrs=levitation.labels,
    )


def _field(question: Question, levitation: Levitation) -> xr.Dataset:
    table, place = levitation.table, np.array(question.place)[None]
    b, gradient = (values[0] for values in table.evaluate(place))
    errors: list[Array] = [values[0] for values in table.relative_error(place)]
    return xr.Dataset(
        {
            "B": variable(("axis",), b, "T", "flux density"),
            "dB": variable(("axis", "along"), gradient, "T/m", "its derivatives"),
            "B_error": variable((), errors[0], "1", "estimated relative error of B"),
            "dB_error": variable((), errors[1], "1", "estimated relative error of its derivatives"),
        },
        {"axis": list(AXIS), "along": list(AXIS)},
        {"model": table.model},
    )


Answers = Mapping[Quantity, Callable[[Question, Levitation], xr.Dataset]]
ANSWERS: Answers = {"equilibria": _equilibria, "flight": _flight, "field": _field}
