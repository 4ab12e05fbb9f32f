"""Where the point dipole, and models between it and the field of the finite magnets, can be trusted.

Region: distance below the lower magnet's centre × lateral offset, worst azimuth, for the article's three rotors.
Truth: the finite-element table, whose own error is stored beside.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ...fem.harmonics.expansion import uniform_moments
from ...fem.rotor.choice import rotor_table
from ...fem.rotor.table import RotorTable
from ...geometry.common import Array
from ...geometry.magnets import Magnet
from ...geometry.rotor import horizontal, tilt, vertical
from ..figures.style import PALETTE, legend_below, styled
from ..result import variable
from ..study import study_of_one
from .article import EDGE, PERMEABILITY, REMANENCE
from .drawing import explain, last_crossing, small_multiples, text_table

ROTORS = {
    "horizontal, δx = 2 mm": horizontal(0.002, EDGE, REMANENCE, PERMEABILITY),
    "vertical, δz = 14 mm": vertical(0.014, EDGE, REMANENCE, PERMEABILITY),
    "tilt, δθ = 10°": tilt(float(np.radians(10)), EDGE, REMANENCE, PERMEABILITY),
}
AZIMUTHS = np.radians(np.arange(0.0, 360.0, 30.0))


def dipole_validity(quick: bool, rotors: Mapping[str, tuple[Magnet, ...]] = ROTORS) -> xr.Dataset:
    """Relative errors of B and of its gradient by rotor, model, distance and lateral offset."""
    distance = np.linspace(0.0115, 0.05, 12 if quick else 60)
    offset = np.linspace(0.0, 0.01, 5 if quick else 21)
    points = _points(distance, offset)
    parts = [_errors(magnets, points, (len(distance), len(offset), len(AZIMUTHS))) for magnets in rotors.values()]
    dims = ("rotor", "model", "distance", "offset")
    errors, gradients, own = (np.stack(part) for part in zip(*parts, strict=True))
    return xr.Dataset(
        {
            "field_error": variable(dims, errors, "1", "largest relative error of B over the azimuth"),
            "gradient_error": variable(dims, gradients, "1", "largest relative error of the gradient of B"),
            "truth_error": variable(("rotor", "distance", "offset"), own, "1", "stated relative error of the truth"),
        },
        coords={
            "rotor": list(rotors),
            "model": list(models(next(iter(rotors.values())), 1.0)),
            "distance": variable(("distance",), distance, "m", "distance below the lower magnet's centre"),
            "offset": variable(("offset",), offset, "m", "distance from the axis"),
        },
    )


def models(magnets: tuple[Magnet, ...], factor: float) -> dict[str, RotorTable]:
    """Models from the article's dipole to the closed form; `factor` is true over remanent moment."""
    true = tuple(replace(magnet, polarization=factor * magnet.polarization) for magnet in magnets)
    return {
        "dipole": _moments(magnets, 1),
        "dipole, true moment": _moments(true, 1),
        "moments to 5, true moment": _moments(true, 5),
        "moments to 13, true moment": _moments(true, 13),
        "cuboid": RotorTable("cuboid", magnets, magnets),
        "cuboid, true moment": RotorTable("cuboid", true, true),
    }


def _moments(magnets: tuple[Magnet, ...], degree: int) -> RotorTable:
    return RotorTable("moments", magnets, (), tuple(uniform_moments(magnet, degree) for magnet in magnets))


def _points(distance: Array, offset: Array) -> Array:
    d, r, phi = np.meshgrid(distance, offset, AZIMUTHS, indexing="ij")
    return np.stack([r * np.cos(phi), r * np.sin(phi), -d], axis=-1).reshape(-1, 3)


def _errors(magnets: tuple[Magnet, ...], points: Array, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    truth = rotor_table(magnets, "fem", 1e-6)
    exact, gradient = truth.evaluate(points)
    factor = float(np.linalg.norm(truth.moment) / np.linalg.norm(sum(m.moment for m in magnets)))
    errors, gradients = [], []
    for table in models(magnets, factor).values():
        b, g = table.evaluate(points)
        apart = np.linalg.norm(b - exact, axis=1) / np.linalg.norm(exact, axis=1)
        apart_gradient = np.linalg.norm(g - gradient, axis=(1, 2)) / np.linalg.norm(gradient, axis=(1, 2))
        errors.append(apart.reshape(shape).max(axis=2))
        gradients.append(apart_gradient.reshape(shape).max(axis=2))
    own = truth.relative_error(points)[0].reshape(shape).max(axis=2)
    return np.array(errors), np.array(gradients), own


LEVELS = (1e-1, 1e-2, 1e-3, 1e-4)


def validity_lines(result: xr.Dataset) -> list[str]:
    """From which distance on each model is good to 10, 1, 0.1 and 0.01 % on the axis, by rotor."""
    distance, rows = 1e3 * result["distance"].values, []
    for rotor in result["rotor"].values:
        for model in result["model"].values:
            error = result["field_error"].sel(rotor=rotor, model=model).isel(offset=0).values
            rows.append((f"{rotor}, {model}", *(_reach(distance, error, level) for level in LEVELS)))
    words = "Distance (mm) below the lower magnet from which on B on the axis is good to each error:"
    return [words, *text_table(("rotor, model", *(f"{100 * level:g} %" for level in LEVELS)), rows)]


def _reach(distance: Array, error: Array, level: float) -> str:
    """The distance beyond which the error stays below a level, with a sign where that is not in the range."""
    found = last_crossing(distance, error, level)
    if np.isnan(found):
        return f">{distance[-1]:.1f}"
    return f"<{found:.1f}" if found == distance[0] else f"{found:.1f}"


@styled
def validity_figure(result: xr.Dataset) -> Figure:
    """Error of each model against the distance, on the axis and at the largest lateral offset, rotor by rotor."""
    names, distance = result["rotor"].values.tolist(), 1e3 * result["distance"].values
    figure, axes = small_multiples(names, 3.0, xlabel="distance (mm)", ylabel="relative error of B", sharey=True)
    for panel, rotor in zip(axes, names, strict=True):
        for model, color in zip(result["model"].values, PALETTE, strict=False):
            error = result["field_error"].sel(rotor=rotor, model=model)
            panel.semilogy(distance, error.isel(offset=0), color=color, label=str(model))
            panel.semilogy(distance, error.isel(offset=-1), ":", color=color)
        own = result["truth_error"].sel(rotor=rotor)
        panel.semilogy(distance, own.max("offset"), color="0.6", lw=2.5, label="error of the finite elements")
    widest = 1e3 * float(result["offset"][-1])
    explain(axes[0], {"on the axis": "-", f"{widest:g} mm off the axis, worst azimuth": ":"})
    legend_below(figure, axes[0], columns=3)
    return figure


STUDY = study_of_one(
    name="dipole-validity",
    summary="where the dipole and each further model are good to 10, 1, 0.1 and 0.01 %",
    compute=dipole_validity,
    figures={"dipole-validity": validity_figure},
    report=validity_lines,
)
