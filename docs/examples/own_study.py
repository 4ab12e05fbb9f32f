"""
A study of your own
===================

Frequency of the axial mode against the floater's density.

A study is a pure function of a point, its points, and the figures and report of the joined result. One object joins
them; it is resumable and runs on any number of workers. Put into ``studies/catalogue/entries.py``, it is also on the
command line.
"""

import tempfile
from importlib.resources import files

import numpy as np
import xarray as xr

from spinlev import Levitation, Models, draw, load_scene, parse_scene, run_study
from spinlev.studies.catalogue.entries import CATALOGUE
from spinlev.studies.figures.style import panels, styled
from spinlev.studies.result import variable
from spinlev.studies.study import Study

TEXT = load_scene(files("spinlev.scenes") / "horizontal.toml").text


def points(quick):
    """Densities (kg/m³), in types that JSON knows."""
    return [{"density": float(density)} for density in np.linspace(7100.0, 7900.0, 5 if quick else 17)]


def compute(point):
    """Axial mode and position of one floater: a dataset over `case` of length one."""
    scene = parse_scene(TEXT, changes={"floater.density_kg_m3": point["density"]})
    found = Levitation(scene, Models("dipole", "none")).stability
    axial = next(mode.frequency_hz for mode in found.modes if mode.name == "bounce")
    return xr.Dataset({
        "density": variable(("case",), [point["density"]], "kg/m³", "density of the floater"),
        "axial": variable(("case",), [axial], "Hz", "frequency of the axial mode"),
        "height": variable(("case",), [found.position[2]], "m", "height"),
    })  # fmt: skip


@styled
def picture(result):
    """The axial mode against the density."""
    figure, ((axes,),) = panels(1, 1, 3.6)
    axes.plot(result["density"], result["axial"], "o-")
    axes.set(
        xlabel="density of the floater (kg/m³)", ylabel="axial mode (Hz)", title="A heavier floater oscillates faster"
    )
    return figure


def report(result):
    """The report, in lines."""
    rows = zip(result["density"].values, result["axial"].values, strict=True)
    return [f"{density:.0f} kg/m³: {axial:.2f} Hz" for density, axial in rows]


STUDY = Study(
    name="axial-mode",
    summary="frequency of the axial mode against the floater's density",
    points=points,
    compute=compute,
    figures={"axial-mode": picture},
    report=report,
)
CATALOGUE[STUDY.name] = STUDY

with tempfile.TemporaryDirectory() as folder:
    result = run_study(STUDY.name, quick=True, out=folder)
print(*report(result), sep="\n")
axial_hz = float(result["axial"].sel(case=2))
figure = draw(result)[STUDY.name]
figure
