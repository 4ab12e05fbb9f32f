"""Sentences of the study of the plate's damping, from its dataset alone."""

import numpy as np
import xarray as xr

from ..article import rotor_label
from ..levitation import range_text
from .plate_cases import DISTANCE, ROTORS
from .plate_damping_figure import SWEEPS, means, part_of

PLACES = ("below", "beside")
REAL = ", real plate"


def damping_lines(result: xr.Dataset) -> list[str]:
    """What the plate does at each place, frequency and rotor; what the infinite slab misses; and the sentence."""
    lines = []
    for sweep in (*PLACES, *(place + REAL for place in PLACES), "frequency", *ROTORS):
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
        real, slab = part_of(result, place + REAL), part_of(result, place)
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
