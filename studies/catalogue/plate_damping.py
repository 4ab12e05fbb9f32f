"""The plates and rotors of the study of the plate's damping, and where the floater levitates without a plate."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import ArrayLike

from ...dynamics.continuation.frequencies import StableRange, at_frequency, reference_state, stable_range
from ...dynamics.equilibria.equilibrium import Equilibrium, EquilibriumError, Survey
from ...dynamics.equilibria.perturbed import plate_action
from ...geometry.common import Array
from ...geometry.scene.contents import Plate
from ...geometry.shapes import Box, rotation_matrix
from ..cli.options import PlateModel
from ..figures.style import PAGE, PALETTE, legend_below, panels, styled
from ..levitation import Levitation
from ..result import AXIS, MODES, Columns, columns, variable
from ..study import Point, Study, cases_with
from .article import (
    CONFIGURATIONS,
    PLATE_CONDUCTIVITY,
    PLATE_SIZE,
    article_scene,
    conducting,
    levitation_of,
    rotor_label,
)
from .dipole_vs_fem import range_text

DISTANCE = 0.018
"""Face below or beside the floater's centre in the sweeps over all else, m."""
CONFIGURATION, MEASURE, FREQUENCY = "tilt", 10.0, 130.0
"""The rotor of the sweeps over plates, that of the scene `tilt-over-plate`: tilt in degrees, Hz."""
REAL = (DISTANCE,)
"""Distances of the face at which the real plate, with its edges, is computed beside the infinite slab, m."""
FIELD_RTOL = 1e-4
MIDDLE = 0.5
ROTORS = ("rotors, below", "rotors, beside")
"""Sweeps over the article's rotors."""


@dataclass(frozen=True)
class PlateCase:
    """One plate and rotor.

    Parameters
    ----------
    sweep : what is varied
    value : of that, SI; of a rotor its displacement (mm) or tilt (degrees)
    model : slab or reduced
    upright : beside the floater instead of below it
    distance : of the face from the floater's centre, m
    thickness : m
    conductivity : S/m
    configuration, measure : of the rotor
    part : place of the rotor's frequency in its range of stable frequencies, 0 to 1; None: `FREQUENCY`
    complete : rotor and floater magnetise each other and have eddy currents, in real air; else Stokes drag alone
    """

    sweep: str
    value: float
    model: PlateModel = "slab"
    upright: bool = False
    distance: float = DISTANCE
    thickness: float = PLATE_SIZE[2]
    conductivity: float = PLATE_CONDUCTIVITY
    configuration: str = CONFIGURATION
    measure: float = MEASURE
    part: float | None = None
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


def without_plate(case: PlateCase) -> tuple[Levitation, Equilibrium]:
    """A case's scene without plate, and its equilibrium that is stable but for the currents in rotor and floater.

    Raises
    ------
    EquilibriumError : nothing levitates there
    """
    return _without_plate(case.configuration, case.measure, case.part, case.complete)


@cache
def _without_plate(
    configuration: str, measure: float, part: float | None, complete: bool
) -> tuple[Levitation, Equilibrium]:
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
    alone, start = without_plate(case)
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
    "growth": (("mode",), "1/s", "growth rate of a small motion"),
    "growth_without": (("mode",), "1/s", "growth rate without a plate"),
    "frequency": (("mode",), "Hz", "frequency of a small motion, rotor's frame"),
    "shift": (("axis",), "m", "displacement of the equilibrium by the plate"),
    "force": (("axis",), "N", "mean force of the plate on the floater"),
    "torque": (("axis",), "N m", "mean torque of the plate on the floater"),
    "loss": ((), "W", "heat in the plate, by floater and rotor"),
    "error": ((), "1", "estimated relative error of the plate's table"),
}


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
        **vars(plate_action(levitation.scene, memory, found[0])),
        "error": max(memory.table.errors.total, memory.share.error),
    }


SWEEPS = {
    "below": ("Plate below", "distance of the face from the floater's centre (mm)", 1e3),
    "beside": ("Plate standing beside", "distance of the face from the floater's centre (mm)", 1e3),
    "frequency": ("Frequency", "frequency of the rotor (Hz)", 1.0),
    "conductivity": ("Conductivity", "conductivity (MS/m)", 1e-6),
    "thickness": ("Thickness", "thickness (mm)", 1e3),
}
DISTANCES = (10, 15, 20, 30, 40, 60)
LIMITS = (8.0, 66.0)
"""Of the axis of distances, mm."""
MODELS = {"": ("infinite slab", "o-", 3.0), ", real plate": ("real plate", "s", 6.0)}
"""By the ending of a sweep's name: what the plate is, its marks and their size."""
LINEAR = 0.1
"""Growth rates below this are drawn on a linear scale, 1/s."""
MEANS = (
    ("Equilibrium moved by", "displacement (mm)"),
    ("Mean force, up", "of the weight (%)"),
    ("Braking torque on the floater", "torque (µN m)"),
    ("Loss in the plate", "loss (mW)"),
)
"""Titles and labels of what `means` gives."""
LIFT = 1
"""Which of them has both signs."""


def means(part: xr.Dataset) -> tuple[Array, Array, Array, Array]:
    """What a plate does on average: displacement (mm), force up (% of the weight), braking torque (µN m), loss (mW)."""
    moved = 1e3 * np.linalg.norm(part["shift"].values, axis=-1)
    lift = 100 * part["force"].sel(axis="z").values / float(part.attrs["weight_N"])
    return np.asarray(moved), lift, -1e6 * part["torque"].sel(axis="z").values, 1e3 * part["loss"].values


@styled
def places_figure(result: xr.Dataset) -> Figure:
    """Growth of each small motion against the plate's distance, below the floater and beside it."""
    figure, axes = _growths(result, ("below", "beside"))
    for ending, (name, style, size) in MODELS.items():
        if part_of(result, f"below{ending}").sizes["case"]:
            axes[0].plot([], [], style, ms=size, mfc="none" if ending else "0.3", color="0.3", label=name)
    legend_below(figure, axes[0], columns=7)
    _mark_distances(axes)
    return figure


@styled
def materials_figure(result: xr.Dataset) -> Figure:
    """Growth of each small motion against frequency, conductivity and thickness, plate 18 mm below the floater."""
    figure, axes = _growths(result, ("frequency", "conductivity", "thickness"))
    legend_below(figure, axes[0])
    return figure


@styled
def rotors_figure(result: xr.Dataset) -> Figure:
    """Growth of the least damped motion of every rotor of the article, plate below and beside."""
    figure, ((axes,),) = panels(1, 1, (0.7 * PAGE, 3.0))
    _rotors(axes, result)
    return figure


@styled
def means_figure(result: xr.Dataset) -> Figure:
    """What the plate does on average: it moves the floater, pushes it, brakes it and is warmed."""
    figure, axes = panels(2, 2, (0.8 * PAGE, 4.4), sharex=True)
    for number, (panel, (title, words)) in enumerate(zip(axes.flat, MEANS, strict=True)):
        _mean(panel, result, number)
        panel.set(title=title, ylabel=words, yscale="linear" if number == LIFT else "log")
    _mark_distances(axes.ravel())
    for panel in axes[1]:
        panel.set_xlabel("distance of the face (mm)")
    legend_below(figure, axes[0, 0])
    return figure


FIGURES = {
    "plate-damping-distance": places_figure,
    "plate-damping-material": materials_figure,
    "plate-damping-rotors": rotors_figure,
    "plate-damping-means": means_figure,
}


def _growths(result: xr.Dataset, sweeps: Sequence[str]) -> tuple[Figure, Any]:
    """A panel for each sweep."""
    figure, (axes,) = panels(1, len(sweeps), (PAGE, 3.2), sharey=True)
    for panel, sweep in zip(axes, sweeps, strict=True):
        title, words, scale = SWEEPS[sweep]
        _growth(panel, result, sweep, scale)
        panel.set(title=title, xlabel=words)
    axes[0].set_ylabel("growth rate (1/s)")
    return figure, axes


def _mark_distances(panels: Iterable[Axes]) -> None:
    """The same marks on each, whatever was drawn: first none may choose limits by itself."""
    for axes in panels:
        axes.autoscale(enable=False, axis="x")
    for axes in panels:
        axes.set(xlim=LIMITS, xscale="log")
        axes.set_xticks(DISTANCES, [f"{d:g}" for d in DISTANCES])
        axes.xaxis.set_minor_locator(NullLocator())


def part_of(result: xr.Dataset, sweep: str) -> xr.Dataset:
    """The cases of one sweep, in ascending order of what is varied."""
    part = cases_with(result, sweep=sweep)
    return part if sweep in ROTORS else part.sortby("value")


def _growth(axes: Axes, result: xr.Dataset, sweep: str, scale: float) -> None:
    for ending, (_, style, size) in MODELS.items():
        part = part_of(result, sweep + ending)
        varied = part["rotor_frequency" if sweep == "frequency" else "value"].values * scale
        for mode, color in zip(result["mode"].values, PALETTE, strict=False):
            growth, error = part["growth"].sel(mode=mode).values, part["error"].values
            axes.errorbar(
                varied, growth, yerr=np.abs(growth) * error, fmt=style, ms=size,
                mfc="none" if ending else color, color=color, label=None if ending else str(mode),
            )  # fmt: skip
    axes.set_xscale("linear" if sweep == "frequency" else "log")
    axes.set_yscale("symlog", linthresh=LINEAR)
    axes.margins(y=0.12)
    axes.axhline(0.0, color="0.3", lw=0.8)


def _rotors(axes: Axes, result: xr.Dataset) -> None:
    """Growth of the least damped motion of each rotor, plate below and beside."""
    for sweep, marker, color in zip(ROTORS, "os", PALETTE, strict=False):
        part = part_of(result, sweep)
        worst, error = part["growth"].max("mode").values, part["error"].values
        places = np.arange(part.sizes["case"])
        axes.errorbar(places, worst, np.abs(worst) * error, fmt=marker, ms=4, color=color, label=sweep.split(", ")[1])
        gone = places[np.isnan(worst)]
        axes.plot(gone, 0 * gone, "x", color=color, label="no equilibrium is left" if len(gone) else None)
        rotors = zip(part["configuration"].values, part["value"].values, strict=True)
        names = [rotor_label(str(configuration), float(value)) for configuration, value in rotors]
        axes.set_xticks(places, names, rotation=90, fontsize=7)
    axes.set_yscale("symlog", linthresh=LINEAR)
    axes.axhline(0.0, color="0.3", lw=0.8)
    axes.set(title="Rotors of the article, plate at 18 mm", ylabel="growth of the least\ndamped motion (1/s)")
    axes.margins(x=0.08, y=0.12)
    axes.legend()


def _mean(axes: Axes, result: xr.Dataset, number: int) -> None:
    for sweep, style, color in (("below", "o-", PALETTE[0]), ("beside", "s--", PALETTE[1])):
        for ending, fill, line in (("", color, style), (", real plate", "none", style[0])):
            part = part_of(result, sweep + ending)
            if part.sizes["case"]:
                values, error = means(part)[number], part["error"].values
                axes.errorbar(
                    part["value"].values * 1e3, values, np.abs(values) * error, fmt=line, ms=6 if ending else 3,
                    color=color, mfc=fill, label=f"{sweep}{ending}",
                )  # fmt: skip


PLACES = ("below", "beside")
REAL_ = ", real plate"


def damping_lines(result: xr.Dataset) -> list[str]:
    """What the plate does at each place, frequency and rotor; what the infinite slab misses; and the sentence."""
    lines = []
    for sweep in (*PLACES, *(place + REAL_ for place in PLACES), "frequency", *ROTORS):
        part = part_of(result, sweep)
        lines += [_line(part.isel(case=k), sweep) for k in range(part.sizes["case"])]
    return [*lines, *_edges(result), sentence(result)]


def _line(one: xr.Dataset, sweep: str) -> str:
    value, configuration = float(one["value"]), str(one["configuration"].values)
    if sweep in ROTORS:
        where = f"{rotor_label(configuration, value)}, plate {sweep.split(', ')[1]}"
    elif sweep == "frequency":
        where = "Plate 18 mm below"
    else:
        where = f"Plate {sweep}, face at {value * SWEEPS['below'][2]:.1f} mm"
    where += f", {float(one['rotor_frequency']):.1f} Hz: "
    worst = float(one["growth"].max("mode"))
    if np.isnan(worst):
        return f"{where}no equilibrium is left."
    mode = str(one["mode"].values[int(one["growth"].argmax("mode"))])
    moved, lift, torque, loss = means(one)
    return (
        f"{where}{'stable' if worst < 0 else 'UNSTABLE'}, least damped motion {mode} {worst:+.3g} ± "
        f"{abs(worst) * float(one['error']):.1g} /s (without the plate {float(one['growth_without'].max()):+.1g} /s); "
        f"moved {moved:.3f} mm; mean force up {lift:+.3g} % of the weight; braking torque {torque:.3g} µN m; "
        f"loss {loss:.3g} mW."
    )


def _edges(result: xr.Dataset) -> list[str]:
    """What the infinite slab misses where the real plate was computed at the same place."""
    lines = []
    for place in PLACES:
        real, slab = part_of(result, place + REAL_), part_of(result, place)
        for value in real["value"].values:
            pair = [float(p["growth"].sel(case=p["value"] == value).max()) for p in (real, slab)]
            lines.append(
                f"Real plate {place}, face at {value * 1e3:.1f} mm: least damped motion {pair[0]:+.4g} /s; as an "
                f"infinite slab {pair[1]:+.4g} /s ({100 * (pair[1] / pair[0] - 1):+.2g} %)."
            )
    return lines


def sentence(result: xr.Dataset) -> str:
    """The answer in one sentence: ranges over the article's rotors, each with the largest error."""
    words = []
    for sweep, place in zip(ROTORS, ("below the floater", "standing beside it"), strict=True):
        part = part_of(result, sweep)
        error, worst = part["error"], part["growth"].max("mode")
        moved = (part["shift"] ** 2).sum("axis", skipna=False) ** 0.5
        lift = 100 * part["force"].sel(axis="z") / float(result.attrs["weight_N"])
        torque = -1e6 * part["torque"].sel(axis="z")
        kept, gone = int((worst < 0).sum()), int(worst.isnull().sum())
        lost = f", {gone} without an equilibrium" if gone else ""
        words.append(
            f"{place} to {range_text(worst, abs(worst) * error)} /s ({kept} of {part.sizes['case']} stable{lost}), "
            f"moving it by {range_text(moved, moved * error, 1e3)} mm, with a mean force up of "
            f"{range_text(lift, abs(lift) * error)} % of its weight and a braking torque of "
            f"{range_text(torque, abs(torque) * error)} µN m"
        )
    before = part_of(result, next(iter(ROTORS)))["growth_without"].max("mode").values
    return (
        f"The plate (infinite slab of 30 mm aluminium, face {DISTANCE * 1e3:g} mm from the floater's centre) changes "
        f"the growth of the least damped small motion of the article's rotors, in the middle of their stable "
        f"frequencies, from {before.min():+.1g} to {before.max():+.1g} /s: {'; '.join(words)}."
    )


STUDY = Study(
    name="plate-damping",
    summary="what a plate does to each small motion, against its place, conductivity and thickness",
    points=damping_points,
    compute=plate_damping,
    gather=gather_damping,
    figures=FIGURES,
    report=damping_lines,
)
