"""Sentences of the study that compares the point dipole with true fields, from its dataset alone."""

import numpy as np
import xarray as xr

from ...geometry.basics import Array
from ..article import by_configuration, rotor_label
from .dipole_vs_fem_figure import CAUSES, TOTAL, change


def dipole_lines(result: xr.Dataset) -> list[str]:
    """Ranges of the changes for each configuration and cause, the limits of every rotor, and the sentence."""
    lines = []
    for configuration, part in by_configuration(result):
        lines.append(f"{configuration}:")
        for cause, models in [*CAUSES.items(), ("all together", TOTAL)]:
            lines.append(f"  {cause}: " + "; ".join(_quantities(part, models)))
        lines += [f"  {_limits(part.isel(case=k))}" for k in range(part.sizes["case"])]
    return [*lines, sentence(result)]


def _quantities(part: xr.Dataset, models: tuple[str, str]) -> list[str]:
    names = {"distance": ("distance", 1e3, "mm"), "polar_angle": ("polar angle", 1.0, "°")}
    names |= {"lowest": ("lowest", 1.0, "Hz"), "highest": ("highest", 1.0, "Hz")}
    words = [
        f"{word} {range_text(*change(part, name, models), scale)} {unit}" for name, (word, scale, unit) in names.items()
    ]
    value, error = change(part, "mode_frequency", models)
    relative = 100 / part["mode_frequency"].sel(model=models[0])
    bounce = {"mode": "bounce"}
    words.append(f"bounce {range_text((value * relative).sel(bounce), (error * relative).sel(bounce))} %")
    return words


def range_text(value: xr.DataArray, error: xr.DataArray, scale: float = 1.0) -> str:
    """A range of values and the largest error."""
    known: Array = scale * value.values[np.isfinite(value.values)]
    if not known.size:
        return "unknown"
    worst = scale * float(np.nanmax(error.values))
    digits = int(np.clip(1 - np.floor(np.log10(max(worst, 1e-6))), 1, 4))
    return f"{known.min():+.{digits}f} to {known.max():+.{digits}f} (± {worst:.1g})"


def _limits(one: xr.Dataset) -> str:
    kind = str(one["configuration"].values)
    words = []
    for model in ("article", "cuboid", "fem", "mutual"):
        ends = [f"{float(one[n].sel(model=model)):.2f} ± {float(one[f'{n}_error'].sel(model=model)):.1g} ({k})"
                for n, k in (("lowest", one["low_kind"].sel(model=model).item()),
                             ("highest", one["high_kind"].sel(model=model).item()))]  # fmt: skip
        words.append(f"{model} {ends[0]} to {ends[1]} Hz")
    return f"{rotor_label(kind, float(one['measure']))}: " + "; ".join(words)


def sentence(result: xr.Dataset) -> str:
    """The answer in one sentence, dipole less truth: ranges over rotors and frequencies, with the largest errors."""

    def wrong(name: str, models: tuple[str, str], scale: float = 1.0) -> str:
        value, error = change(result, name, models)
        return range_text(-value, error, scale)

    causes = ", ".join(f"{cause} {wrong('distance', models, 1e3)} mm" for cause, models in CAUSES.items())
    return (
        f"The dipole is wrong by {wrong('distance', TOTAL, 1e3)} mm in the levitation distance, because it leaves out: "
        f"{causes}; by {wrong('polar_angle', TOTAL)}° in the polar angle, and by {wrong('lowest', TOTAL)} Hz at the "
        f"lower and {wrong('highest', TOTAL)} Hz at the upper end of stable levitation."
    )
