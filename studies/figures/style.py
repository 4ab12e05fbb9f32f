"""The style of every figure, and how figures are written."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from pathlib import Path
from string import ascii_lowercase
from textwrap import fill
from typing import TYPE_CHECKING, Any, Literal, ParamSpec

import numpy as np

from ...geometry.files import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

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
FigureWidth = Literal["column", "page"]
WIDTHS: Mapping[str, float] = {"column": 85 / 25.4, "page": 170 / 25.4}  # of a journal's column and page, inches
LOWER, LOWEST = 0.85, 2.2  # height of a row in a column, of that across the page; inches, or as across the page
BELOW = 0.6  # of a row's height is taken by what is written above and below its panels, inches
LETTERS = 16  # of a label along an inch
LEGEND = 0.4  # height of a legend that a figure's height reckons with, inches
_width: ContextVar[FigureWidth] = ContextVar("width", default="page")


class _Looks(dict[str, str]):
    """How each field model is shown; one of a user's own looks as `other`, or has its own name."""

    other = ""

    def __missing__(self, model: str) -> str:
        return self.other or model


NAMES = _Looks(dipole="point dipole", cuboid="closed form (μr = 1)", fem="finite elements", moments="moments")
NAMES |= {"map": "map", "surface": "charges on the surfaces"}
COLORS = _Looks(zip(NAMES, PALETTE, strict=False))
DASHES = _Looks(dipole="--", cuboid="-.", fem="-", moments=":", map="-", surface="-")
COLORS.other, DASHES.other = "#000000", "-"
Arguments = ParamSpec("Arguments")


def styled(draw: Callable[Arguments, Figure], explained: bool = False) -> Callable[Arguments, Figure]:
    """Let a function draw in the project's style; what has a name may be `explained` below the panels."""

    @wraps(draw)
    def inside(*arguments: Arguments.args, **options: Arguments.kwargs) -> Figure:
        import matplotlib as mpl

        with mpl.rc_context(STYLE):
            figure = draw(*arguments, **options)
            if explained:
                legend_below(figure)
        for panel in figure.axes:
            if place := panel.get_subplotspec():  # a colour bar has none
                room = figure.get_figheight() / place.get_gridspec().nrows - BELOW
                lines = panel.get_ylabel().split("\n")
                panel.set_ylabel("\n".join(fill(line, max(12, int(LETTERS * room))) for line in lines))
        return figure

    return inside


def drawn(draw: Callable[Arguments, Figure]) -> Callable[Arguments, Figure]:
    """Let a function draw in the project's style; all that has a name is explained below the panels."""
    return styled(draw, explained=True)


def titled(panel: Axes, words: str) -> None:
    panel.set_title(f"{panel.get_title('left')} {words}".strip())


@contextmanager
def figures_across(width: FigureWidth) -> Iterator[None]:
    """What is drawn inside is as wide as a journal's column (85 mm) or page (170 mm)."""
    token = _width.set(width)
    try:
        yield
    finally:
        _width.reset(token)


def panels(
    rows: int, columns: int, height: float, beside: int | None = None, stays: bool = False, **shared: Any
) -> tuple[Figure, Any]:
    """A figure without a window and its axes (`rows`, `columns`), lettered (a), (b) where there are several.

    A row has a `height` in inches and across the page so many panels `beside` each other, by default all; `shared` are
    options of `Figure.subplots`. In a column panels stand one below the other where they are up to four, else in pairs,
    and their text keeps its size, unless the figure `stays` across the page because its panels belong together.
    """
    from matplotlib.figure import Figure

    width, count, turned, beside = "page" if stays else _width.get(), rows * columns, False, beside or columns
    if width == "column":
        turned, beside = columns > rows > 1, min(beside, 2 if count > 4 else 1)
        height = min(height, max(LOWER * height, LOWEST))
    shape = (columns, rows) if turned else (-(-count // beside), beside)  # each row becomes a column, or is wrapped
    figure = Figure(figsize=(WIDTHS[width], height * shape[0]))
    axes = figure.subplots(*shape, squeeze=False, **shared)
    axes = axes.T if turned else axes.ravel()
    for unused in axes.flat[count:]:
        unused.remove()
    axes = axes.flat[:count].reshape(rows, columns)
    for letter, panel in zip(ascii_lowercase, axes.flat if count > 1 else (), strict=False):
        panel.set_title(f"({letter})")
    return figure, axes


def colour_bar(figure: Figure, shown: Any, axes: Any, **options: Any) -> Any:
    """The bar of the colours in a row of panels beside it, of those in a column below it; options of `colorbar`."""
    row = len({panel.get_subplotspec().rowspan.start for panel in axes}) == 1
    return figure.colorbar(shown, ax=list(axes), location="right" if row else "bottom", **options)


def plot_branch(axes: Axes, x: ArrayLike, y: ArrayLike, solid: NDArray[np.bool_], **style: Any) -> None:
    """A curve, solid where `solid`, else dashed, without a gap between."""
    inside = solid & np.append(solid[1:], True) & np.append(True, solid[:-1])
    axes.plot(x, np.where(inside, np.nan, y), "--", **{**style, "label": None})
    axes.plot(x, np.where(solid, y, np.nan), "-", **style)


def plain_log(axis: Any, ticks: Sequence[float] = ()) -> None:
    """A logarithmic axis of few decades, its ticks (if not given 1, 3, 10 … of x, 1, 2, 5 … of y) as plain numbers."""
    from matplotlib.ticker import FixedLocator, LogLocator, NullLocator

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    locator = LogLocator(subs=(1.0, 3.0) if axis.axis_name == "x" else (1.0, 2.0, 5.0))
    axis.set(major_locator=FixedLocator(ticks) if ticks else locator, minor_locator=NullLocator())
    axis.set_major_formatter("{x:g}")


def legend_below(figure: Figure) -> None:
    """One legend below all panels, in as many columns as fit, up to six; the figure becomes higher by its height."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    entries = {n: h for axes in figure.axes for h, n in zip(*axes.get_legend_handles_labels(), strict=True)}
    canvas: Any = FigureCanvasAgg(figure)
    for columns in range(min(len(entries), 6), 0, -1):
        legend = figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=columns)
        size = legend.get_window_extent(canvas.get_renderer())
        if columns == 1 or size.width < 0.97 * figure.bbox.width:
            figure.set_figheight(figure.get_figheight() + max(0.0, size.height / figure.dpi - LEGEND))
            return
        legend.remove()


def save_figures(figures: Mapping[str, Figure], out: Path) -> list[str]:
    """Write each figure as PNG and PDF; returns the files."""
    files = []
    for name, figure in figures.items():
        for kind in ("png", "pdf"):
            files.append(str(out / f"{name}.{kind}"))
            write_whole(out / f"{name}.{kind}", figure_bytes(figure, kind))
            figure.set_layout_engine(None)  # the places found for the first format are those of the second
    return files


def figure_bytes(figure: Figure, kind: str) -> bytes:
    import matplotlib as mpl

    stream = io.BytesIO()
    with mpl.rc_context(STYLE):
        figure.savefig(stream, format=kind)
    return stream.getvalue()
