"""What figures and reports of several studies share: panels, legends, colours of rotors, tables and numbers as text."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from ...geometry.common import Array
from ..figures.style import PAGE, PALETTE, panels
from ..study import cases_with
from .article import CONFIGURATIONS, label_of, rotor_label

TITLES = {"horizontal": "displaced cube", "vertical": "two cubes", "tilt": "tilted cube"}


def small_multiples(
    titles: Sequence[str], height: float, columns: int = 3, xlabel: str = "", ylabel: str = "", **shared: Any
) -> tuple[Figure, list[Axes]]:
    """A panel for each title.

    Parameters
    ----------
    titles : of the panels, behind their letters
    height : of a row, inches
    columns : panels side by side, at most
    xlabel, ylabel : of the lowest panel of each column, and of the first of each row
    shared : as of `Figure.subplots`
    """
    count = len(titles)
    columns = min(columns, count)
    rows = -(-count // columns)
    figure, grid = panels(rows, columns, (PAGE, height * rows + 0.5), **shared)
    for unused in grid.flat[count:]:
        unused.remove()
    axes = list(grid.flat[:count])
    for k, (panel, title) in enumerate(zip(axes, titles, strict=True)):
        panel.set_title(f"{panel.get_title('left')} {title}".strip())
        if k % columns == 0:
            panel.set_ylabel(ylabel)
        if k + columns >= count:
            panel.set_xlabel(xlabel)
            panel.tick_params(labelbottom=True)  # the last in its column, though another row may follow
    return figure, axes


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


def _measure(part: xr.Dataset) -> str:
    """What a study calls displacement or tilt."""
    return "measure" if "measure" in part else "value"


def configuration_panels(
    result: xr.Dataset, height: float, xlabel: str = "", ylabel: str = "", **shared: Any
) -> tuple[Figure, list[tuple[Axes, str, xr.Dataset]]]:
    """A panel for each configuration of a joined result, with its name and its cases; options of `small_multiples`."""
    parts = list(by_configuration(result))
    figure, axes = small_multiples([TITLES[name] for name, _ in parts], height, 3, xlabel, ylabel, **shared)
    return figure, [(panel, *part) for panel, part in zip(axes, parts, strict=True)]


def rotor_panels(
    result: xr.Dataset, height: float, xlabel: str, ylabel: str
) -> tuple[Figure, list[tuple[Axes, xr.Dataset, Any]]]:
    """A panel for each configuration, and for each rotor its panel, its cases and its colour.

    Colours go from dark to bright along viridis with displacement or tilt; a bar below the panel tells them.
    Parameters are those of `small_multiples`.
    """
    figure, rows = configuration_panels(result, height, xlabel, ylabel, sharey=True)
    found: list[tuple[Axes, xr.Dataset, Any]] = []
    for axes, configuration, part in rows:
        rotors = [rotor for _, rotor in by_rotor(part)]
        known = [float(rotor[_measure(rotor)][0]) for rotor in rotors]
        if len(known) == 1:
            axes.set_title(axes.get_title("left").replace(TITLES[configuration], rotor_label(configuration, known[0])))
            found.append((axes, rotors[0], PALETTE[0]))
            continue
        colors = mpl.colormaps["viridis"](np.linspace(0, 0.88, len(known)))
        norm = BoundaryNorm(np.arange(len(known) + 1) - 0.5, len(known))
        bar = figure.colorbar(
            ScalarMappable(norm, ListedColormap(colors)), ax=axes, location="bottom", ticks=range(len(known)), aspect=25
        )
        bar.ax.set_xticklabels([f"{value:g}" for value in known])
        bar.set_label(label_of(configuration))
        found += [(axes, rotor, color) for rotor, color in zip(rotors, colors, strict=True)]
    return figure, found


def rotor_places(axes: Axes, configuration: str, part: xr.Dataset) -> Array:
    """Numbered places (case,) for the rotors of one configuration along x, labelled by their displacement or tilt."""
    count = part.sizes["case"]
    axes.set_xticks(range(count), [f"{m:g}" for m in part["measure"].values])
    axes.set(xlabel=label_of(configuration), xlim=(-0.6, count - 0.4))
    return np.arange(count, dtype=float)


def explain(axes: Axes, formats: Mapping[str, str], **style: Any) -> None:
    """Entries of a legend that no curve has by itself.

    Parameters
    ----------
    axes : that has them
    formats : of `Axes.plot`, by meaning; grey where neither it nor `style` has a colour
    style : of all
    """
    for words, shape in formats.items():
        grey = {} if "C" in shape or "k" in shape else {"color": "0.3"}
        axes.plot([], [], shape, **{**grey, "label": words, **style})


def plain_log(axes: Axes, ticks: Sequence[float]) -> None:
    """A logarithmic x axis of less than a decade, its ticks as plain numbers."""
    axes.set_xscale("log")
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.xaxis.set_minor_locator(NullLocator())


def plot_branch(axes: Axes, x: Array, y: Array, solid: NDArray[np.bool_], **style: Any) -> None:
    """A curve, solid where `solid`, else dashed, without a gap between."""
    inside = solid & np.append(solid[1:], True) & np.append(True, solid[:-1])
    axes.plot(x, np.where(inside, np.nan, y), "--", **{**style, "label": None})
    axes.plot(x, np.where(solid, y, np.nan), "-", **style)
