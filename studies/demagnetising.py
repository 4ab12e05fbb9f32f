"""Demagnetisation of a scene's magnets: the field along their easy axes, with the floater where it levitates."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..dynamics.equilibria.equilibrium import EquilibriumError
from ..dynamics.flights.flight import most_like_levitation
from ..fem.rotor.working_point import EasyField, easy_axis, working_points
from ..geometry.common import InputError
from ..geometry.files import write_whole
from ..geometry.scene.files import scene_text
from .cli.console import note, to_json
from .cli.options import Answer
from .figures.run import working_point_figure
from .figures.style import save_figures
from .levitation import Levitation
from .result import AXIS, Columns, columns, variable, write_dataset

STEPS, LEVELS = 101, 201  # points across a section; levels of the field that are kept of a magnet
OF_A_POINT: Columns = {
    "lowest": (("magnet",), "T", "lowest μ0 H along the easy axis"),
    "place": (("magnet", "axis"), "m", "where it is lowest"),
    "error": (("magnet",), "T", "estimated error of the lowest"),
    "lowest_turning": (("magnet",), "T", "lowest, the rotor turning past the floater"),
    "clear": (("magnet",), "m", "distance from edges that the lowest keeps"),
    "knee": (("magnet",), "T", "knee of the demagnetisation curve"),
    "share_below": (("magnet",), "1", "share of the volume below the knee"),
    "share_error": (("magnet",), "1", "estimated error of the share"),
}
OF_A_SECTION: Columns = {
    "section": (("magnet", "v", "u"), "T", "μ0 H along the easy axis"),
    "along": (("magnet", "u"), "m", "along the easy axis, from the centre"),
    "across": (("magnet", "v"), "m", "across the easy axis"),
    "across_axis": (("magnet", "axis"), "1", "unit vector of `across`"),
}
COLUMNS: Columns = {
    **OF_A_POINT,
    **OF_A_SECTION,
    "levels": (("magnet", "level"), "T", "μ0 H along the easy axis"),
    "easy_axis": (("magnet", "axis"), "1", "easy axis"),
    "center": (("magnet", "axis"), "m", "centre"),
    "floater": (("axis",), "m", "place of the floater"),
}


def working_point_dataset(levitation: Levitation) -> xr.Dataset:
    """The working point of every magnet that has a polarisation, over `magnet`, with a section through each.

    Raises InputError where no magnet has one.
    """
    scene = levitation.scene
    numbers = [k for k, magnet in enumerate(scene.rotor) if magnet.polarization.any()]
    if not numbers:
        raise InputError(
            "Input rotor must have a magnet with a polarisation, whose working point is asked for; instead none has."
        )
    floating = None
    if len(scene.floater.magnets) != 1:
        note("The magnets alone: of a floater of several magnets they are not computed.")
    else:
        with suppress(EquilibriumError):  # without one the magnets are alone
            floating = most_like_levitation(levitation.without_plate.equilibria)
    note("Field in the magnets ...")
    start = None if floating is None else floating.start
    at = None if start is None else scene.floater.magnets_at(start.position, start.orientation)[0]
    field = EasyField(scene.rotor, at)
    known = working_points(field)
    found = [(k, point) for k in numbers if (point := known[k]) is not None]
    sections = [field.section(k, point.place, STEPS) for k, point in found]
    shares = np.linspace(0, 1, LEVELS)
    share = variable(("level",), shares, "1", "share of the volume")
    values = {
        # As an array of numbers, in which None is NaN.
        **{name: np.array([getattr(point, name) for _, point in found], float) for name in OF_A_POINT},
        "levels": [np.quantile(point.levels, shares) for _, point in found],
        **{name: [section[n] for section in sections] for n, name in enumerate(OF_A_SECTION)},
        "easy_axis": [easy_axis(scene.rotor[k]) for k in numbers],
        "center": [scene.rotor[k].body.center for k in numbers],
        "floater": np.full(3, np.nan) if start is None else start.position,
    }
    return xr.Dataset(
        columns(COLUMNS, values),
        {"magnet": ("magnet", np.array(numbers) + 1), "axis": list(AXIS), "share": share},
        {
            "study": "working-point",
            "title": "Field along the easy axes of the rotor's magnets, rotor's frame",
            "scene": scene_text(scene),
        },
    )


def working_point_answer(found: xr.Dataset) -> dict[str, Any]:
    """The numbers of `working_point_dataset` for JSON."""
    at = found["floater"].values
    return {
        "floater_position_mm": None if np.isnan(at).any() else 1e3 * at,
        "working_points": [
            {
                "magnet": int(one["magnet"]),
                "lowest_mu0H_T": float(one["lowest"]),
                "error_T": float(one["error"]),
                "place_mm": 1e3 * one["place"].values,
                "clear_of_edges_mm": 1e3 * float(one["clear"]),
                "lowest_while_slipping_mu0H_T": float(one["lowest_turning"]),
                "knee_mu0H_T": (knee := None if np.isnan(one["knee"]) else float(one["knee"])),
                "share_below_knee": None if knee is None else float(one["share_below"]),
                "share_error": None if knee is None else float(one["share_error"]),
            }
            for one in (found.isel(magnet=k) for k in range(found.sizes["magnet"]))
        ],
    }


def working_point_lines(answer: Mapping[str, Any]) -> list[str]:
    """How far down each magnet's field goes along its easy axis, and whether it demagnetises."""
    lines = [] if answer["floater_position_mm"] is not None else ["The floater has no equilibrium: it is left out."]
    for one in answer["working_points"]:
        text = (
            f"Magnet {one['magnet']}: μ0H along its easy axis goes down to {one['lowest_mu0H_T']:.4f} ± "
            f"{max(one['error_T'], 1e-4):.1g} T ({one['lowest_while_slipping_mu0H_T']:.4f} T while the rotor turns "
            f"past the floater), {one['clear_of_edges_mm']:.2g} mm or more from edges"
        )
        if one["knee_mu0H_T"] is None:
            lines.append(f"{text}. Give coercivity_kA_m to see whether it demagnetises.")
            continue
        margin, share = one["lowest_mu0H_T"] - one["knee_mu0H_T"], one["share_below_knee"]
        safe = margin > one["error_T"] and share <= one["share_error"]
        state = "it keeps its polarisation" if safe else f"{100 * share:.2g} % of its volume is beyond the knee"
        side = "above" if margin > 0 else "below"
        lines.append(f"{text}, {abs(margin):.3f} T {side} its knee of {one['knee_mu0H_T']:.3f} T: {state}.")
    return lines


def write_working_point(levitation: Levitation, out: Path) -> tuple[dict[str, Any], list[str], list[str]]:
    """Write working-point.nc and its picture; returns the numbers, lines for a person, and the files."""
    found = working_point_dataset(levitation)
    write_dataset(found, out / "working-point.nc")
    files = [str(out / "working-point.nc"), *save_figures({"working-point": working_point_figure(found)}, out)]
    answer = working_point_answer(found)
    return answer, working_point_lines(answer), files


def working_point_job(levitation: Levitation, out: Path) -> Answer:
    """The working point of every magnet; writes working-point.nc, .json and the picture."""
    answer, lines, files = write_working_point(levitation, out)
    error = max(one["error_T"] / abs(one["lowest_mu0H_T"]) for one in answer["working_points"])
    values = {"model": "fem", "error_estimate": error, **answer, "tables_from_cache": levitation.from_cache}
    write_whole(out / "working-point.json", f"{to_json(values)}\n".encode())
    return {**values, "files": files}, [*lines, f"In {', '.join(files)}"]
