"""
A study of your own
===================

How the bounce depends on the floater's density.

A study is a pure function of a point, the points at which it is asked, and what is drawn and said of the joined
result. One object joins them, and it is resumable and runs on any number of workers; put into
``studies/catalogue/entries.py``, the command line knows it too.
"""

import tempfile
from importlib.resources import files

import numpy as np
import xarray as xr

from spinlev import draw, load_scene, parse_scene, run_study, stability
from spinlev.studies.catalogue.entries import CATALOGUE
from spinlev.studies.figures.style import panels, styled
from spinlev.studies.result import variable
from spinlev.studies.study import Study

TEXT = load_scene(files("spinlev.scenes") / "horizontal.toml").text


def points(quick):
    """Densities (kg/m³), in types that JSON knows."""
    return [{"density": float(density)} for density in np.linspace(7100.0, 7900.0, 5 if quick else 17)]


def compute(point):
    """Bounce and place of one floater: a dataset over `case` of length one."""
    scene = parse_scene(TEXT, changes={"floater.density_kg_m3": point["density"]})
    found = stability(scene, model="dipole", plate_model="none")
    bounce = found["mode_frequency"].sel(mode="bounce").item()
    return xr.Dataset({
        "density": variable(("case",), [point["density"]], "kg/m³", "density of the floater"),
        "bounce": variable(("case",), [bounce], "Hz", "frequency of the bounce"),
        "height": variable(("case",), [found["position"].sel(axis="z").item()], "m", "height"),
    })  # fmt: skip


@styled
def picture(result):
    """The bounce against the density."""
    figure, ((axes,),) = panels(1, 1, (5.5, 3.6))
    axes.plot(result["density"], result["bounce"], "o-")
    axes.set(xlabel="density of the floater (kg/m³)", ylabel="bounce (Hz)", title="A heavier floater bounces faster")
    return figure


def report(result):
    """What it says, in lines."""
    rows = zip(result["density"].values, result["bounce"].values, strict=True)
    return [f"{density:.0f} kg/m³: {bounce:.2f} Hz" for density, bounce in rows]


STUDY = Study(
    name="bounce",
    summary="bounce against the floater's density",
    points=points,
    compute=compute,
    figures={"bounce": picture},
    report=report,
)
CATALOGUE[STUDY.name] = STUDY

with tempfile.TemporaryDirectory() as folder:
    result = run_study(STUDY.name, quick=True, out=folder)
print(*report(result), sep="\n")
bounce_hz = float(result["bounce"].sel(case=2))
figure = draw(result)[STUDY.name]
figure
