"""The studies that the program knows, and how one is run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from ..geometry import load_scene
from .dipole_validity import dipole_validity, validity_figure, validity_lines
from .drift import drift_study
from .drift_figure import drift_figure, drift_lines
from .field_hard_cases import field_hard_cases, hard_case_lines
from .field_hard_cases_figure import hard_case_figure
from .figures import save_figure
from .floater_figure import floater_figure, floater_lines
from .floater_permeability import floater_permeability
from .plate_damping import plate_damping
from .plate_damping_figure import damping_figure, damping_lines
from .results import write_dataset
from .shipped_scenes import default_scene
from .speed_accuracy import speed_accuracy
from .speed_accuracy_figure import speed_figure, speed_lines
from .team7_report import team7_figure, team7_lines, team7_study


@dataclass(frozen=True)
class Study:
    """One question to the program.

    Parameters
    ----------
    summary : what it gives, in a line
    compute : takes `quick` and returns the labelled result
    draw : the figure, from the result alone
    report : what it says, in lines, from the result alone
    """

    summary: str
    compute: Callable[[bool], xr.Dataset]
    draw: Callable[[xr.Dataset], Figure]
    report: Callable[[xr.Dataset], list[str]]


CATALOGUE = {
    "dipole-validity": Study(
        "where the dipole and each further model are good to 10, 1, 0.1 and 0.01 %",
        dipole_validity,
        validity_figure,
        validity_lines,
    ),
    "speed-accuracy": Study(
        "error of B and of its gradient against time, unknowns and memory, for every way to the rotor's field",
        speed_accuracy,
        speed_figure,
        speed_lines,
    ),
    "field-hard-cases": Study(
        "true and stated error of the rotor's table in hard cases: contact, extensions, flat, touching, strong, many",
        field_hard_cases,
        hard_case_figure,
        hard_case_lines,
    ),
    "floater-permeability": Study(
        "what the rigid dipole misses once rotor and floater magnetise each other, in the default scene",
        lambda quick: floater_permeability(load_scene(default_scene()), quick=quick),
        floater_figure,
        floater_lines,
    ),
    "plate-damping": Study(
        "what a plate does to each small motion, against its place, conductivity and thickness",
        plate_damping,
        damping_figure,
        damping_lines,
    ),
    "drift": Study(
        "levitation time against frequency by the slow drift of the floater's spin",
        drift_study,
        drift_figure,
        drift_lines,
    ),
    "team7": Study(
        "eddy currents against the measurement of TEAM workshop problem 7", team7_study, team7_figure, team7_lines
    ),
}


def run_study(name: str, quick: bool, out: Path) -> list[str]:
    """Compute a study; writes NAME.nc and NAME.png and returns what it says."""
    study = CATALOGUE[name]
    result = study.compute(quick)
    write_dataset(result, out / f"{name}.nc")
    save_figure(study.draw(result), out / f"{name}.png")
    return [*study.report(result), f"Result and figure: {out / name}.nc, {out / name}.png"]
