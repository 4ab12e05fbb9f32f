"""What a page gives its reader to take home: the scene file, the result, and the figure of what is on the screen."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import scene_text
from ..one_scene import Levitation, equilibria_answer
from ..results import PAGE, PALETTE, figure_bytes, found_dataset, panels, styled, write_dataset
from ..terminal import to_json
from .shown import Shown
from .state import PageState

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILES = {"toml": "scene.toml", "json": "equilibria.json", "nc": "equilibria.nc", "png": "explore.png"}
TYPES = {"toml": "text/plain", "json": "application/json", "nc": "application/x-netcdf", "png": "image/png"}


@dataclass(frozen=True)
class Screen:
    """What is on a page's screen.

    Parameters
    ----------
    shown : the numbers; None where there are none
    map_title, axes : of the map: its name, and names of frequency and measure
    frequencies, measures, kind : of the map, as of `Regions`; empty where there is none
    point : frequency and measure now
    time, height, tilt : of the flight so far, s, mm and degrees
    """

    shown: Shown | None
    map_title: str
    axes: tuple[str, str]
    frequencies: Array
    measures: Array
    kind: Array
    point: tuple[float, float]
    time: Array
    height: Array
    tilt: Array


def content(kind: str, state: PageState, screen: Screen | None = None) -> bytes:
    """A file's content; the result is computed as the command line does.

    Raises
    ------
    SpinlevError : the scene has no answer
    """
    if kind == "toml":
        return scene_text(state.scene).encode()
    if kind == "png":
        assert screen is not None
        return figure_bytes(screen_figure(screen, state), "png")
    levitation = Levitation(state.scene, state.models, state.spin)
    if kind == "json":
        answer: dict[str, Any] = {**equilibria_answer(levitation), "tables_from_cache": levitation.from_cache}
        return f"{to_json(answer)}\n".encode()
    dataset = found_dataset(levitation.equilibria).assign_attrs(study="equilibria", **levitation.labels)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / FILES["nc"]
        write_dataset(dataset, path, state.scene)
        return path.read_bytes()


@styled
def screen_figure(screen: Screen, state: PageState) -> Figure:
    """Map, running plots and the headline."""
    from matplotlib.colors import ListedColormap

    figure, ((chart, height), (words, tilt)) = panels(2, 2, (PAGE, 4.6))
    said = screen.shown.headline if screen.shown else "No equilibrium is known."
    figure.suptitle(said, fontsize=8, x=0.01, ha="left", wrap=True)
    if screen.kind.size:
        colors = ListedColormap(["white", "#D8DEE9", PALETTE[5]])
        chart.pcolormesh(
            screen.frequencies, screen.measures, screen.kind.T, cmap=colors, vmin=0, vmax=2, rasterized=True
        )
        chart.plot(*screen.point, "o", color=PALETTE[1])
        chart.set(xlabel=screen.axes[0], ylabel=screen.axes[1], title=screen.map_title)
    else:
        chart.set_axis_off()
    for axes, values, label in ((height, screen.height, "Height (mm)"), (tilt, screen.tilt, "Tilt of the moment (°)")):
        axes.plot(screen.time, values)
        axes.set(xlabel="Time (s)", ylabel=label)
        if not np.size(values):
            axes.text(0.5, 0.5, "no flight yet", transform=axes.transAxes, ha="center", color="grey")
    words.set_axis_off()
    words.text(0, 1, _table(screen, state), transform=words.transAxes, va="top", fontsize=6, family="monospace")
    return figure


def _table(screen: Screen, state: PageState) -> str:
    if screen.shown is None:
        return ""
    rows = [row for table in (screen.shown.rows, [("",)], screen.shown.modes) for row in table]
    lines = [" ".join(f"{text:>14}" for text in (row[:4] if len(row) > 3 else row)) for row in rows]
    return "\n".join([f"By: {screen.shown.sign}", f"spinlev equilibria scene.toml {state.command}", "", *lines])
