"""The figures of any result, from its file alone."""

from collections.abc import Mapping
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from ...fem.storage import read_checked
from ...geometry.basics import InputError
from ..pictures import drawable, modes_figure, question_figure
from ..results import field_figure, force_figure, save_figures, trajectory_figure
from .entries import CATALOGUE

QUESTION = "question"
"""What the result of one's own question is called."""
DRAWN = {
    "axis_field": ("field", field_figure),
    "curve_force": ("force", force_figure),
    "position_rotor_frame": ("trajectory", trajectory_figure),
    "mode_growth": ("modes", modes_figure),
}
"""By variable of a result that is no study: name of the figure and who draws it."""


def draw_result(path: Path, out: Path) -> list[str]:
    """Draw a result file anew; returns the files written.

    Raises
    ------
    InputError : the file cannot be read, or is no result of this program
    """
    return save_figures(figures_of(read_result(path)), out)


def read_result(path: Path) -> xr.Dataset:
    """The whole of a result file. Raises InputError if it cannot be read, or is no result of this program."""
    if path.suffix == ".toml":
        raise InputError(
            f"Input {path} must be a result; instead it is a scene. Its result is made by: spinlev run {path}"
        )
    result = read_checked(path)
    if "study" not in result.attrs:
        raise InputError(f"Input {path} must be a result of spinlev; instead it has no attribute 'study'.")
    return result


def figures_of(result: xr.Dataset) -> Mapping[str, Figure]:
    """The figures of a result by name."""
    kind = str(result.attrs["study"])
    if kind in CATALOGUE:
        return {name: draw(result) for name, draw in CATALOGUE[kind].figures.items()}
    if kind == QUESTION:
        return {QUESTION: question_figure(result)} if drawable(result) else {}
    found = {name: draw(result) for key, (name, draw) in DRAWN.items() if key in result}
    if not found:
        raise InputError(f"Input study must be one that this version knows; instead the result is of '{kind}'.")
    return found
