"""What is computed for a page, by processes of its own."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ...dynamics.continuation.map import equilibrium_map
from ...dynamics.continuation.rotor_family import rotor_family
from ...dynamics.equilibria.equilibrium import MODE_NAMES
from ...dynamics.equilibria.search import survey
from ...dynamics.flights.live import LiveFlight, Piece
from ...geometry.common import Array, ComputationError, SpinlevError
from ...geometry.scene.files import canonical_keys, scene_text
from ..cli.console import to_json
from ..cli.options import Models
from ..figures.pictures import drawn_field
from ..figures.view import field_lines
from ..levitation import Levitation
from ..result import Result, write_dataset
from ..words import equilibria_rows, headline, left_out_words, worth_a_row
from .state import MEASURES, PageState

SIGHT = np.array([[-0.045], [0.045]]) * np.ones(3)  # The box in which field lines are drawn, m
ENDS = {
    "beyond": "left the region for which the plate's response was computed",
    "contact": "touched the rotor or the plate",
    "lost": "lost: it is too far away to come back",
}
MODEL_WORDS = {
    "dipole": "point dipole",
    "cuboid": "closed form of the cuboids",
    "surface": "charges on the magnets' surfaces",
    "fem": "finite elements",
    "map": "map of the field",
}
PLATE_WORDS = {"none": "without the plate's currents", "slab": "plate as an infinite slab"}
PLATE_WORDS |= dict.fromkeys(("reduced", "fem"), "finite plate")
MODE_COLUMNS = ("normal mode", "frequency (Hz)", "growth rate (s⁻¹)")
FILES = {
    "toml": ("scene.toml", "text/plain"),
    "json": ("equilibria.json", "application/json"),
    "nc": ("equilibria.nc", "application/x-netcdf"),
}  # What can be taken home: a file's name and its type


@dataclass(frozen=True)
class Shown:
    """The numbers of a scene by some models."""

    headline: str  # where the floater levitates and whether it remains there
    rows: list[tuple[str, ...]]  # of the table of equilibria, the head first; as the command line prints them
    modes: list[tuple[str, ...]]  # of the eigenvalues of the first equilibrium, the head first
    sign: str  # by which models
    places: list[tuple[list[float], list[float]]]  # position mm and direction of the moment at t = 0 of each
    left_out: list[str]  # which solutions are no equilibria, or not known to be, in sentences
    lines: list[Array] = field(default_factory=list)  # of the field, m, where they were asked for


def become(state: PageState, method: str, arguments: tuple[Any, ...]) -> tuple[PageState, Shown | str]:
    """Another state, by a method of `PageState`, and its preview, or why there is none."""
    made: PageState = getattr(state, method)(*arguments)
    made.keys  # noqa: B018  # travels with it: the page's own process does not look for overlaps
    try:
        return made, preview(made)
    except SpinlevError as error:
        return made, str(error)


def preview(state: PageState) -> Shown:
    """All equilibria by what can be computed while a slider moves: the point dipole without the plate's currents."""
    models = Models("map" if state.model == "map" else "dipole", "none")
    levitation = Levitation(state.scene, models, state.spin)
    # Not from the cache, which would get a file for every step of a slider.
    levitation.adopt(survey(state.scene, levitation.interaction, state.spin, rates=levitation.rates))
    return _shown(levitation)


def complete(state: PageState) -> Shown:
    """All equilibria by the models asked for, as the command line finds them, and the field's lines."""
    levitation = Levitation(state.scene, state.models, state.spin)
    found = _shown(levitation)
    known = drawn_field(state.scene, levitation.table)
    lines = field_lines(state.scene, lambda points: np.nan_to_num(known(points)), *SIGHT)
    return replace(found, lines=[line[::2] for line in lines])


def _shown(levitation: Levitation) -> Shown:
    found, left_out = levitation.equilibria, levitation.survey.left_out
    useful = worth_a_row(found)
    felt = levitation.plate.model if levitation.plate is not None else "none"
    plate = f", {PLATE_WORDS[felt]}" if levitation.scene.plate is not None else ""
    mutual = ", rotor and floater magnetise each other" if levitation.interaction_model == "mutual" else ""
    modes = (
        [(MODE_NAMES.get(m.name, m.name), f"{m.frequency_hz:.6g}", f"{m.growth_per_s:.6g}") for m in useful[0].modes]
        if useful
        else []
    )
    return Shown(
        headline=headline(levitation, found, left_out),
        rows=equilibria_rows(levitation, found),
        modes=[MODE_COLUMNS, *modes] if useful else [],
        sign=f"{MODEL_WORDS.get(levitation.table.model, levitation.table.model)}{mutual}{plate}",
        places=[((1e3 * e.start.position).tolist(), e.start.moment.tolist()) for e in useful],
        left_out=left_out_words(levitation, left_out),
    )


@dataclass(frozen=True)
class Regions:
    """Where something levitates: 0 nothing, 1 only unstably, 2 stably, (n, m) over frequencies Hz and measures."""

    model: str
    frequencies: Array
    measures: Array
    kind: Array


def has_map(state: PageState) -> bool:
    """Whether a scene's rotor has a measure for a map's second axis, and its equilibria are fixed points."""
    known = state.keys["rotor"].get("configuration") in MEASURES
    return known and not np.any(state.scene.gravity[:2])


def map_key(state: PageState) -> str:
    """All that a map depends on: neither its own axes, nor the plate, nor where a trajectory begins."""
    whole = canonical_keys(state.scene)
    keys = {key: value for key, value in whole.items() if key not in ("frequency_hz", "plate", "start")}
    open_ones = ("displacement_mm", "angle_deg")
    keys["rotor"] = {key: value for key, value in keys["rotor"].items() if key not in open_ones}
    return f"{keys} {state.spin} {state.model == 'cuboid'}"


def regions(
    state: PageState, spans: tuple[tuple[float, float], tuple[float, float]], model: str, points: int
) -> Regions:
    """A map of where something levitates.

    Parameters
    ----------
    state : gives all but frequency and measure of the rotor
    spans : of the frequency, Hz, and of the measure, mm or degrees
    model, points : of the field, and along each axis
    """
    configuration = state.keys["rotor"]["configuration"]
    frequencies, measures = (np.linspace(*span, points) for span in spans)
    unit = np.radians(1.0) if configuration == "tilt" else 1e-3
    try:
        family = rotor_family(state.scene, configuration, model)
        every, stable = equilibrium_map(family, frequencies, measures * unit, state.spin).number
    except ValueError as error:
        raise ComputationError(str(error)) from None
    return Regions(model, frequencies, measures, np.asarray((every > 0).astype(np.uint8) + (stable > 0)))


Frame: TypeAlias = "dict[str, Any]"
"""A moment of a trajectory: `samples` (3, n) since the last, time s, height mm, polar angle °; the floater's `pose`,
its position (3,) mm and moment along the laboratory's axes, the position as `seen` along the rotor's, the rotor's
`angle`, rad; how the trajectory has `ended`, in words; a `message` of what was wrong with a wish."""
_flights: list[LiveFlight] = []  # The one of this process


def begin_flight(state: PageState) -> Frame:
    """The first frame of a trajectory."""
    _flights[:] = [Levitation(state.scene, state.models, state.spin).live_flight()]
    return _frame()


def fly(seconds: float) -> Frame:
    """The trajectory, so much later."""
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
        "samples": np.stack([piece.time, 1e3 * places[:, 2], polar_angle(moments)]),
        "pose": {
            "position": 1e3 * places[-1],
            "moment": moments[-1],
            "seen": 1e3 * seen[-1],
            "angle": float(np.fmod(piece.angle, 2 * np.pi)),
        },
        "ended": f"After {flight.time:.3g} s {words}." if words else "",
        "message": "",
    }


def polar_angle(moments: Array) -> Array:
    """Of moments (..., 3) from +z, degrees."""
    return np.asarray(np.degrees(np.arctan2(np.hypot(moments[..., 0], moments[..., 1]), moments[..., 2])))


def content(kind: str, state: PageState) -> bytes:
    """The content of a file of `FILES`, which the command line computes alike.

    Raises
    ------
    SpinlevError : the scene has no answer
    """
    if kind == "toml":
        return scene_text(state.scene).encode()
    levitation = Levitation(state.scene, state.models, state.spin)
    result = Result(levitation, levitation.survey)
    if kind == "json":
        answer: dict[str, Any] = {**result.summary, "tables_from_cache": levitation.from_cache}
        return f"{to_json(answer)}\n".encode()
    dataset = result.dataset().assign_attrs(study="equilibria")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "equilibria.nc"
        write_dataset(dataset, path, state.scene)
        return path.read_bytes()
