"""What the console says of equilibria, flights and effects: sentences and tables."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

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
from .cli.console import detail
from .effects import PLATE_NOT_MODELLED
from .figures.style import NAMES
from .levitation import Levitation

MILLI = 1e-3
DIGITS = 4
"""Significant digits of a number, at most."""
NOTHING = 1e-9
"""Lengths below this are round-off, mm."""
SAME = 1e-6
"""Difference of two levitation distances that is none whatever their errors, mm: round-off and stopped iterations."""
USELESS = 1.0
"""Relative error of a distance from which on an equilibrium is not worth a row."""
CLEAR = 0.5
"""Share of the damping that must be gone without the plate before it is called the plate's."""
FINEST = 0.01
"""Of distances from the axis, mm."""
SWINGS = 0.1
"""Polar angles that differ by more in a turn (°) are told with their extremes."""
LONG = 7200.0
"""From here on (s) hours are said too."""
CLEARLY_SLOW = 0.02
"""Relative error of what an effect adds to the growth of motions that goes without saying."""
SPOKEN = {"side, backward": "backward side motion", "side, forward": "forward side motion"}
"""Names of small motions in a sentence, where they are others."""
COLUMNS = (
    "distance (mm)", "lateral offset (mm)", "polar angle (°)", "phase lag (°)", "slowest motion", "growth (1/s)", "",
)  # fmt: skip
EFFECTS = ("effect", "in the motion", "moves it by (mm)", "adds to growth (1/s)")
NOT_SLOW = (
    "Of the {name} torque and lift are exact in a steady turn; motions are taken as slow against them: the growth that "
    "they add may be wrong by {motion_error:.0%}."
)


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


def headline(levitation: Levitation, equilibria: Sequence[Equilibrium], left_out: Sequence[LeftOut] = ()) -> str:
    """Where the floater floats and whether it stays there, in one sentence."""
    useful = worth_a_row(equilibria)
    if not useful:
        why = "there is no equilibrium"
        if equilibria:
            why = "the field model is too rough to tell where an equilibrium is"
        elif any(one.why in (NOT_CONVERGED, PAST_TABLE) for one in left_out):
            return f"No equilibrium was found at {levitation.scene.frequency:g} Hz, but not all could be computed."
        elif left_out:
            why = "no solution is an equilibrium"
        return f"Nothing floats at {levitation.scene.frequency:g} Hz: {why}."
    first = useful[0]
    name, growth = _slowest(first)
    alone = first.without if first.currents is not None else None
    if not first.stable:
        blame = " (without the plate it would be stable)" if alone is not None and alone.stable else ""
        grows = f"the {name} grows at {abs(growth):.2g} /s{blame}"
        return f"Does not stay up: the equilibrium {_place(first)}, is unstable; {grows}."
    damping = "undamped"
    if growth < -first.growth_error_per_s:
        change = 0.0 if alone is None else abs(first.growth_per_s - alone.growth_per_s)
        by = "plate" if change > CLEAR * abs(first.growth_per_s) else "air"
        damping = f"slowest motion ({name}) damped at {abs(growth):.2g} /s by the {by}"
    return f"Floats {_place(first)}; stable, {damping}."


def _place(equilibrium: Equilibrium) -> str:
    """Where the floater is in the laboratory, and how its moment points."""
    distance, error = _distance(equilibrium).lstrip("-"), equilibrium.position_error / MILLI
    angle = f"polar angle {_polar_angle(equilibrium, 1, '°')}"
    aside = equilibrium.lateral_offset / MILLI
    if math.hypot(*equilibrium.laboratory_position[:2]) / MILLI > max(aside / 2, FINEST):  # it stays on one side
        offset = bracketed(aside, max(error, FINEST))
        return f"{distance} mm along the axis from the rotor's centre, lateral offset {offset} mm, {angle}"
    return f"{distance} mm {'below' if equilibrium.position[2] < 0 else 'above'} the rotor's centre, {angle}"


def _distance(equilibrium: Equilibrium) -> str:
    return bracketed(-equilibrium.position[2] / MILLI, equilibrium.position_error / MILLI)


def _polar_angle(equilibrium: Equilibrium, digits: int, unit: str = "") -> str:
    """The mean over a turn, and the extremes where they matter."""
    low, high = equilibrium.polar_angle_swing_deg
    swing = f" ({low:.1f} to {high:.1f}{unit})" if high - low > SWINGS else ""
    return f"{equilibrium.polar_angle_deg:.{digits}f}{unit}{swing}"


def _slowest(equilibrium: Equilibrium) -> tuple[str, float]:
    """The least stable mode, and its growth rate, 1/s."""
    if not equilibrium.modes:
        return "a small motion", equilibrium.growth_per_s
    worst = max(equilibrium.modes, key=lambda mode: mode.growth_per_s)
    return SPOKEN.get(worst.name, worst.name), worst.growth_per_s


def worth_a_row(equilibria: Sequence[Equilibrium]) -> list[Equilibrium]:
    """Those whose place is known well enough to be told."""
    return [e for e in equilibria if e.position_error < USELESS * e.distance]


def equilibria_rows(levitation: Levitation, equilibria: Sequence[Equilibrium]) -> list[tuple[str, ...]]:
    """The table's head and a row for each equilibrium that is worth one; nothing where none is."""
    rows: list[tuple[str, ...]] = []
    for e in worth_a_row(equilibria):
        name, growth = _slowest(e)
        aside, doubt = e.lateral_offset / MILLI, e.position_error / MILLI
        angle = e.position_error / e.distance  # of a direction, rad: all that is known of its size
        without = e.currents is None and levitation.plate is not None
        rows.append(
            (
                _distance(e),
                bracketed(aside, max(doubt, FINEST)) if aside > FINEST / 2 else "0",
                _polar_angle(e, 2 if angle < 1e-4 else 1),
                f"{e.lag_deg + 0.0:.2f}".replace("-0.00", "0.00"),
                name,
                f"{growth:.2g}",
                ("stable" if e.stable else "unstable") + (", without the plate" if without else ""),
            )
        )
    return [COLUMNS, *rows] if rows else []


def equilibria_words(levitation: Levitation, survey: Survey) -> list[str]:
    """The headline, the equilibria as a table, and what was left out."""
    found, left_out = survey.equilibria, survey.left_out
    rows = equilibria_rows(levitation, found)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    table = ["  ".join(["", *map(str.rjust, row[:-1], widths), row[-1]]).rstrip() for row in rows]
    return [headline(levitation, found, left_out), *table, *left_out_words(levitation, left_out)]


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


def comparison_lines(compared: Mapping[str, Any] | None) -> list[str]:
    """Levitation distance by the point dipole against the true field; see `comparison` of `run`."""
    if compared is None:
        return []
    apart, error = compared["difference_mm"], compared["difference_error_mm"]
    said = f"Point-dipole model, same conditions: levitation distance {compared['dipole_distance_mm']:.2f} mm, "
    if abs(apart) <= max(error, SAME):
        return [f"{said}no difference beyond its error of {max(error, SAME):.0e} mm."]
    more = "more" if apart > 0 else "less"
    return [f"{said}{bracketed(abs(apart), error, 2)} mm {more} than with {NAMES[compared['true_model']]}."]


def kind_of_flight(levitation: Levitation, flight: Trajectory) -> str:
    """How a flight went; one that was still up, but had begun at an unstable equilibrium, is no stable one."""
    kind = flight_kind(flight)
    return kind if kind != STABLE or levitation.absolute or levitation.stability.stable else GROWING


def flight_words(levitation: Levitation, flight: Trajectory) -> str:
    """How a flight went, in one sentence."""
    kind, seconds = kind_of_flight(levitation, flight), flight.levitated_s
    flew = f"Flew {seconds:.4g} s" if seconds < LONG else f"Flew {seconds / 3600:.4g} h ({seconds:.0f} s)"
    if flight.left_plate_table:
        return (
            f"{flew}, then left the region in which the plate's response could be computed; "
            f"what it does farther on is not known. {levitation.no_wider}".rstrip()
        )
    if flight.ended_by in ("contact", "lost"):
        return f"{flew}, then {'touched something' if flight.ended_by == 'contact' else 'fell'} ({kind})."
    how = {"drifting": "; it drifts slowly", GROWING: "; the oscillation grows"}.get(kind, "")
    if not levitation.absolute and not levitation.stability.stable:
        how = f"; the oscillation grows (e-fold in {1 / levitation.stability.growth_per_s:.2g} s)"
    return f"{flew}, still up{how}."


def plate_words(levitation: Levitation) -> list[str]:
    """How well the plate's response is known, where that is worse than asked for."""
    memory, asked = levitation.flight_plate, levitation.models.plate_rtol
    if memory is None or memory.error <= asked:
        return []
    edges = " (an infinite slab leaves out the plate's edges)" if memory.neglected > asked else ""
    return [f"The plate's response may be wrong by {memory.error:.2g} of itself{edges}; {asked:g} was asked for."]


def effects_words(values: Mapping[str, Any]) -> list[str]:
    """Which effects are in the motion and about what each changes, or would change, as a table; reasons are details."""
    for sentence in values["not_modelled"]:
        detail(sentence)
    rows = [EFFECTS]
    for effect in values["effects"]:
        shift, growth = ("" if effect[key] is None else f"{effect[key]:.2g}" for key in ("shift_mm", "growth_per_s"))
        rows.append((effect["name"], "yes" if effect["included"] else "no", shift, growth))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    table = [f"  {row[0]:{widths[0]}}  " + "  ".join(map(str.rjust, row[1:], widths[1:])) for row in rows]
    plate = [PLATE_NOT_MODELLED] if PLATE_NOT_MODELLED in values["not_modelled"] else []
    told = [e for e in values["effects"] if e["included"] or e["growth_per_s"] is not None]
    fast = [NOT_SLOW.format(**effect) for effect in told if effect["motion_error"] > CLEARLY_SLOW]
    return [*(line.rstrip() for line in table), *plate, *fast]


def tell_details(flight: Trajectory) -> None:
    """How exactly a flight was integrated, where the user wants to know everything."""
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
