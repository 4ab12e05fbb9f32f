"""Many trajectories of one scene: initial states that are given, or drawn at random about its own, and their ends."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dynamics.flights.batch import Endings, ensemble
from ..dynamics.flights.flight import displaced, initial_state
from ..dynamics.motion.events import clearance
from ..dynamics.motion.state import State
from ..geometry.common import Array, InputError
from ..geometry.scene.contents import AbsoluteStart, OffsetStart
from .cli.options import refused, wrong
from .levitation import Levitation
from .processes import mapped

TOGETHER = 512  # Trajectories that a worker gets at once
WIDER = 4  # Times at most that a plate's table is made larger for trajectories that leave it

# SI units of the keys of `[start]`.
UNITS = dict.fromkeys(("offset_mm", "position_mm", "velocity_mm_s"), 1e-3)
UNITS |= {"moment": 1.0, "spin_hz": 2 * np.pi, "body_x": 1.0}
SPREADS = {"offset_mm": 1e-3, "velocity_mm_s": 1e-3, "moment_deg": np.pi / 180, "spin_hz": 2 * np.pi}


def endings(
    levitation: Levitation, starts: State, offset: Array | None, duration: float, workers: int
) -> tuple[Endings, Levitation]:
    """Ends of trajectories of `duration` (s) from (n,) `starts` by `workers` processes, and what has their models.

    `offset` (n, 3) m is that from the equilibrium of a `levitation`, where they are given by it.
    """
    scene, count = levitation.scene, len(starts.position)
    free = np.flatnonzero(clearance(scene, np.zeros(count), starts.position, starts.orientation) > 0)
    if offset is None and scene.plate is not None and len(free):
        # the nearest to the plate tells whether its currents matter
        nearest = starts[free[np.argmin(scene.plate.body.distance(starts.position[free]))]]
        begins = AbsoluteStart(nearest.position, nearest.velocity, nearest.moment, nearest.spin)
        levitation = levitation.elsewhere(start=begins)

    def found(some: NDArray[np.intp]) -> Endings:
        together, plate, currents = min(TOGETHER, -(-len(some) // workers)), levitation.flight_plate, None
        if plate is not None and offset is not None:
            currents = initial_state(scene, levitation.interaction, levitation.known_for_flight, plate)[1]
        begun = starts[some], duration, map if workers == 1 else mapped(workers), together
        away = None if offset is None else offset[some]
        return ensemble(scene, levitation.interaction, *begun, away, plate, currents)

    whole = found(np.arange(count))
    for _ in range(WIDER):
        left = np.flatnonzero(whole.left_plate_table)
        lab = whole.last.to_lab(scene.angle(whole.levitated_s)).position
        if not len(left) or not levitation.follow(lab[left], whole.levitated_s[left]):
            break
        whole = whole.replaced(left, found(left))
    return whole, levitation


def given_starts(levitation: Levitation, starts: Mapping[Any, Any]) -> tuple[Levitation, State, Array | None]:
    """States (n, 3) at t = 0 from keys of `[start]`, what they are about, and offsets (n, 3) m where these are given.

    Raises InputError for what is not allowed, with the way out; EquilibriumError: offsets, and no equilibrium.
    """
    columns = {str(key): _rows("starts", str(key), values, UNITS) for key, values in starts.items()}
    if ("offset_mm" in columns) == ("position_mm" in columns):
        raise refused("starts", "have either offset_mm or position_mm", list(columns))
    if "offset_mm" in columns and len(columns) > 1:
        raise refused("starts", "have offset_mm alone, or position_mm", list(columns))
    lengths = {key: len(rows) for key, rows in columns.items() if len(rows) != 1}
    if len(set(lengths.values())) > 1:
        raise refused("starts", "have as many rows in each key", lengths)
    count = next(iter(lengths.values()), 1)
    if "offset_mm" in columns:
        about, offset = levitation.elsewhere(start=OffsetStart(np.zeros(3))), columns["offset_mm"]
        begun, _ = initial_state(about.scene, about.interaction, about.known_for_flight)
        return about, displaced(begun, offset, about.scene.angular_velocity), offset
    near, floater = columns.pop("body_x", None), levitation.scene.floater
    if near is not None and floater.round:
        rule = "be left out of a floater that is round about its moment, as it changes nothing"
        raise wrong("starts.body_x", rule, "it is given.")
    defaults = {"velocity_mm_s": (0.0, 0.0, 0.0), "moment": (0.0, 0.0, 1.0), "spin_hz": (0.0, 0.0, 0.0)}
    whole = {key: columns.get(key, np.array([defaults.get(key)])) for key in list(UNITS)[1:-1]}
    position, velocity, moment, spin = (np.tile(v, (count, 1)) if len(v) == 1 else v for v in whole.values())
    sizes = np.linalg.norm(moment, axis=1)
    if not sizes.all():
        raise InputError("Input starts.moment must be directions, not zero; instead received one that is.")
    found = State(position, velocity, moment / sizes[:, None], spin)
    if not floater.round:
        sides = [None] * count if near is None else np.broadcast_to(near, (count, 3))
        axes = np.array([floater.axes(m, x) for m, x in zip(found.moment, sides, strict=True)])
        found = replace(found, axes=axes)
    return levitation, found, None


def drawn_starts(levitation: Levitation, count: int | None, seed: int, spread: Mapping[str, Any]) -> State:
    """`count` states about where a `levitation`'s scene begins, normal with standard deviations `spread`, by `seed`."""
    for name, value, least in (("n", count, 1), ("seed", seed, 0)):
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
            raise refused(name, f"be a whole number, {least} at least", value)
    sizes = {key: _rows("spread", key, values, SPREADS)[0] for key, values in spread.items()}
    if not sizes or any((size < 0).any() for size in sizes.values()):
        rule = f"have standard deviations, not negative, of some of {', '.join(SPREADS)}"
        raise wrong("spread", rule, f"received {dict(spread)}.")
    draws = np.random.default_rng(int(seed)).normal(size=(int(count or 0), len(SPREADS), 3))
    offset, velocity, moment, spin = (draws[:, k] * sizes.get(key, np.zeros(3)) for k, key in enumerate(SPREADS))
    begun, _ = initial_state(levitation.scene, levitation.interaction, levitation.known_for_flight)
    begun = displaced(begun, offset, levitation.scene.angular_velocity)
    turned = begun.moment + moment
    turned = turned / np.linalg.norm(turned, axis=1)[:, None]
    drawn = State(begun.position, begun.velocity + velocity, turned, begun.spin + spin)
    if begun.axes is not None:  # turned about an axis across both moments
        cross = np.cross(np.cross(begun.moment, turned)[:, None], np.eye(3)).swapaxes(1, 2)
        cosine = np.sum(begun.moment * turned, axis=1)[:, None, None]
        turns = np.eye(3) + cross + cross @ cross / np.maximum(1 + cosine, 1e-12)
        drawn = replace(drawn, axes=turns @ begun.axes)
    return drawn


def _rows(name: str, key: str, values: Any, units: Mapping[str, float]) -> Array:
    if key not in units:
        raise refused(name, f"have keys among {', '.join(units)}", key)
    try:
        rows = np.asarray(values, float)
    except (TypeError, ValueError):
        raise refused(f"{name}.{key}", "be numbers", values) from None
    if name == "spread" and rows.ndim == 0:
        rows = np.full(3, rows)
    fine = rows.ndim in (1, 2) and rows.shape[-1] == 3 and rows.size and np.isfinite(rows).all()
    if not fine or (name == "spread" and rows.ndim > 1):
        each = "three finite numbers for each trajectory, (n, 3)"
        shape = "one or three finite numbers" if name == "spread" else each
        what = values if rows.ndim == 0 else f"an array of shape {rows.shape}"
        raise InputError(f"Input {name}.{key} must be {shape}; instead received {what}.")
    return np.atleast_2d(rows) * units[key]
