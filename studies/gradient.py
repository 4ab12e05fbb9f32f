"""Derivatives of a scene's equilibria by the numbers of its scene file.

What a number changes at a fixed state is differenced, and nothing else: the rotor's field and the effects at a few
values of it (`_Changed`), from tables of one mesh, so that differences are smooth; the equilibrium and its modes follow
by `dynamics.equilibria.derivatives`.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..dynamics.continuation.branch import BranchPoint
from ..dynamics.continuation.frequencies import BORDER, CONTACT, stable_ranges
from ..dynamics.equilibria.derivatives import Implicit, Nearby, Setting, Tangent
from ..dynamics.equilibria.equilibrium import AVERAGED, FOLD, LOCKED, Equilibrium, EquilibriumError
from ..dynamics.motion.effect import Interaction, interaction_of
from ..dynamics.motion.effects import mean_over_turns, with_effects
from ..dynamics.motion.equations import parameters
from ..dynamics.motion.events import rotor_gap
from ..dynamics.motion.plate import PlateForce, PlateMemory
from ..dynamics.motion.rotor_effects import Mutual, RotorCurrents
from ..dynamics.motion.state import Scales
from ..fem.mutual.making import moved_mutual, mutual_table_beside
from ..fem.mutual.table import MutualTable, StrongerMutual
from ..fem.rotor.models import changed_table, magnified
from ..fem.rotor.table import RotorTable
from ..fem.rotor_metal import MovedLosses, RotorLosses, cached_rotor_losses
from ..geometry.common import Array, InputError, shown
from ..geometry.cutting import united
from ..geometry.scene.contents import Plate, Scene
from ..geometry.scene.files import changed, scene_numbers, scene_text
from ..geometry.scene.messages import SceneError
from .cli.console import note
from .cli.options import Answer, FieldModel, Models, PlateModel, Requested, documented
from .levitation import Levitation
from .plan import SceneLike
from .result import IN_JSON, MODES, label_of_key, variable, write_dataset

# What has derivatives: unit, label, and dimensions beside `equilibrium` and `key`, as in the dataset of equilibria
ANSWERS: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "distance": ("m", "distance from the rotor's origin", ()),
    "lateral_offset": ("m", "distance from the axis of rotation", ()),
    "polar_angle": ("deg", "polar angle of the moment", ()),
    "lag": ("deg", "lag behind the rotor of the moment's turning part", ()),
    "position": ("m", "mean position, rotor's frame", ("axis",)),
    "growth": ("1/s", "growth rate of the least stable mode", ()),
    "mode_growth": ("1/s", "growth rate of a mode", ("mode",)),
    "mode_frequency": ("Hz", "frequency of a mode", ("mode",)),
}
# Step of differences by a number, by its size or by one that such a number usually has, by the end of its key
STEP, USUAL = 2e-3, {"mm": 10.0, "deg": 20.0, "T": 1.0, "m_s2": 9.81}
# The same where a table is made anew by a fit: what its points leave is smooth over this
WIDE = 0.02
CENTRAL = ((1, 2 / 3), (-1, -2 / 3), (2, -1 / 12), (-2, 1 / 12))  # Steps and weights, of fourth order
FORWARD = ((0, -25 / 12), (1, 4.0), (2, -3.0), (3, 4 / 3), (4, -1 / 4))  # Where a number has an end
AT_FOLD = "at a fold an equilibrium has no derivatives"


class Gradient:
    """Derivatives of the equilibria of a `levitation` by numbers of its scene.

    Raises
    ------
    InputError : the rotor is at rest, or its field is a map
    """

    def __init__(self, levitation: Levitation) -> None:
        self.levitation = levitation
        self.scene, self.numbers = scene_numbers(levitation.still)
        if not self.scene.frequency:
            raise InputError("Input frequency_hz must be positive for derivatives; instead the rotor is at rest.")
        if self.scene.field_map:
            raise InputError("Input rotor.field_map must be left out for derivatives; instead the field is a map.")
        if len(united(self.scene.rotor)) < len(self.scene.rotor):  # by what parts them nothing is smooth
            raise InputError(
                "Input rotor.magnets must not be parts of one magnet for derivatives; instead some that touch have one "
                "material and one polarisation. Give them as one."
            )
        # why derivatives are not known, and what is left out of those that are
        self.reasons: dict[str, str] = {}
        self._end: list[tuple[Equilibrium, _Changed, Implicit, list[Nearby]]] = []

    def checked_keys(self, by: Sequence[str] | None, name: str = "by") -> list[str]:
        """The keys asked for, all of the scene's where none are. Raises InputError for one that is no number of it."""
        return list(self.numbers) if by is None else _checked(name, by, self.numbers, "keys of numbers in this scene")

    def ways(self, known: Equilibrium, keys: Sequence[str]) -> tuple[dict[str, Tangent], Implicit | None, _Changed]:
        """The way of one equilibrium by each key, with its equations and those of scenes nearby.

        There is none by a key, or no equations, where it is not known: see `reasons`.
        """
        base = _Changed(self.levitation, self.scene, known.kind == AVERAGED, known.currents is not None)
        if known.kind == LOCKED:
            self.reasons[LOCKED] = (
                "derivatives of frequency-locked equilibria of a body that is not round are not known"
            )
            return {}, None, base
        implicit = Implicit(known, base.setting)
        if implicit.at_fold:
            self.reasons["fold"] = AT_FOLD
        found = {}
        base.prepare(keys)
        for key in keys:
            if base.with_plate and (why := unknown_over_plate(key)):
                self.reasons[why] = why
                continue
            found[key] = implicit.by(self._nearby(base, key))
        return found, implicit, base

    def _around(self, base: _Changed, key: str) -> list[tuple[int, float, Setting]]:
        """Steps, weights and equations about a number; on one side where it may not grow or shrink."""
        step = base.step(key, self.numbers[key])
        for steps, sign in ((CENTRAL, 1), (FORWARD, 1), (FORWARD, -1)):
            try:
                scenes = {k: changed(self.scene, {key: self.numbers[key] + sign * k * step}) for k, _ in steps}
            except SceneError:
                continue
            return [(sign * k, sign * weight / step, base.at(scenes[k], {key: sign * k * step})) for k, weight in steps]
        raise InputError(f"Input {key} must have room to change for a derivative; instead it has none.")

    def end_by(self, point: BranchPoint, key: str) -> float:
        """Derivative of the frequency of a range's end, at which the scene is, by a number of the scene."""
        if key == "frequency_hz":
            return 0.0
        if not self._end:
            known = equilibrium_at(self.levitation, point)
            base = _Changed(self.levitation, self.scene, False, False)
            implicit = Implicit(known, base.setting)
            self._end.append((known, base, implicit, self._nearby(base, "frequency_hz")))
        known, base, implicit, by_frequency = self._end[0]
        nearby = self._nearby(base, key)
        if point.kind == FOLD:
            return implicit.fold_by(implicit.missed(nearby), implicit.missed(by_frequency))

        def excess(tangent: Tangent, some: Sequence[Nearby]) -> float:
            if point.kind != CONTACT:
                return float(np.real(derivative(known, tangent, "growth")))
            moved = tangent.of(lambda e: rotor_gap(self.scene, e.position, e.state.orientation))
            return float(moved) + self._gap_by(known, key if some is nearby else "frequency_hz")

        ways = (implicit.by(nearby), nearby), (implicit.by(by_frequency), by_frequency)
        return -excess(*ways[0]) / excess(*ways[1])

    def _gap_by(self, known: Equilibrium, key: str) -> float:
        """Derivative of the gap between floater and rotor by a number, the floater where it is."""
        step = _Changed(self.levitation, self.scene, False, False).step(key, self.numbers[key])
        gaps = [(weight, changed(self.scene, {key: self.numbers[key] + k * step})) for k, weight in CENTRAL]
        return sum(w * rotor_gap(scene, known.position, known.state.orientation) for w, scene in gaps) / step

    def _nearby(self, base: _Changed, key: str) -> list[Nearby]:
        step = base.step(key, self.numbers[key])
        return [Nearby(k * step, weight, setting) for k, weight, setting in self._around(base, key)]

    def dataset(self, equilibria: Sequence[Equilibrium], of: Sequence[str], by: Sequence[str]) -> xr.Dataset:
        """Derivatives over `equilibrium` and `key`; NaN where they do not exist, with the reasons as an attribute."""
        sizes = {"axis": 3, "mode": len(MODES)}
        ends, of = [name for name in of if name in ENDS], [name for name in of if name not in ENDS]
        columns = {
            name: np.full((len(equilibria), len(by), *(sizes[d] for d in ANSWERS[name][2])), np.nan) for name in of
        }
        for row, known in enumerate(equilibria):
            tangents, _, _ = self.ways(known, by)
            for k, key in enumerate(by):
                for name in of if key in tangents else ():
                    columns[name][row, k] = derivative(known, tangents[key], name)
        data = {
            name: variable(
                ("equilibrium", "key", *ANSWERS[name][2]), values, ANSWERS[name][0], f"derivative: {ANSWERS[name][1]}"
            )
            for name, values in columns.items()
        }
        slopes = range_ends(self, by)[1] if ends else np.zeros((2, 0))
        for name in ends:
            row = slopes[list(ENDS).index(name)]
            data[name] = variable(("key",), row, "Hz", f"derivative: {ENDS[name]}")
        data["number"] = variable(("key",), [self.numbers[key] for key in by], "as the key", "number of the scene")
        units = [label_of_key(key)["units"] for key in by]
        return xr.Dataset(
            data,
            {
                "equilibrium": np.arange(len(equilibria)),
                "key": list(by),
                "unit": ("key", units),
                "mode": list(MODES),
                "axis": list("xyz"),
            },
            {"study": "gradient", "not_known": "; ".join(self.reasons.values()), **self.levitation.labels},
        )


def unknown_over_plate(key: str) -> str:
    """Why derivatives by a key are not known where a plate's currents act; empty where they are."""
    if key.startswith("plate.") and not key.startswith(("plate.center_mm", "plate.rotation_deg", "plate.conductivity")):
        return "derivatives by sizes of a plate whose currents act are not known"
    return ""


def _moves_rotor(key: str) -> bool:
    """Whether a number changes the rotor's field in the plate in more than its strength."""
    still = ("rotor.remanence_T", "rotor.conductivity_S_m")
    return key.startswith(("rotor.", "plate.center_mm", "plate.rotation_deg")) and not key.startswith(still)


# Ends of the stable range of the levitating branch, Hz, without a plate's currents
ENDS = {"lowest_frequency": "lowest stable frequency", "highest_frequency": "highest stable frequency"}


def range_ends(gradient: Gradient, keys: Sequence[str]) -> tuple[Array, Array]:
    """Ends (2,) Hz of the stable range that a scene's frequency is in, and their derivatives (2, key) by key.

    A fold moves so that F stays singular, a change of stability so that the growth rate stays what is tolerated, and a
    contact so that the bodies touch. Raises EquilibriumError: the scene's equilibrium is in no such range.
    """
    levitation = gradient.levitation
    runs = [
        run
        for run in stable_ranges(levitation.branch)
        if run.low.parameter <= gradient.scene.frequency <= run.high.parameter
    ]
    if not runs:
        raise EquilibriumError(
            "The equilibrium is in no range of stable frequencies, whose ends would have derivatives."
        )
    ends = runs[0].low, runs[0].high
    found = np.full((2, len(keys)), np.nan)
    for row, point in zip(found, ends, strict=True):
        if point.kind == BORDER:
            gradient.reasons[BORDER] = f"nothing ends at {point.parameter:.4g} Hz, beyond which nobody looked"
            continue
        there = Gradient(levitation.elsewhere(frequency=point.parameter))
        row[:] = [there.end_by(point, key) for key in keys]
    return np.array([point.parameter for point in ends]), found


def equilibrium_at(levitation: Levitation, point: BranchPoint) -> Equilibrium:
    """The equilibrium of a point of a branch, at whose frequency the scene is."""
    scales = Scales.of(levitation.still)
    return Equilibrium(
        scales.unpack(point.state), point.spin, residual=0.0, position_error=0.0, **point.motion.in_seconds(scales.time)
    )


def answer_of(known: Equilibrium, name: str) -> ArrayLike:
    """An answer of `ANSWERS`, SI units and degrees."""
    if name in ("mode_growth", "mode_frequency"):
        modes = {mode.name: (mode.growth_per_s, mode.frequency_hz) for mode in known.modes}
        return np.array([modes.get(mode, (np.nan, np.nan))[name == "mode_frequency"] for mode in MODES])
    if name == "growth":
        return known.growth_per_s
    return getattr(known, name + ("_deg" if ANSWERS[name][0] == "deg" else ""))  # type: ignore[no-any-return]


def derivative(known: Equilibrium, tangent: Tangent, name: str) -> ArrayLike:
    """Derivative of an answer of `ANSWERS` along the way of an equilibrium."""
    if name in ("mode_growth", "mode_frequency"):
        rates = [tangent.modes.get(mode, complex(np.nan, np.nan)) for mode in MODES]
        return np.real(rates) if name == "mode_growth" else np.imag(rates) / (2 * np.pi)
    if name == "growth":
        return tangent.modes[max(known.modes, key=lambda mode: mode.growth_per_s).name].real
    return tangent.of(lambda equilibrium: answer_of(equilibrium, name))


@dataclass(frozen=True, eq=False)
class _Changed:
    """A scene's equations, and those of scenes that differ from it in one number."""

    levitation: Levitation
    scene: Scene
    averaged: bool  # the motion of the floater's mean over turns about its moment
    with_plate: bool

    def step(self, key: str, value: float) -> float:
        """Of the differences by a key's number."""
        usual = next((size for end, size in USUAL.items() if key.rstrip(".0123456789").endswith(f"_{end}")), 0.0)
        return STEP * (max(abs(value), usual) or 1.0)

    @cached_property
    def setting(self) -> Setting:
        return self._setting(
            self.scene, self.levitation.interaction, self.levitation.plate if self.with_plate else None
        )

    def _setting(self, scene: Scene, interaction: Interaction, plate: PlateMemory | None) -> Setting:
        if self.averaged:
            scene, interaction, _ = mean_over_turns(scene, interaction)
        scales = Scales.of(scene)
        values = parameters(scene, scales, frozen_spin=True)
        rates = self.levitation.rates
        if interaction is not self.levitation.interaction or self.averaged:
            rates = (self.setting.rates if "setting" in self.__dict__ else rates).elsewhere(interaction)
        return Setting(scales, rates, values, PlateForce(plate, values) if plate else None)

    def at(self, scene: Scene, offsets: Mapping[str, float]) -> Setting:
        """The equations of a scene in which numbers are larger by `offsets`, by key."""
        table, of_rotor = self.levitation.table, any(key.startswith("rotor.") for key in offsets)
        field = changed_table(table, scene.rotor) if of_rotor and isinstance(table, RotorTable) else table
        effects = interaction_of(field)
        if (mutual := self.levitation.answers[0]) is not None:
            effects = effects.joined(Mutual(self._mutual(mutual, scene, offsets), scene.floater.moment))
        if (losses := self.levitation.losses) is not None:
            effects = effects.joined(RotorCurrents(self._losses(losses, scene, offsets)))
        plate = self._plate(scene, offsets) if self.with_plate else None
        return self._setting(scene, with_effects(scene, effects), plate)

    @cached_property
    def _strength(self) -> float:
        return float(np.linalg.norm(self.scene.rotor[0].polarization)) or 1.0

    def _mutual(self, table: MutualTable, scene: Scene, offsets: Mapping[str, float]) -> Any:
        lone, strong = magnified(self.scene.rotor, scene.rotor), 1.0
        found: Any = moved_mutual(table, scene.rotor)
        if "rotor.remanence_T" in offsets:
            strong = float(np.linalg.norm(scene.rotor[0].polarization)) / self._strength
        for key, offset in offsets.items():
            moves = key.startswith("rotor.") and lone and lone[0] == 1.0
            if moves or key.endswith("remanence_T") or not key.startswith(("rotor.", "floater.")):
                continue
            if key.startswith("floater.") and not key.endswith(("_mm", "permeability")):
                continue
            ends = self._ends_of(
                "mutual", key, table, lambda there: mutual_table_beside(table, there.rotor, there.floater.ball, note)
            )
            found = _Line(found, *ends[:2], offset / ends[2])
        return found if strong == 1.0 else StrongerMutual(found, strong)

    def _losses(self, losses: RotorLosses, scene: Scene, offsets: Mapping[str, float]) -> Any:
        before, after = self.scene.rotor, scene.rotor
        found: Any = losses
        alone = not self.scene.conductors and len({magnet.conductivity for magnet in after}) == 1
        lone = alone and magnified(before, after)
        if alone and "rotor.conductivity_S_m" in offsets:
            ratio = float(after[0].conductivity / before[0].conductivity)  # type: ignore[operator]
            found = replace(losses, weights=losses.weights * np.sqrt(ratio))
        if lone:
            return MovedLosses(found, before[0], after[0], lone[0])
        for key, offset in offsets.items():
            if key.startswith("rotor.") and not key.endswith(
                ("remanence_T", "recoil_permeability", "rotor.conductivity_S_m")
            ):
                ends = self._ends_of("losses", key, losses, lambda there: cached_rotor_losses(there, note)[0])
                found = _Line(found, *ends[:2], offset / ends[2])
        return found

    def _plate(self, scene: Scene, offsets: Mapping[str, float]) -> PlateMemory | None:
        memory = self.levitation.plate
        assert memory is not None
        assert scene.plate is not None
        if "plate.conductivity_S_m" in offsets:
            rates = memory.table.rates * (memory.plate.conductivity / scene.plate.conductivity)
            memory = replace(memory, table=replace(memory.table, rates=rates))
        if "rotor.remanence_T" in offsets:
            strong = float(np.linalg.norm(scene.rotor[0].polarization)) / self._strength
            memory = replace(memory, share=replace(memory.share, series=strong * memory.share.series))
        if any(key.startswith(("plate.center_mm", "plate.rotation_deg")) for key in offsets):
            memory = replace(memory, plate=replace(memory.plate, body=scene.plate.body))
        moves = {key: offset for key, offset in offsets.items() if _moves_rotor(key)}
        if moves:  # about a plate that has not gone down
            series = memory.share.series @ memory.share.by_depth(0.0)
            series = series + sum(offset * self._shares[key] for key, offset in moves.items())
            memory = replace(memory, share=replace(memory.share, distance=0.0, series=series[:, :, None]))
        return memory

    @cached_property
    def _shares(self) -> dict[str, Array]:
        return {}

    def prepare(self, keys: Sequence[str]) -> None:
        """Differentiate the rotor's share of the plate's signals by keys that move both against each other."""
        wanted = [key for key in keys if _moves_rotor(key)] if self.with_plate else []
        memory, requested = self.levitation.plate, self.levitation.requested_plate
        table = self.levitation.table
        if not wanted or memory is None or requested is None or not isinstance(table, RotorTable):
            return
        numbers, others, widths = scene_numbers(self.scene)[1], list[tuple[Plate, RotorTable]](), list[float]()
        for key in wanted:
            step = 2 * self.step(key, numbers[key])
            try:
                ends = [changed(self.scene, {key: numbers[key] + sign * step}) for sign in (1, -1)]
            except SceneError:  # it has an end here
                ends, step = [changed(self.scene, {key: numbers[key] + step}), self.scene], step / 2
            widths.append(2 * step)
            for scene in ends:
                assert scene.plate is not None
                others.append((replace(memory.plate, body=scene.plate.body), changed_table(table, scene.rotor)))
        note("The rotor's share of the plate's currents by what moves both ...")
        found = requested.changed_shares((memory.table, memory.share), others, note)
        for key, width, above, below in zip(wanted, widths, found[::2], found[1::2], strict=True):
            self._shares[key] = (above - below) / width

    def _ends_of(self, name: str, key: str, base: Any, make: Callable[[Scene], Any]) -> tuple[Any, Any, float]:
        """Tables that are made at `WIDE` steps to both sides of a number, and the way between."""
        if (name, key) not in self._ends:
            value = scene_numbers(self.scene)[1][key]
            wide = WIDE / STEP * self.step(key, value)
            try:
                first, last = (make(changed(self.scene, {key: value + s * wide})) for s in (-1, 1))
                self._ends[name, key] = first, last, 2 * wide
            except SceneError:  # it has an end here
                self._ends[name, key] = base, make(changed(self.scene, {key: value + wide})), wide
        return self._ends[name, key]

    @cached_property
    def _ends(self) -> dict[tuple[str, str], tuple[Any, Any, float]]:
        return {}


@dataclass(frozen=True, eq=False)
class _Line:
    """A table between others: the numbers of `base` and a share of what two others differ by."""

    base: Any
    first: Any
    last: Any
    share: float

    @property
    def polarizability(self) -> float:
        return float(self.base.polarizability)

    def derivatives(self, places: Array, moments: Array) -> tuple[Array, ...]:
        """See `MutualTable`."""
        parts = (table.derivatives(places, moments) for table in (self.base, self.first, self.last))
        return tuple(a + self.share * (c - b) for a, b, c in zip(*parts, strict=True))

    def products(self, places: Array) -> Array:
        """See `RotorLosses`."""
        base, first, last = (table.products(places) for table in (self.base, self.first, self.last))
        return np.asarray(base + self.share * (last - first))


@documented
def gradient(
    scene: SceneLike,
    of: Sequence[str] | None = None,
    by: Sequence[str] | None = None,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    progress: bool | None = None,
    **requested: Unpack[Requested],
) -> xr.Dataset:
    """Derivatives of all equilibria, and of their modes, by numbers of the scene file, without searching anew.

    Parameters
    ----------
    of : sequence of str, optional
        "distance", "lateral_offset", "polar_angle", "lag", "position", "growth", "mode_growth" and "mode_frequency",
        left out, all these; "lowest_frequency" and "highest_frequency", ends of the stable range (Hz, over `key`).
    by : sequence of str, optional
        Dotted keys of numbers, as `rotor.edge_mm` or `plate.center_mm.2`; left out, all that the scene has.

    Returns
    -------
    xarray.Dataset
        Over `equilibrium` and `key`: SI units and degrees per unit of the key, which is the coordinate `unit`; NaN
        where there is no derivative, as at a fold, with the reasons in the attribute `not_known`.

    Raises
    ------
    EquilibriumError
        There is no equilibrium.

    Examples
    --------
    >>> import spinlev as sl
    >>> cube = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
    >>> ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    >>> scene = sl.scene(frequency_hz=130.0, rotor=cube, floater=ball)
    >>> found = sl.gradient(scene, ["distance"], ["rotor.edge_mm"], model="dipole").isel(equilibrium=0)
    >>> round(1e3 * float(found.distance[0]), 3)  # mm by mm
    1.573
    """
    levitation = Levitation(scene, Models(model, plate_model, **requested), spin)
    found = Gradient(levitation)
    names, keys = checked_answers(of), found.checked_keys(by)
    if not levitation.equilibria:
        raise EquilibriumError(f"At {levitation.scene.frequency:g} Hz the floater has no equilibrium to differentiate.")
    return found.dataset(levitation.equilibria, names, keys).assign_attrs(scene=scene_text(levitation.scene))


def checked_answers(of: Sequence[str] | None) -> list[str]:
    """The answers asked for, or all of an equilibrium. Raises InputError for one that has no derivatives."""
    return list(ANSWERS) if of is None else _checked("of", of, [*ANSWERS, *ENDS], "answers that have derivatives")


def _checked(name: str, given: Sequence[str], known: Collection[str], what: str) -> list[str]:
    """The names `given` as an argument; InputError unless each is `known`, which all are `what`."""
    if isinstance(given, str) or not given or not all(isinstance(one, str) for one in given):
        raise InputError(f"Input {name} must be a list of {what}; instead received {shown(given)}.")
    for one in given:
        if one not in known:
            close = difflib.get_close_matches(one, known, n=1)
            hint = f"did you mean `{close[0]}`?" if close else f"allowed are {', '.join(known)}"
            raise InputError(f"Input {name} must name {what}; instead received {shown(one)} ({hint})")
    if len(set(given)) < len(given):
        raise InputError(f"Input {name} must name each once; instead received {shown(list(given))}.")
    return list(given)


def gradient_job(levitation: Levitation, out: Path) -> Answer:
    """Derivatives of all equilibria for JSON, those of the first as a table too; writes gradient.nc to `out`."""
    found = Gradient(levitation)
    if not levitation.equilibria:
        return {"gradient": []}, []
    result = found.dataset(levitation.equilibria, list(ANSWERS), found.checked_keys(None))
    write_dataset(result, out / "gradient.nc", levitation.scene)
    rows = [
        {
            str(key): {
                "unit": str(one["unit"].values),
                **{
                    f"{name}{IN_JSON[unit][0]}": float(one[name]) / IN_JSON[unit][1]
                    for name, (unit, _, dims) in ANSWERS.items()
                    if not dims
                },
                "modes": [
                    {
                        "name": str(m),
                        "growth_per_s": float(one["mode_growth"].sel(mode=m)),
                        "frequency_hz": float(one["mode_frequency"].sel(mode=m)),
                    }
                    for m in one["mode"].values
                ],
            }
            for key in each["key"].values
            for one in [each.sel(key=key)]
        }
        for each in (result.isel(equilibrium=k) for k in range(result.sizes["equilibrium"]))
    ]
    head = (
        "derivative of the first by",
        "unit",
        "distance (mm)",
        "polar angle (°)",
        "growth rate (s⁻¹)",
        "axial mode (Hz)",
    )
    first = result.isel(equilibrium=0)
    cells: list[tuple[str, ...]] = [head]
    for key in first["key"].values:
        one = first.sel(key=key)
        numbers = 1e3 * one["distance"], one["polar_angle"], one["growth"], one["mode_frequency"].sel(mode=MODES[0])
        cells.append((str(key), str(one["unit"].values), *(f"{float(number):.5g}" for number in numbers)))
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in cells]
    not_known = str(result.attrs["not_known"])
    return {"gradient": rows, "not_known": not_known}, [*lines, *([f"Derivatives: {not_known}."] if not_known else [])]
