"""Figure, sentences and numbers of the study of the upper frequency, from its dataset alone."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..article import FLIGHT, rotor_label
from ..results import PAGE, PALETTE, cases_with, legend_below, panels, styled

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
