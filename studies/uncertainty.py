"""Error bars of equilibria from the tolerances of a scene's numbers, to first order, and a check by draws."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import scipy
import xarray as xr

from ..dynamics.equilibria.equilibrium import Equilibrium, EquilibriumError
from ..geometry.common import Array
from ..geometry.scene.files import changed
from ..geometry.scene.messages import SceneError
from .cli.options import Answer, FieldModel, Models, PlateModel, Requested, documented, positive, refused
from .gradient import ANSWERS, Gradient, answer_of, derivative
from .levitation import Levitation
from .plan import SceneLike
from .result import AXIS, IN_JSON, MODES, variable, write_dataset

DRAWS, SEED = 200, 20250701  # of the check, by default
FEW_DRAWS = 20  # of commands where a plate's currents act: each takes half a second
PERCENTILES = (5.0, 95.0)
CHECKED = 0.2  # Relative difference of the two error bars from which on the first order is said not to do
SAID = {
    "distance": ("distance", 1e3, " mm"),
    "polar_angle": ("polar angle", 1.0, "°"),
    "growth": ("growth rate", 1.0, " s⁻¹"),
}


def error_bars(
    levitation: Levitation, tolerances: Mapping[str, float], draws: int = DRAWS, seed: int = SEED
) -> xr.Dataset:
    """The Dataset of `uncertainty` for a scene's `levitation`."""
    gradient = Gradient(levitation)
    if not isinstance(tolerances, Mapping) or not tolerances:
        way_out = " A scene file may have them: edge_mm = {value = 10, tolerance = 0.05}."
        raise refused("tolerances", "be numbers by key of the scene file", tolerances, way_out)
    keys = gradient.checked_keys(list(tolerances), "tolerances")
    for key, value in tolerances.items():
        positive(f"tolerances: that of {key}", value)
    if isinstance(draws, bool) or not isinstance(draws, int) or not 0 <= draws <= 100_000:
        raise refused("draws", "be a number from 0 to 100000", draws)
    if not (known := levitation.equilibria):
        raise EquilibriumError(f"At {levitation.scene.frequency:g} Hz the floater has no equilibrium.")
    wide = np.array([float(tolerances[key]) for key in keys])
    # a Latin hypercube: each number's draws are spread evenly (McKay, Beckman, Conover, Technometrics 21 (1979) 239)
    cube = scipy.stats.qmc.LatinHypercube(len(keys), seed=seed).random(draws) if draws else np.zeros((0, len(keys)))
    rows = [_row(gradient, one, keys, wide, wide * (2 * cube - 1)) for one in known]
    data: dict[str, Any] = {}
    for k, (answer, (unit, label, dims)) in enumerate(ANSWERS.items()):
        here, first, sample = (np.array([row[part][k] for row in rows]) for part in range(3))
        error = np.sqrt(np.sum(first**2, axis=1))
        parts: list[tuple[str, tuple[str, ...], Any, str]] = [
            ("", (), here, label),
            ("_error", (), error, f"standard deviation of the {label}, to first order"),
            ("_share", ("key",), first, f"part of it: {label}"),
        ]
        if draws:
            deviations, drawn = zip(*map(_statistics, sample), strict=True)
            parts += [("_drawn_error", (), deviations, f"the same of draws: {label}")]
            parts += [("_drawn", ("percentile",), drawn, label)]
        for end, more, values, said in parts:
            data[f"{answer}{end}"] = variable(("equilibrium", *more, *dims), np.array(values), unit, said)
    if draws:
        lost = [np.isnan(sample[0]).mean() if np.isfinite(shares[0]).all() else np.nan for _, shares, sample in rows]
        data["lost"] = variable(("equilibrium",), lost, "1", "part of the draws that have no such equilibrium")
    data["tolerance"] = variable(("key",), wide, "as the key", "how far the number may be off")
    axes = {"equilibrium": np.arange(len(known)), "key": keys, "mode": list(MODES), "axis": list(AXIS)}
    about = {"study": "uncertainty", "draws": draws, "seed": seed, "not_known": "; ".join(gradient.reasons.values())}
    return xr.Dataset(data, {**axes, "percentile": list(PERCENTILES)}, {**about, **levitation.about})


def _statistics(sample: Array) -> tuple[Array, Array]:
    good = sample[np.isfinite(sample).reshape(len(sample), -1).any(axis=1)]
    if len(good) < 2:
        return np.full(sample.shape[1:], np.nan), np.full((len(PERCENTILES), *sample.shape[1:]), np.nan)
    return np.std(good, axis=0, ddof=1), np.percentile(good, PERCENTILES, axis=0)


def _row(
    gradient: Gradient, known: Equilibrium, keys: Sequence[str], wide: Array, drawn: Array
) -> tuple[list[Array], list[Array], list[Array]]:
    """Of one equilibrium, for each answer: its value, what each tolerance makes of it (key, ...), draws (draw, ...)."""
    tangents, implicit, changes = gradient.ways(known, keys)
    values = [np.asarray(answer_of(known, name), float) for name in ANSWERS]
    shares = [np.full((len(keys), *value.shape), np.nan) for value in values]
    for row, name in zip(shares, ANSWERS, strict=True):
        for k, key in enumerate(keys):
            if key in tangents:
                row[k] = derivative(known, tangents[key], name) * wide[k] / np.sqrt(3)
    sample = [np.full((len(drawn), *value.shape), np.nan) for value in values]
    if implicit is None or len(tangents) < len(keys):
        return values, shares, sample
    for k, draw in enumerate(drawn):
        offsets = dict(zip(keys, draw.tolist(), strict=True))
        try:
            scene = changed(gradient.scene, {key: gradient.numbers[key] + offset for key, offset in offsets.items()})
        except SceneError:  # as with overlapping bodies
            continue
        found = implicit.moved(changes.at(scene, offsets), [(offsets[key], tangents[key]) for key in keys])
        if found is not None:
            for row, name in zip(sample, ANSWERS, strict=True):
                row[k] = answer_of(found, name)
    return values, shares, sample


@documented
def uncertainty(
    scene: SceneLike,
    tolerances: Mapping[str, float] | None = None,
    draws: int = DRAWS,
    seed: int = SEED,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    progress: bool | None = None,
    **requested: Unpack[Requested],
) -> xr.Dataset:
    """Error bars of all equilibria and their modes from the tolerances of the scene's numbers.

    A number lies anywhere within its tolerance, either way, alike: its standard deviation is the tolerance over √3.
    Draws are equilibria of the whole equations, which Newton's method finds from the tangent.

    Parameters
    ----------
    tolerances : dict of str to float, optional
        By dotted key, in its unit; left out, those of the scene file (`edge_mm = {value = 10, tolerance = 0.05}`).
    draws : int
        Of the numbers together, for a check of the first order; 0 for none.
    seed : int
        Of the draws.

    Returns
    -------
    xarray.Dataset
        Over `equilibrium`, `key` and `mode`: each answer of `gradient` with its standard deviation to first order
        (``..._error``), each tolerance's part of it (``..._share``, signed), of draws (``..._drawn_error``) and their
        percentiles (``..._drawn``); `lost` is the part of the draws that have no such equilibrium.

    Raises
    ------
    EquilibriumError
        There is no equilibrium.

    Examples
    --------
    >>> found = sl.uncertainty(scene, {"rotor.edge_mm": 0.05}, draws=20, model="dipole").isel(equilibrium=0)
    >>> print(f"{1e3 * found.distance:.2f} ± {1e3 * found.distance_error:.2f} mm")
    18.84 ± 0.05 mm
    """
    levitation = Levitation(scene, Models(model, plate_model, **requested), spin)
    given = dict(levitation.scene.tolerances) if tolerances is None else tolerances
    return error_bars(levitation, given, draws, seed)


def uncertainty_job(levitation: Levitation, out: Path) -> Answer:
    """Error bars by a scene file's tolerances, if it has some, for JSON and in words; uncertainty.nc in `out`."""
    tolerances = dict(levitation.scene.tolerances)
    if not tolerances or not levitation.equilibria:
        return {}, []
    over_plate = any(one.currents is not None for one in levitation.equilibria)
    found = error_bars(levitation, tolerances, FEW_DRAWS if over_plate else DRAWS)
    write_dataset(found, out / "uncertainty.nc")
    rows = []
    for number in range(found.sizes["equilibrium"]):
        one, row = found.isel(equilibrium=number), dict[str, Any]()
        for name, (unit, _, dims) in ANSWERS.items():
            if not dims:
                end, scale = IN_JSON[unit]
                error, drawn = (float(one[f"{name}{part}"]) / scale for part in ("_error", "_drawn_error"))
                shares = zip(one["key"].values.tolist(), one[f"{name}_share"].values.tolist(), strict=True)
                by = {key: share / scale for key, share in shares}
                row[f"{name}{end}"] = {"error": error, "drawn_error": drawn, "share": by}
        rows.append(row | {"lost": float(one["lost"])})
    first, values = found.isel(equilibrium=0), {"uncertainty": rows, "draws": int(found.attrs["draws"])}
    if not np.isfinite(first["distance_error"]):
        return values, [f"Within the tolerances: not known, as {found.attrs['not_known']}."]
    said = [
        f"{words} {scale * float(first[name]):.4g} ± {scale * float(first[f'{name}_error']):.2g}{unit}"
        for name, (words, scale, unit) in SAID.items()
    ]
    largest = first["key"].values[int(np.argmax(np.abs(first["distance_share"].values)))]
    lines = [f"Within the tolerances (standard deviations): {', '.join(said)}. Most of it by {largest}."]
    ratio = float(first["distance_drawn_error"] / first["distance_error"])
    lost = float(first["lost"])
    if lost or not abs(ratio - 1) < CHECKED:
        lines.append(
            f"Of {found.attrs['draws']} draws {lost:.0%} have no such equilibrium; the others' distances scatter "
            f"{ratio:.2g} times as much as the first order says."
        )
    return values, lines
