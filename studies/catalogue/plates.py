"""What a conducting plate does to a floater, and its eddy currents against a measurement."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from importlib.resources import files
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ...dynamics.continuation.frequencies import StableRange, at_frequency
from ...dynamics.equilibria.equilibrium import Equilibrium, EquilibriumError
from ...dynamics.equilibria.perturbed import plate_action
from ...fem.closed_forms.potentials import Dipole, Racetrack
from ...fem.plate.eddy import solve_eddy
from ...geometry.common import Array
from ...geometry.meshes.plate import Block, ConductorMesh, graded_partition, hex_mesh, skin_depth
from ...geometry.scene.contents import Plate
from ...geometry.shapes import Box, rotation_matrix
from ..cli.options import PlateModel
from ..figures.style import PALETTE, drawn, panels, plain_log
from ..levitation import Levitation
from ..result import AXIS, MODES, Columns, columns, variable
from ..study import Point, Study, cases_with, each_case, study_of_one
from ..words import mode_words
from . import article, showing

# What a plate does to each mode of the floater, against its place, conductivity, thickness, and the rotor.
DISTANCE = 0.018  # Face below or beside the floater's centre in the sweeps over all else, m
FREQUENCY = 130.0  # Of the rotor of the sweeps over plates, that of the scene `tilt-over-plate`, Hz
FIELD_RTOL, RTOL = 1e-4, 3e-3  # Of the rotor's field and of the plate's reaction
ROTORS = ("rotors, below", "rotors, beside")  # Sweeps over the article's rotors
PLACES, REAL_PLATE = ("below", "beside"), ", real plate"


@dataclass(frozen=True)
class PlateCase:
    """One plate and rotor."""

    sweep: str  # what is varied
    value: float  # of that, SI; of a rotor its displacement (mm) or tilt (degrees)
    model: PlateModel = "slab"  # slab or reduced
    upright: bool = False  # beside the floater instead of below it
    distance: float = DISTANCE  # of the face from the floater's centre, m
    thickness: float = article.PLATE_SIZE[2]  # m
    conductivity: float = article.PLATE_CONDUCTIVITY  # S/m
    configuration: str = "tilt"  # of the rotor
    measure: float = 10.0
    # place of the rotor's frequency in its range of stable frequencies, 0 to 1; None: `FREQUENCY`
    part: float | None = None
    # rotor and floater magnetise each other and have eddy currents, in real air; else Stokes drag alone
    complete: bool = False

    def plate(self, place: Array) -> Plate:
        size, away = np.array([*article.PLATE_SIZE[:2], self.thickness]), self.distance + self.thickness / 2
        center = np.array([away, 0.0, place[2]] if self.upright else [0.0, 0.0, place[2] - away])
        return Plate(Box(size, center, rotation_matrix((0.0, 90.0 * self.upright, 0.0))), self.conductivity)


def cases(quick: bool) -> list[PlateCase]:
    """The plates and rotors of the study; the real plate, with its edges, at one distance beside the infinite slab."""
    few, real = (3, ()) if quick else (10, (DISTANCE,))
    found: list[PlateCase] = []
    for sweep, nearest, upright in (("below", 0.0085, False), ("beside", 0.01, True)):
        places = (*np.geomspace(nearest, 0.06, few).tolist(), *real)
        found += [PlateCase(sweep, d, upright=upright, distance=d) for d in places]
    found += [PlateCase("conductivity", s, conductivity=s) for s in np.geomspace(1e6, 6e7, few).tolist()]
    found += [PlateCase("thickness", t, thickness=t) for t in np.geomspace(1e-3, 5e-2, few).tolist()]
    found += [PlateCase("frequency", p, part=p) for p in np.linspace(0.02, 0.98, 2 if quick else 9).tolist()]
    for sweep, upright in zip(ROTORS, (False, True), strict=True):
        rotors = article.levitated_rotors(quick)
        found += [PlateCase(sweep, rotor["measure"], upright=upright, part=0.5, **rotor) for rotor in rotors]
    for place, upright in zip(PLACES, (False, True), strict=True):
        found += [PlateCase(place + REAL_PLATE, d, "reduced", upright, d) for d in real]
    return [replace(case, complete=not quick) for case in found]


@cache
def _in_air(configuration: str, measure: float, complete: bool) -> tuple[Levitation, StableRange]:
    """A rotor, its field and compiled motion, once for all points that a process computes; without currents."""
    scene = article.rotor_scene(configuration, measure, FREQUENCY)
    alone = article.levitation_of(scene, "fem", FIELD_RTOL, "auto" if complete else "rigid")
    return alone, article.stable_frequencies(scene, alone.rates)


@cache
def without_plate(
    configuration: str, measure: float, part: float | None, complete: bool
) -> tuple[Levitation, Equilibrium]:
    """A scene without plate, and its equilibrium that is stable but for the currents in rotor and floater.

    By `configuration`, `measure`, `part` and `complete` of a `PlateCase`; EquilibriumError where nothing levitates.
    """
    alone, stable = _in_air(configuration, measure, complete)
    frequency = FREQUENCY if part is None else float(article.within(stable, part))
    near = at_frequency(alone.scene, alone.rates, stable.near(frequency), frequency).distance
    levitation = alone.elsewhere(frequency=frequency, **(article.losses(alone.scene) if complete else {}))
    if (found := article.equilibrium_at(levitation, near)) is None:
        raise EquilibriumError("There is no stable levitation without the plate.")
    return levitation, found


COLUMNS: Columns = {
    "growth": (("mode",), "1/s", "growth rate of a mode"),
    "growth_without": (("mode",), "1/s", "growth rate without a plate"),
    "frequency": (("mode",), "Hz", "frequency of a mode, rotor's frame"),
    "shift": (("axis",), "m", "displacement of the equilibrium by the plate"),
    "force": (("axis",), "N", "mean force of the plate on the floater"),
    "torque": (("axis",), "N m", "mean torque of the plate on the floater"),
    "loss": ((), "W", "heat in the plate, by floater and rotor"),
    "error": ((), "1", "estimated relative error of the plate's table"),
    "value": ((), "SI, mm or °", "what is varied in the sweep"),
    "rotor_frequency": ((), "Hz", "frequency of the rotor"),
    "sweep": ((), "", "what is varied"),
    "configuration": ((), "", "rotor"),
}


def plate_damping(point: Point) -> xr.Dataset:
    case = PlateCase(**point)
    alone, start = without_plate(case.configuration, case.measure, case.part, case.complete)
    row: dict[str, Any] = {name: point[name] for name in ("value", "sweep", "configuration")}
    row |= {"growth_without": [mode.growth_per_s for mode in start.modes], "rotor_frequency": alone.scene.frequency}
    if found := article.over_plate(alone, start, case.plate(start.position), case.model, RTOL):
        beside, there, row["error"] = found
        assert beside.plate is not None
        row |= {"shift": there.position - start.position, **plate_action(beside.scene, beside.plate, there)}
        row["growth"], row["frequency"] = zip(*((m.growth_per_s, m.frequency_hz) for m in there.modes), strict=True)
    data = columns(COLUMNS, row, mode=len(MODES), axis=len(AXIS))
    said = {"weight_N": alone.scene.floater.mass * 9.81, "plate_rtol": RTOL}
    return xr.Dataset(data, {"mode": list(MODES), "axis": list(AXIS)}, said).expand_dims("case")


SWEEPS = {
    "below": ("plate below", "distance of the face (mm)", 1e3),
    "beside": ("plate standing beside", "distance of the face (mm)", 1e3),
    "frequency": ("frequency", "frequency of the rotor (Hz)", 1.0),
    "conductivity": ("conductivity", "conductivity (MS/m)", 1e-6),
    "thickness": ("thickness", "thickness (mm)", 1e3),
}
DISTANCES = (10, 15, 20, 30, 40, 60)
ENDINGS = {"": ("infinite slab", "o-", None), REAL_PLATE: ("real plate", "s", "none")}
"""By the ending of a sweep's name: what the plate is, its marks and their face."""
MEANS: dict[str, tuple[str, Callable[[xr.Dataset], xr.DataArray]]] = {
    "equilibrium moved": ("displacement (mm)", lambda of: 1e3 * (of["shift"] ** 2).sum("axis", skipna=False) ** 0.5),
    "mean force, up": ("of the weight (%)", lambda of: 100 * of["force"].sel(axis="z") / of.attrs["weight_N"]),
    "braking torque on the floater": ("torque (µN m)", lambda of: -1e6 * of["torque"].sel(axis="z")),
    "loss in the plate": ("loss (mW)", lambda of: 1e3 * of["loss"]),
}  # What a plate does on average, by title: its label, and its values of some cases


@drawn
def growth_figure(result: xr.Dataset, sweeps: Sequence[str]) -> Figure:
    """Damping rate of each mode against what is varied; crosses: it grows; bars: error of the plate's table."""
    titles = {SWEEPS[sweep][0]: sweep for sweep in sweeps}
    figure, rows = showing.small_multiples(titles, 3.0, 3, ylabel="damping rate (s⁻¹)", sharey=True)
    for panel, sweep in rows:
        for ending, (words, style, fill) in ENDINGS.items():
            part = part_of(result, sweep + ending)
            if not part.sizes["case"]:
                continue
            varied = part["rotor_frequency"] if sweep == "frequency" else part["value"] * SWEEPS[sweep][2]
            for mode, color in zip(result["mode"].values, PALETTE, strict=False):
                _damped(panel, varied, part["growth"].sel(mode=mode), part["error"], style, color=color, mfc=fill)
                showing.explain(panel, {mode_words(mode): "-"}, color=color)
            showing.explain(panel, {words: style}, mfc=fill, ms=4)
        panel.set_xlabel(SWEEPS[sweep][1])
        if sweep != "frequency":
            plain_log(panel.xaxis, DISTANCES if sweep in PLACES else ())
    return figure


def _damped(axes: Axes, x: ArrayLike, growth: xr.DataArray, error: ArrayLike, style: str, **look: Any) -> None:
    axes.errorbar(x, -growth.where(growth < 0), np.abs(growth) * error, fmt=style, ms=4, **look)
    axes.plot(x, growth.where(growth >= 0), "x", color=look["color"], ms=5)
    axes.set_yscale("log")
    if (growth >= 0).any():
        showing.explain(axes, {"growth rate (unstable)": "x"}, ms=5)


@drawn
def rotors_figure(result: xr.Dataset) -> Figure:
    """Damping rate of the least stable mode of every rotor of the article, plate below and beside, face at 18 mm."""
    figure, ((axes,),) = panels(1, 1, 3.4)
    for sweep, place, marker, color in zip(ROTORS, PLACES, "os", PALETTE, strict=False):
        part = part_of(result, sweep)
        places = np.arange(part.sizes["case"])
        _damped(axes, places, part["growth"].max("mode"), part["error"], marker, color=color)
        showing.explain(axes, {f"plate {place}": marker}, color=color, ms=4)
        rotors = zip(part["configuration"].values.tolist(), part["value"].values.tolist(), strict=True)
        axes.set_xticks(places, [article.rotor_label(*rotor).replace(" = ", "\n") for rotor in rotors])
    axes.set(xlabel="rotor; face of the plate at 18 mm", ylabel="damping rate of the\nleast stable mode (s⁻¹)")
    return figure


@drawn
def means_figure(result: xr.Dataset) -> Figure:
    """What the plate does on average: it moves the floater, pushes it, brakes it and is warmed."""
    figure, rows = showing.small_multiples(MEANS, 2.2, 2, "distance of the face (mm)", sharex=True)
    for panel, (label, mean) in rows:
        for place, line, color in zip(PLACES, ("-", "--"), PALETTE, strict=False):
            for ending, (words, style, fill) in ENDINGS.items():
                part = part_of(result, place + ending)
                if part.sizes["case"]:
                    values, marks = mean(part), style[0] if ending else f"{style[0]}{line}"
                    more: Any = {"ms": 4, "color": color, "mfc": fill, "label": f"{place}, {words}"}
                    panel.errorbar(1e3 * part["value"], values, np.abs(values) * part["error"], fmt=marks, **more)
        panel.set(ylabel=label, yscale="linear" if "weight" in label else "log")
        plain_log(panel.xaxis, DISTANCES)
    return figure


def part_of(result: xr.Dataset, sweep: str) -> xr.Dataset:
    """The cases of one sweep, in ascending order of what is varied."""
    part = cases_with(result, sweep=sweep)
    return part if sweep in ROTORS else part.sortby("value")


def _damping_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for sweep in (*PLACES, *(place + REAL_PLATE for place in PLACES), "frequency", *ROTORS):
        for one in each_case(part_of(result, sweep)):
            where, value = f"plate {sweep}, face at {1e3 * float(one['value']):.1f} mm", float(one["value"])
            if sweep in ROTORS:
                where = f"{article.rotor_label(one['configuration'].item(), value)}, plate {sweep.split(', ')[1]}"
            elif sweep == "frequency":
                where = f"plate {1e3 * DISTANCE:g} mm below"
            cells, worst = ["no equilibrium", "", *[""] * len(MEANS)], float(one["growth"].max("mode"))
            if np.isfinite(worst):
                mode = mode_words(one["mode"].values[int(one["growth"].argmax("mode"))])
                rate = showing.uncertain(worst, abs(worst) * one["error"])
                cells = [mode, rate, *(f"{float(mean(one)):.3g}" for _, mean in MEANS.values())]
            before = f"{float(one['growth_without'].max()):+.1g}"
            rows.append((where, f"{float(one['rotor_frequency']):.1f}", before, *cells))
    head = ("where", "rotor (Hz)", "growth without (s⁻¹)", "least stable mode", "growth (s⁻¹)")
    return [*showing.text_table((*head, *(label for label, _ in MEANS.values())), rows), sentence(result)]


def sentence(result: xr.Dataset) -> str:
    words = []
    for sweep, place in zip(ROTORS, ("below the floater", "standing beside it"), strict=True):
        part = part_of(result, sweep)
        worst = part["growth"].max("mode")
        kept, gone = int(article.stable_in_flight(worst).sum()), int(worst.isnull().sum())
        span = showing.range_text(worst, abs(worst) * part["error"])
        lost = f", {gone} without an equilibrium" if gone else ""
        words.append(f"{place} to {span} s⁻¹ ({kept} of {part.sizes['case']} stable{lost})")
    before = part_of(result, ROTORS[0])["growth_without"].max("mode").values
    return (
        f"The plate (infinite slab of 30 mm aluminium, face {DISTANCE * 1e3:g} mm from the floater's centre) changes "
        f"the growth rate of the least stable mode of the article's rotors, amid their stable frequencies, from "
        f"{before.min():+.1g} to {before.max():+.1g} s⁻¹: {'; '.join(words)}."
    )


PLATE_DAMPING = Study(
    name="plate-damping",
    summary="what a plate does to each mode, against its place, conductivity and thickness",
    quick="nine of twelve rotors, the real plate, most points of each sweep, eddy currents in rotor and floater",
    points=lambda quick: [asdict(case) for case in cases(quick)],
    compute=plate_damping,
    figures={
        "plate-damping-distance": partial(growth_figure, sweeps=PLACES),
        "plate-damping-material": partial(growth_figure, sweeps=("frequency", "conductivity", "thickness")),
        "plate-damping-rotors": rotors_figure,
        "plate-damping-means": means_figure,
    },
    report=_damping_lines,
)


# TEAM workshop problem 7: an asymmetrical conductor with a hole under a racetrack coil, against measurement.
#
# Aluminium 294 × 294 × 19 mm, σ = 3.526e7 S/m, with a hole of 108 × 108 mm whose corner is at (18, 18) mm; a coil
# of 2742 ampere-turns above it.  B_z was measured on the line y = 72, z = 34 mm at 50 and 200 Hz, for ωt = 0 and 90°:
# with phasors e^{+iωt} and the current I cos ωt these are Re B and -Im B.
#
# K. Fujiwara, T. Nakata, COMPEL 9 (1990) 137-154, doi 10.1108/eb010071.
CONDUCTIVITY = 3.526e7
COIL = Racetrack(np.array([0.194, 0.100, 0.099]), (0.2, 0.2), 0.1, 0.025, 0.05, 2742.0)
FREQUENCIES = (50.0, 200.0)
CURVES = ("50 Hz, ωt = 0", "50 Hz, ωt = 90°", "200 Hz, ωt = 0", "200 Hz, ωt = 90°")
FACES = *(np.array([0.0, 18.0, 126.0, 294.0]),) * 2, np.array([0.0, 19.0])  # Of plate and hole across each axis, mm
DRAWN = 97  # Places of the line at which it is computed to be drawn
REACH = 1500.0  # Distance from the plate to the outer boundary, mm


CELL, SKIN_SHARE, GROWTH = 70.0, 2.0, 2.0  # Largest cell, mm; part of the skin depth at a face, growing so much a mm


def team7_mesh(frequency: float) -> ConductorMesh:
    """Structured mesh, finer at the plate's faces by the skin depth of a `frequency` (Hz)."""
    skin = SKIN_SHARE * 1e3 * skin_depth(CONDUCTIVITY, frequency)

    def size(coordinate: Array, faces: Array) -> Array:
        near = GROWTH * np.abs(coordinate[:, None] - faces).min(axis=1)
        inside = (coordinate > faces[0]) & (coordinate < faces[-1])
        return np.asarray(np.where(inside, np.minimum(CELL, skin + near), CELL / 2 + near))

    lines = [graded_partition([f[0] - REACH, *f, f[-1] + REACH], partial(size, faces=f)) for f in FACES]
    plate = Block("plate", np.array([f[0] for f in FACES]), np.array([f[-1] for f in FACES]))
    hole = Block("air", np.array([18.0, 18.0, 0.0]), np.array([126.0, 126.0, 19.0]))
    return ConductorMesh(hex_mesh(lines, [plate, hole]), {"plate": CONDUCTIVITY})


def measured_line() -> tuple[Array, Array]:
    """x (17,) m and measured B_z (17, 4) T."""
    lines = files(__package__).joinpath("team7_line_A1B1.csv").read_text(encoding="utf-8").splitlines()
    x, *fields = np.loadtxt(lines, delimiter=",", skiprows=3).T
    return x * 1e-3, np.array(fields).T * 1e-4  # gauss


def compute_line(frequency: float, x: Array, mesh: ConductorMesh, order: int = 3) -> Array:
    """B_z (n, 2), T, at ωt = 0 and 90° at `x` (n,) m on the line y = 72, z = 34 mm, at a `frequency` in Hz.

    By finite elements of an `order` on a `mesh`; the reaction by reciprocity.
    """
    points = np.column_stack([x, np.full_like(x, 0.072), np.full_like(x, 0.034)])
    response = solve_eddy(mesh, order, frequency, [COIL])
    reaction = response.couplings_to([Dipole(p, np.array([0.0, 0.0, 1.0])) for p in points])[:, 0]
    total = COIL.flux_density(points)[:, 2] + reaction
    return np.column_stack([total.real, -total.imag])


def team7(quick: bool = False, order: int = 0) -> xr.Dataset:
    """B_z on the line, measured and computed by elements of an order, else the third or `quick` the second."""
    x, measured = measured_line()
    fine = np.linspace(x[0], x[-1], DRAWN)
    every, order = np.concatenate([x, fine]), order or (2 if quick else 3)
    lines = np.hstack([compute_line(f, every, team7_mesh(f), order) for f in FREQUENCIES])
    drawn = {"line": variable(("place", "curve"), lines[len(x) :], "T", "computed B_z between the measured places")}
    places = {"place": variable(("place",), fine, "m", "x of the computed line")}
    return compared(x, measured, lines[: len(x)]).assign(drawn).assign_coords(places)


LINE: Columns = {
    "measured": (("x", "curve"), "T", "measured B_z"),
    "computed": (("x", "curve"), "T", "computed B_z"),
    "deviation": (("x", "curve"), "1", "deviation over the line's peak"),
}


def compared(x: Array, measured: Array, computed: Array) -> xr.Dataset:
    """B_z `measured` and `computed` (17, 4) T at `x` (17,) m; deviation over the largest |B| of the same frequency."""
    amplitude = np.hypot(measured[:, 0::2], measured[:, 1::2]).max(axis=0)
    data = columns(LINE, (measured, computed, (computed - measured) / np.repeat(amplitude, 2)))
    return xr.Dataset(data, {"x": variable(("x",), x, "m", "x"), "curve": list(CURVES)})


def team7_lines(result: xr.Dataset) -> list[str]:
    lines = ["TEAM workshop problem 7, B_z on y = 72, z = 34 mm: deviation in per cent of the line's peak"]
    size = 100 * abs(result["deviation"])
    every = {str(curve): size.sel(curve=curve) for curve in size["curve"].values}
    for name, part in {**every, f"all {size.size} values": size}.items():
        lines.append(f"  {name:22} largest {float(part.max()):5.2f}, mean {float(part.mean()):5.2f}")
    for k, frequency in enumerate(FREQUENCIES):
        # what stays once all phases are turned by one angle
        cosines, sines = (result[["measured", "computed"]].isel(curve=2 * k + n).to_array().values for n in (0, 1))
        measured, computed = cosines - 1j * sines
        angle = float(np.angle(np.vdot(computed, measured)))
        left = 100 * (computed * np.exp(1j * angle) - measured) / np.abs(measured).max()
        rest = np.abs([left.real, left.imag])
        lines.append(
            f"  {frequency:g} Hz, all phases turned by {np.degrees(angle):+.2f}°: largest {rest.max():.2f}, "
            f"mean {rest.mean():.2f}; at 90° largest {rest[1].max():.2f}"
        )
    return lines


@drawn
def team7_figure(result: xr.Dataset) -> Figure:
    """The four curves with what is measured, and their deviation."""
    figure, ((left, right),) = panels(1, 2, 3.2)
    x = 1e3 * result["x"].values
    for curve, color in zip(result["curve"].values, PALETTE, strict=False):
        here = result.sel(curve=curve)
        line = here["line"] if "line" in here else here["computed"]  # an older result has no more places
        left.plot(1e3 * line[line.dims[0]], 1e3 * line, color=color, label=curve)
        left.plot(x, 1e3 * here["measured"], "o", ms=3.5, color=color)
        right.plot(x, 100 * here["deviation"], "o-", ms=3, color=color, label=curve)
    showing.explain(left, {"computed": "-", "measured (COMPEL 1990)": "o"}, ms=3.5)
    left.set(xlabel="x (mm)", ylabel="$B_z$ (mT)")
    right.set(xlabel="x (mm)", ylabel="computed less measured (% of the peak)")
    return figure


TEAM7 = study_of_one(
    name="team7",
    summary="eddy currents against the measurement of TEAM workshop problem 7",
    quick="elements of order 3 (order 2 instead)",
    compute=team7,
    figures={"team7": team7_figure},
    report=team7_lines,
)
