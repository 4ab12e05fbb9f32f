"""The style of every figure, and how figures are written."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any, ParamSpec

from ...fem.files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PALETTE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]
"""Colours of M. Okabe and K. Ito, which all kinds of colour vision tell apart."""
STYLE: Any = {
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.fontsize": 7,
    "legend.handlelength": 1.6,
    "legend.title_fontsize": 7,
    "lines.linewidth": 1.2,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.prop_cycle": f"cycler('color', {PALETTE})",
    "legend.frameon": False,
    "savefig.dpi": 180,
    "pdf.fonttype": 42,  # journals take no Type 3 fonts
    "figure.constrained_layout.use": True,
}
COLUMN, PAGE = 85 / 25.4, 170 / 25.4  # Width of a figure in one column of a journal and across its page, inches


class _Looks(dict[str, str]):
    """How each field model is shown; one of a user's own looks as `other`, or has its own name."""

    other = ""

    def __missing__(self, model: str) -> str:
        return self.other or model


NAMES = _Looks(
    dipole="point dipole",
    cuboid="cuboid, closed form (μr = 1)",
    fem="finite elements",
    moments="moments",
    map="map",
)
COLORS = _Looks(zip(NAMES, PALETTE, strict=False))
DASHES = _Looks(dipole="--", cuboid="-.", fem="-", moments=":", map="-")
COLORS.other, DASHES.other = PALETTE[len(NAMES)], "-"
Arguments = ParamSpec("Arguments")


def styled(draw: Callable[Arguments, Figure]) -> Callable[Arguments, Figure]:
    """Let a function draw in the project's style."""

    @wraps(draw)
    def inside(*arguments: Arguments.args, **options: Arguments.kwargs) -> Figure:
        import matplotlib as mpl

        with mpl.rc_context(STYLE):
            return draw(*arguments, **options)

    return inside


def panels(rows: int, columns: int, size: tuple[float, float], **shared: Any) -> tuple[Figure, Any]:
    """A figure without a window and its axes, lettered (a), (b) where there are several.

    Parameters
    ----------
    rows, columns : of the panels
    size : width and height, inches
    shared : as of `Figure.subplots`
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=size)
    axes = figure.subplots(rows, columns, squeeze=False, **shared)
    for letter, panel in zip(ascii_lowercase, axes.flat if rows * columns > 1 else (), strict=False):
        panel.set_title(f"({letter})")
    return figure, axes


def legend_below(figure: Figure, *labelled: Any, columns: int = 6) -> None:
    """One legend below all panels, where nothing that is drawn lies under it.

    Parameters
    ----------
    figure : with its panels
    labelled : the axes whose names it explains; all where none are given
    columns : at most
    """
    named = labelled or figure.axes
    entries = {n: h for axes in named for h, n in zip(*axes.get_legend_handles_labels(), strict=True)}
    if entries:
        figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=min(columns, len(entries)))


def save_figures(figures: Mapping[str, Figure], out: Path) -> list[str]:
    """Write each figure as PNG and PDF; returns the files."""
    files = []
    for name, figure in figures.items():
        for kind in ("png", "pdf"):
            save_figure(figure, out / f"{name}.{kind}")
            figure.set_layout_engine("none")  # the places found for the first format are those of the second
            files.append(str(out / f"{name}.{kind}"))
    return files


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure; the format follows the suffix."""
    write_whole(path, figure_bytes(figure, path.suffix[1:]))


def figure_bytes(figure: Figure, kind: str) -> bytes:
    """The figure as the content of a file of the kind `png` or `pdf`."""
    import matplotlib as mpl

    stream = io.BytesIO()
    with mpl.rc_context(STYLE):
        figure.savefig(stream, format=kind)
    return stream.getvalue()
