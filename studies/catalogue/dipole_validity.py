"""Where the point dipole, and what lies between it and the true field, can be trusted.

Region: distance below the lower magnet's centre × lateral offset, worst azimuth, for the article's three rotors.
Truth: the finite-element table, whose own error is stored beside.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from ...fem.harmonics import uniform_moments
from ...fem.rotor_tables import RotorTable, rotor_table
from ...geometry.basics import Array
from ...geometry.bodies import Magnet, horizontal, tilt, vertical
from ..results import study_of_one, variable
from .dipole_validity_figure import FIGURES, validity_lines

EDGE, REMANENCE, PERMEABILITY = 0.01, 1.305, 1.05
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


STUDY = study_of_one(
    name="dipole-validity",
    summary="where the dipole and each further model are good to 10, 1, 0.1 and 0.01 %",
    compute=dipole_validity,
    figures=FIGURES,
    report=validity_lines,
)
