"""Speed against error of every way to compute the rotor's field.

Two problems have a known answer: one cube with μr = 1, whose closed form is exact, and with μr = 1.05, where the answer
is a table of far finer tolerance, whose own error is stored.
"""

import warnings
from collections.abc import Sequence

import numpy as np
import xarray as xr

from ...fem.rotor_tables import AccuracyWarning, rotor_table
from ...geometry.basics import Array
from ..results import study_of_one, variable
from ..terminal import note
from .field_methods import methods
from .method_cost import DISTANCES, PERMEABILITIES, apart, cube, peer_pace, sphere_points
from .speed_accuracy_figure import FIGURES, speed_lines

TRUTH_TOLERANCE, QUICK_TRUTH = 1e-9, 1e-8
"""Asked of the reference, in 24 and in 4 s of processor time."""


def speed_accuracy(quick: bool, names: Sequence[str] | None = None, truth: float | None = None) -> xr.Dataset:
    """Errors of B and of its gradient by method and distance, beside time, unknowns and memory.

    Parameters
    ----------
    names : of the methods; None for all
    truth : tolerance of the reference; None for the one of the study
    """
    catalogue = {name: method for name, method in methods(quick).items() if names is None or name in names}
    asked = truth or (QUICK_TRUTH if quick else TRUTH_TOLERANCE)
    truths = {problem: _truth(problem, asked) for problem in PERMEABILITIES}
    rows = []
    for name in catalogue:
        note(f"  {name} ...")
        rows.append(apart(name, quick))
    exact = [truths[method.problem] for method in catalogue.values()]
    errors = [
        (_largest(row.field, b, 1), _largest(row.gradient, g, 2)) for row, (b, g, _) in zip(rows, exact, strict=True)
    ]
    dims = ("approach", "distance")
    data = {
        "field_error": variable(dims, np.array([e for e, _ in errors]), "1", "largest relative error of B"),
        "gradient_error": variable(dims, np.array([e for _, e in errors]), "1", "largest relative error of grad B"),
        "stated_error": variable(dims, np.array([row.stated for row in rows]), "1", "error of B that is stated"),
        "truth_error": variable(dims, np.array([own for _, _, own in exact]), "1", "error of the reference itself"),
    }
    costs = {
        "unknowns": ("1", "degrees of freedom"),
        "seconds": ("s", "time from nothing"),
        "cpu_seconds": ("s", "processor time from nothing"),
        "memory": ("B", "memory that it took"),
        "per_point": ("s", "time of B and its gradient per point"),
    }
    for key, (units, label) in costs.items():
        data[key] = variable(("approach",), np.array([float(getattr(row, key)) for row in rows]), units, label)
    coords = {
        "approach": list(catalogue),
        "family": (("approach",), [method.family for method in catalogue.values()]),
        "problem": (("approach",), [method.problem for method in catalogue.values()]),
        "distance": variable(("distance",), np.array(DISTANCES), "m", "distance from the cube's centre"),
    }
    return xr.Dataset(data, coords, {"magpylib_seconds_per_point": peer_pace()})


def _truth(problem: str, rtol: float) -> tuple[Array, Array, Array]:
    """B, its gradient and the stated relative error (d,) of B at the points."""
    points = sphere_points()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)  # its own error is stored, whatever it is
        table = rotor_table(cube(problem), "auto", rtol)
    b, g = table.evaluate(points.reshape(-1, 3))
    own = table.relative_error(points.reshape(-1, 3))[0].reshape(points.shape[:2]).max(axis=1)
    return b.reshape(points.shape), g.reshape(*points.shape, 3), own


def _largest(values: Array, truth: Array, rank: int) -> Array:
    """Largest relative error (d,) over the points of each distance."""
    axes = tuple(range(2, 2 + rank))
    return np.asarray((np.linalg.norm(values - truth, axis=axes) / np.linalg.norm(truth, axis=axes)).max(axis=1))


STUDY = study_of_one(
    name="speed-accuracy",
    summary="error of B and of its gradient against time, unknowns and memory, for every way to the rotor's field",
    compute=speed_accuracy,
    figures=FIGURES,
    report=speed_lines,
    timed=True,
)
