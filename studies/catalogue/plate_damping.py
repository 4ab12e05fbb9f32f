"""What a plate does to each mode of the floater, against its place, conductivity, thickness, and the rotor."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ...dynamics.continuation.frequencies import StableRange, at_frequency, reference_state, stable_range
from ...dynamics.equilibria.equilibrium import Equilibrium, EquilibriumError, Survey
from ...dynamics.motion.equations import parameters
from ...dynamics.motion.plate import PlateForce, PlateMemory
from ...dynamics.motion.state import Scales, State
from ...geometry.common import Array
from ...geometry.scene.contents import Plate, Scene
from ...geometry.shapes import Box, rotation_matrix
from ..cli.options import PlateModel
from ..figures.style import PAGE, PALETTE, legend_below, panels, styled
from ..levitation import Levitation
from ..result import AXIS, MODES, Columns, columns, variable
from ..study import Point, Study, cases_with, each_case
from .article import (
    CONFIGURATIONS,
    PLATE_CONDUCTIVITY,
    PLATE_SIZE,
    article_scene,
    conducting,
    levitation_of,
    rotor_label,
)
from .drawing import explain, plain_log, range_text, small_multiples, text_table, uncertain

DISTANCE = 0.018  # Face below or beside the floater's centre in the sweeps over all else, m
CONFIGURATION, MEASURE, FREQUENCY = "tilt", 10.0, 130.0
"""The rotor of the sweeps over plates, that of the scene `tilt-over-plate`: tilt in degrees, Hz."""
REAL = (DISTANCE,)
"""Distances of the face at which the real plate, with its edges, is computed beside the infinite slab, m."""
FIELD_RTOL = 1e-4
MIDDLE = 0.5
ROTORS = ("rotors, below", "rotors, beside")  # Sweeps over the article's rotors


@dataclass(frozen=True)
class PlateCase:
    """One plate and rotor."""

    sweep: str  # what is varied
    value: float  # of that, SI; of a rotor its displacement (mm) or tilt (degrees)
    model: PlateModel = "slab"  # slab or reduced
    upright: bool = False  # beside the floater instead of below it
    distance: float = DISTANCE  # of the face from the floater's centre, m
    thickness: float = PLATE_SIZE[2]  # m
    conductivity: float = PLATE_CONDUCTIVITY  # S/m
    configuration: str = CONFIGURATION  # of the rotor
    measure: float = MEASURE
    # place of the rotor's frequency in its range of stable frequencies, 0 to 1; None: `FREQUENCY`
    part: float | None = None
    # rotor and floater magnetise each other and have eddy currents, in real air; else Stokes drag alone
    complete: bool = False

    def plate(self, place: Array) -> Plate:
        """The plate for a floater at `place` (3,) m."""
        size = np.array([*PLATE_SIZE[:2], self.thickness])
        away = self.distance + self.thickness / 2
        if self.upright:
            center = np.array([away, 0.0, place[2]])
            return Plate(Box(size, center, rotation_matrix((0.0, 90.0, 0.0))), self.conductivity)
        return Plate(Box(size, np.array([0.0, 0.0, place[2] - away])), self.conductivity)


def cases(quick: bool) -> list[PlateCase]:
    """The plates and rotors of the study."""
    few, real = (3, ()) if quick else (10, REAL)
    found = [PlateCase("below", d, distance=d) for d in (*np.geomspace(0.0085, 0.06, few).tolist(), *real)]
    found += [
        PlateCase("beside", d, upright=True, distance=d) for d in (*np.geomspace(0.01, 0.06, few).tolist(), *real)
    ]
    found += [PlateCase("conductivity", s, conductivity=s) for s in np.geomspace(1e6, 6e7, few).tolist()]
    found += [PlateCase("thickness", t, thickness=t) for t in np.geomspace(1e-3, 5e-2, few).tolist()]
    found += [PlateCase("frequency", p, part=p) for p in np.linspace(0.02, 0.98, 2 if quick else 9).tolist()]
    for sweep in ROTORS:
        for name, kind in CONFIGURATIONS.items():
            some = kind.levitated[1:2] if quick else kind.levitated
            beside = sweep == ROTORS[1]
            found += [PlateCase(sweep, m, upright=beside, configuration=name, measure=m, part=MIDDLE) for m in some]
    found += [PlateCase("below, real plate", d, "reduced", distance=d) for d in real]
    found += [PlateCase("beside, real plate", d, "reduced", upright=True, distance=d) for d in real]
    return [replace(case, complete=not quick) for case in found]


@cache
def _in_field(configuration: str, measure: float, complete: bool) -> Levitation:
    """A rotor in air, its field and compiled motion, once for all points that a process computes; without currents."""
    scene = article_scene(configuration, measure, FREQUENCY)
    return levitation_of(scene, "fem", FIELD_RTOL, "auto" if complete else "rigid")


@cache
def _stable_range(configuration: str, measure: float, complete: bool) -> StableRange:
    levitation = _in_field(configuration, measure, complete)
    return stable_range(levitation.scene, levitation.rates, *reference_state(levitation.scene))


@cache
def without_plate(
    configuration: str, measure: float, part: float | None, complete: bool
) -> tuple[Levitation, Equilibrium]:
    """A rotor's scene without plate, and its equilibrium that is stable but for the currents in rotor and floater.

    Parameters
    ----------
    configuration, measure, part, complete : as of a `PlateCase`

    Raises
    ------
    EquilibriumError : nothing levitates there
    """
    alone, frequency = _in_field(configuration, measure, complete), FREQUENCY
    if part is not None:
        stable = _stable_range(configuration, measure, complete)
        frequency = stable.low.parameter + part * (stable.high.parameter - stable.low.parameter)
        near = at_frequency(alone.scene, alone.rates, stable.near(frequency), frequency).distance
    else:
        near = next((e.distance for e in alone.equilibria if e.stable), np.nan)
    levitation = alone.elsewhere(frequency=frequency)
    if complete:
        scene = conducting(levitation.scene)
        whole = Levitation(replace(scene, drag=replace(scene.drag, air=True)), alone.models)
        whole.share(levitation)
        levitation = whole
    known = [e for e in levitation.equilibria if abs(e.distance - near) < 1e-6]
    if not known:
        raise EquilibriumError("There is no stable levitation without the plate.")
    return levitation, known[0]


RTOL = 3e-3


def damping_points(quick: bool) -> list[Point]:
    """The plates and rotors as points of the study."""
    return [asdict(case) for case in cases(quick)]


def plate_damping(point: Point) -> xr.Dataset:
    """Levitation of a rotor of the article beside or above one plate.

    Returns
    -------
    Dataset over `case`: growth and frequency of each mode, displacement, mean force, torque and loss; NaN where the
    plate undoes the equilibrium.  Plates are infinite slabs but for those called real.

    Raises
    ------
    EquilibriumError : nothing levitates even without the plate
    """
    case = PlateCase(**point)
    alone, start = without_plate(case.configuration, case.measure, case.part, case.complete)
    models = replace(alone.models, plate_model=case.model, plate_rtol=RTOL)
    beside = alone.elsewhere(models, plate=case.plate(start.position))
    beside.adopt(Survey((start,), ()))
    row, scene = _row(beside, start), alone.scene
    return xr.Dataset(
        {
            **columns(COLUMNS, row, mode=len(MODES), axis=len(AXIS)),
            "sweep": ((), case.sweep),
            "configuration": ((), case.configuration),
            "value": variable((), case.value, "SI, mm or °", "what is varied in the sweep"),
            "rotor_frequency": variable((), scene.frequency, "Hz", "frequency of the rotor"),
        },
        {"mode": list(MODES), "axis": list(AXIS)},
        {"weight_N": scene.floater.mass * 9.81, "plate_rtol": RTOL},
    ).expand_dims("case")


def gather_damping(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """The plates one after the other."""
    return xr.concat(parts, "case", data_vars="minimal", coords="minimal", compat="override", join="exact")


COLUMNS: Columns = {
    "growth": (("mode",), "1/s", "growth rate of a mode"),
    "growth_without": (("mode",), "1/s", "growth rate without a plate"),
    "frequency": (("mode",), "Hz", "frequency of a mode, rotor's frame"),
    "shift": (("axis",), "m", "displacement of the equilibrium by the plate"),
    "force": (("axis",), "N", "mean force of the plate on the floater"),
    "torque": (("axis",), "N m", "mean torque of the plate on the floater"),
    "loss": ((), "W", "heat in the plate, by floater and rotor"),
    "error": ((), "1", "estimated relative error of the plate's table"),
}


def plate_action(scene: Scene, memory: PlateMemory, equilibrium: Equilibrium) -> dict[str, ArrayLike]:
    """The plate's mean force (3,) N and torque (3,) N m, along the laboratory's axes, and the heat in it, W.

    Raises ValueError for an `equilibrium` of the `scene` that was found without the plate's currents (`memory`).
    """
    if equilibrium.turn is None or equilibrium.currents is None:
        raise ValueError("Input equilibrium must have been found with the plate's currents; instead received none.")
    scales, floater, count = Scales.of(scene), scene.floater, len(equilibrium.currents)
    times = 2 * np.pi * np.arange(count) / count
    coupling = PlateForce(memory, parameters(scene, scales, frozen_spin=True))(times, scales.pack(equilibrium.turn))
    root_energy = np.sqrt(floater.mass) * scales.length / scales.time
    currents = equilibrium.currents / root_energy - coupling.signals
    push = np.einsum("aix,ai->ax", coupling.fields, currents) / scales.time**2
    force, torque = push[:, :3] * floater.mass * scales.length, push[:, 3:] * floater.inertia
    lab = State(force, force, torque, torque).to_lab(times)
    loss = np.einsum("ai,i,ai->a", currents, memory.table.rates, currents).mean() * root_energy**2
    return {"force": lab.position.mean(axis=0), "torque": lab.moment.mean(axis=0), "loss": loss}


def _row(levitation: Levitation, start: Equilibrium) -> dict[str, ArrayLike]:
    memory, found = levitation.plate, levitation.equilibria
    row: dict[str, ArrayLike] = {"growth_without": [mode.growth_per_s for mode in start.modes]}
    if memory is None or not found or found[0].currents is None:
        return row
    return {
        **row,
        "growth": [mode.growth_per_s for mode in found[0].modes],
        "frequency": [mode.frequency_hz for mode in found[0].modes],
        "shift": found[0].position - start.position,
        **plate_action(levitation.scene, memory, found[0]),
        "error": max(memory.table.errors.total, memory.share.error),
    }


SWEEPS = {
    "below": ("Plate below", "distance of the face (mm)", 1e3),
    "beside": ("Plate standing beside", "distance of the face (mm)", 1e3),
    "frequency": ("Frequency", "frequency of the rotor (Hz)", 1.0),
    "conductivity": ("Conductivity", "conductivity (MS/m)", 1e-6),
    "thickness": ("Thickness", "thickness (mm)", 1e3),
}
DISTANCES = (10, 15, 20, 30, 40, 60)
PLACES, REAL_PLATE = ("below", "beside"), ", real plate"
ENDINGS = {"": ("infinite slab", "o-", None), REAL_PLATE: ("real plate", "s", "none")}
"""By the ending of a sweep's name: what the plate is, its marks and their face."""
MEANS = {
    "moved": ("Equilibrium moved by", "displacement (mm)"),
    "lift": ("Mean force, up", "of the weight (%)"),
    "torque": ("Braking torque on the floater", "torque (µN m)"),
    "loss": ("Loss in the plate", "loss (mW)"),
}
"""Titles and labels of what `means` gives."""


def means(part: xr.Dataset) -> dict[str, xr.DataArray]:
    """What a plate does on average: displacement (mm), force up (% of the weight), braking torque (µN m), loss (mW)."""
    return {
        "moved": 1e3 * (part["shift"] ** 2).sum("axis", skipna=False) ** 0.5,
        "lift": 100 * part["force"].sel(axis="z") / float(part.attrs["weight_N"]),
        "torque": -1e6 * part["torque"].sel(axis="z"),
        "loss": 1e3 * part["loss"],
    }


@styled
def growth_figure(result: xr.Dataset, sweeps: Sequence[str]) -> Figure:
    """Damping rate of each mode in some sweeps, a panel each; open: it grows instead."""
    titles, ylabel = [SWEEPS[sweep][0] for sweep in sweeps], "damping rate (1/s)"
    figure, axes = small_multiples(titles, 3.0, 3, "", ylabel, sharey=True)
    for panel, sweep in zip(axes, sweeps, strict=True):
        for ending, (_, style, fill) in ENDINGS.items():
            part = part_of(result, sweep + ending)
            varied = part["rotor_frequency"] if sweep == "frequency" else part["value"] * SWEEPS[sweep][2]
            for mode, color in zip(result["mode"].values, PALETTE, strict=False):
                growth = part["growth"].sel(mode=mode)
                _damped(panel, varied, growth, part["error"], style, color, fill or color)
                if not ending:
                    explain(panel, {str(mode): "-"}, color=color)
        panel.set_xlabel(SWEEPS[sweep][1])
        if sweep in PLACES:
            plain_log(panel, DISTANCES)
        elif sweep != "frequency":
            panel.set_xscale("log")
        for words, style, fill in ENDINGS.values():
            explain(panel, {words: style}, mfc=fill, ms=4)
        explain(panel, {"growth rate (unstable)": "x"}, ms=4)
    legend_below(figure, axes[0])
    return figure


def _damped(
    axes: Axes, x: ArrayLike, growth: xr.DataArray, error: ArrayLike, style: str, color: str, fill: str
) -> None:
    """Damping rates with their errors, and as crosses the growth rates of what is not damped, on one log axis."""
    style_of: Any = {"fmt": style, "color": color, "mfc": fill, "ms": 4}
    axes.errorbar(x, -growth.where(growth < 0), yerr=np.abs(growth) * error, **style_of)
    axes.plot(x, growth.where(growth >= 0), "x", color=color, ms=5)
    axes.set_yscale("log")


@styled
def rotors_figure(result: xr.Dataset) -> Figure:
    """Damping rate of the least stable mode of every rotor of the article, plate below and beside."""
    figure, ((axes,),) = panels(1, 1, (PAGE, 3.4))
    for sweep, marker, color in zip(ROTORS, "os", PALETTE, strict=False):
        part = part_of(result, sweep)
        worst, places = part["growth"].max("mode"), np.arange(part.sizes["case"])
        _damped(axes, places, worst, part["error"], marker, color, color)
        explain(axes, {f"plate {sweep.split(', ')[1]}": marker}, color=color, ms=4)
        rotors = zip(part["configuration"].values, part["value"].values, strict=True)
        axes.set_xticks(places, [rotor_label(str(name), float(value)) for name, value in rotors], rotation=90)
    explain(axes, {"growth rate (unstable)": "x"}, ms=5)
    axes.set(title="Rotors of the article, plate at 18 mm", ylabel="damping rate of the\nleast stable mode (1/s)")
    legend_below(figure, axes)
    return figure


@styled
def means_figure(result: xr.Dataset) -> Figure:
    """What the plate does on average: it moves the floater, pushes it, brakes it and is warmed."""
    titles = [title for title, _ in MEANS.values()]
    figure, axes = small_multiples(titles, 2.2, 2, "distance of the face (mm)", sharex=True)
    for panel, name in zip(axes, MEANS, strict=True):
        for place, line, color in zip(PLACES, ("-", "--"), PALETTE, strict=False):
            for ending, (words, style, fill) in ENDINGS.items():
                part = part_of(result, place + ending)
                values, marks = means(part)[name], style[0] if ending else f"{style[0]}{line}"
                more: Any = {"ms": 4, "color": color, "mfc": fill or color, "label": f"{place}, {words}"}
                panel.errorbar(1e3 * part["value"], values, np.abs(values) * part["error"], fmt=marks, **more)
        panel.set(ylabel=MEANS[name][1], yscale="linear" if name == "lift" else "log")
        plain_log(panel, DISTANCES)
    legend_below(figure, axes[0])
    return figure


FIGURES: dict[str, Callable[[xr.Dataset], Figure]] = {
    "plate-damping-distance": partial(growth_figure, sweeps=PLACES),
    "plate-damping-material": partial(growth_figure, sweeps=("frequency", "conductivity", "thickness")),
    "plate-damping-rotors": rotors_figure,
    "plate-damping-means": means_figure,
}


def part_of(result: xr.Dataset, sweep: str) -> xr.Dataset:
    """The cases of one sweep, in ascending order of what is varied."""
    part = cases_with(result, sweep=sweep)
    return part if sweep in ROTORS else part.sortby("value")


def damping_lines(result: xr.Dataset) -> list[str]:
    """What the plate does at each place, frequency and rotor; and the sentence."""
    rows = []
    for sweep in (*PLACES, *(place + REAL_PLATE for place in PLACES), "frequency", *ROTORS):
        for one in each_case(part_of(result, sweep)):
            value, configuration = float(one["value"]), str(one["configuration"].values)
            where = f"plate {sweep}, face at {1e3 * value:.1f} mm"
            if sweep in ROTORS:
                where = f"{rotor_label(configuration, value)}, plate {sweep.split(', ')[1]}"
            elif sweep == "frequency":
                where = f"plate {1e3 * DISTANCE:g} mm below"
            frequency, before = f"{float(one['rotor_frequency']):.1f}", f"{float(one['growth_without'].max()):+.1g}"
            worst = float(one["growth"].max("mode"))
            if np.isnan(worst):
                rows.append((where, frequency, "no equilibrium", "", before, *[""] * len(MEANS)))
                continue
            mode = str(one["mode"].values[int(one["growth"].argmax("mode"))])
            rate = uncertain(worst, abs(worst) * float(one["error"]))
            rows.append((where, frequency, mode, rate, before, *(f"{float(v):.3g}" for v in means(one).values())))
    head = (
        "where",
        "rotor (Hz)",
        "least stable mode",
        "growth (1/s)",
        "without plate",
        *(w for _, w in MEANS.values()),
    )
    return [*text_table(head, rows), sentence(result)]


def sentence(result: xr.Dataset) -> str:
    """The answer in one sentence: ranges over the article's rotors, each with the largest error."""
    words = []
    for sweep, place in zip(ROTORS, ("below the floater", "standing beside it"), strict=True):
        part = part_of(result, sweep)
        error, worst = part["error"], part["growth"].max("mode")
        kept, gone = int((worst < 0).sum()), int(worst.isnull().sum())
        lost = f", {gone} without an equilibrium" if gone else ""
        words.append(
            f"{place} to {range_text(worst, abs(worst) * error)} /s ({kept} of {part.sizes['case']} stable{lost})"
        )
    before = part_of(result, ROTORS[0])["growth_without"].max("mode").values
    return (
        f"The plate (infinite slab of 30 mm aluminium, face {DISTANCE * 1e3:g} mm from the floater's centre) changes "
        f"the growth rate of the least stable mode of the article's rotors, amid their stable frequencies, from "
        f"{before.min():+.1g} to {before.max():+.1g} /s: {'; '.join(words)}."
    )


STUDY = Study(
    name="plate-damping",
    summary="what a plate does to each mode, against its place, conductivity and thickness",
    points=damping_points,
    compute=plate_damping,
    gather=gather_damping,
    figures=FIGURES,
    report=damping_lines,
)
