"""What figures and reports of several studies share: panels, legends, colours of rotors; tables and numbers."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import wraps
from typing import Any, SupportsFloat

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ...geometry.common import Array
from ..cli.console import aligned
from ..figures.style import PALETTE, drawn, panels, titled
from ..study import cases_with, each_case
from .article import CONFIGURATIONS, label_of, rotor_label

Drawing = Callable[[xr.Dataset], Figure]
TITLES = {"horizontal": "displaced cube", "vertical": "two cubes", "tilt": "tilted cube"}


def each(
    panels: Callable[..., tuple[Figure, Any]], *how: Any, of: Callable[[xr.Dataset], Any] | None = None, **shared: Any
) -> Callable[[Callable[..., None]], Drawing]:
    """Let what draws one panel draw the figure of a joined result, or of what is made `of` it.

    One of the functions below arranges the `panels`; each row that it returns is handed on to what is decorated.
    """

    def decorated(draw: Callable[..., None]) -> Drawing:
        def figure_of(result: xr.Dataset) -> Figure:
            figure, rows = panels(of(result) if of else result, *how, **shared)
            for row in rows:
                draw(*row)
            return figure

        return drawn(wraps(draw)(figure_of))

    return decorated


def small_multiples(
    parts: Any, height: float, columns: int = 3, xlabel: str = "", ylabel: str = "", **shared: Any
) -> tuple[Figure, list[tuple[Axes, Any]]]:
    """A panel for each of `parts` (by title, behind its letter), beside what it shows; `shared` are of `subplots`.

    Rows have `columns` panels and a `height` in inches; `xlabel` is below the lowest, `ylabel` beside the first.
    """
    count = len(parts := dict(parts))
    figure, ((*axes,),) = panels(1, count, height + 0.3, min(columns, count), **shared)
    for k, (panel, title) in enumerate(zip(axes, parts, strict=True)):
        titled(panel, title)
        if (place := panel.get_subplotspec()).is_first_col():
            panel.set_ylabel(ylabel)
        if k + place.get_gridspec().ncols >= count:
            panel.set_xlabel(xlabel)
            panel.tick_params(labelbottom=True)  # the last in its column, though another row may follow
    return figure, list(zip(axes, parts.values(), strict=True))


def by_configuration(result: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Each configuration that a joined result has, with its rotors by ascending displacement or tilt."""
    for configuration in CONFIGURATIONS:
        part = cases_with(result, configuration=configuration)
        if part.sizes["case"]:
            yield configuration, part.sortby(_measure(part))


def by_rotor(result: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Each rotor that a joined result has, by its label, with all of its cases."""
    for configuration, part in by_configuration(result):
        for value in np.unique(part[_measure(part)].values):
            yield rotor_label(configuration, float(value)), cases_with(part, **{_measure(part): value})


def rotor_cases(result: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Each case of a joined result with its rotor's label, rotor by rotor."""
    return ((label, one) for label, rotor in by_rotor(result) for one in each_case(rotor))


def _measure(part: xr.Dataset) -> str:
    return "measure" if "measure" in part else "value"


def configuration_panels(
    result: xr.Dataset, height: float, xlabel: str = "", ylabel: str = "", **shared: Any
) -> tuple[Figure, list[tuple[Axes, xr.Dataset]]]:
    """A panel for each configuration of a `result`; `height`, `xlabel` (else the measure's), `ylabel` as above."""
    parts = {TITLES[name]: part for name, part in by_configuration(result)}
    figure, rows = small_multiples(parts, height, 3, xlabel, ylabel, sharey=True, **shared)
    for axes, part in () if xlabel else rows:
        axes.set_xlabel(label_of(part["configuration"].values[0]))
    return figure, rows


def rotor_panels(
    result: xr.Dataset, height: float, xlabel: str, ylabel: str, **shared: Any
) -> tuple[Figure, list[tuple[Axes, xr.Dataset, Any]]]:
    """A panel for each configuration of a `result`, and for each rotor its panel, cases and colour, explained by a bar.

    `height`, `xlabel` and `ylabel` are as of `small_multiples`.
    """
    figure, rows = configuration_panels(result, height, xlabel, ylabel, **shared)
    found: list[tuple[Axes, xr.Dataset, Any]] = []
    for axes, part in rows:
        rotors, configuration = dict(by_rotor(part)), part["configuration"].values[0]
        if len(rotors) == 1:
            axes.set_title(axes.get_title("left").replace(TITLES[configuration], next(iter(rotors))))
            found.append((axes, part, PALETTE[0]))
            continue
        colors, count = mpl.colormaps["viridis"](np.linspace(0, 0.88, len(rotors))), len(rotors)
        shown = ScalarMappable(BoundaryNorm(np.arange(count + 1) - 0.5, count), ListedColormap(colors))
        bar = figure.colorbar(shown, ax=axes, location="bottom", ticks=range(count), aspect=25)
        bar.ax.set_xticklabels([f"{value:g}" for value in np.unique(part[_measure(part)])])
        bar.set_label(label_of(configuration))
        found += [(axes, rotor, color) for rotor, color in zip(rotors.values(), colors, strict=True)]
    return figure, found


def rotor_places(axes: Axes, part: xr.Dataset) -> Array:
    """Numbered places (case,) for the rotors of one configuration along x, labelled by their displacement or tilt."""
    count = part.sizes["case"]
    axes.set_xticks(range(count), [f"{m:g}" for m in part["measure"].values])
    axes.set_xlim(-0.6, count - 0.4)
    return np.arange(count, dtype=float)


def explain(axes: Axes, formats: Mapping[str, str], **style: Any) -> None:
    """Entries in a legend that no curve has by itself: formats of `Axes.plot` by meaning, grey if without a colour."""
    for words, shape in formats.items():
        grey = {} if "C" in shape or "k" in shape else {"color": "0.3"}
        axes.plot([], [], shape, **{**grey, "label": words, **style})


def text_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Lines with aligned columns below their heads; numbers with four significant digits, NaN as a dash."""

    def cell(value: Any) -> str:
        return value if isinstance(value, str) else f"{float(value):.4g}" if np.isfinite(float(value)) else "–"

    return aligned([tuple(head), *(tuple(map(cell, row)) for row in rows)], "<>")


def span(values: ArrayLike, digits: str = ".3g") -> str:
    """The smallest and the largest of the known values; a dash if there is none."""
    known = np.ravel(np.asarray(values, float))
    known = known[np.isfinite(known)]
    if not known.size:
        return "–"
    low, high = (f"{value:{digits}}" for value in (known.min(), known.max()))
    return low if low == high else f"{low} to {high}"


def uncertain(value: SupportsFloat, error: SupportsFloat) -> str:
    """A number with its error, which has one digit; without it where it is not known."""
    number, doubt = float(value), float(error)
    if not np.isfinite(doubt) or doubt <= 0:
        return f"{number:.4g}"
    return f"{number:.{int(np.clip(-np.floor(np.log10(doubt)), 0, 6))}f} ± {doubt:.1g}"


def range_text(value: xr.DataArray, error: xr.DataArray, scale: float = 1.0) -> str:
    """A range of values with signs, times `scale`, and the largest of their errors, which have the same dimensions."""
    if not value.notnull().any():
        return "–"
    worst = scale * float(np.nanmax(error.values))
    digits = int(np.clip(1 - np.floor(np.log10(max(worst, 1e-6))), 1, 4))
    return f"{span(scale * value, f'+.{digits}f')} (± {worst:.1g})"


def last_crossing(distance: Array, values: Array, level: float) -> float:
    """From which `distance` (n,), ascending, on `values` (n,) stay below a `level`; NaN if beyond the last."""
    above = np.flatnonzero(values > level)
    if not len(above):
        return float(distance[0])
    k = int(above[-1])
    if k + 1 == len(distance):
        return float("nan")
    share = np.log(values[k] / level) / np.log(values[k] / values[k + 1])
    return float(distance[k] * (distance[k + 1] / distance[k]) ** share)
