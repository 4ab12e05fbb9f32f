"""What a page is about: a scene, the models and the body spin; and the same as the text of an address."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast, get_args
from urllib.parse import urlencode

import numpy as np

from ...dynamics.equilibria.equilibrium import Equilibrium
from ...geometry.common import Array, InputError, shown as shown_value
from ...geometry.scene.contents import Scene
from ...geometry.scene.files import changed, parse_scene, scene_keys, scene_text
from ...geometry.scene.making import assemble
from ...geometry.scene.messages import SceneError
from ...geometry.shapes import Box
from ..cli.console import to_json
from ..cli.options import FieldModel, Models, PlateModel, finite
from ..figures.style import PAGE, PALETTE, figure_bytes, panels, styled
from ..levitation import Levitation
from ..result import Result, write_dataset
from ..words import equilibria_rows, headline, left_out_words, worth_a_row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUICK: tuple[FieldModel, ...] = ("dipole", "cuboid")
"""Fields whose equilibria follow a slider at once."""
CHOICES = ("model", "plate_model", "spin")
"""Keys of an address that are none of the scene file."""
LONGEST, LARGEST = 20_000, 200_000
"""Characters of an address's state; bytes of a scene file that is opened in a page."""


@dataclass(frozen=True, eq=False)
class PageState:
    """All that decides what a page shows, but for the flight.

    Parameters
    ----------
    scene : its scene
    model : of the field
    plate_model : of the plate's currents
    spin : body spin of the equilibria
    source : the scene's file, or another name of it in messages
    first : the scene that the page began with, whose files alone another one may name; None: `scene` itself
    """

    scene: Scene
    model: FieldModel = "dipole"
    plate_model: PlateModel = "slab"
    spin: float = 0.0
    source: str = "scene"
    first: Scene | None = None

    @cached_property
    def keys(self) -> Mapping[str, Any]:
        """Of the scene file."""
        return scene_keys(self.scene)

    @property
    def models(self) -> Models:
        """As the commands take them."""
        return Models(self.model, self.plate_model)

    @property
    def whole_quickly(self) -> bool:
        """Whether the numbers that follow a slider at once are already those of the models asked for."""
        felt = self.scene.plate is not None and self.plate_model != "none"
        return self.model in QUICK and not felt

    @property
    def command(self) -> str:
        """Options of the command line that ask for the same of the scene file."""
        spin = f" --spin {self.spin:g}" if self.spin else ""
        return f"--model {self.model} --plate-model {self.plate_model}{spin}"

    def changed(self, key: str, value: float) -> Self:
        """With another number: of the scene file, by its dotted key, or `spin`. Raises SceneError."""
        if key == "spin":
            return replace(self, spin=finite("spin", value))
        return replace(self, scene=changed(self.scene, {key: value}, self.source, self.first or self.scene))

    def query(self) -> str:
        """The state as the text behind the question mark of an address."""
        parts = {"model": self.model, "plate_model": self.plate_model, "spin": json.dumps(self.spin)}
        return urlencode(parts | dict(_flat(self.keys)))

    def with_query(self, asked: Mapping[str, str]) -> Self:
        """The state of an address: of a whole scene, or one that changes what it names; its rotor or plate is whole.

        Raises
        ------
        SceneError : the scene of the address cannot be, or names a file that the first scene does not
        InputError : a model that does not exist, a spin that is no number, or more than an address may hold
        """
        if sum(len(key) + len(value) for key, value in asked.items()) > LONGEST:
            raise InputError(f"Input address must have at most {LONGEST} characters of a scene; instead it is longer.")
        given = {key: value for key, value in asked.items() if key not in CHOICES}
        scene = self._scene(given) if given else self.scene
        return replace(
            self,
            scene=scene,
            model=_choice(
                "model", asked.get("model", self.model), cast("tuple[FieldModel, ...]", get_args(FieldModel))
            ),
            plate_model=_choice("plate_model", asked.get("plate_model", self.plate_model), get_args(PlateModel)),
            spin=_spin(asked.get("spin", self.spin)),
        )

    def opened(self, content: bytes, name: str) -> Self:
        """The state in which a page shows a scene file of its reader's.

        Raises
        ------
        SceneError : the scene cannot be, or names a file that the first scene does not
        InputError : no text, or more than a page takes
        """
        if len(content) > LARGEST:
            raise InputError(f"Input scene must have at most {LARGEST} bytes in a page; instead it has {len(content)}.")
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            raise SceneError(name, ["Input scene must be a readable UTF-8 text; instead it is not."]) from None
        known = self.first or self.scene
        new = first_state(parse_scene(text, name, known=known), name)
        return replace(
            self,
            scene=new.scene,
            model=new.model,
            plate_model=new.plate_model,
            spin=new.spin,
            source=name,
            first=known,
        )

    def _scene(self, given: Mapping[str, str]) -> Scene:
        keys: dict[str, Any] = scene_keys(self.scene)
        tables = {key.partition(".")[0] for key in given}
        if tables >= {"frequency_hz", "rotor", "floater"}:
            keys = {}
        for table in tables - {"floater"}:
            keys.pop(table, None)
        for key, text in given.items():
            _put(keys, key.split("."), _value(text))
        return assemble(keys, self.source, known=self.first or self.scene)


def first_state(scene: Scene, source: str = "scene") -> PageState:
    """Where a page begins: everything by what can be told at once, the plate as an infinite slab if that can be."""
    model: FieldModel = "map" if scene.field_map else "dipole"
    felt = scene.plate is not None and scene.floater.body is None
    return PageState(scene, model, "slab" if felt else "none", source=source)


def _choice(name: str, value: str, known: tuple[Any, ...]) -> Any:
    if value not in known:
        raise InputError(f"Input {name} must be one of {', '.join(known)}; instead received {shown_value(value)}.")
    return value


def _spin(value: str | float) -> float:
    try:
        spin = finite("spin", float(value))
    except ValueError:
        raise InputError(f"Input spin must be a number; instead received {shown_value(value)}.") from None
    if not -1e3 <= spin <= 1e3:
        raise InputError(f"Input spin must be between -1000 and 1000; instead received {shown_value(value)}.")
    return spin


def _flat(keys: Mapping[str, Any], table: str = "") -> list[tuple[str, str]]:
    """Dotted keys and their values as texts; lists stay whole."""
    found = []
    for key, value in keys.items():
        name = f"{table}.{key}".lstrip(".")
        if isinstance(value, Mapping):
            found += _flat(value, name)
        else:
            found.append((name, value if isinstance(value, str) else json.dumps(value)))
    return found


def _put(keys: Any, path: list[str], value: Any) -> None:
    """Put a value in the place of a dotted key; where a number stands in its way, the scene's check says so."""
    for part in path[:-1]:
        if not isinstance(keys.get(part), dict):
            keys[part] = {}
        keys = keys[part]
    keys[path[-1]] = value


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):  # a text, or lists in lists by the thousand
        return text


MEASURES = {
    "horizontal": ("rotor.displacement_mm", "Displacement (mm)", 0.0, 10.0),
    "vertical": ("rotor.displacement_mm", "Displacement (mm)", 5.0, 30.0),
    "tilt": ("rotor.angle_deg", "Tilt (°)", 0.0, 45.0),
}
"""What moves a rotor of the article."""


@dataclass(frozen=True)
class Control:
    """A number that a slider moves.

    Parameters
    ----------
    key : of the scene file, with dots, or `spin`
    title : with the unit
    value : now
    low, high, step : the slider's
    """

    key: str
    title: str
    value: float
    low: float
    high: float
    step: float


PLATE_REACH = 20.0
"""How far a plate whose middle is level with the rotor's can be moved, mm."""
ROTOR_SIZES = {
    "edge_mm": "Edge of the cube (mm)",
    "diameter_mm": "Rotor's diameter (mm)",
    "height_mm": "Rotor's height (mm)",
}
"""Titles of the sizes that a rotor of the article may have, for its shape."""
FLOATER_SIZES = {"diameter_mm": "Floater's diameter (mm)", "height_mm": "Floater's height (mm)"}


def controls(state: PageState) -> list[Control]:
    """The sliders of a state, from the most to the least used: of what its scene has."""
    found = [_control("frequency_hz", "Frequency (Hz)", state.scene.frequency, 20.0, 300.0, 0.5)]
    keys = state.keys
    rotor, floater = keys["rotor"], keys["floater"]
    if (kind := rotor.get("configuration")) in MEASURES:
        key, title, low, high = MEASURES[kind]
        low = max(low, 1e3 * float(state.scene.rotor[0].body.size[2])) if kind == "vertical" else low  # they touch
        found.append(_control(key, title, rotor[key.partition(".")[2]], low, high, 0.05))
        sizes = [(key, title) for key, title in ROTOR_SIZES.items() if key in rotor]
        found += [_control(f"rotor.{key}", title, rotor[key], 3.0, 20.0, 0.05) for key, title in sizes]
    for key, title in FLOATER_SIZES.items():
        if key in floater:
            found.append(_control(f"floater.{key}", title, floater[key], 3.0, 30.0, 0.05))
    for k, size in enumerate(floater.get("size_mm", ())):
        found.append(
            _control(f"floater.size_mm.{k}", f"Floater's edge along its {'xyz'[k]} (mm)", size, 3.0, 30.0, 0.05)
        )
    found.append(_control("spin", "Body spin S", state.spin, -2.0, 2.0, 0.01))
    if state.scene.plate is not None:
        axis = _facing(state.scene.plate.box)
        title = ("Plate, x (mm)", "Plate, y (mm)", "Plate's height (mm)")[axis]
        place = keys["plate"]["center_mm"][axis]
        near, far = (0.4 * place, 2.5 * place) if place else (-PLATE_REACH, PLATE_REACH)
        found.append(_control(f"plate.center_mm.{axis}", title, place, min(near, far), max(near, far), 0.25))
    return found


def _control(key: str, title: str, value: float, low: float, high: float, step: float) -> Control:
    """One whose range has room for its value."""
    low, high = np.floor(min(low, value) / step) * step, np.ceil(max(high, value) / step) * step
    return Control(key, title, float(value), round(float(low), 6), round(float(high), 6), step)


def _facing(box: Box) -> int:
    """The axis of the laboratory along which a plate is thin."""
    return int(np.abs(box.rotation[:, int(np.argmin(box.size))]).argmax())


MODEL_WORDS = {
    "dipole": "point dipole",
    "cuboid": "closed form of the cuboids",
    "fem": "finite elements",
    "map": "map of the field",
}
PLATE_WORDS = {"none": "without the plate's currents", "slab": "plate as an infinite slab", "reduced": "finite plate"}
PLATE_WORDS["fem"] = PLATE_WORDS["reduced"]
MODE_COLUMNS = ("small motion", "frequency (Hz)", "growth (1/s)")


@dataclass(frozen=True)
class Shown:
    """The numbers of a scene by some models.

    Parameters
    ----------
    headline : where the floater floats and whether it stays there
    rows : of the table of equilibria, the head first; as the command line prints them
    left_out : which solutions are no equilibria, or not known to be, in sentences
    modes : of the eigenvalues of the first equilibrium, the head first
    sign : by which models
    complete : whether all equilibria were searched for here; else they were carried here from a scene nearby
    places : position mm and direction of the moment at t = 0, and whether it is stable, of each equilibrium
    """

    headline: str
    rows: list[tuple[str, ...]]
    modes: list[tuple[str, ...]]
    sign: str
    complete: bool
    places: list[tuple[list[float], list[float], bool]] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def shown(levitation: Levitation) -> Shown:
    """What a page shows of a scene."""
    found, left_out = levitation.equilibria, levitation.survey.left_out
    useful = worth_a_row(found)
    felt = levitation.plate.model if levitation.plate is not None else "none"
    plate = f", {PLATE_WORDS[felt]}" if levitation.scene.plate is not None else ""
    mutual = ", rotor and floater magnetise each other" if levitation.interaction_model == "mutual" else ""
    return Shown(
        headline=headline(levitation, found, left_out),
        rows=equilibria_rows(levitation, found),
        modes=_modes(useful[0]) if useful else [],
        sign=f"{MODEL_WORDS.get(levitation.table.model, levitation.table.model)}{mutual}{plate}",
        complete=levitation.searched,
        places=[((1e3 * e.start.position).tolist(), e.start.moment.tolist(), e.stable) for e in useful],
        left_out=left_out_words(levitation, left_out),
    )


def _modes(equilibrium: Equilibrium) -> list[tuple[str, ...]]:
    rows = [(mode.name, f"{mode.frequency_hz:.6g}", f"{mode.growth_per_s:.6g}") for mode in equilibrium.modes]
    return [MODE_COLUMNS, *rows]


LINES = 20
"""Field lines, of which each is followed both ways."""
STEP, STEPS = 1.2e-3, 60
"""Length of a step, m, and how many are made at most."""
FAR = 45e-3
"""How far from the rotor's origin a line is followed, m."""


def field_lines(scene: Scene, field: Callable[[Array], Array]) -> list[Array]:
    """Lines (n, 3) m of a field B (n, 3) at points (n, 3) m, outside the magnets; between neighbours is equal flux.

    Runge and Kutta's fourth order in steps of equal length: a line is off by less than it is thick.
    """
    seeds = _seeds(scene, field)
    ways = [_followed(scene, field, seeds, sign) for sign in (-1.0, 1.0)]
    lines = [np.concatenate([back[::-1], ahead[1:]]) for back, ahead in zip(*ways, strict=True)]
    return [line for line in lines if len(line) > 2]


def _seeds(scene: Scene, field: Callable[[Array], Array]) -> Array:
    """Places (LINES, 3) m on a circle around the magnets."""
    corners = np.concatenate([magnet.box.corners for magnet in scene.rotor])
    middle = corners.mean(axis=0) * (1, 0, 1)
    radius = 1.03 * np.linalg.norm((corners - middle)[:, [0, 2]], axis=1).max()
    angles = np.linspace(-np.pi, np.pi, 361)
    outwards = np.column_stack([np.cos(angles), np.zeros(361), np.sin(angles)])
    through = np.abs(np.einsum("nk,nk->n", field(middle + radius * outwards), outwards))
    flux = np.cumsum(through)
    if not flux[-1] > 0:
        return np.zeros((0, 3))
    return np.asarray(middle + radius * outwards[np.searchsorted(flux, (np.arange(LINES) + 0.5) / LINES * flux[-1])])


def _followed(scene: Scene, field: Callable[[Array], Array], start: Array, sign: float) -> list[Array]:
    """From each start (n, 3) along the field or against it, to a magnet or out of sight."""

    def slope(places: Array) -> Array:
        b = field(places)
        return np.asarray(sign * b / np.maximum(np.linalg.norm(b, axis=1, keepdims=True), 1e-30))

    lines, active = [[place] for place in start], np.arange(len(start))
    for _ in range(STEPS):
        places = np.reshape([lines[k][-1] for k in active], (-1, 3))
        active = active[_outside(scene, places)]
        if not len(active):
            break
        places = np.array([lines[k][-1] for k in active])
        one = slope(places)
        two = slope(places + STEP / 2 * one)
        three = slope(places + STEP / 2 * two)
        four = slope(places + STEP * three)
        for k, place in zip(active, places + STEP / 6 * (one + 2 * two + 2 * three + four), strict=True):
            lines[k].append(place)
    return [np.array(line) for line in lines]


def _outside(scene: Scene, places: Array) -> Array:
    """Which of the places (n, 3) m are in sight and farther from every magnet than two steps."""
    free = np.linalg.norm(places, axis=1) < FAR
    for magnet in scene.rotor:
        free &= magnet.body.distance(places) > 0.1 * STEP
    return np.asarray(free)


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
    result = Result(levitation, levitation.survey)
    if kind == "json":
        answer: dict[str, Any] = {**result.summary, "tables_from_cache": levitation.from_cache}
        return f"{to_json(answer)}\n".encode()
    dataset = result.dataset().assign_attrs(study="equilibria")
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
