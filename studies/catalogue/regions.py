"""Where floaters levitate: regions in frequency and displacement, and the frequency until which trajectories last."""

from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ...dynamics.continuation.branch import OSCILLATORY, REAL
from ...dynamics.continuation.frequencies import HIGHEST, StableRange, at_frequency, levitating_ranges
from ...dynamics.continuation.slow_drift import Lasting, drift, lasting_frequencies
from ...dynamics.equilibria.equilibrium import EquilibriumError
from ...dynamics.motion.state import Scales
from ...geometry.common import Array
from ...geometry.magnets import Conductor
from ...geometry.scene.contents import Scene
from ...geometry.shapes import Box
from ..cli.console import note
from ..figures.style import COLORS, NAMES, PALETTE
from ..levitation import Levitation
from ..result import Columns, records
from ..study import Point, Study, cases_with, each_case, recorded
from . import article, showing
from .showing import each, small_multiples

# Regions of stable levitation in frequency and displacement, what bounds them, and what a plate makes of them.
#
# Regions: the motion without losses, of a rigid floater in the dipole's field, and in that of finite elements with
# mutual magnetisation.  Where trajectories last, every effect takes part: the currents in the floater, real air, and
# those in the rotor's magnets or not.
MEASURES = {
    "horizontal": (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0),
    "vertical": (10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 18.0, 20.0),
    "tilt": (2.5, 5.0, 7.5, 10.0, 12.5, 15.0, 17.5, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0),
}  # Displacements (mm) and tilts (degrees): the article's tested ones and some between
RTOL, PLATE_RTOL = 1e-4, 1e-2
MOST, TRIED = 4, 6  # Intervals of stability that are kept of one rotor, and frequencies with a plate
BEYOND = 1.15  # How far above the last stable frequency the plate is tried
FACE = -0.045  # Height of the plate's upper face below the rotor's origin, m: no floater that levitates touches it
METAL = {"insulating": False, "conducting": True}  # The rotor's magnets: whether they have eddy currents
INTERVAL: Columns = {
    "lowest": (("interval",), "Hz", "lower end of an interval of stability"),
    "highest": (("interval",), "Hz", "upper end of an interval of stability"),
    "distance_lowest": (("interval",), "m", "distance at the lower end"),
    "distance_highest": (("interval",), "m", "distance at the upper end"),
    "leading_highest": (("interval",), "Hz", "frequency of the mode that is the first unstable one above"),
    "low_kind": (("interval",), "", "what is at the lower end"),
    "high_kind": (("interval",), "", "what is at the upper end"),
    "plate_frequency": (("tried",), "Hz", "frequency at which a plate below is tried"),
    "plate_growth": (("tried",), "1/s", "largest growth rate with a plate below"),
    "plate_distance": (("tried",), "m", "distance with a plate below"),
    "plate_error": (("tried",), "1", "estimated relative error of the plate's table"),
}
LASTING: Columns = {
    "low": (("metal",), "Hz", "lowest frequency at which trajectories last"),
    "high": (("metal",), "Hz", "highest frequency up to which trajectories last"),
    "growth_per_s": (("metal",), "1/s", "largest growth rate of a mode in the trajectory there"),
    "ended_by": (("metal",), "", "what ends trajectories beyond"),
}


def map_points(quick: bool) -> list[Point]:
    rotors = {name: (value,) for name, value in article.QUICK_ROTORS} if quick else MEASURES
    points: list[Point] = []
    for c, m, model in ((c, m, model) for c, some in rotors.items() for m in some for model in article.MODELS):
        known = model == "fem" and m in article.CONFIGURATIONS[c].levitated
        more = {} if quick else {"flights": known, "interaction": "auto"}
        with_plate = (2 if quick else 5) if known else 0
        points.append({"configuration": c, "measure": m, "model": model, "with_plate": with_plate, **more})
    return points


def stability_map(point: Point, rtol: float = RTOL) -> xr.Dataset:
    scene = article.rotor_scene(point["configuration"], point["measure"], drag=False)
    levitation = article.levitation_of(scene, point["model"], rtol, point.get("interaction", "rigid"))
    try:
        ranges = levitating_ranges(scene, levitation.interaction, levitation.rates)
    except EquilibriumError as error:
        note(str(error))
        ranges = []
    rows, kinds = np.full((5, MOST), np.nan), np.full((2, MOST), "", dtype="U12")
    for k, run in enumerate(ranges[:MOST]):
        low, high = run.low, run.high
        # at a fold, or where the floater touches the rotor, no mode is the least stable but by round-off
        leading = high.leading_hz if high.kind in (OSCILLATORY, REAL) else np.nan
        rows[:, k] = low.parameter, high.parameter, low.distance, high.distance, leading
        kinds[:, k] = low.kind, high.kind
    plate = np.full((TRIED, 4), np.nan)
    if ranges and point["with_plate"]:
        plate[: point["with_plate"]] = _with_plate(levitation, ranges[0], point["with_plate"])
    table, axes, found = INTERVAL, {}, [*rows, *kinds, *plate.T]
    if "flights" in point:
        lasting = [Lasting()] * len(METAL)
        if ranges and point["flights"]:  # from spin 0, with all effects
            middle = ranges[0].near(float(article.within(ranges[0], 0.5)))
            there = [levitation.elsewhere(**article.losses(scene, conducts)) for conducts in METAL.values()]
            start = middle.state, middle.parameter, article.FLIGHT
            lasting = [lasting_frequencies(each.scene, each.table, each.rates, *start) for each in there]
        found += [np.array([getattr(one, name) for one in lasting]) for name in LASTING]
        table, axes = {**INTERVAL, **LASTING}, {"metal": list(METAL)}
    return recorded(point, table, found, axes)


def _with_plate(alone: Levitation, stable: StableRange, number: int) -> Array:
    """Frequency (Hz), growth (1/s), distance (m) and error of the plate's table (number, 4); NaN where it fails."""
    rows = np.full((number, 4), np.nan)
    rows[:, 0] = np.linspace(1.01 * stable.low.parameter, min(BEYOND * stable.high.parameter, HIGHEST), number)
    for row in rows:
        there = alone.elsewhere(frequency=float(row[0]))
        try:
            near = at_frequency(alone.scene, alone.rates, stable.near(row[0]), float(row[0]))
        except EquilibriumError:
            continue
        known = article.equilibrium_at(there, near.distance)
        found = known and article.over_plate(there, known, article.plate_with_face(FACE), "slab", PLATE_RTOL)
        if found:
            row[1:] = found[1].growth_per_s, found[1].distance, found[2]
    return rows


MARKERS = {
    "fold": ("^", "fold: no equilibrium beyond"),
    "oscillatory": ("o", "growing oscillation (Hopf)"),
    "real": ("D", "growing without oscillation"),
    "contact": ("v", "contact with the rotor"),
    "border": ("_", "end of the search"),
}
VERDICTS = (
    ("P", PALETTE[4], "plate: stable"),
    ("x", PALETTE[3], "plate: unstable"),
    ("1", "0.2", "plate: no equilibrium"),
)
MARKS = {
    "insulating": ("<", f"trajectories last {article.FLIGHT:g} s up to here"),
    "conducting": ("*", "… with currents in the rotor"),
}


@each(showing.configuration_panels, 3.9, ylabel="frequency of the rotor (Hz)")
def map_figure(axes: Axes, rotors: xr.Dataset) -> None:
    """Regions of stable levitation by dipole and by finite elements, kinds of boundary, and the plate's verdict."""
    for model in article.MODELS:
        _region(axes, cases_with(rotors, model=model), COLORS[model])
        showing.explain(axes, {f"stable: {NAMES[model]}": "s"}, color=COLORS[model], alpha=0.5)
    true = cases_with(rotors, model="fem")
    growth, frequency = true["plate_growth"].values, true["plate_frequency"].values
    measure = np.broadcast_to(true["measure"].values[:, None], growth.shape)
    stable = article.stable_in_flight(growth)
    found = (stable, np.isfinite(growth) & ~stable, np.isnan(growth) & np.isfinite(frequency))
    for here, (marker, color, words) in zip(found, VERDICTS, strict=True):
        if here.any():
            label = f"{words}, face {-1e3 * FACE:g} mm below"
            axes.plot(measure[here], frequency[here], marker, color=color, ms=4, mew=0.8, label=label)
    for metal, (marker, words) in MARKS.items() if "high" in true else ():
        axes.plot(true["measure"], true["high"].sel(metal=metal), marker, color="k", ms=5, label=words)
    axes.set_ylim(20, 410)
    axes.margins(x=0.08)


def _region(axes: Axes, part: xr.Dataset, color: str) -> None:
    measure = part["measure"].values
    wide = measure if len(measure) > 1 else measure * np.array([0.99, 1.01])  # one rotor alone is a bar
    for k in range(part.sizes["interval"]):
        ends = [part[name].values[:, k] for name in ("lowest", "highest")]
        low, high = (np.broadcast_to(end, wide.shape) for end in ends)
        axes.fill_between(wide, low, high, color=color, alpha=0.2, lw=0)
        for values, name in zip(ends, ("low_kind", "high_kind"), strict=True):
            axes.plot(measure, values, color=color, lw=0.8)
            for kind, (marker, words) in MARKERS.items():
                here = part[name].values[:, k] == kind
                if here.any():
                    axes.plot(measure[here], values[here], marker, color=color, mfc="white", ms=4)
                    showing.explain(axes, {words: marker}, mfc="white", ms=4)


def _map_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for label, one in showing.rotor_cases(result):
        ends = zip(*(one[name].values for name in ("lowest", "low_kind", "highest", "high_kind")), strict=True)
        stable = [f"{low:.1f} ({a}) to {high:.1f} Hz ({b})" for low, a, high, b in ends if np.isfinite(low)]
        pairs = zip(one["plate_frequency"].values, one["plate_growth"].values, strict=True)
        found = [(f, f"{g:+.2g}" if np.isfinite(g) else "no equilibrium") for f, g in pairs if np.isfinite(f)]
        plate = [f"{f:.0f} Hz {growth}" for f, growth in found]
        known = zip(*(one[name].values for name in ("metal", *LASTING)), strict=True) if "high" in one else ()
        lasting = [f"{low:.1f} to {high:.1f} Hz ({of} rotor; then {end})" for of, low, high, _, end in known if end]
        cells = (" and ".join(stable) or "never", ", ".join(plate), " and ".join(lasting))
        rows.append((f"{label}, {one['model'].item()}", *cells))
    head = ("rotor, model", "stable", "growth with the plate (s⁻¹)", f"trajectories last {article.FLIGHT:g} s")
    return showing.text_table(head, rows)


STABILITY_MAP = Study(
    name="stability-map",
    summary="regions of stable levitation in frequency and displacement, their boundaries, with and without a plate",
    quick="all but three rotors, trajectories, mutual magnetisation; two instead of five frequencies over the plate",
    points=map_points,
    compute=stability_map,
    figures={"stability-map": map_figure},
    report=_map_lines,
)


# The upper frequency: until when a floater stays above it, with and without currents in the rotor's metal.
#
# For each rotor that levitated in the article: averaged trajectories along its stable frequencies with body spin 0 at
# release, below a rotor that does not conduct (as one of ferrite or of powder in plastic, of the same field), one whose
# magnets do, and for displaced cubes one that also has the steel with which the article balances them.
# Closed form of μr = 1, rigid floater with its own currents, real air.
VARIANTS = ("does not conduct", "magnets conduct", "magnets and spacers conduct")
STEEL_CONDUCTIVITY, STEEL_DENSITY, MAGNET_DENSITY = 1.4e6, 7900.0, 7500.0  # Of AISI 304, S/m and kg/m³; of NdFeB
STEPS, LONGEST = 16, 3600.0  # Frequencies of trajectories; how long they are followed, s
COLUMNS: Columns = {
    "low": ((), "Hz", "lowest stable frequency without losses"),
    "high": ((), "Hz", "highest stable frequency without losses"),
    "lasts_from": ((), "Hz", "lowest frequency at which trajectories last"),
    "lasts_to": ((), "Hz", "highest frequency at which trajectories last"),
    "rotor_frequency": (("step",), "Hz", "frequency of the rotor"),
    "levitated": (("step",), "s", "time until the loss"),
    "growth": (("step",), "1/s", "largest growth rate of a mode in the trajectory"),
    "end": (("step",), "", "what ended the trajectory"),
    "ended_by": ((), "", "what ends trajectories beyond"),
    "variant": ((), "", "what conducts"),
}
ENDS = tuple(COLUMNS)[:4]
NUMBERS = {"configuration": "configuration", "value": "measure", "variant": "variant"}
NUMBERS |= {f"{name}_hz": name for name in ENDS}


def spacer(displacement: float) -> Conductor:
    """A steel block as wide and deep as the cube, behind it, that puts the centre of mass on the axis."""
    # with a displacement x and half an edge a the balance is ρ_m 2a x = ρ_s t (a - x + t/2) for its thickness t
    gap, load = article.EDGE / 2 - displacement, MAGNET_DENSITY / STEEL_DENSITY * article.EDGE * displacement
    thickness = np.sqrt(gap**2 + 2 * load) - gap
    center = np.array([-gap - thickness / 2, 0.0, 0.0])
    return Conductor(Box(np.array([thickness, article.EDGE, article.EDGE]), center), STEEL_CONDUCTIVITY)


def scene_of(point: Point) -> Scene:
    bare, variant = article.rotor_scene(point["configuration"], point["measure"], permeability=1.0), point["variant"]
    blocks = (spacer(1e-3 * point["measure"]),) if variant == VARIANTS[2] else ()
    return replace(bare, conductors=blocks, **article.losses(bare, variant != VARIANTS[0]))


def upper_limit(point: Point) -> xr.Dataset:
    scene = scene_of(point)
    bare = article.rotor_scene(point["configuration"], point["measure"], permeability=1.0, drag=False)
    alone, whole = article.levitation_of(bare, "cuboid"), article.levitation_of(scene, "cuboid")
    stable = article.stable_frequencies(bare, alone.rates)
    low, high = stable.low.parameter, stable.high.parameter
    middle = stable.near((low + high) / 2)
    lasts = lasting_frequencies(scene, whole.interaction, whole.rates, middle.state, middle.parameter, article.FLIGHT)
    grid = np.linspace(low, high, STEPS + 2)[1:-1]
    flights = []
    for frequency in grid:
        there = replace(scene, frequency=float(frequency))
        state = at_frequency(bare, alone.rates, stable.near(frequency), frequency).state
        flight = drift(there, whole.interaction, 0.0, LONGEST, whole.rates, Scales.of(there).unpack(state))
        flights.append((min(flight.levitated_s, LONGEST), flight.growth_per_s.max(), flight.ended_by))
    found = (low, high, lasts.low, lasts.high, grid, *zip(*flights, strict=True), lasts.ended_by, point["variant"])
    return recorded(point, COLUMNS, found, {})


@each(small_multiples, 1.9, 4, "frequency (Hz)", "levitation time (s)", of=showing.by_rotor, sharey=True)
def limit_figure(panel: Axes, rotor: xr.Dataset) -> None:
    """Levitation time against frequency of each rotor, one line for each variant."""
    for one, style, color in zip(each_case(rotor), ("o-", "s--", "^:"), PALETTE, strict=False):
        frequency, time = one["rotor_frequency"], one["levitated"]
        panel.semilogy(frequency, time, style, ms=3, color=color, label=one["variant"].item())
    longest = f"longest of the experiment, {article.FLIGHT:g} s"
    panel.axhline(article.FLIGHT, color="0.6", lw=0.8, zorder=0, label=longest)
    panel.axhline(LONGEST, color="0.6", lw=0.8, ls=":", zorder=0, label=f"followed no longer, {LONGEST:g} s")


def _limit_lines(result: xr.Dataset) -> list[str]:
    rows, lines = [], []
    for label, rotor in showing.by_rotor(result):
        for one in each_case(rotor):
            low, high, start, end = (f"{float(one[name]):.1f}" for name in ENDS)
            lasts = "none" if np.isnan(one["lasts_to"]) else f"{start} to {end} ± 0.5"
            rows.append((f"{label}, {one['variant'].item()}", f"{low} to {high}", lasts, one["ended_by"].item()))
        # what conduction changes where it changes the most: the end in Hz, and a trajectory in s
        first, second = each_case(rotor)[:2]
        less, lost = max(0.0, float(first["lasts_to"] - second["lasts_to"])), second["end"].values == "instability"
        if not lost.any():
            lines.append(f"{label}: the magnets' currents lower the end by {less:.1f} Hz and shorten no trajectory.")
            continue
        k = int(np.argmax(np.where(lost, first["levitated"].values / second["levitated"].values, 0.0)))
        times = [float(f"{float(one['levitated'][k]):.3g}") for one in (first, second)]
        lines.append(
            f"{label}: a rotor that does not conduct levitates up to {less:.1f} Hz more; at "
            f"{float(first['rotor_frequency'][k]):.1f} Hz its floater stays for {times[0]:g} instead of {times[1]:g} s."
        )
    head = ("rotor", "stable without losses (Hz)", f"trajectories last {article.FLIGHT:g} s (Hz)", "then")
    return [*showing.text_table(head, rows), *lines]


UPPER_LIMIT = Study(
    name="upper-limit",
    summary="until which frequency trajectories last, below rotors that do and do not conduct",
    quick="all rotors but δx = 2 mm; conducting spacers",
    points=lambda quick: [
        {**rotor, "variant": variant}
        for rotor in ([{"configuration": "horizontal", "measure": 2.0}] if quick else article.levitated_rotors(False))
        for variant in (VARIANTS if rotor["configuration"] == "horizontal" and not quick else VARIANTS[:2])
    ],
    compute=upper_limit,
    figures={"upper-limit": limit_figure},
    report=_limit_lines,
    numbers=lambda result: {"limits": records(result, NUMBERS)},
)
