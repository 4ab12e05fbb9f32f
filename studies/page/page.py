"""One page in the browser: what its reader does, what is computed for it, and what it shows; lengths mm."""

import asyncio
import base64
import binascii
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from ...dynamics.motion.state import polar_angle
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..cli.options import KINDS, shipped_scene
from ..figures.view import Surface, near_plate, triangles
from . import work
from .state import PageState, controls
from .work import Frame, Regions, Shown
from .worker import PATIENCE, Worker

REST = 0.25  # Seconds after which a slider is taken to rest
QUICK, LONG = 60.0, 600.0  # Seconds that a scene with its preview, and other work, may take
SLOWEST = 0.25  # Most seconds of a trajectory between two pictures
POINTS = 41  # Of a map along each axis
ROLLING = 4000  # Samples of a trajectory that are kept
PLATES = {"none": "Plate: only an obstacle", "slab": "Plate: infinite slab", "auto": "Plate: as the accuracy needs it"}
PLATES["reduced"] = "Plate: finite, as a network"
NO_MAP = "No map: it needs a horizontal, vertical or tilted rotor and gravity along the axis."
MAGNET, METAL, BALL = "#434C5E", "#B08D57", "#9AA5B1"
SEEN = 0.03  # How far along its edges a plate is drawn, m


class Page:
    """A page that begins with a `state`, and its processes; `tell` sends it what to show, by its name in page.js."""

    def __init__(self, tell: Callable[..., None], state: PageState) -> None:
        self.tell, self.state = tell, state
        self.quick = Worker("Reading this scene", QUICK, self._failed)
        self.slow = Worker("The result of the chosen models", LONG, self._failed, PATIENCE)
        self.mapper = Worker("The map", LONG, self._no_map, PATIENCE)
        self.porter = Worker("The file", LONG, self._failed, PATIENCE)
        self.flyer = Worker("The trajectory", LONG, self._lost)
        self.number = 0  # of answers
        self.shown: Shown | None = None
        self.samples = np.zeros((3, 0))  # of the trajectory: time s, height mm and polar angle °
        self.resting: asyncio.TimerHandle | None = None
        self.mapped, self.begun = "", False
        self.flying, self.ended = False, False
        self.drawn: tuple[str, str] = ("", "")
        self.lines: list[Array] = []
        # what the page's reader can do, by its name in page.js
        self.does: dict[str, Callable[..., None]] = {
            "move": lambda name, value: self._become("changed", name, round(float(value), 9)),
            "choose": lambda name, value: self._become("with_query", {name: value}),
            "open": self._opened,
            "preset": lambda kind: self._become("opened", shipped_scene(KINDS[kind]).read_bytes(), kind),
            "go": self._go,
            "get": self._download,
            "fly": self._fly,
            "kick": lambda *velocity: self._wish("push", velocity),
            "put": lambda x, z: self._wish("put", (x, 0.0, z)),
            "reset": self._land,
        }

    def begin(self, preview: Shown | None, asked: Mapping[str, str]) -> None:
        """Show the state with its preview, if that is known, or another with what is `asked` in the page's address."""
        if not asked:
            self._begin()
        if not asked and preview is not None:
            self._became(False, (self.state, preview))
        else:
            self._become("with_query", dict(asked))

    def close(self) -> None:
        if self.resting is not None:
            self.resting.cancel()
        for worker in (self.quick, self.slow, self.mapper, self.porter, self.flyer):
            worker.stop()

    def _begin(self) -> None:
        self.begun, state = True, self.state
        names = ["dipole", "cuboid", "surface", "fem", *(["map"] if state.scene.field_map else [])]
        names += [state.model] if state.model not in names else []
        shown: dict[str, Any] = {"sliders": [vars(control) for control in controls(state)]}
        shown["models"] = {name: f"Field: {work.MODEL_WORDS.get(name, 'chosen by accuracy')}" for name in names}
        shown["plate_models"] = PLATES if state.scene.plate is not None else {}
        self.tell(controls={**shown, "model": state.model, "plate_model": state.plate_model})

    def _become(self, method: str, *arguments: Any) -> None:
        """Ask for another state, by a method of the state at that time; of moves of one slider the last counts."""
        self.tell(message="")
        # A slider's key replaces its own older moves; every other wish has a key of its own and is never dropped.
        key = arguments[0] if method == "changed" else object()
        other = partial(self._became, method == "opened")
        self.quick.ask(key, lambda: (work.become, self.state, method, arguments, self.near), other)

    @property
    def near(self) -> list[work.Pose]:
        return self.shown.places if self.shown else []

    def _became(self, is_other: bool, found: tuple[PageState, Shown | str]) -> None:
        self.state, preview = found
        self.slow.stop()
        if is_other or not self.begun:
            self._begin()
        if self.flying:
            self.tell(playing=False)
            self._land()
        if work.has_map(self.state):
            self.tell(point=[control.value for control in controls(self.state)[:2]])
        self.tell(copies=self.state.copies())
        if isinstance(preview, str):
            self._failed(preview)
        else:
            self._answered(False, preview)
        if self.resting is not None:
            self.resting.cancel()
        self.resting = asyncio.get_running_loop().call_later(REST, self._rest)

    def _opened(self, name: str, text: str) -> None:
        try:
            data = base64.b64decode(text)
        except binascii.Error:
            data = b"\xff"  # which is no text
        self._become("opened", data, str(name) or "scene")

    def _go(self, *point: float) -> None:
        for slider, place in zip(controls(self.state)[:2], point, strict=True):
            value = slider.start + round((place - slider.start) / slider.step) * slider.step
            value = round(min(max(value, slider.start), slider.end), 9)
            self.tell(slider=[slider.name, value])
            self._become("changed", slider.name, value)

    def _answered(self, complete: bool, found: Shown) -> None:
        self.shown, self.number = found, self.number + 1
        shown = {key: value for key, value in vars(found).items() if key not in ("lines", "strength")}
        shown["models"] = [vars(one) for one in found.models]
        self.tell(numbers={**shown, "number": self.number, "complete": complete})
        keys = self.state.keys
        rotor, whole = str(keys["rotor"]), str((keys["rotor"], keys["floater"], keys.get("plate")))
        if complete or self.drawn[0] != rotor:  # 7 kB that a slider of the frequency does not change
            strength = base64.b64encode(found.strength).decode()
            self.tell(slice={"x": work.SLICE[0], "z": work.SLICE[1], "pixel": work.PIXEL, "strength": strength})
        if found.lines or self.drawn[1] != whole:  # field lines are kept as far as they hold
            self.lines = found.lines or (self.lines if self.drawn[0] == rotor else [])
            self.drawn = rotor, whole
            self.tell(bodies=scene_bodies(self.state.scene, self.lines))
        if not self.flying:
            self._show_rest()

    def _rest(self) -> None:
        self.tell(address=self.state.query())
        if self.shown and not all(one.known for one in self.shown.models):  # the plate can take far longer
            receive = partial(self._answered, False)
            self.slow.ask("preview", lambda: (work.preview, self.state, self.near, True), receive)
        self.slow.ask("", lambda: (work.complete, self.state), partial(self._answered, True))
        if not work.has_map(self.state):
            self._forget_map(NO_MAP)
        elif (key := work.map_key(self.state)) != self.mapped:
            self._forget_map("The map is being computed by the point dipole ...")
            self.mapped = key
            axes = controls(self.state)[:2]
            spans = tuple((control.start, control.end) for control in axes)
            self.tell(map={"title": axes[1].title, "spans": spans, "article": work.article_points(self.state)})
            models = ("dipole",) if self.state.scene.field_map else ("dipole", "fem")
            for model in models:
                call = (work.regions, self.state, spans, model, POINTS)
                last = partial(self._map, model == models[-1])
                self.mapper.ask(model, lambda call=call: call, last)  # type: ignore[misc]

    def _failed(self, message: str) -> None:
        if not self.begun:  # what the address asks for cannot be made
            self._begin()
            self._become("with_query", {})
        self.tell(message=message)

    def _forget_map(self, why: str) -> None:
        self.mapper.stop()
        self.mapped = ""
        self.tell(map=None, map_says=why)

    def _no_map(self, why: str) -> None:
        self.mapper.stop()
        self.tell(map_says=f"No map: {why}")

    def _map(self, last: bool, found: Regions) -> None:
        name = work.MODEL_WORDS[found.model]
        says = f"Blue: stable levitation without the plate, by {name}"
        says += "; grey line: point dipole. " if found.model != "dipole" else ". "
        says += "Click to go there." if last else "Click to go there. Finite elements follow ..."
        self.tell(regions=vars(found), map_says=says)

    def _download(self, kind: str) -> None:
        name, form = work.FILES[kind]
        self.tell(message="")

        def downloaded(data: bytes) -> None:
            self.tell(file={"name": name, "kind": form, "content": base64.b64encode(data).decode()})

        self.porter.ask(kind, lambda: (work.content, kind, self.state), downloaded)

    # The trajectory, which page.js asks for piece by piece

    def _land(self) -> None:
        self.flyer.stop()
        self.flying = self.ended = False
        self.tell(says="")
        self._show_rest()

    def _show_rest(self) -> None:
        self.tell(equilibria=[[position[0], position[2]] for position, _ in self.near])
        if self.near:
            position, moment = self.near[0]
            self._sample(np.array([[0.0], [position[2]], [np.degrees(polar_angle(np.array(moment)))]]), fresh=True)
            pose = {"position": position, "moment": moment, "seen": position, "angle": 0.0, "plate": 0.0}
            self.tell(pose={**pose, "flying": False})

    def _take_off(self) -> None:
        if not self.flying:
            self.flying = True
            self.tell(says="Preparing the simulation ...")
            self._sample(np.zeros((3, 0)), fresh=True)
            self.flyer.ask("begin", lambda: (work.begin_flight, self.state), self._flown)

    def _fly(self, seconds: float) -> None:
        if self.ended:
            self._land()
        self._take_off()
        self.flyer.ask("fly", lambda: (work.fly, min(float(seconds), SLOWEST)), partial(self._flown, piece=True))

    def _wish(self, what: str, vector: Sequence[float]) -> None:
        """A floater that is dragged moves on; where it cannot be the page waits, so that the reason can be read."""
        self._take_off()
        call = work.wish, what, [1e-3 * float(part) for part in vector]
        self.flyer.ask(object(), lambda: call, partial(self._flown, put=what == "put"))

    def _flown(self, frame: Frame, piece: bool = False, put: bool = False) -> None:
        self._sample(frame["samples"])
        self.ended = bool(frame["ended"])
        self.tell(
            says=frame["message"] or frame["ended"] or f"t = {frame['samples'][0, -1]:.4g} s",
            pose={**frame["pose"], "flying": True, "piece": piece, "ended": self.ended},
        )
        if put:
            self.tell(playing=not frame["message"])

    def _lost(self, message: str) -> None:
        self.tell(playing=False)
        self._land()
        self.tell(says=message)

    def _sample(self, new: Array, fresh: bool = False) -> None:
        self.samples = new if fresh else np.concatenate([self.samples, new], axis=1)[:, -ROLLING:]
        self.tell(samples={"fresh": fresh, "most": ROLLING, "new": np.round(new, 6)})


def scene_bodies(scene: Scene, lines: Sequence[Array]) -> dict[str, Any]:
    """What page.js draws of a `scene`: what turns with the rotor, what stands, and the floater about its centre."""
    size = max(float(np.linalg.norm(magnet.box.size)) for magnet in scene.rotor)
    turning = [_mesh(triangles(magnet.body), MAGNET) for magnet in scene.rotor]
    turning += [_mesh(triangles(conductor.body), METAL) for conductor in scene.conductors]
    directions = [(magnet.box.center, magnet.polarization_in_rotor) for magnet in scene.rotor]
    arrows = [(c, 0.55 * size * d / length) for c, d in directions if (length := np.linalg.norm(d)) > 0]
    found: dict[str, Any] = {
        "turning": turning,
        "arrows": np.round(1e3 * np.reshape(arrows, (-1, 2, 3)), 3),
        "floater": [] if scene.floater.is_sphere else [_mesh(triangles(body), BALL) for body in scene.floater.bodies],
        "fixed": [],
        "lines": [np.round(1e3 * line, 2) for line in lines],
        "radius": 1e3 * scene.floater.radius,
        "reach": [32.0, -50.0, 18.0],
    }
    if scene.plate is not None:
        near = near_plate(scene.plate.body, SEEN)
        found |= {"fixed": [_mesh(triangles(near), BALL, 0.25)], "reach": [38.0, -62.0, 18.0]}
    return found


def _mesh(surface: Surface, color: str, opacity: float = 1.0) -> dict[str, Any]:
    return {"at": np.round(1e3 * surface[0], 3), "faces": surface[1], "color": color, "opacity": opacity}
