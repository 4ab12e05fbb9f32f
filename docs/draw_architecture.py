"""Draws the house, the way of the data and the walks of a run and of a flight from the code itself, in docs/pictures.

.venv/bin/python docs/draw_architecture.py
"""

from __future__ import annotations

import ast
import sys
import threading
import time
from collections.abc import Mapping
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Thread
from types import FrameType

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from spinlev.studies.cli.main import run
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation

ROOT = Path(__file__).parent.parent
PICTURES = Path(__file__).parent / "pictures"
FLOORS = ("geometry", "fem", "dynamics", "studies")
COLORS = dict(zip(FLOORS, ("#dbe9f6", "#dff0d8", "#fdebd0", "#f3e0ee"), strict=True))
Room = tuple[str, str]


def rooms() -> dict[Room, set[Room]]:
    """Every room, and every module that lies in none, with those that it imports from at the top of its modules."""
    found: dict[Room, set[Room]] = {}
    for floor in FLOORS:
        for path in sorted((ROOT / floor).rglob("*.py")):
            if path.name != "__init__.py":
                room = _room(path)
                found.setdefault(room, set()).update(_imported(path) - {room})
    return found


def _room(path: Path) -> Room:
    floor, name, *_ = path.relative_to(ROOT).with_suffix("").parts
    return floor, name


def _imported(path: Path) -> set[Room]:
    package, found = path.relative_to(ROOT).parts[:-1], set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.level and node.module:
            base = (*package[: len(package) - node.level + 1], *node.module.split("."))
            found |= {(base[0], base[1])} if len(base) > 1 else set()
    return found


def essential(graph: Mapping[Room, set[Room]]) -> dict[Room, set[Room]]:
    """The arrows that no chain of other arrows replaces."""
    below = {room: set(others) for room, others in graph.items()}
    for _ in graph:
        below = {room: others.union(*(below[other] for other in others)) for room, others in below.items()}
    return {room: others - set().union(*(below[other] for other in others)) for room, others in graph.items()}


def levels(graph: Mapping[Room, set[Room]]) -> dict[Room, int]:
    """How many rooms lie below each one."""
    found: dict[Room, int] = {}
    while len(found) < len(graph):
        for room, others in graph.items():
            if room not in found and others <= set(found):
                found[room] = 1 + max((found[other] for other in others), default=-1)
    return found


def draw_house() -> Figure:
    """Rooms in the order of imports from left to right, one floor over the other; arrows point to what is used."""
    graph = rooms()
    level = levels(graph)
    figure = Figure(figsize=(17, 9), layout="constrained")
    axes = figure.add_subplot()
    places: dict[Room, tuple[float, float]] = {}
    bottom = 0.0
    for floor in FLOORS:
        columns = groupby(sorted((room for room in graph if room[0] == floor), key=level.__getitem__), key=level.get)
        stacks = [list(column) for _, column in columns]
        height = max(map(len, stacks))
        axes.axhspan(bottom - 0.6, bottom + height - 0.4, color=COLORS[floor], zorder=0)
        axes.text(-1.25, bottom + (height - 1) / 2, floor, fontsize=12, ha="center", va="center", rotation=90)
        for k, stack in enumerate(stacks):
            for j, room in enumerate(stack):
                places[room] = (1.9 * k, bottom + j + (height - len(stack)) / 2)
        bottom += height + 0.4
    files = {room: len(list((ROOT / Path(*room)).glob("*.py"))) - 1 for room in graph}
    names = {room: _words(room) + (f"\n{count} files" if count > 0 else "") for room, count in files.items()}
    boxes = {room: _box(axes, place, names[room]) for room, place in places.items()}
    for room, others in essential(graph).items():
        for other in others:
            _arrow(axes, boxes[room], boxes[other], places[room], places[other])
    axes.set(xlim=(-1.6, 1.9 * max(x / 1.9 for x, _ in places.values()) + 1), ylim=(-0.8, bottom - 0.6))
    axes.axis("off")
    return figure


def _words(room: Room) -> str:
    return room[1].replace("_", " ")


def _box(axes: Axes, place: tuple[float, float], name: str) -> FancyBboxPatch:
    x, y = place
    box = FancyBboxPatch((x - 0.75, y - 0.3), 1.5, 0.6, boxstyle="round,pad=0.02", fc="white", ec="0.4", zorder=3)
    axes.add_patch(box)
    words = name.replace(" ", "\n") if len(name) > 12 and "\n" not in name else name
    axes.text(x, y, words, ha="center", va="center", zorder=4)
    return box


def _arrow(
    axes: Axes, origin: FancyBboxPatch, target: FancyBboxPatch, start: tuple[float, float], end: tuple[float, float]
) -> None:
    axes.add_patch(
        FancyArrowPatch(
            *(start, end),
            patchA=origin,
            patchB=target,
            shrinkA=0,
            shrinkB=1,
            connectionstyle="arc3,rad=0.06",
            arrowstyle="-|>",
            mutation_scale=10,
            color="0.45",
            lw=0.8,
            zorder=2,
        )
    )


def members() -> dict[str, set[str]]:
    """What each public member of `Levitation` asks of the others."""
    tree = ast.parse((ROOT / "studies" / "levitation.py").read_text())
    (body,) = (node for node in tree.body if getattr(node, "name", "") == "Levitation")
    functions = {node.name: node for node in body.body if isinstance(node, ast.FunctionDef)}
    uses = {
        name: {n.attr for n in ast.walk(node) if isinstance(n, ast.Attribute) and ast.unparse(n.value) == "self"}
        for name, node in functions.items()
        if name != "__init__"
    }
    hidden = [name for name in uses if name.startswith("_")]
    for name in (*hidden, *hidden):
        uses = {k: (v - {name}) | uses[name] if name in v else v for k, v in uses.items()}
    known = {"scene", "models", *(name for name in uses if not name.startswith("_"))} - {"labels", "absolute"}
    return {"scene": set(), "models": set()} | {k: (v & known) - {k} for k, v in uses.items() if k in known}


def draw_data() -> Figure:
    """From a scene to its flight: an arrow goes from what is known to what is made of it."""
    graph = {("", name): {("", other) for other in others} for name, others in members().items()}
    level, arrows = levels(graph), essential(graph)
    height = max(len(list(column)) for _, column in groupby(sorted(level.values())))
    figure = Figure(figsize=(15, 0.3 + 0.8 * height), layout="constrained")
    axes = figure.add_subplot()
    places: dict[Room, tuple[float, float]] = {}
    for k, column in groupby(sorted(graph, key=lambda room: (level[room], room)), key=level.__getitem__):
        stack = list(column)
        places |= {room: (2.1 * k, j - (len(stack) - 1) / 2) for j, room in enumerate(stack)}
    boxes = {room: _box(axes, place, _words(room)) for room, place in places.items()}
    for room, others in arrows.items():
        for other in others:
            _arrow(axes, boxes[other], boxes[room], places[other], places[room])
    axes.set(xlim=(-1, max(x for x, _ in places.values()) + 1), ylim=(-height / 2, height / 2))
    axes.axis("off")
    return figure


LEAST = 0.01  # share of a run's time that a stay in a room has, at least, to be drawn
INTERVAL = 5e-3  # between two looks at where a run is, s


def walk(arguments: list[str]) -> list[tuple[str, float, float]]:
    """Rooms that a command calls out of the top of `studies`: each with the begin and the length of the stay, s."""
    seen: list[tuple[str, float]] = []
    runs, over = threading.get_ident(), Event()

    def room(frame: FrameType) -> str:
        parts = Path(frame.f_code.co_filename).parts
        floor = next((k for k in range(len(parts) - 1, 0, -1) if parts[k] in FLOORS), None)
        return "" if floor is None or "site-packages" in parts[floor:] else "/".join(parts[floor:-1])

    def look() -> None:
        while not over.wait(INTERVAL):
            frame, path = sys._current_frames().get(runs), list[str]()
            while frame:
                path.append(room(frame))
                frame = frame.f_back
            known = [here for here in reversed(path) if here not in ("", "studies/cli")]
            seen.append((next((here for here in known if here != "studies"), ""), time.perf_counter()))

    watcher = Thread(target=look)
    watcher.start()
    run(arguments, Event())
    over.set()
    watcher.join()
    begin, end = seen[0][1], seen[-1][1]
    stays = [(here, [t for _, t in looks]) for here, looks in groupby(seen, key=itemgetter(0)) if here]
    long = [(here, looks) for here, looks in stays if looks[-1] - looks[0] > LEAST * (end - begin)]
    return [(here, looks[0] - begin, looks[-1] - looks[0]) for here, looks in long]


def draw_walk() -> Figure:
    """The rooms of a run one after the other: how long each stay takes, and how often a room is come back to."""
    with TemporaryDirectory() as folder:
        scene = str(ROOT / "scenes" / "horizontal.toml")
        stays = walk(["run", scene, "--plate-model", "reduced", "--duration-s", "2", "--out", folder])
    order = list(dict.fromkeys(here for here, _, _ in stays))
    visits = [here for here, _ in groupby(here for here, _, _ in stays)]
    figure = Figure(figsize=(11, 0.4 * len(order) + 1.2), layout="constrained")
    axes = figure.add_subplot()
    for here, begin, spent in stays:
        axes.barh(order.index(here), spent, left=begin, color=COLORS[here.split("/")[0]], edgecolor="0.4")
    axes.set_yticks(range(len(order)), order)
    axes.invert_yaxis()
    axes.set_xlabel("time (s)")
    axes.set_title(f"{len(order)} rooms, {len(visits) - len(order)} returns", loc="left")
    return figure


def first_calls(seconds: float) -> list[Room]:
    """Functions of `flights` and `motion` under `simulate`, in the order of their first calls: file and name."""
    levitation = Levitation(ROOT / "scenes" / "horizontal.toml", Models(plate_model="reduced"))
    found, inside = dict[Room, None](), 0

    def look(frame: FrameType, event: str, _: object) -> None:
        nonlocal inside
        file, name = "/".join(Path(frame.f_code.co_filename).parts[-3:]), frame.f_code.co_qualname
        if event not in ("call", "return") or not file.startswith(("dynamics/flights/", "dynamics/motion/")):
            return
        if (file, name) == ("dynamics/flights/flight.py", "simulate"):
            inside += 1 if event == "call" else -1
        if inside and event == "call" and "<" not in name:
            found.setdefault((file.removeprefix("dynamics/"), name))

    sys.setprofile(look)
    levitation.flight(seconds)
    sys.setprofile(None)
    return list(found)


def draw_simulate() -> Figure:
    """The files of `simulate` in the order of calls: how many functions each stay reads for the first time."""
    files = [file for file, _ in first_calls(2.0)]
    stays = [(file, len(list(group))) for file, group in groupby(files)]
    own = [file for file, _ in groupby(file for file in files if file.startswith("flights"))]
    order = sorted(dict.fromkeys(files), key=lambda file: file.split("/")[0])
    figure = Figure(figsize=(11, 0.4 * len(order) + 1.2), layout="constrained")
    axes, begin = figure.add_subplot(), 0
    for file, count in stays:
        color = COLORS["dynamics" if file in own else "fem"]
        axes.barh(order.index(file), count, left=begin, color=color, edgecolor="0.4")
        begin += count
    axes.set_yticks(range(len(order)), order)
    axes.invert_yaxis()
    axes.set_xlabel("functions in the order of their first calls")
    told = f"flights: {len(own)} stays in {len(set(own))} files; with motion {len(stays)} in {len(order)}"
    axes.set_title(told, loc="left")
    return figure


if __name__ == "__main__":
    pictures = {"house": draw_house(), "data": draw_data(), "walk": draw_walk(), "simulate": draw_simulate()}
    for name, figure in pictures.items():
        figure.savefig(PICTURES / f"{name}.png", dpi=110)
