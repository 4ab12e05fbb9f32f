"""The style of every figure, and how figures are written."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

from ...fem.files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PALETTE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]
"""Colours of M. Okabe and K. Ito, which all kinds of colour vision tell apart."""
STYLE: Any = {
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # a place that is not measured anew in each drawing: that is a third of its time
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
    "figure.constrained_layout.use": True,
}
COLUMN, PAGE = 3.4, 7.0
"""Width of a figure in one column of a journal and across its page, inches."""


class _Looks(dict[str, str]):
    """How each field model is shown; one of a user's own has its own name, or looks as `other`."""

    def __init__(self, known: Mapping[str, str], other: str | None = None) -> None:
        super().__init__(known)
        self.other = other

    def __missing__(self, model: str) -> str:
        return self.other or model


NAMES = _Looks(
    {
        "dipole": "point dipole",
        "cuboid": "cuboid, closed form (μr = 1)",
        "fem": "finite elements",
        "moments": "moments",
        "map": "map",
    }
)
COLORS = _Looks(dict(zip(NAMES, PALETTE, strict=False)), other=PALETTE[len(NAMES)])
DASHES = _Looks({"dipole": "--", "cuboid": "-.", "fem": "-", "moments": ":", "map": "-"}, other="-")
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
Draw = TypeVar("Draw", bound="Callable[..., Figure]")


def styled(draw: Draw) -> Draw:
    """Let a function draw in the project's style."""

    @wraps(draw)
    def inside(*arguments: Any, **options: Any) -> Figure:
        import matplotlib as mpl

        with mpl.rc_context(STYLE):
            return draw(*arguments, **options)

    return cast("Draw", inside)


def panels(rows: int, columns: int, size: tuple[float, float], **shared: Any) -> tuple[Figure, Any]:
    """A figure without a window and its axes (rows, columns); `size` in inches, `shared` as of `Figure.subplots`."""
    from matplotlib.figure import Figure

    return _with_axes(Figure(figsize=size), rows, columns, **shared)


def fixed_panels(rows: int, columns: int, size: tuple[float, float], lines_below: int = 0) -> tuple[Figure, Any]:
    """As `panels`, at places that leave room for a title, labels, numbers with an exponent and a legend's lines below.

    To measure every text and make room for it, as `panels` does, takes half as long again as drawing.
    """
    from matplotlib.figure import Figure

    figure, (wide, high) = Figure(figsize=size), size
    figure.set_layout_engine("none")
    # Margins in inches, for the style's sizes of letters.
    left, right, top, bottom = 0.78, 0.15, 0.42, 0.45 + lines_below * 0.16
    panel_wide, panel_high = (wide - right) / columns - left, (high - bottom - top - (rows - 1) * 0.87) / rows
    places = {"left": left / wide, "right": 1 - right / wide, "bottom": bottom / high, "top": 1 - top / high}
    apart = {"wspace": left / panel_wide, "hspace": 0.87 / panel_high}
    figure, grid = _with_axes(figure, rows, columns, gridspec_kw=places | apart)
    for axes in grid.flat:
        axes.xaxis.set_label_coords(0.5, -0.26 / panel_high)
        axes.yaxis.set_label_coords(-0.52 / panel_wide, 0.5)
    return figure, grid


def _with_axes(figure: Figure, rows: int, columns: int, **options: Any) -> tuple[Figure, Any]:
    """The figure and its new axes; powers of ten stand over the numbers, beside the title instead of under it."""
    grid = figure.subplots(rows, columns, squeeze=False, **options)
    for axes in grid.flat:
        axes.yaxis.get_offset_text().set_horizontalalignment("right")
    return figure, grid


def power_of_ten(value: float, _: int) -> str:
    """The number at a decade of a logarithmic axis, in letters: a formula would have to be read."""
    return "10" + f"{math.log10(value):.0f}".translate(RAISED)


def legend_below(figure: Figure, *labelled: Any, columns: int = 6) -> None:
    """One legend below all panels, of what the axes `labelled` name: nothing that is drawn lies under it."""
    entries = {n: h for axes in labelled for h, n in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=min(columns, len(entries)))


def save_figures(figures: Mapping[str, Figure], out: Path) -> list[str]:
    """Write each figure as PNG and PDF; returns the files."""
    files = [out / f"{name}.{kind}" for name in figures for kind in ("png", "pdf")]
    for file in files:
        save_figure(figures[file.stem], file)
    return [str(file) for file in files]


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure; the format follows the suffix."""
    write_whole(path, figure_bytes(figure, path.suffix[1:]))


def figure_bytes(figure: Figure, kind: str) -> bytes:
    """The figure as the content of a file of the kind `png` or `pdf`.

    Drawn once, where `savefig` draws twice; its axes are placed with the first file and stand there for the next.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_pdf import FigureCanvasPdf

    stream, shown = io.BytesIO(), figure.dpi
    figure.dpi = STYLE["savefig.dpi"]
    try:
        with mpl.rc_context(STYLE):
            canvas: Any = FigureCanvasAgg(figure) if kind == "png" else FigureCanvasPdf(figure)
            getattr(canvas, f"print_{kind}")(stream)
    finally:
        figure.dpi = shown
    figure.set_layout_engine("none")
    return stream.getvalue()
