"""Numbers of a scene that fit what was measured: least squares over equilibria with their derivatives."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import scipy
import xarray as xr
from matplotlib.figure import Figure

from ..geometry.common import Array, ComputationError, InputError, shown
from ..geometry.scene.files import changed, scene_numbers
from .candidates import DECAY, FREQUENCY, MODE_OF, Candidate, Limits, Search
from .cli.options import FieldModel, Models, PlateModel, Requested, documented, refused, wrong
from .design import checked_free
from .figures.style import PALETTE, drawn, panels
from .levitation import Levitation
from .plan import SceneLike
from .result import label_of_key, variable

# What may have been measured: unit and label; beside these the modes' frequencies and decay rates, as `axial_hz`
MEASURABLE: Mapping[str, tuple[str, str]] = {
    "distance_mm": ("mm", "levitation distance"),
    "depth_mm": ("mm", "depth below the rotor's centre"),
    "lateral_offset_mm": ("mm", "distance from the axis of rotation"),
    "polar_angle_deg": ("deg", "polar angle of the moment"),
    "lowest_hz": ("Hz", "lowest stable frequency"),
    "highest_hz": ("Hz", "highest stable frequency"),
}
TIME, HEIGHT = "time_s", "z_mm"  # columns of a track
FEWEST, CLEAR = 16, 5.0  # points of a track at least; amplitude of an oscillation, by its error, that is one
ERROR = "_error"  # what a column of standard deviations is called after that of its measure
LOST = 1e3  # residual of each value of a scene that has no such equilibrium, so that the fit comes back
Data = str | PathLike[str] | xr.Dataset | Mapping[str, Sequence[float]]


def table_of(data: Data) -> dict[str, Array]:
    """Columns of measurements with numbers alone; empty cells are NaN. Raises InputError, OSError."""
    if isinstance(data, str | PathLike) and str(data).endswith(".nc"):
        with xr.open_dataset(data, engine="h5netcdf") as opened:
            return table_of(opened.load())
    if isinstance(data, xr.Dataset):
        frame = data.to_dataframe().reset_index()
        columns: dict[str, Any] = {str(name): frame[name].tolist() for name in frame if name in data.variables}
    elif isinstance(data, str | PathLike):
        lines = [line for line in Path(data).read_text(encoding="utf-8").splitlines() if line.strip(" ,")]
        rows = list(csv.reader(line for line in lines if not line.lstrip().startswith("#")))
        if len({len(row) for row in rows}) != 1:
            raise InputError(f"Input data must have rows of one length, with commas; instead those of {data} have not.")
        columns = {name.strip(): [cell.strip() or "nan" for cell in cells] for name, *cells in zip(*rows, strict=True)}
    elif isinstance(data, Mapping):
        columns = {str(name): list(np.atleast_1d(values)) for name, values in data.items()}
    else:
        raise refused("data", "be a table or its file", data)
    if len({len(values) for values in columns.values()}) != 1 or not min(map(len, columns.values())):
        raise InputError("Input data must have columns of one length that are not empty; instead they have not.")
    found = {}
    for name, values in columns.items():
        try:
            found[name] = np.array([float(value) for value in values])
        except (TypeError, ValueError):
            raise InputError(f"Input data must have numbers; instead those of {name} are {shown(values)}.") from None
    return found


def rows_of_tracks(table: Mapping[str, Array]) -> dict[str, Array]:
    """A row for each track: its depth, and frequency and decay rate of its axial mode, with their standard deviations.

    Tracks of one table differ in what was set. Each is c + e^{-γt} (a cos 2πft + b sin 2πft), by least squares, what is
    left of it is white noise. Where nothing oscillates the depth alone is known. Raises InputError.
    """
    keys = [name for name in table if name not in (TIME, HEIGHT)]
    settings = np.stack([table[name] for name in keys] or [0.0 * table[TIME]], axis=1)
    names = [n for stem in ("depth_mm", f"axial{FREQUENCY}", f"axial{DECAY}") for n in (stem, f"{stem}{ERROR}")]
    rows = []
    for one in np.unique(settings, axis=0):
        here = np.all(settings == one, axis=1)
        times, heights = table[TIME][here], table[HEIGHT][here]
        if here.sum() < FEWEST or not (np.isfinite([times, heights]).all() and np.all(np.diff(times) > 0)):
            rule = f"have tracks of {FEWEST} points or more, with growing {TIME} and a {HEIGHT} at each"
            raise wrong("data", rule, f"one of {here.sum()} points has not.")
        rows.append([*one[: len(keys)], *_ringing(times, -heights)])
    return dict(zip([*keys, *names], np.array(rows).T, strict=True))


def _ringing(times: Array, values: Array) -> list[float]:
    """Centre of an oscillation that decays, its frequency (Hz) and its decay rate (1/s), each with its error."""
    span, rest = float(np.ptp(times)), values - values.mean()
    tried = 2 * np.pi * np.arange(1 / span, 0.5 / np.median(np.diff(times)), 0.1 / span)
    power = scipy.signal.lombscargle(times, rest, tried)

    def waves(z: Array) -> Array:
        turn, fall = z[0] * (times - times[0]), np.exp(-z[1] * (times - times[0]))
        return np.stack([np.ones_like(turn), fall * np.cos(turn), fall * np.sin(turn)], axis=1)

    def left(z: Array) -> Array:
        return np.asarray(waves(z) @ np.linalg.lstsq(waves(z), values)[0] - values)

    starts = [np.array([tried[np.argmax(power)], rate / span]) for rate in (0.0, 1.0, 5.0)]
    best = min((scipy.optimize.least_squares(left, z, x_scale=[1 / span] * 2) for z in starts), key=lambda f: f.cost)
    basis, (turn, _) = waves(best.x), best.x
    center, a, b = np.linalg.lstsq(basis, values)[0]
    since, across = times - times[0], b * basis[:, 1] - a * basis[:, 2]
    whole = np.column_stack([basis, since * across, -since * (basis[:, 1:] @ [a, b])])
    noise = 2 * best.cost / (len(times) - whole.shape[1])
    errors = np.sqrt(noise * np.diag(np.linalg.pinv(whole.T @ whole)))
    if np.hypot(a, b) < CLEAR * np.hypot(*errors[1:3]):
        return [float(values.mean()), float(np.sqrt(np.var(values) / len(times))), *[np.nan] * 4]
    return [*map(float, (center, errors[0], *np.array([turn, errors[3]]) / (2 * np.pi), best.x[1], errors[4]))]


class _Rows:
    """The scenes of a table's rows, and what was measured in them."""

    def __init__(self, levitation: Levitation, table: Mapping[str, Array], free: Limits) -> None:
        scene, numbers = scene_numbers(levitation.scene)
        known = {**MEASURABLE, **MODE_OF}
        self.measures = [name for name in table if name in known]
        self.keys = [name for name in table if name in numbers]
        errors = [name for name in table if name.removesuffix(ERROR) in self.measures and name not in known]
        rest = set(table) - {*self.measures, *self.keys, *errors}
        if rest or not self.measures:
            what = f"unknown are {', '.join(sorted(rest))}" if rest else "none is a measure"
            rule = f"have columns of keys of the scene file and of what was measured ({', '.join(known)})"
            raise wrong("data", rule, f"{what}.")
        if both := set(self.keys) & set(free):
            raise InputError(f"Input free must not name what the data give; instead both have {', '.join(both)}.")
        if errors and len(errors) < len(self.measures):
            raise InputError("Input data must have standard deviations of all measures or of none; instead of some.")
        self.measured = np.stack([table[name] for name in self.measures], axis=1)
        self.given, self.there = bool(errors), np.isfinite(self.measured)
        self.deviations = np.ones_like(self.measured)
        if errors:
            self.deviations = np.stack([table[f"{name}{ERROR}"] for name in self.measures], axis=1)
            if not np.all(self.deviations[self.there] > 0):
                raise InputError("Input data must have positive standard deviations; instead some are not.")
        if self.there.sum() <= len(free) - bool(errors):
            instead = f"{self.there.sum()} values are to give {len(free)} numbers."
            raise wrong("data", "have more values than there are free numbers", instead)
        self.set = np.array([table[name] for name in self.keys]).reshape(len(self.keys), len(self.there)).T
        self.searches = []
        for row in self.set:
            one = changed(scene, dict(zip(self.keys, row.tolist(), strict=True)))
            there = Levitation(one, levitation.models, levitation.spin)
            there.share(levitation)
            self.searches.append(Search(there, free))

    def _at(self, numbers: Array) -> Iterator[tuple[Search, Candidate | None, list[str], Array, Array]]:
        for k, search in enumerate(self.searches):
            names = [name for name, here in zip(self.measures, self.there[k], strict=True) if here]
            yield search, search.at(numbers), names, self.measured[k][self.there[k]], self.deviations[k][self.there[k]]

    def residuals(self, numbers: Array) -> Array:
        """What is computed less what was measured, in standard deviations."""
        return np.concatenate([
            np.full(len(names), LOST) if known is None
            else (np.concatenate([known.values(name) for name in names]) - measured) / deviations
            for _, known, names, measured, deviations in self._at(numbers)
        ])  # fmt: skip

    def slopes(self, numbers: Array) -> Array:
        """Derivatives of the same by the free numbers; from here on equilibria are followed from these scenes."""
        parts = []
        for search, known, names, _, deviations in self._at(numbers):
            parts.append(np.zeros((len(names), len(numbers))))
            if known is not None:
                search.go_on_from(known, numbers)
                for row, name in zip(parts[-1], names, strict=True):
                    row += known.slopes(name)[0]
                parts[-1] /= deviations[:, None]
        return np.concatenate(parts)

    def computed(self, numbers: Array) -> Array:
        """(row, measure) all that the scenes answer; NaN where they have no equilibrium."""
        known = [search.at(numbers) for search in self.searches]
        return np.array([[np.nan if one is None else one.values(name)[0] for name in self.measures] for one in known])


@documented
def fit(
    scene: SceneLike,
    data: Data,
    free: Mapping[str, Sequence[float]],
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    progress: bool | None = None,
    **requested: Unpack[Requested],
) -> xr.Dataset:
    """Numbers of a scene that fit what was measured best, with their covariance: least squares by exact derivatives.

    Parameters
    ----------
    data : path of a CSV or netCDF file, Dataset, or dict of columns
        A row for each experiment: what was set, by keys of the scene file ("frequency_hz"), and what was measured:
        "distance_mm", "depth_mm" (below the rotor's centre), "lateral_offset_mm", "polar_angle_deg", frequencies of
        modes in the rotor's frame ("axial_hz", "forward_whirl_hz", "backward_whirl_hz", "precession_hz",
        "nutation_hz"), their decay rates ("axial_decay_per_s") and the ends of stable frequencies ("lowest_hz",
        "highest_hz"). Standard deviations are in columns of the same names with "_error" (of all or of none: then all
        are the same, and what is left tells how large). Empty cells were not measured.
        With a column "time_s" it is of tracks: "z_mm" at each time, and what was set, in which tracks differ.
        Each gives the depth, and frequency and decay rate of the axial mode, with their errors.
    free : dict of str to (float, float)
        Bounds of the numbers that are looked for, by dotted key; the scene's own are within, where the fit begins.

    Returns
    -------
    xarray.Dataset
        `estimate`, its standard deviation `error` and `covariance` by `key`; `measured`, `deviation` and `computed` by
        `row` and `measure`; attributes `chi_squared` and `degrees_of_freedom`. `sl.draw` makes its figure.

    Raises
    ------
    EquilibriumError
        A row's scene has no equilibrium, nor have others within the bounds.
    ComputationError
        The data do not tell the numbers apart.

    Examples
    --------
    >>> seen = {"frequency_hz": [110.0, 130.0, 150.0], "distance_mm": [21.2, 18.8, 17.1]}
    >>> found = sl.fit(scene, seen, {"rotor.angle_deg": (5.0, 20.0)}, model="dipole")
    >>> print(f"{float(found.estimate[0]):.2f} ± {float(found.error[0]):.2f}")
    9.95 ± 0.21
    """
    levitation = Levitation(scene, Models(model, plate_model, **requested), spin)
    bounds = checked_free(free, levitation)
    table = table_of(data)
    if TIME in table and HEIGHT in table:
        table = rows_of_tracks(table)
    rows = _Rows(levitation, table, bounds)
    low, high = np.array(list(bounds.values())).T
    found = scipy.optimize.least_squares(
        lambda z: rows.residuals(low + z * (high - low)),
        (rows.searches[0].first - low) / (high - low),
        jac=lambda z: rows.slopes(low + z * (high - low)) * (high - low),
        bounds=(0.0, 1.0), x_scale="jac", xtol=1e-10, ftol=1e-12, gtol=1e-10,
    )  # fmt: skip
    numbers = low + found.x * (high - low)
    freedom, chi = len(found.fun) - len(numbers), float(found.fun @ found.fun)
    normal = rows.slopes(numbers).T @ rows.slopes(numbers)
    if np.linalg.cond(normal / np.sqrt(np.outer(*[np.diag(normal)] * 2))) > 1e12 or not np.all(np.diag(normal)):
        raise ComputationError("The data do not tell the free numbers apart. Measure more, or free fewer.")
    covariance = np.linalg.inv(normal) * (1.0 if rows.given else chi / max(freedom, 1))
    labels = [label_of_key(key) for key in bounds]
    over = ("row", "measure")
    return xr.Dataset(
        {
            "estimate": variable(("key",), numbers, "as the key", "number that fits best"),
            "error": variable(("key",), np.sqrt(np.diag(covariance)), "as the key", "its standard deviation"),
            "covariance": (("key", "other_key"), covariance),
            "bound": variable(("key", "end"), list(bounds.values()), "as the key", "its bounds"),
            "measured": variable(over, rows.measured, "as the measure", "measured"),
            "deviation": variable(over, rows.deviations, "as the measure", "its standard deviation"),
            "computed": variable(over, rows.computed(numbers), "as the measure", "computed with the estimate"),
            "set": variable(("row", "setting"), rows.set, "as the key", "what was set"),
        },
        {
            "key": list(bounds), "other_key": list(bounds), "unit": ("key", [label["units"] for label in labels]),
            "measure": rows.measures, "setting": rows.keys, "end": ["least", "most"],
        },
        {"study": "fitted", "chi_squared": chi, "degrees_of_freedom": freedom, "deviations_given": int(rows.given),
         **levitation.about},
    )  # fmt: skip


@drawn
def fit_figure(result: xr.Dataset) -> Figure:
    """What was measured, with its standard deviations, and what is computed, one panel a measure."""
    names, rows = result["measure"].values.tolist(), np.arange(result.sizes["row"])
    figure, axes = panels(1, len(names), 2.8)
    along, label = rows, "row"
    if result.sizes["setting"]:
        key = str(result["setting"].values[0])
        along, label = result["set"].values[:, 0], f"{key} ({label_of_key(key)['units']})"
    order = np.argsort(along)
    for panel, name in zip(axes[0], names, strict=True):
        here = result.sel(measure=name)
        bars = here["deviation"].values if result.attrs["deviations_given"] else None
        panel.errorbar(along, here["measured"], bars, fmt="o", ms=3, color=PALETTE[1], label="measured")
        panel.plot(along[order], here["computed"].values[order], color=PALETTE[0], lw=0.9, label="computed")
        mode = name.removesuffix(FREQUENCY).removesuffix(DECAY).replace("_", " ")
        other = ("s⁻¹", f"decay of the {mode} mode") if name.endswith(DECAY) else ("Hz", f"{mode} mode")
        unit, said = MEASURABLE.get(name, other)
        panel.set(xlabel=label, ylabel=f"{said} ({unit})")
    return figure
