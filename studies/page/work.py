"""What is computed for a page, by processes of its own."""

import tempfile
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ...dynamics.continuation.map import EquilibriumMap, equilibrium_map
from ...dynamics.equilibria.balance import CONVERGED_STEP, EVERY, solve
from ...dynamics.equilibria.equilibrium import MARGINAL, STABILITIES, Equilibrium, is_stable, nearest_of, spectra
from ...dynamics.equilibria.path import NEAR, NEWTON_STEPS, Ways
from ...dynamics.equilibria.search import survey
from ...dynamics.flights.live import LiveFlight, Piece
from ...dynamics.motion.state import Parameter, polar_angle
from ...fem.cache import NotKeptError, kept_only
from ...fem.rotor.choice import PERMEABLE
from ...fem.rotor.models import of_true_moment
from ...geometry.common import Array, ComputationError, SpinlevError
from ...geometry.scene.files import canonical_keys, changed, scene_text
from ..candidates import survey_near
from ..catalogue import article
from ..cli.console import to_json
from ..cli.options import FieldModel, Models
from ..compare import compared_models
from ..figures.pictures import drawn_field
from ..figures.view import field_lines
from ..levitation import Levitation
from ..plan import sources
from ..result import Result, write_dataset
from ..words import comparison_words, equilibria_rows, headline, left_out_words, mode_words, worth_a_row
from .state import MEASURES, PageState

SIGHT = np.array([[-0.045], [0.045]]) * np.ones(3)  # The box in which field lines are drawn, m
SLICE = (-34.0, 34.0), (-60.0, 15.0)  # Where |B| is shown in the plane of the moments, x and z in mm
PIXEL, WEAKEST = 1.0, -3.0  # of it: mm, and log10 of |B| in T
ENDS = {"contact": "touched the rotor or the plate", "lost": "lost: it is too far away to come back"}
ENDS["beyond"] = "left the region for which the plate's response was computed"
MODEL_WORDS = {"dipole": "point dipole", "cuboid": "closed form of the cuboids", "fem": "finite elements"}
MODEL_WORDS |= {"surface": "charges on the magnets' surfaces", "map": "map of the field"}
PLATE_WORDS = {"none": "without the plate's eddy currents", "slab": "over the plate as an infinite slab"}
PLATE_WORDS |= dict.fromkeys(("reduced", "fem"), "over the finite plate")
HALVINGS = 6  # of a step of the map, until where its region of stability ends is known
# Trajectories of the article whose frequency it gives: Hz, mm and what became of them
ARTICLE_FLIGHTS = {
    "horizontal": ((115.0, 1.0, "fell"), (140.0, 1.0, "levitated for 250 s"), (150.0, 1.0, "lost in oscillations")),
    "vertical": ((60.0, 14.0, "levitated for 24 h"),),
}
MODE_COLUMNS = ("normal mode", "frequency (Hz)", "growth rate (s⁻¹)")
# What can be taken home: a file's name and its type
FILES = {"toml": ("scene.toml", "text/plain"), "json": ("equilibria.json", "application/json")}
FILES["nc"] = ("equilibria.nc", "application/x-netcdf")


Pose: TypeAlias = tuple[list[float], list[float]]  # Position, mm, and direction of the moment at t = 0


@dataclass(frozen=True)
class ModelAnswer:
    """Where the floater levitates by one model of the rotor's field, if that is `known` and there is an equilibrium."""

    name: str
    known: bool
    pose: Pose | None = None
    distance: float = 0.0  # of levitation, mm
    polar_angle: float = 0.0  # °
    stability: str = "no equilibrium"


@dataclass(frozen=True)
class Shown:
    """The numbers of a scene by the selected model, and beside them those of point dipole and finite elements."""

    headline: str  # where the floater levitates and whether it remains there, as the command line says it
    conditions: str  # under which all models are compared
    models: list[ModelAnswer]  # the selected one first
    rows: list[tuple[str, ...]]  # of the table of equilibria, the head first; as the command line prints them
    modes: list[tuple[str, ...]]  # of the eigenvalues of the first equilibrium, the head first
    places: list[Pose]  # of each equilibrium
    left_out: list[str]  # which solutions are no equilibria, or not known to be, in sentences
    strength: bytes  # |B| in the plane `SLICE`, row by row from below: 0 at `WEAKEST` to 254 at 1 T, 255 in magnets
    comparison: list[str] = field(default_factory=list)  # of point dipole and finite elements in a sentence
    lines: list[Array] = field(default_factory=list)  # of the field, m, where they were asked for


def become(state: PageState, method: str, arguments: Any, near: Sequence[Any]) -> tuple[PageState, Shown | str]:
    """Another state by a `method` of the `state` with `arguments`; its preview from `near`, or why there is none."""
    made: PageState = getattr(state, method)(*arguments)
    made.keys  # noqa: B018  # travels with it: the page's own process does not look for overlaps
    try:
        return made, preview(made, near)
    except SpinlevError as error:
        return made, str(error)


def compared(state: PageState) -> list[FieldModel]:
    """The models that are shown: the selected one, then point dipole and finite elements, or the map in their place."""
    return list(dict.fromkeys((state.model, "map" if state.scene.field_map else "fem", "dipole")))


def preview(state: PageState, near: Sequence[Any] = (), patient: bool = False) -> Shown:
    """Equilibria of a `state` without the plate's currents, while a slider moves: by Newton's method from those `near`.

    Else from the point dipole's, else by a search. Who is `patient` gets finite elements that are not cached, too.
    """
    known: dict[str, Levitation] = {}
    fresh: Sequence[Any] = ()  # places by the point dipole, the first of all
    # Cheap models first: Newton's method finds the others' equilibria from theirs, where the last ones are too far off.
    for model in sorted(compared(state), key=lambda name: name in PERMEABLE):
        levitation = Levitation(state.scene, Models(model, "none"), state.spin)
        try:
            with nullcontext() if patient or model not in PERMEABLE else kept_only():
                found = None
                for poses in filter(len, (near, fresh)):
                    places, moments = map(np.array, zip(*poses, strict=True))
                    found = found or survey_near(levitation, 1e-3 * places, moments)
                # Not from the cache, which would get a file for every step of a slider.
                found = found or survey(state.scene, levitation.interaction, state.spin, rates=levitation.rates)
        except NotKeptError:
            continue
        levitation.adopt(found)
        known[model] = levitation
        fresh = fresh or [_pose(e) for e in found.equilibria]
    return _shown(state, known)


def complete(state: PageState) -> Shown:
    """All equilibria by the models asked for, as the command line finds them, the others' beside, and the field."""
    selected = Levitation(state.scene, state.models, state.spin)
    selected.survey  # noqa: B018  # refused here, before the others
    known: dict[str, Levitation] = {state.model: selected}
    for model in compared(state)[1:]:
        other = selected.elsewhere(replace(state.models, model=model))
        with suppress(SpinlevError):  # as of a magnet that no mesh can be made of
            if other.table.model not in {one.table.model for one in known.values()}:
                other.plate = selected.plate  # all have one network of its currents
                other.survey  # noqa: B018
                known[model] = other
    found = _shown(state, known)
    rough, fine = known.get("dipole"), next((one for name, one in known.items() if name != "dipole"), None)
    if rough and fine:
        true = rough.elsewhere(rotor=of_true_moment(state.scene.rotor, sources(fine.table)))
        true.plate = selected.plate
        distances = compared_models(rough.survey, true.survey, fine.survey, fine.table.model)
        alone = state.scene.plate is not None and not selected.plate
        found = replace(found, comparison=comparison_words(distances, alone))
    drawn = drawn_field(state.scene, selected.table)
    lines = field_lines(state.scene, lambda points: np.nan_to_num(drawn(points)), *SIGHT)
    return replace(found, lines=[line[::2] for line in lines])


def _shown(state: PageState, known: Mapping[str, Levitation]) -> Shown:
    first = known.get(state.model) or next(iter(known.values()))
    found, left_out = first.equilibria, first.survey.left_out
    useful = worth_a_row(found)
    leading = useful[0].modes if useful else ()
    answers = []
    for model in compared(state):
        if one := known.get(model):
            near = worth_a_row(one.equilibria)
            # Not its first: that may be another branch, and the difference would be no error of a model.
            e = nearest_of(near, useful[0].position) if useful else next(iter(near), None)
            name = MODEL_WORDS[one.table.model]  # of the table, as "auto" and rotors without permeability choose it
            there = (_pose(e), -1e3 * e.position[2], e.polar_angle_deg, STABILITIES[e.stability]) if e else ()
            answers.append(ModelAnswer(name, True, *there))
        elif not any(MODEL_WORDS.get(model) == answer.name for answer in answers):
            answers.append(ModelAnswer(MODEL_WORDS.get(model, "model chosen by accuracy"), False))
    felt = first.plate.model if first.plate is not None else "none"
    conditions = [PLATE_WORDS[felt]] if state.scene.plate is not None else []
    if any(one.interaction_model == "mutual" for one in known.values()):
        conditions.append("finite elements with mutual magnetisation of rotor and floater")
    modes = [(mode_words(m.name), f"{m.frequency_hz:.6g}", f"{m.growth_per_s:.6g}") for m in leading]
    z, x = np.meshgrid(*(np.arange(low, high + PIXEL / 2, PIXEL) for low, high in SLICE[::-1]), indexing="ij")
    places = 1e-3 * np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3)
    with np.errstate(divide="ignore"):
        size = np.log10(np.linalg.norm(drawn_field(state.scene, first.table)(places), axis=1))
    # A byte a pixel: a slice is sent with every step of a slider.
    levels = np.clip(np.nan_to_num((size - WEAKEST) / -WEAKEST * 254, neginf=0.0), 0, 254)
    levels = np.where(np.isnan(size), 255, levels)
    return Shown(
        headline=headline(first, found, left_out),
        conditions="; ".join(conditions),
        models=answers,
        rows=equilibria_rows(first, found),
        modes=[MODE_COLUMNS, *modes] if useful else [],
        places=[_pose(e) for e in useful],
        left_out=left_out_words(first, left_out),
        strength=levels.astype(np.uint8).tobytes(),
    )


def _pose(equilibrium: Equilibrium) -> Pose:
    return (1e3 * equilibrium.start.position).tolist(), equilibrium.start.moment.tolist()


Place: TypeAlias = tuple[float, float]  # Frequency, Hz, and measure of the rotor, mm or °


@dataclass(frozen=True)
class Regions:
    """Where the floater levitates stably over frequency (Hz) and measure (mm or °): polygons, and what bounds them."""

    model: str
    cells: list[list[Place]]
    border: list[tuple[Place, ...]]


def has_map(state: PageState) -> bool:
    """Whether a scene's rotor has a measure for a map's second axis, and its equilibria are fixed points."""
    known = state.keys["rotor"].get("configuration") in MEASURES
    return known and not np.any(state.scene.gravity[:2])


def map_key(state: PageState) -> str:
    whole = canonical_keys(state.scene)
    keys = {key: value for key, value in whole.items() if key not in ("frequency_hz", "plate", "start")}
    open_ones = ("displacement_mm", "angle_deg")
    keys["rotor"] = {key: value for key, value in keys["rotor"].items() if key not in open_ones}
    return f"{keys} {state.spin}"


def article_points(state: PageState) -> dict[str, Any]:
    kind = state.keys["rotor"]["configuration"]
    known = article.CONFIGURATIONS[kind]
    return {"tested": known.tested, "levitated": known.levitated, "flights": ARTICLE_FLIGHTS.get(kind, ())}


def regions(state: PageState, spans: Sequence[tuple[float, float]], model: FieldModel, points: int) -> Regions:
    """Where something levitates stably without plate over `spans` of frequency (Hz) and measure (mm or °).

    Of a `state`, by a `model` of the field at `points` along each axis. Raises ComputationError: it has no such map.
    """
    configuration = state.keys["rotor"]["configuration"]
    axes, key = [np.linspace(*span, points) for span in spans], f"rotor.{MEASURES[configuration][0]}"
    models = replace(state.models, model=model)
    if configuration == "vertical":  # magnets that move against each other would need seconds a distance
        models = replace(models, model="cuboid" if model in PERMEABLE else model, interaction="rigid")
    try:
        columns = [Levitation(changed(state.scene, {key: value}, state.source), models) for value in axes[1].tolist()]
        for column in columns[1:]:
            column.share(columns[0], changed=True)
        tables = [column.interaction for column in columns]
        found = equilibrium_map([column.scene for column in columns], tables, axes[0], state.spin)
    except ValueError as error:
        raise ComputationError(str(error)) from None
    stable, ends = found.number[1] > 0, _ends(found)
    cells, border = list[list[Place]](), list[tuple[Place, ...]]()
    # Marching squares: a cell's stable corners, and between a stable and another one where stability ends. Only points
    # are classified, so that a tongue narrower than a step of the map is lost.
    for i, j in np.ndindex(points - 1, points - 1):
        outline, crossed = list[Place](), list[Place]()
        corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1), (i, j)]
        for one, following in pairwise(corners):
            places = [(float(axes[0][k]), float(axes[1][n])) for k, n in (one, following)]
            if stable[one]:
                outline.append(places[0])
            if stable[one] != stable[following]:
                part = ends[one, following] if stable[one] else 1 - ends[following, one]
                (x, y), (right, up) = places
                crossed.append((x + part * (right - x), y + part * (up - y)))
                outline.append(crossed[-1])
        cells += [outline] if outline else []
        border += [tuple(crossed[k : k + 2]) for k in range(0, len(crossed), 2)]
    return Regions(str(models.model), cells, border)


def _ends(found: EquilibriumMap) -> dict[tuple[tuple[int, int], ...], float]:
    """Where the stable equilibrium of a point of a map ends on the way (0 to 1) to a neighbour that has none."""
    stable = found.number[1] > 0
    beside = np.pad(~stable, 1)  # nothing but False around the map
    pairs = [
        ((i, j), (i + down, j + right))
        for i, j in np.argwhere(stable).tolist()
        for down, right in ((1, 0), (-1, 0), (0, 1), (0, -1))
        if beside[i + down + 1, j + right + 1]
    ]
    if not pairs:
        return {}
    # Of several stable equilibria at a point the first (the list is reversed, and a later key replaces an earlier one).
    which = {(int(found.row[k]), int(found.column[k])): k for k in np.flatnonzero(found.lasting)[::-1]}
    first = np.array([which[one] for one, _ in pairs])
    begin, end = (np.ravel_multi_index(np.array(nodes).T.tolist(), stable.shape) for nodes in zip(*pairs, strict=True))
    ways = Ways(found.grid.balance(begin), found.grid.balance(end))
    length, time = ways.start.values[:, [Parameter.LENGTH]], ways.start.values[:, Parameter.TIME]
    position, moment = found.position[first] / length, found.moment[first]
    low, high = np.zeros(len(pairs)), np.ones(len(pairs))
    # All pairs are halved together: a call of compiled code costs more than the pairs in it.
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        balance = ways.balances(middle, np.arange(len(pairs)))
        places, turned, size = solve(balance, position, moment, EVERY, NEWTON_STEPS)
        apart = np.linalg.norm(places - position, axis=1)
        good = np.flatnonzero((size < CONVERGED_STEP) & (apart < 3 * NEAR))  # not a number is neither
        there = balance.at(good)
        states = there.states(places[good], turned[good])
        linear, slow = spectra(states, there.rates(states, there.values)[1]), MARGINAL * time[good, None]
        good = good[is_stable(linear.eigenvalues, np.maximum(linear.errors, slow))]
        position[good], moment[good], low[good] = places[good], turned[good], middle[good]
        high[np.setdiff1d(np.arange(len(pairs)), good)] = middle[np.setdiff1d(np.arange(len(pairs)), good)]
    return dict(zip(pairs, ((low + high) / 2).tolist(), strict=True))


# A moment of a trajectory: `samples` (3, n) since the last, time s, height mm, polar angle °; the floater's `pose`: its
# position (3,) mm and moment along the laboratory's axes, the position as `seen` along the rotor's, the rotor's `angle`
# (rad), how far the `plate` is lowered (mm); how the trajectory has `ended`; a `message` of what was wrong with a wish
Frame: TypeAlias = "dict[str, Any]"
_flights: list[LiveFlight] = []  # The one of this process


def begin_flight(state: PageState) -> Frame:
    _flights[:] = [Levitation(state.scene, state.models, state.spin).live_flight()]
    return _frame()


def fly(seconds: float) -> Frame:
    """The trajectory so many `seconds` (s) onward, ended where its motion could not be computed."""
    try:
        return _frame(_flights[0].onward(seconds))
    except SpinlevError as error:
        return {**_frame(), "message": str(error), "ended": "stopped: the motion could not be computed"}


def wish(what: str, vector: list[float]) -> Frame:
    """The trajectory after its floater got a "push", m/s, or was "put" elsewhere, m."""
    try:
        getattr(_flights[0], what)(np.array(vector))
    except SpinlevError as error:
        return {**_frame(), "message": str(error)}
    return _frame()


def _frame(piece: Piece | None = None) -> Frame:
    flight = _flights[0]
    if piece is None:  # nothing was simulated
        lab = type(flight.now)(*(vector[None] for vector in flight.now.vectors))
        turned = float(flight.scene.angle(flight.time))
        piece = Piece(np.array([flight.time]), lab, turned, flight.ended_by)
    places, moments = piece.lab.position, piece.lab.moment
    seen = piece.lab.to_rotor(flight.scene.angle(piece.time)).position
    words = ENDS.get(piece.ended_by, "")
    return {
        "samples": np.stack([piece.time, 1e3 * places[:, 2], np.degrees(polar_angle(moments))]),
        "pose": {
            "position": 1e3 * places[-1],
            "moment": moments[-1],
            "seen": 1e3 * seen[-1],
            "angle": float(np.fmod(piece.angle, 2 * np.pi)),
            "plate": 1e3 * float(plate.depth(piece.time[-1])) if (plate := flight.scene.plate) else 0.0,
        },
        "ended": f"After {flight.time:.3g} s {words}." if words else "",
        "message": "",
    }


def content(kind: str, state: PageState) -> bytes:
    """The content of a file of `FILES`, which the command line computes alike. Raises what the scene's answer does."""
    if kind == "toml":
        return scene_text(state.scene).encode()
    levitation = Levitation(state.scene, state.models, state.spin)
    result = Result(levitation, levitation.survey)
    if kind == "json":
        answer: dict[str, Any] = {**result.summary, "tables_from_cache": levitation.from_cache}
        return f"{to_json(answer)}\n".encode()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "equilibria.nc"
        write_dataset(result.dataset(), path)
        return path.read_bytes()
