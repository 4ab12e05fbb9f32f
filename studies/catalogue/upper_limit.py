"""The upper frequency: until when a floater stays above it, with and without currents in the rotor's metal.

For each rotor that levitated in the article: averaged flights along its stable frequencies with body spin 0 at
release, below a rotor that does not conduct (as one of ferrite or of powder in plastic, of the same field), one whose
magnets do, and for displaced cubes one that also has the steel with which the article balances them.
Closed form of μr = 1, rigid floater with its own currents, real air.
"""

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
from ..figures.style import PALETTE, legend_below, styled
from ..result import Columns, columns
from ..study import Point, Study, cases_with, each_case, one_case
from .article import EDGE, FLIGHT, article_scene, conducting, levitated_rotors, levitation_of, rotor_label
from .drawing import by_configuration, small_multiples, text_table

VARIANTS = ("does not conduct", "magnets conduct", "magnets and spacers conduct")
STEEL_CONDUCTIVITY, STEEL_DENSITY, MAGNET_DENSITY = 1.4e6, 7900.0, 7500.0
"""Of non-magnetic steel (AISI 304), S/m and kg/m³; of NdFeB."""
STEPS, LONGEST = 16, 3600.0  # Frequencies of flights; how long they are followed, s
COLUMNS: Columns = {
    "low": ((), "Hz", "lowest stable frequency without losses"),
    "high": ((), "Hz", "highest stable frequency without losses"),
    "lasts_from": ((), "Hz", "lowest frequency at which flights last"),
    "lasts_to": ((), "Hz", "highest frequency at which flights last"),
    "rotor_frequency": (("step",), "Hz", "frequency of the rotor"),
    "levitated": (("step",), "s", "time until the loss"),
    "growth": (("step",), "1/s", "largest growth rate of a mode in the flight"),
}
ENDS = tuple(COLUMNS)[:4]


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
    """How long flights last at each frequency (`step`), and between which they last for the article's 250 s."""
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
    times, growth, ends = zip(*flights, strict=True)
    found = dict(zip(COLUMNS, (low, high, lasts.low, lasts.high, frequencies, times, growth), strict=True))
    data = columns(COLUMNS, {name: np.asarray(value) for name, value in found.items()})
    labels = {"variant": ((), point["variant"]), "ended_by": ((), lasts.ended_by), "end": (("step",), list(ends))}
    return one_case(point, xr.Dataset({**data, **labels}))


def rotors_of(result: xr.Dataset) -> list[tuple[str, xr.Dataset]]:
    """Each rotor's label with its variants."""
    return [
        (rotor_label(name, measure), cases_with(part, measure=measure))
        for name, part in by_configuration(result)
        for measure in np.unique(part["measure"].values)
    ]


@styled
def limit_figure(result: xr.Dataset) -> Figure:
    """Levitation time against frequency of each rotor, one line for each variant."""
    rotors = rotors_of(result)
    words = "frequency (Hz)", "levitation time (s)"
    figure, axes = small_multiples([label for label, _ in rotors], 1.9, 4, *words, sharey=True)
    for panel, (_, rotor) in zip(axes, rotors, strict=True):
        for one, style, color in zip(each_case(rotor), ("o-", "s--", "^:"), PALETTE, strict=False):
            panel.semilogy(
                one["rotor_frequency"], one["levitated"], style, ms=3, color=color, label=one["variant"].item()
            )
        panel.axhline(FLIGHT, color="0.6", lw=0.8, zorder=0, label=f"longest of the experiment, {FLIGHT:g} s")
        panel.axhline(LONGEST, color="0.6", lw=0.8, ls=":", zorder=0, label=f"followed no longer, {LONGEST:g} s")
    legend_below(figure, *axes, columns=3)
    return figure


def limit_lines(result: xr.Dataset) -> list[str]:
    """Where flights last by variant, and what a rotor that does not conduct would change."""
    rows, lines = [], []
    for label, rotor in rotors_of(result):
        for one in each_case(rotor):
            ends = [f"{float(one[name]):.1f}" for name in ("low", "high", "lasts_from", "lasts_to")]
            lasts = "none" if np.isnan(one["lasts_to"]) else f"{ends[2]} to {ends[3]} ± 0.5"
            rows.append((f"{label}, {one['variant'].item()}", f"{ends[0]} to {ends[1]}", lasts, one["ended_by"].item()))
        lines.append(f"{label}: {_change(rotor)}")
    head = ("rotor", "stable without losses (Hz)", f"trajectories last {FLIGHT:g} s (Hz)", "then")
    return [*text_table(head, rows), *lines]


def _change(rotor: xr.Dataset) -> str:
    """What conduction changes where it changes the most: the end in Hz, and a flight in s."""
    first, second = each_case(rotor)[:2]
    less = max(0.0, float(first["lasts_to"] - second["lasts_to"]))
    ratio = first["levitated"].values / second["levitated"].values
    lost = second["end"].values == "instability"
    if not lost.any():
        return f"the magnets' currents lower the end by {less:.1f} Hz and shorten no trajectory."
    k = int(np.argmax(np.where(lost, ratio, 0.0)))
    times = [float(f"{float(one['levitated'][k]):.3g}") for one in (first, second)]
    return (
        f"a rotor that does not conduct levitates up to {less:.1f} Hz more; at "
        f"{float(first['rotor_frequency'][k]):.1f} Hz its floater stays for {times[0]:g} instead of {times[1]:g} s."
    )


def limit_numbers(result: xr.Dataset) -> dict[str, Any]:
    """Ends of lasting flights by rotor and variant as numbers: `limits`."""
    return {
        "limits": [
            {
                "configuration": str(one["configuration"].values),
                "value": float(one["measure"]),
                "variant": str(one["variant"].values),
                **{f"{name}_hz": None if np.isnan(one[name]) else float(one[name]) for name in ENDS},
            }
            for one in each_case(result)
        ]
    }


STUDY = Study(
    name="upper-limit",
    summary="until which frequency flights last, below rotors that do and do not conduct",
    points=limit_points,
    compute=upper_limit,
    figures={"upper-limit": limit_figure},
    report=limit_lines,
    numbers=limit_numbers,
)
