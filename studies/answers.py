"""What the commands answer, as mappings ready for JSON."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..dynamics.equilibria.equilibrium import (
    FOLD,
    IN_PLATE,
    IN_ROTOR,
    NOT_CONVERGED,
    PAST_TABLE,
    Equilibrium,
    LeftOut,
    Survey,
)
from ..dynamics.flights.trajectory import GROWING, STABLE, Trajectory, flight_kind
from ..dynamics.motion.plate import PlateMemory
from ..fem.rotor.near_field import CompleteTable
from ..fem.rotor.table import FieldTable
from ..geometry.common import MU_0, Array, millimetres
from .cli.console import detail
from .effects import PLATE_NOT_MODELLED, effects_answer
from .levitation import Levitation
from .result import EQUILIBRIUM_FIELDS


def field_answer(table: FieldTable, points: Array) -> dict[str, Any]:
    """B, its gradient and their estimated errors at points (n, 3) m."""
    if isinstance(table, CompleteTable) and not table.in_range(points).all():
        return _near_answer(table, points)
    b, gradient = table.evaluate(points)
    error, gradient_error = table.relative_error(points)
    return {
        "model": table.model,
        "error_estimate": float(error.max()),
        "gradient_error_estimate": float(gradient_error.max()),
        "B_T": b,
        "dB_T_per_m": gradient,
        "B_relative_error": error,
        "dB_relative_error": gradient_error,
    }


def _near_answer(table: CompleteTable, points: Array) -> dict[str, Any]:
    """As `field_answer`, with H, M and the magnets' numbers, also where the table itself does not reach."""
    found = table.fields(points)
    size = np.linalg.norm(found.flux_density, axis=1) + np.finfo(float).tiny
    steepness = np.linalg.norm(found.gradient, axis=(1, 2)) + np.finfo(float).tiny
    return {
        "model": table.model,
        "error_estimate": float((found.error / size).max()),
        "gradient_error_estimate": float((found.gradient_error / steepness).max()),
        "B_T": found.flux_density,
        "dB_T_per_m": found.gradient,
        "H_A_per_m": found.field / MU_0,
        "M_A_per_m": found.magnetization / MU_0,
        "inside_magnet": (found.magnet + 1).tolist(),
        "B_relative_error": found.error / size,
        "dB_relative_error": found.gradient_error / steepness,
    }


def equilibrium_answer(equilibrium: Equilibrium) -> dict[str, Any]:
    """One synchronous equilibrium."""
    return {
        **{field.key: field.shown(equilibrium) for field in EQUILIBRIUM_FIELDS if field.key},
        "frequencies_hz": equilibrium.frequencies_hz,
        "modes": [vars(mode) for mode in equilibrium.modes],
        "with_plate": equilibrium.currents is not None,
        "without_plate": None if equilibrium.without is None else equilibrium_answer(equilibrium.without),
    }


def left_out_answer(left_out: LeftOut) -> dict[str, Any]:
    """One solution that is no equilibrium of the scene, or is not known to be one."""
    known = left_out.known
    return {
        "position_mm": known.position / 1e-3,
        "laboratory_position_mm": known.laboratory_position / 1e-3,
        "with_plate": known.currents is not None,
        "why": left_out.why,
        "followed_to": left_out.part,
    }


def left_out_text(left_out: Sequence[LeftOut]) -> str:
    """The same of several, for an attribute of a dataset."""
    return "; ".join(f"{one.why}: {millimetres(one.known.position)}" for one in left_out)


def equilibria_answer(levitation: Levitation, known: Survey | None = None) -> dict[str, Any]:
    """All equilibria, or those given; the error estimate is the field's largest relative error at any of them."""
    known = levitation.survey if known is None else known
    found, left_out = known.equilibria, known.left_out
    places = np.array([e.start.position for e in found]).reshape(-1, 3)
    return {
        "model": levitation.table.model,
        "body_spin": levitation.spin,
        "error_estimate": float(levitation.table.relative_error(places)[0].max()) if len(places) else None,
        **effects_answer(levitation, found),
        **plate_answer(levitation.plate),
        "equilibria": [equilibrium_answer(equilibrium) for equilibrium in found],
        "left_out": [left_out_answer(one) for one in left_out],
    }


def plate_answer(memory: PlateMemory | None) -> dict[str, Any]:
    """The plate's model and its estimated relative error."""
    if memory is None:
        return {"plate_model": "none"}
    return {
        "plate_model": memory.model,
        "plate_error_estimate": memory.error,
        "plate_states": len(memory.table.rates),
    }


def flight_answer(levitation: Levitation, flight: Trajectory) -> dict[str, Any]:
    """How a flight went; the error estimate is the field's largest relative error along it."""
    table = levitation.flight_table
    places = flight.rotor.position[:: max(1, len(flight.time) // 500)]
    return {
        "model": table.model,
        "error_estimate": float(table.relative_error(places[table.in_range(places)])[0].max()),
        **effects_answer(levitation, () if levitation.absolute else levitation.equilibria),
        **plate_answer(levitation.flight_plate),
        "beyond_plate_table": flight.beyond_plate_table,
        "left_plate_table": flight.left_plate_table,
        "levitated_s": flight.levitated_s,
        "ended_by": flight.ended_by,
        "kind": kind_of_flight(levitation, flight),
        "energy_error": flight.energy_error,
        "field_changes": vars(flight.field_changes),
        "realtime_factor": flight.realtime_factor,
    }


def kind_of_flight(levitation: Levitation, flight: Trajectory) -> str:
    """How a flight went; one that was still up, but had begun at an unstable equilibrium, is no stable one."""
    kind = flight_kind(flight)
    return kind if kind != STABLE or levitation.absolute or levitation.stability.stable else GROWING


MILLI = 1e-3
DIGITS = 4
"""Significant digits of a number, at most."""
NOTHING = 1e-9
"""Lengths below this are round-off, mm."""
USELESS = 1.0
"""Relative error of a distance from which on an equilibrium is not worth a row."""
CLEAR = 0.5
"""Share of the damping that must be gone without the plate before it is called the plate's."""

SPOKEN = {"side, backward": "backward side motion", "side, forward": "forward side motion"}
"""Names of small motions in a sentence, where they are others."""
COLUMNS = (
    "distance (mm)", "lateral offset (mm)", "polar angle (°)", "phase lag (°)", "slowest motion", "growth (1/s)", "",
)  # fmt: skip
FINEST = 0.01
"""Of distances from the axis, mm."""
CLEARLY_SLOW = 0.02
"""Relative error of what an effect adds to the growth of motions that goes without saying."""
NOT_SLOW = (
    "Of the {name} torque and lift are exact in a steady turn; motions are taken as slow against them: the growth that "
    "they add may be wrong by {motion_error:.0%}."
)
SWINGS = 0.1
"""Polar angles that differ by more in a turn (°) are told with their extremes."""
LONG = 7200.0
"""From here on (s) hours are said too."""


def bracketed(value: float, error: float, digits: int = DIGITS) -> str:
    """A number with its uncertainty, rounded up, in units of the last digit; `digits` significant ones at most.

    >>> bracketed(17.2138, 2e-6), bracketed(17.2138, 0.023), bracketed(-2.871, 0.12), bracketed(0.0, 0.0)
    ('17.21(1)', '17.21(3)', '-2.9(2)', '0')
    """
    if abs(value) < NOTHING or not math.isfinite(value):
        return "0" if abs(value) < NOTHING else f"{value:g}"
    places = digits - 1 - math.floor(math.log10(abs(value)))
    if error > 0:
        places = min(places, -math.floor(math.log10(error)))
    places = max(places, 0)
    last = max(1, math.ceil(error * 10**places - 1e-9))
    return f"{value:.{places}f}({last})"


def rate(value: float) -> str:
    """A rate of growth or decay, /s, with two digits: nobody needs more of it."""
    return f"{abs(value):.2g} /s"


def headline(levitation: Levitation, equilibria: Sequence[Equilibrium], left_out: Sequence[LeftOut] = ()) -> str:
    """Where the floater floats and whether it stays there, in one sentence."""
    useful = worth_a_row(equilibria)
    if not useful:
        if equilibria:
            why = "the field model is too rough to tell where an equilibrium is"
        elif any(one.why in (NOT_CONVERGED, PAST_TABLE) for one in left_out):
            return f"No equilibrium was found at {levitation.scene.frequency:g} Hz, but not all could be computed."
        elif left_out:
            why = "no solution is an equilibrium"
        else:
            why = "there is no equilibrium"
        return f"Nothing floats at {levitation.scene.frequency:g} Hz: {why}."
    first = useful[0]
    if first.stable:
        return f"Floats {_place(first)}; stable, {_damping(first)}."
    name, growing = slowest(first)
    return (
        f"Does not stay up: the equilibrium {_place(first)}, is unstable; the {name} grows at "
        f"{rate(growing)}{_blame(first)}."
    )


def _place(equilibrium: Equilibrium) -> str:
    """Where the floater is in the laboratory, and how its moment points."""
    side = "below" if equilibrium.position[2] < 0 else "above"
    distance, error = _distance(equilibrium).lstrip("-"), equilibrium.position_error / MILLI
    angle = f"polar angle {_polar_angle(equilibrium, 1, '°')}"
    aside = equilibrium.lateral_offset / MILLI
    if math.hypot(*equilibrium.laboratory_position[:2]) / MILLI > max(aside / 2, FINEST):  # it stays on one side
        offset = bracketed(aside, max(error, FINEST))
        return f"{distance} mm along the axis from the rotor's centre, lateral offset {offset} mm, {angle}"
    return f"{distance} mm {side} the rotor's centre, {angle}"


def _polar_angle(equilibrium: Equilibrium, digits: int, unit: str = "") -> str:
    """The mean over a turn, and the extremes where they matter."""
    low, high = equilibrium.polar_angle_swing_deg
    swing = f" ({low:.1f} to {high:.1f}{unit})" if high - low > SWINGS else ""
    return f"{equilibrium.polar_angle_deg:.{digits}f}{unit}{swing}"


def slowest(equilibrium: Equilibrium) -> tuple[str, float]:
    """The small motion that decides: the one that grows fastest, or dies out most slowly; its rate, 1/s."""
    if not equilibrium.modes:
        return "a small motion", equilibrium.growth_per_s
    worst = max(equilibrium.modes, key=lambda mode: mode.growth_per_s)
    return SPOKEN.get(worst.name, worst.name), worst.growth_per_s


def worth_a_row(equilibria: Sequence[Equilibrium]) -> list[Equilibrium]:
    """Those whose place is known well enough to be told."""
    return [e for e in equilibria if e.position_error < USELESS * e.distance]


def _distance(equilibrium: Equilibrium) -> str:
    return bracketed(-equilibrium.position[2] / MILLI, equilibrium.position_error / MILLI)


def _damping(equilibrium: Equilibrium) -> str:
    name, growth = slowest(equilibrium)
    if growth >= -equilibrium.growth_error_per_s:
        return "undamped"
    by = "plate" if _the_plate_decides(equilibrium) else "air"
    return f"slowest motion ({name}) damped at {rate(growth)} by the {by}"


def _the_plate_decides(equilibrium: Equilibrium) -> bool:
    alone = equilibrium.without
    if equilibrium.currents is None or alone is None:
        return False
    return abs(equilibrium.growth_per_s - alone.growth_per_s) > CLEAR * abs(equilibrium.growth_per_s)


def _blame(equilibrium: Equilibrium) -> str:
    alone = equilibrium.without
    by_plate = equilibrium.currents is not None and alone is not None and alone.stable
    return " (without the plate it would be stable)" if by_plate else ""


def equilibria_words(levitation: Levitation, known: Survey | None = None) -> list[str]:
    """The headline, the equilibria as a table, and what was left out; of all, or of those given."""
    known = levitation.survey if known is None else known
    return [
        headline(levitation, known.equilibria, known.left_out),
        *equilibria_table(levitation, known.equilibria),
        *left_out_words(levitation, known.left_out),
    ]


def left_out_words(levitation: Levitation, left_out: Sequence[LeftOut]) -> list[str]:
    """Which solutions are no equilibria of the scene, or could not be computed, and why: a sentence each kind."""
    cause = "the plate's response" if levitation.plate is not None else "gravity across the axis"
    said = []
    for body, where in ((IN_PLATE, "plate"), (IN_ROTOR, "rotor")):
        depths = [_distance(one.known) for one in left_out if one.why == body]
        if depths:
            count = "a solution" if len(depths) == 1 else f"{len(depths)} solutions"
            said.append(f"Left out: {count} at {', '.join(depths)} mm, where the floater would overlap the {where}.")
    for one in left_out:
        place = f"equilibrium at {_distance(one.known)} mm"
        if one.why == FOLD:
            said.append(f"The {place} without {cause} ends at {one.part:.1%} of it, where it meets another (fold).")
        elif one.why == NOT_CONVERGED:
            said.append(
                f"Not known: what becomes of the {place} without {cause}. Newton's method did not converge beyond "
                f"{one.part:.1%} of it, so that there may be an equilibrium."
            )
        elif one.why == PAST_TABLE:
            said.append(f"Not known: the {place}, beyond the range of the plate's precomputed field, is left out.")
    return said


def equilibria_table(levitation: Levitation, equilibria: Sequence[Equilibrium]) -> list[str]:
    """The equilibria worth a row, as a table."""
    rows = equilibria_rows(levitation, equilibria)
    widths = [max((len(row[k]) for row in rows), default=0) for k in range(len(COLUMNS))]
    return ["  ".join(["", *map(str.rjust, row[:-1], widths), row[-1]]).rstrip() for row in rows]


def equilibria_rows(levitation: Levitation, equilibria: Sequence[Equilibrium]) -> list[tuple[str, ...]]:
    """The table's head and a row for each equilibrium that is worth one; nothing where none is."""
    useful = worth_a_row(equilibria)
    if not useful:
        return []
    felt = levitation.plate is not None
    rows: list[tuple[str, ...]] = [COLUMNS]
    for e in useful:
        name, growth = slowest(e)
        aside, doubt = e.lateral_offset / MILLI, e.position_error / MILLI
        angle = e.position_error / e.distance  # of a direction, rad: all that is known of its size
        verdict = "stable" if e.stable else "unstable"
        rows.append(
            (
                _distance(e),
                bracketed(aside, max(doubt, FINEST)) if aside > FINEST / 2 else "0",
                _polar_angle(e, 2 if angle < 1e-4 else 1),
                f"{e.lag_deg + 0.0:.2f}".replace("-0.00", "0.00"),
                name,
                f"{growth:.2g}",
                verdict + ("" if e.currents is not None or not felt else ", without the plate"),
            )
        )
    return rows


def flight_words(levitation: Levitation, flight: Trajectory) -> str:
    """How a flight went, in one sentence."""
    kind = kind_of_flight(levitation, flight)
    if flight.left_plate_table:
        return (
            f"Flew {_time(flight.levitated_s)}, then left the region in which the plate's response could be computed; "
            f"what it does farther on is not known. {levitation.no_wider}".rstrip()
        )
    if flight.ended_by == "contact":
        return f"Flew {_time(flight.levitated_s)}, then touched something ({kind})."
    if flight.ended_by == "lost":
        return f"Flew {_time(flight.levitated_s)}, then fell ({kind})."
    start = None if levitation.absolute else levitation.stability
    how = {"stable": "", "drifting": "; it drifts slowly", "growing oscillation": "; the oscillation grows"}.get(
        kind, ""
    )
    if start is not None and not start.stable:
        how = f"; the oscillation grows (e-fold in {1 / start.growth_per_s:.2g} s)"
    return f"Flew {_time(flight.levitated_s)}, still up{how}."


def plate_words(levitation: Levitation) -> list[str]:
    """How well the plate's response is known, where that is worse than asked for."""
    memory, asked = levitation.flight_plate, levitation.models.plate_rtol
    if memory is None or memory.error <= asked:
        return []
    edges = " (an infinite slab leaves out the plate's edges)" if memory.neglected > asked else ""
    return [f"The plate's response may be wrong by {memory.error:.2g} of itself{edges}; {asked:g} was asked for."]


def _time(seconds: float) -> str:
    return f"{seconds:.4g} s" if seconds < LONG else f"{seconds / 3600:.4g} h ({seconds:.0f} s)"


def effects_words(values: Mapping[str, Any]) -> list[str]:
    """Which effects are in the motion and about what each changes, or would change, as a table; reasons are details."""
    for sentence in values["not_modelled"]:
        detail(sentence)
    rows = [("effect", "in the motion", "moves it by (mm)", "adds to growth (1/s)")]
    for effect in values["effects"]:
        sizes = ("" if effect[key] is None else f"{effect[key]:.2g}" for key in ("shift_mm", "growth_per_s"))
        rows.append((effect["name"], "yes" if effect["included"] else "no", *sizes))
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    table = [f"  {row[0]:{widths[0]}}  " + "  ".join(map(str.rjust, row[1:], widths[1:])) for row in rows]
    plate = [PLATE_NOT_MODELLED] if PLATE_NOT_MODELLED in values["not_modelled"] else []
    told = [e for e in values["effects"] if e["included"] or e["growth_per_s"] is not None]
    fast = [NOT_SLOW.format(**effect) for effect in told if effect["motion_error"] > CLEARLY_SLOW]
    return [*(line.rstrip() for line in table), *plate, *fast]


def tell_details(flight: Trajectory) -> None:
    """How exactly a flight was integrated."""
    beyond, changes = flight.beyond_plate_table, flight.field_changes
    detail(
        f"Energy ledger and unit length of the moment violated by {flight.energy_error:.1e} at most; "
        f"{flight.realtime_factor:.3g} times real time."
    )
    if beyond:
        detail(f"For {beyond:.1%} of the flight the floater was beyond the range of the plate's table.")
    if changes.count:
        detail(
            f"The floater changed {changes.count} times from one ball with an expansion of the field to another "
            f"(error up to {changes.error:.0e}); that changed its energy by {changes.energy:.1e}, beside the ledger."
        )
