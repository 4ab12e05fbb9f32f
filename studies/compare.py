"""One scene by every model of the rotor's field, under the same conditions: may the point dipole be used for it?"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..dynamics.continuation.branch import BranchPoint
from ..dynamics.continuation.frequencies import levitates, nearest_range, on_branch
from ..dynamics.equilibria.equilibrium import CRITERION, STABILITIES, Equilibrium, Survey, nearest_of
from ..dynamics.flights.flight import most_like_levitation
from ..fem.rotor.models import of_true_moment
from ..geometry.common import Array, InputError
from ..geometry.files import write_whole
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import scene_text
from ..geometry.solids import Part
from .cli.console import aligned, note, to_json
from .cli.options import Answer, FieldModel, Models
from .figures.style import COLORS, NAMES, PALETTE, drawn, panels, save_figures
from .levitation import Levitation, branch_of
from .plan import PlatePlan, sources
from .result import variable, write_dataset
from .words import bracketed, worth_a_row

TRUE_MOMENT, MUTUAL = "dipole, true moment", "{} + mutual"
BESIDE = 0.1  # of the frequency: how far beyond the ranges of stability the branches are drawn
PART_RTOL = 1e-4  # a hundredth of what models differ by
GRID = 41  # frequencies at which they are, where none are asked for
END = ("low", "high")
OF_EQUILIBRIUM = "distance_mm", "polar_angle_deg", "growth_per_s", "stability", "frequencies_hz"
COLUMNS = (
    "model", "distance (mm)", "polar angle (°)", "growth rate (s⁻¹)", "modes (Hz)", "stable from, to (Hz)", ""
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Compared:
    """One model's results."""

    name: str
    levitation: Levitation
    found: Equilibrium | None  # on the branch on which the floater levitates by the best model
    branch: tuple[BranchPoint, ...]  # through it by frequency, without the plate
    stable: tuple[float, float] | None  # the range of stable frequencies there, Hz

    def row(self) -> dict[str, Any]:
        row: dict[str, Any] = {"name": self.name, "stable_range_hz": self.stable}
        if (e := self.found) is None:
            return row | dict.fromkeys(OF_EQUILIBRIUM)
        row |= {"distance_mm": -1e3 * float(e.position[2]), "distance_error_mm": 1e3 * e.position_error}
        names = "polar_angle_deg", "growth_per_s", "efolding_s", "stability", "frequencies_hz"
        return row | {name: getattr(e, name) for name in names}


def compared_models(dipole: Survey, true_moment: Survey, best: Survey, name: str) -> dict[str, Any] | None:
    """Levitation distances (mm) by `dipole`, one of the `true_moment` and the `best` model (its `name`), without plate.

    Of the dipoles' equilibria those nearest to the best model's, or else the dipole's own; None where neither has one.
    """
    true = most_like_levitation(best.equilibria)
    rough = nearest_of(dipole.equilibria, true.position) if true else most_like_levitation(dipole.equilibria)
    if (known := true or rough) is None:
        return None
    moment = nearest_of(true_moment.equilibria, known.position)
    distances = [None if e is None else -float(e.position[2]) * 1e3 for e in (rough, moment, true)]
    return {
        "true_model": name,
        "dipole_stability": rough.stability if rough else None,
        "true_stability": true.stability if true else None,
        "dipole_distance_mm": distances[0],
        "true_moment_distance_mm": distances[1],
        "true_distance_mm": distances[2],
        "difference_mm": None if distances[0] is None or distances[2] is None else distances[0] - distances[2],
        # The dipole's own position error says how wrong its field is, which is what is measured here.
        "difference_error_mm": true.position_error * 1e3 if true else None,
    }


def field_rtol(scene: Scene) -> float:
    return PART_RTOL if any(isinstance(magnet.body, Part) for magnet in scene.rotor) else Models.rtol


def compared(scene: Scene, requested: Models, spin: float = 0.0) -> list[Compared]:
    """A `scene` with body `spin` by dipoles, closed form, finite elements, and these with mutual magnetisation.

    Tolerances and plate are as `requested`; a map takes the place of finite elements. What mutual magnetisation cannot
    be computed for is left out with a message. Raises EquilibriumError: the rotor is at rest.
    """
    if not scene.floater.round:
        note("All models have the mean of the floater over turns about its moment.")
        scene = replace(scene, floater=scene.floater.averaged)
    best: FieldModel = "map" if scene.field_map else "fem"
    alone = replace(requested, model=best, interaction="rigid")
    finest = Levitation(scene, alone, spin)
    rough = replace(alone, model="dipole")
    made = [
        ("dipole", finest.elsewhere(rough)),
        (TRUE_MOMENT, finest.elsewhere(rough, rotor=of_true_moment(scene.rotor, sources(finest.table)))),
        ("cuboid", finest.elsewhere(replace(alone, model="cuboid"))),
        (best, finest),
    ]
    both = finest.elsewhere(replace(alone, interaction="mutual"))
    try:
        both.interaction  # noqa: B018  # refused here where it cannot be computed
        made.append((MUTUAL.format(best), both))
    except InputError as error:
        note(f"Left out: mutual magnetisation. {error}")
    found = list[Compared]()
    for name, levitation in reversed(made):  # the best first: the others' equilibria are those nearest to its own
        note(f"Model: {name}")
        if found:
            levitation.plate = None
            if (best_plate := found[0].levitation.plate) is not None:  # all have one network of its currents
                model, edges, region = best_plate.model, best_plate.neglected, best_plate.table.region
                plan = PlatePlan(model, edges, requested.plate_rtol, region)
                levitation.plate = levitation.plate_about(np.zeros(3), plan)
        chosen = _nearest(worth_a_row(levitation.equilibria), found[0].found if found else None)
        here = _nearest(levitation.without_plate.equilibria, chosen)
        points = branch_of(levitation, here, "The range of stable frequencies is") if here else ()
        run = nearest_range(points, scene.frequency)
        stable = None if run is None else (run.low.parameter, run.high.parameter)
        found.append(Compared(name, levitation, chosen, points, stable))
    return found[::-1]


def _nearest(equilibria: Sequence[Equilibrium], to: Equilibrium | None) -> Equilibrium | None:
    return nearest_of(equilibria, to.position) if to else most_like_levitation(equilibria)


def compared_dataset(scene: Scene, rows: Sequence[Compared], frequencies: Array | None = None) -> xr.Dataset:
    """All `rows` of a `scene` over `model`, and branches over `frequencies` (n,) Hz, by default the stable ones."""
    if frequencies is None:
        ends = [f for row in rows for f in row.stable or ()] or [scene.frequency * (1 - BESIDE)]
        low, high = min(*ends, scene.frequency), max(*ends, scene.frequency)
        low, high = low * (1 - BESIDE), high * (1 + BESIDE)
        frequencies = low + (high - low) * np.linspace(0.0, 1.0, GRID) ** 2  # dense at the fold, where branches turn
    branch = np.full((len(rows), len(frequencies), 3), np.nan)
    branch[..., 2] = False
    for row, values in zip(rows, branch, strict=True):
        alone = replace(row.levitation.scene, plate=None)
        for k, p in enumerate(on_branch(alone, row.levitation.rates, row.branch, frequencies)):
            if p:
                values[k] = -p.position[2], p.growth_per_s, levitates(p)
    found = [row.found for row in rows]
    modes = [e.frequencies_hz if e else () for e in found]
    spectrum = np.array([*zip_longest(*modes, fillvalue=np.nan)], float).reshape(-1, len(rows)).T

    def each(value: str) -> Array:
        return np.array([getattr(e, value) if e else np.nan for e in found], float)

    distance = [-e.position[2] if e else np.nan for e in found]
    over = ("model", "frequency")
    plate = next((row.levitation.plate for row in rows if row.levitation.plate), None)
    return xr.Dataset(
        {
            "distance": variable(("model",), distance, "m", "levitation distance"),
            "distance_error": variable(("model",), each("position_error"), "m", "its error, as the model states it"),
            "polar_angle": variable(("model",), each("polar_angle_deg"), "deg", "polar angle of the moment"),
            "growth": variable(("model",), each("growth_per_s"), "1/s", "growth rate of the least stable mode"),
            "stability": (("model",), [e.stability if e else "" for e in found]),
            "mode_frequency": variable(("model", "mode"), spectrum, "Hz", "frequencies of the modes, rotor's frame"),
            "stable_range": variable(
                ("model", "end"), [row.stable or (np.nan,) * 2 for row in rows], "Hz",
                "ends of the range of stable frequencies, without the plate",
            ),
            "branch_distance": variable(over, branch[..., 0], "m", "levitation distance, without the plate"),
            "branch_growth": variable(over, branch[..., 1], "1/s", "growth rate, without the plate"),
            "branch_stable": (over, branch[..., 2] == 1),
        },
        {"model": [row.name for row in rows], "end": list(END),
         "frequency": variable(("frequency",), frequencies, "Hz", "rotor frequency")},
        {"study": "compare", "frequency_hz": scene.frequency, "scene": scene_text(scene)}
        | {"plate_model": plate.model if plate else "none"},
    )  # fmt: skip


def compare_words(rows: Sequence[Compared]) -> list[str]:
    best, dipole = rows[-1], rows[0]
    scene = best.levitation.scene
    name = best.name.replace("fem", "finite elements").replace("+ mutual", "with mutual magnetisation")
    said = [f"At {scene.frequency:g} Hz the floater has no equilibrium by {name}."]
    if best.found is not None and dipole.found is not None:
        apart = 1e3 * float(best.found.position[2] - dipole.found.position[2])
        share = abs(apart) / (1e3 * best.found.distance)
        error = 1e3 * best.found.position_error
        more = "more" if apart > 0 else "less"
        one, other = (STABILITIES[row.found.stability] for row in (dipole, best) if row.found)
        verdict = f"both are {one}" if one == other else f"the dipole is {one}, {best.name} {other}"
        said = [
            f"Levitation distance by the point dipole: {bracketed(abs(apart), error, 2)} mm {more} "
            f"({share:.1%}) than by {name}; {verdict}."
        ]
    elif best.found is not None:
        said = [f"At {scene.frequency:g} Hz there is no equilibrium by the point dipole, but one by {name}."]
    table = [COLUMNS, *(_cells(row) for row in rows)]
    lines = aligned(table, "<" + ">" * (len(COLUMNS) - 2) + "<")
    plate = best.levitation.plate
    conditions = "without a plate" if scene.plate is None else "without eddy currents in the plate"
    if plate is not None:
        conditions = f"with eddy currents in the plate ({plate.model})"
    plates = "" if scene.plate is None else ", without eddy currents in the plate"
    return [*said, *lines, f"Equilibria: {conditions}. Stable from, to: {CRITERION}{plates}."]


def _cells(row: Compared) -> tuple[str, ...]:
    if (e := row.found) is None:
        return (row.name, "", "", "", "", "", "no equilibrium")
    last = e.position_error if row.name not in ("dipole", TRUE_MOMENT, "cuboid") else 0.0  # theirs is what is compared
    ranged = "" if row.stable is None else f"{row.stable[0]:.1f}, {row.stable[1]:.1f}"
    return (
        row.name,
        bracketed(-1e3 * e.position[2], 1e3 * last) if last else f"{-1e3 * e.position[2]:.2f}",
        f"{e.polar_angle_deg:.2f}",
        f"{e.growth_per_s:.2g}",
        " ".join(f"{f:.3g}" for f in e.frequencies_hz),
        ranged,
        STABILITIES[e.stability],
    )


@drawn
def compare_figure(result: xr.Dataset) -> Figure:
    """Levitation distance of every model by frequency, and how far each is from the best."""
    figure, ((left, right),) = panels(1, 2, 2.9)
    best = result.isel(model=-1)
    colors = {TRUE_MOMENT: PALETTE[5], MUTUAL.format("fem"): PALETTE[3]}
    names = {name: NAMES[name].replace("fem +", f"{NAMES['fem']} +") for name in result["model"].values.tolist()}
    for model, name in names.items():
        one, color = result.sel(model=model), colors.get(model, COLORS[model])
        for panel, share in ((left, 0.0), (right, 1.0)):
            curve = 1e3 * (one["branch_distance"] - share * best["branch_distance"])
            panel.plot(curve["frequency"], curve, ":", color=color)
            panel.plot(curve["frequency"], curve.where(one["branch_stable"]), color=color, label=name)
            scene = 1e3 * (one["distance"] - share * best["distance"])
            panel.plot(result.attrs["frequency_hz"], scene, "o", color=color, ms=3)
    left.plot([], [], "k:", label="unstable")
    plate = result.attrs["plate_model"] != "none"
    left.plot([], [], "ko", ms=3, label="the scene, with its plate" if plate else "the scene")
    for panel in (left, right):
        panel.set_xlabel("rotor frequency (Hz)")
    left.set_ylabel("levitation distance (mm)")
    right.set_ylabel(f"difference from {names[best['model'].item()]} (mm)")
    return figure


def compare_job(scene: Scene, requested: Models, spin: float, frequencies: Array | None, out: Path) -> Answer:
    """Results as of `compared`, at `frequencies` (n,) Hz too; writes compare.nc, .json and the figure to `out`."""
    rows = compared(scene, requested, spin)
    best = rows[-1]
    result = compared_dataset(scene, rows, frequencies)
    values: dict[str, Any] = {
        "models": [row.row() for row in rows],
        "frequency_hz": scene.frequency,
        **best.levitation.labels,  # of the last
        # of the field where the floater levitates
        "error_estimate": float(best.levitation.table.relative_error(best.found.position)[0]) if best.found else None,
        "tables_from_cache": best.levitation.from_cache,
    }
    if frequencies is not None:
        branches = 1e3 * result["branch_distance"].values
        values["frequencies_hz"] = frequencies
        values["distances_mm"] = {row.name: branches[k] for k, row in enumerate(rows)}
    write_dataset(result, out / "compare.nc")
    write_whole(out / "compare.json", f"{to_json(values)}\n".encode())
    save_figures({"compare": compare_figure(result)}, out)
    return values, [*compare_words(rows), f"Figure and numbers in {out}/compare.png, .pdf, .nc and .json"]
