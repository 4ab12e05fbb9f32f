"""How far a rotor can be turned down and up until its floater is lost, against the stable equilibria."""

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ...dynamics.continuation.frequencies import at_frequency, kicked
from ...dynamics.flights.flight import simulate
from ...geometry.scene.contents import DriveStep
from ..figures.style import PALETTE
from ..result import Columns, records
from ..study import Point, Study, each_case, recorded
from ..words import ENDS
from . import article, showing

RATES = (2.0, 8.0)  # Hz/s; a motor is turned by hand or by a program as slowly as that
INSIDE, BELOW, ABOVE = 10.0, 10.0, 60.0  # Where a ramp begins inside the stable range, and ends beyond it, Hz
KICK = 1e-3  # Velocity upwards at the start, m/s: an axial mode of some hundredths of a millimetre
WAYS = ("down", "up")
COLUMNS: Columns = {
    "lowest": ((), "Hz", "lowest stable frequency, at steady frequencies"),
    "highest": ((), "Hz", "highest stable frequency, at steady frequencies"),
    "low_kind": ((), "", "what is at the lowest"),
    "high_kind": ((), "", "what is at the highest"),
    "lost_at": (("way", "rate"), "Hz", "frequency at which the floater was lost"),
    "ended_by": (("way", "rate"), "", "what ended the trajectory"),
    "motor_work": (("way", "rate"), "J", "work of the motor until then"),
}


def ramps(point: Point) -> xr.Dataset:
    bare = article.rotor_scene(point["configuration"], point["measure"], drag=False)
    alone = article.levitation_of(bare, point["model"], interaction="rigid" if point["model"] == "dipole" else "mutual")
    whole = alone if point["model"] == "dipole" else alone.elsewhere(**article.losses(bare))
    stable = article.stable_frequencies(bare, alone.rates)
    low, high = stable.low.parameter, stable.high.parameter
    inside = min(INSIDE, (high - low) / 3)
    rows = []
    for begin, end in ((low + inside, low - BELOW), (high - inside, high + ABOVE)):
        start = at_frequency(bare, alone.rates, stable.near(begin), begin)
        for rate in RATES:
            seconds = abs(end - begin) / rate
            scene = replace(kicked(whole.scene, start, KICK), drive=(DriveStep(end, seconds),))
            flight = simulate(scene, whole.interaction, seconds)
            assert flight.given is not None
            lost = np.nan if flight.lost_at_hz is None else flight.lost_at_hz
            rows.append((lost, str(flight.ended_by), flight.given[-1, 1]))
    flights = (np.reshape(column, (2, len(RATES))) for column in zip(*rows, strict=True))
    found = low, high, stable.low.kind, stable.high.kind, *flights
    return recorded(point, COLUMNS, found, {"way": list(WAYS), "rate": ("rate", list(RATES), {"units": "Hz/s"})})


@showing.each(showing.configuration_panels, 3.4, ylabel="frequency of the rotor (Hz)")
def ramps_figure(axes: Axes, part: xr.Dataset) -> None:
    """The stable range of each rotor as a bar, and where its floater is lost on the way down and up."""
    places = showing.rotor_places(axes, part)
    span = (part["highest"] - part["lowest"]).values
    axes.bar(places, span, 0.5, part["lowest"].values, color="0.85", label="stable at steady frequency")
    for way, marker in zip(WAYS, "v^", strict=True):
        for rate, color in zip(part["rate"].values, PALETTE, strict=False):
            label = f"lost on the way {way}, {rate:g} Hz/s"
            axes.plot(places, part["lost_at"].sel(way=way, rate=rate), marker, color=color, ms=4, label=label)


def _ramps_lines(result: xr.Dataset) -> list[str]:
    rates, rows = result["rate"].values, []
    for label, one in showing.rotor_cases(result):
        steady = f"{float(one['lowest']):.1f} to {float(one['highest']):.1f} ({ENDS[one['high_kind'].item()]})"
        ends = zip(one["lost_at"].values.ravel(), one["ended_by"].values.ravel(), strict=True)
        rows.append((label, steady, *("–" if np.isnan(at) else f"{at:.1f} ({end})" for at, end in ends)))
    head = [f"lost {way}, {rate:g} Hz/s" for way in WAYS for rate in rates]
    late = (result["lowest"] - result["lost_at"].sel(way="down"), result["lost_at"].sel(way="up") - result["highest"])
    spans = [[showing.span(beyond.sel(rate=rate).values, ".2g") for rate in rates] for beyond in late]
    lines = [
        f"At {rate:g} Hz/s floaters are lost {down} Hz below the lowest and {up} Hz above the highest stable frequency."
        for rate, down, up in zip(rates, *spans, strict=True)
    ]
    return [*showing.text_table(("rotor", "stable (Hz)", *head), rows), *lines]


def ramps_numbers(result: xr.Dataset) -> dict[str, Any]:
    rotor = {"configuration": "configuration", "value": "measure"}
    found = records(result, rotor | {"lowest_stable_hz": "lowest", "highest_stable_hz": "highest"})
    for row, one in zip(found, each_case(result[["lost_at"]].stack(ramp=("way", "rate"))), strict=True):
        row["lost"] = records(one, {"way": "way", "rate_hz_per_s": "rate", "lost_at_hz": "lost_at"})
    return {"ramps": found}


STUDY = Study(
    name="ramps",
    summary="how far a rotor can be turned down and up until its floater is lost",
    quick="finite elements (point dipoles instead), all losses, mutual magnetisation",
    points=lambda quick: [{**one, "model": "dipole" if quick else "fem"} for one in article.levitated_rotors(False)],
    compute=ramps,
    figures={"ramps": ramps_figure},
    report=_ramps_lines,
    numbers=ramps_numbers,
)
