"""The upper frequency: until when a floater stays above it, with and without currents in the rotor's metal.

For each rotor that levitated in the article: averaged flights along its stable frequencies with body spin 0 at
release, below a rotor that does not conduct (as one of ferrite or of powder in plastic, of the same field), one whose
magnets do, and for displaced cubes one that also has the steel with which the article balances them.
Closed form of μr = 1, rigid floater with its own currents, real air.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ...dynamics.continuation.frequencies import at_frequency, reference_state, stable_range
from ...dynamics.continuation.slow_drift import drift, lasting_frequencies
from ...dynamics.motion.state import Scales
from ...geometry.rotor import Conductor
from ...geometry.scene.contents import Scene
from ...geometry.shapes import Box
from ..figures.style import PAGE, PALETTE, legend_below, panels, styled
from ..result import variable
from ..study import Point, Study, by_case, cases_with, one_case
from .article import EDGE, FLIGHT, article_scene, conducting, levitated_rotors, levitation_of, rotor_label

VARIANTS = ("does not conduct", "magnets conduct", "magnets and spacers conduct")
STEEL_CONDUCTIVITY, STEEL_DENSITY, MAGNET_DENSITY = 1.4e6, 7900.0, 7500.0
"""Of non-magnetic steel (AISI 304), S/m and kg/m³; of NdFeB."""
STEPS, LONGEST = 16, 3600.0
"""Frequencies of flights; how long they are followed, s."""


def limit_points(quick: bool) -> list[Point]:
    """Every rotor that levitated, without and with its metal; `quick` only δx = 2 mm."""
    rotors = levitated_rotors(False) if not quick else [{"configuration": "horizontal", "measure": 2.0}]
    return [
        {**rotor, "variant": variant}
        for rotor in rotors
        for variant in (VARIANTS if rotor["configuration"] == "horizontal" and not quick else VARIANTS[:2])
    ]


def spacer(displacement: float) -> Conductor:
    """A steel block as wide and deep as the cube, behind it, that puts the centre of mass on the axis.

    With a displacement x and half an edge a the balance is ρ_m 2a x = ρ_s t (a - x + t/2) for its thickness t.
    """
    gap, load = EDGE / 2 - displacement, MAGNET_DENSITY / STEEL_DENSITY * EDGE * displacement
    thickness = np.sqrt(gap**2 + 2 * load) - gap
    center = np.array([-gap - thickness / 2, 0.0, 0.0])
    return Conductor(Box(np.array([thickness, EDGE, EDGE]), center), STEEL_CONDUCTIVITY)


def scene_of(point: Point) -> Scene:
    """The rotor of a point in real air, with the currents that its variant has."""
    bare = article_scene(point["configuration"], point["measure"], permeability=1.0)
    scene = conducting(replace(bare, drag=replace(bare.drag, air=True)), rotor=point["variant"] != VARIANTS[0])
    if point["variant"] == VARIANTS[2]:
        return replace(scene, conductors=(spacer(1e-3 * point["measure"]),))
    return scene


def upper_limit(point: Point) -> xr.Dataset:
    """How long flights last at each frequency, and between which they last for the article's 250 s.

    Returns
    -------
    Dataset over `case` and `step`: frequency and time until the loss (at most `LONGEST`), ends of lasting flights, and
    of the frequencies that are stable without losses.
    """
    scene = scene_of(point)
    bare = article_scene(point["configuration"], point["measure"], permeability=1.0, drag=False)
    alone, whole = levitation_of(bare, "cuboid"), levitation_of(scene, "cuboid")
    stable = stable_range(bare, alone.rates, *reference_state(bare))
    low, high = stable.low.parameter, stable.high.parameter
    middle = stable.near((low + high) / 2)
    lasts = lasting_frequencies(scene, whole.interaction, whole.rates, middle.state, middle.parameter, FLIGHT)
    frequencies = np.linspace(low, high, STEPS + 2)[1:-1]
    flights = []
    for frequency in frequencies:
        point_there = at_frequency(bare, alone.rates, stable.near(frequency), frequency)
        there = replace(scene, frequency=float(frequency))
        start = Scales.of(there).unpack(point_there.state)
        flight = drift(there, whole.interaction, 0.0, LONGEST, whole.rates, start)
        flights.append((min(flight.levitated_s, LONGEST), flight.growth_per_s.max(), flight.ended_by))
    times, growth = (np.array([flight[k] for flight in flights]) for k in range(2))
    numbers = {
        "low": (low, "lowest stable frequency without losses"),
        "high": (high, "highest stable frequency without losses"),
        "lasts_from": (lasts.low, "lowest frequency at which flights last"),
        "lasts_to": (lasts.high, "highest frequency at which flights last"),
    }
    single = {name: variable((), np.array(value), "Hz", text) for name, (value, text) in numbers.items()}
    rows = {
        "rotor_frequency": variable(("step",), frequencies, "Hz", "frequency of the rotor"),
        "levitated": variable(("step",), times, "s", "time until the loss"),
        "growth": variable(("step",), growth, "1/s", "largest growth of a small motion in the flight"),
    }
    rows["end"] = (("step",), [ended for _, _, ended in flights])  # type: ignore[assignment]
    labels = {"variant": xr.Variable((), point["variant"]), "ended_by": xr.Variable((), lasts.ended_by)}
    return one_case(point, xr.Dataset({**single, **rows, **labels}))


COLUMNS = 4


def _rotors(result: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Each rotor with its variants."""
    pairs = zip(result["configuration"].values, result["measure"].values, strict=True)
    for configuration, measure in dict.fromkeys((str(c), float(m)) for c, m in pairs):
        yield rotor_label(configuration, measure), cases_with(result, configuration=configuration, measure=measure)


@styled
def limit_figure(result: xr.Dataset) -> Figure:
    """Levitation time against frequency of each rotor, one line for each variant."""
    rotors = list(_rotors(result))
    columns = min(COLUMNS, len(rotors))
    rows = -(-len(rotors) // columns)
    figure, axes = panels(rows, columns, (PAGE, 0.9 + 1.9 * rows), sharey=True)
    for panel, (label, rotor) in zip(axes.ravel(), rotors, strict=False):
        for k in range(rotor.sizes["case"]):
            one = rotor.isel(case=k)
            panel.plot(
                one["rotor_frequency"], one["levitated"], ".-", color=PALETTE[k], label=str(one["variant"].values)
            )
        panel.axhline(FLIGHT, color="0.8", lw=0.8, zorder=0)
        panel.set(yscale="log", xlabel="frequency (Hz)")
        panel.set_title(label)
    for row in axes:
        row[0].set_ylabel("levitation time (s)")
    legend_below(figure, axes[0][0])
    return figure


FIGURES = {"upper-limit": limit_figure}


def limit_lines(result: xr.Dataset) -> list[str]:
    """Where flights last by variant, and what a rotor that does not conduct would change."""
    lines = []
    for label, rotor in _rotors(result):
        for k in range(rotor.sizes["case"]):
            one = rotor.isel(case=k)
            lines.append(f"{label}, {one['variant'].values}: {_span(one)}")
        change = _change(rotor)
        if change:
            lines.append(f"{label}: {change}")
    return lines


def _span(one: xr.Dataset) -> str:
    low, high = float(one["lasts_from"]), float(one["lasts_to"])
    stable = f"stable without losses from {float(one['low']):.1f} to {float(one['high']):.1f} Hz"
    if np.isnan(high):
        return f"no flight lasts for {FLIGHT:g} s; {stable}."
    ended = one["ended_by"].values
    return f"flights last for {FLIGHT:g} s from {low:.1f} to {high:.1f} ± 0.5 Hz (then {ended}); {stable}."


def _change(rotor: xr.Dataset) -> str:
    """What conduction changes where it changes the most: the end in Hz, and a flight in s."""
    first, second = (rotor.isel(case=k) for k in (0, 1))
    less = max(0.0, float(first["lasts_to"] - second["lasts_to"]))
    ratio = first["levitated"].values / second["levitated"].values
    lost = second["end"].values == "instability"
    if not lost.any():
        return f"the magnets' currents lower the end by {less:.1f} Hz and shorten no flight."
    k = int(np.argmax(np.where(lost, ratio, 0.0)))
    times = [float(f"{float(one['levitated'][k]):.3g}") for one in (first, second)]
    return (
        f"a rotor that does not conduct holds up to {less:.1f} Hz more; at "
        f"{float(first['rotor_frequency'][k]):.1f} Hz its floater stays for {times[0]:g} instead of {times[1]:g} s."
    )


def limit_numbers(result: xr.Dataset) -> dict[str, Any]:
    """Ends of lasting flights by rotor and variant as numbers: `limits`."""
    rows = []
    for k in range(result.sizes["case"]):
        one = result.isel(case=k)
        ends = {f"{name}_hz": _number(one[name]) for name in ("low", "high", "lasts_from", "lasts_to")}
        rows.append({
            "configuration": str(one["configuration"].values), "value": float(one["measure"]),
            "variant": str(one["variant"].values), **ends,
        })  # fmt: skip
    return {"limits": rows}


def _number(value: xr.DataArray) -> float | None:
    return None if bool(np.isnan(value)) else float(value)


STUDY = Study(
    name="upper-limit",
    summary="until which frequency flights last, below rotors that do and do not conduct",
    points=limit_points,
    compute=upper_limit,
    gather=by_case,
    figures=FIGURES,
    report=limit_lines,
    numbers=limit_numbers,
)
