"""Sentences and tables about equilibria and trajectories, for the console."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..dynamics.continuation.branch import OSCILLATORY, REAL
from ..dynamics.continuation.frequencies import BORDER, CONTACT, nearest_range
from ..dynamics.equilibria import equilibrium as why
from ..dynamics.equilibria.equilibrium import MODE_NAMES, STABILITIES, Equilibrium, LeftOut, Survey
from ..dynamics.flights.trajectory import DRIFTING, GROWING, LOST_AT_ONCE, STABLE, Trajectory, flight_kind
from .cli.console import aligned, detail
from .figures.style import NAMES
from .levitation import Levitation

MILLI = 1e-3
DIGITS = 4  # significant digits of a number, at most
# Difference of two levitation distances that is none whatever their errors, mm: round-off and stopped iterations.
SAME = 1e-6
CLEAR = 0.5  # share of the decay rate that must be gone without the plate before it is called the plate's
FINEST = 0.01  # of distances from the axis, mm
SWINGS = 0.1  # polar angles that differ by more in a turn (°) are given with their extremes
COLUMNS = (
    "distance (mm)", "lateral offset (mm)", "polar angle (°)", "phase lag (°)", "least stable mode",
    "growth rate (s⁻¹)", "",
)  # fmt: skip

ENDS = {
    why.FOLD: "fold",
    OSCILLATORY: "growing oscillation",
    REAL: "growth without oscillation",
    CONTACT: "contact with the rotor",
    BORDER: "not followed farther",
}  # Of a range of stable frequencies


def bracketed(value: float, error: float, digits: int = DIGITS) -> str:
    """A `value` with its `error`, rounded up, in units of the last digit; `digits` significant ones at most.

    >>> bracketed(17.2138, 2e-6), bracketed(17.2138, 0.023), bracketed(-2.871, 0.12), bracketed(0.0, 0.0)
    ('17.21(1)', '17.21(3)', '-2.9(2)', '0')
    """
    if abs(value) < 1e-9 or not math.isfinite(value):  # mm: round-off
        return "0" if abs(value) < 1e-9 else f"{value:g}"
    places = digits - 1 - math.floor(math.log10(abs(value)))
    if error > 0:
        places = min(places, -math.floor(math.log10(error)))
    places = max(places, 0)
    last = max(1, math.ceil(error * 10**places - 1e-9))
    return f"{value:.{places}f}({last})"


def spoken_time(seconds: float) -> str:
    """Three digits in the unit that suits them.

    >>> spoken_time(0.0364), spoken_time(11.0), spoken_time(45e3)
    ('36.4 ms', '11 s', '12.5 h')
    """
    if seconds < 0.1:
        return f"{1e3 * seconds:.3g} ms"
    unit, size = ("s", 1.0) if seconds < 600 else ("min", 60.0) if seconds < 7200 else ("h", 3600.0)
    return f"{seconds / size:.3g} {unit}"


def headline(levitation: Levitation, equilibria: Sequence[Equilibrium], left_out: Sequence[LeftOut] = ()) -> str:
    """Distance and stability in a `levitation`, by its `equilibria` and what was `left_out`."""
    if not (useful := worth_a_row(equilibria)):
        reason = "there is no equilibrium"
        if equilibria:
            reason = "the field model is too rough to tell where an equilibrium is"
        elif any(one.why in (why.NOT_CONVERGED, why.PAST_TABLE) for one in left_out):
            return f"No equilibrium was found at {levitation.scene.frequency:g} Hz, but not all could be computed."
        elif left_out:
            reason = "no solution is an equilibrium"
        return f"No levitation at {levitation.scene.frequency:g} Hz: {reason}."
    first = useful[0]
    of_kind = first.kind and f" ({first.kind})"
    mode, alone = _least_stable(first), first.without if first.currents is not None else None
    if not first.stable:
        kind = "Marginally unstable" if first.stability == "marginal" else "Unstable"
        blame = "; without the plate it would be stable" if alone is not None and alone.stable else ""
        time = spoken_time(first.efolding_s or math.inf)
        return f"{kind} {_place(first)}{of_kind}: the {mode} mode grows with an e-folding time of {time}{blame}."
    decay = "is undamped"
    if first.growth_per_s < -first.growth_error_per_s:
        change = 0.0 if alone is None else abs(first.growth_per_s - alone.growth_per_s)
        cause = "eddy currents in the plate" if change > CLEAR * abs(first.growth_per_s) else "air drag"
        decay = f"decays at {-first.growth_per_s:.2g} s⁻¹ by {cause}"
    return f"Stable levitation {_place(first)}{of_kind}. Least stable mode: {mode}, {decay}."


def _place(equilibrium: Equilibrium) -> str:
    distance, error = _distance(equilibrium).lstrip("-"), equilibrium.position_error / MILLI
    angle = f"polar angle {_polar_angle(equilibrium, 1, '°')}"
    offset, mean = equilibrium.lateral_offset / MILLI, math.hypot(*equilibrium.laboratory_position[:2]) / MILLI
    one_side = mean > max(offset / 2, FINEST)
    if one_side or offset > abs(equilibrium.position[2]) / MILLI:  # on one side, or beside the rotor
        lateral = bracketed(offset, max(error, FINEST))
        return f"{distance} mm along the axis from the rotor's centre, lateral offset {lateral} mm, {angle}"
    return f"{distance} mm {'below' if equilibrium.position[2] < 0 else 'above'} the rotor's centre, {angle}"


def _distance(equilibrium: Equilibrium) -> str:
    return bracketed(-equilibrium.position[2] / MILLI, equilibrium.position_error / MILLI)


def _polar_angle(equilibrium: Equilibrium, digits: int, unit: str = "") -> str:
    """The mean over a turn, and the extremes where they matter."""
    low, high = equilibrium.polar_angle_swing_deg
    swing = f" ({low:.1f} to {high:.1f}{unit})" if high - low > SWINGS else ""
    return f"{equilibrium.polar_angle_deg:.{digits}f}{unit}{swing}"


def _least_stable(equilibrium: Equilibrium) -> str:
    return mode_words(max(equilibrium.modes, key=lambda m: m.growth_per_s).name if equilibrium.modes else "unnamed")


def mode_words(name: str) -> str:
    return MODE_NAMES.get(name, name)


def worth_a_row(equilibria: Sequence[Equilibrium]) -> list[Equilibrium]:
    """Those whose distance is known better than to a factor of 2."""
    return [e for e in equilibria if e.position_error < e.distance]


def equilibria_rows(levitation: Levitation, equilibria: Sequence[Equilibrium]) -> list[tuple[str, ...]]:
    """The table's head and a row for each equilibrium that is worth one; nothing where none is."""
    rows: list[tuple[str, ...]] = []
    for e in worth_a_row(equilibria):
        offset, doubt = e.lateral_offset / MILLI, e.position_error / MILLI
        angle = e.position_error / e.distance  # of a direction, rad: all that is known of its size
        without = e.currents is None and levitation.plate is not None
        rows.append(
            (
                _distance(e),
                bracketed(offset, max(doubt, FINEST)) if offset > FINEST / 2 else "0",
                _polar_angle(e, 2 if angle < 1e-4 else 1),
                f"{e.lag_deg + 0.0:.2f}".replace("-0.00", "0.00"),
                _least_stable(e),
                f"{e.growth_per_s:.2g}",
                STABILITIES[e.stability] + (" (plate not included)" if without else "") + (e.kind and f", {e.kind}"),
            )
        )
    return [COLUMNS, *rows] if rows else []


def equilibria_words(levitation: Levitation, survey: Survey) -> list[str]:
    table = aligned(equilibria_rows(levitation, survey.equilibria), ">" * (len(COLUMNS) - 1) + "<")
    said = headline(levitation, survey.equilibria, survey.left_out)
    return [said, *(f"  {line}" for line in table), *left_out_words(levitation, survey.left_out)]


def left_out_words(levitation: Levitation, left_out: Sequence[LeftOut]) -> list[str]:
    cause = "the plate's response" if levitation.plate is not None else "gravity across the axis"
    said = []
    for body, where in ((why.IN_PLATE, "plate"), (why.IN_ROTOR, "rotor")):
        if depths := [_distance(one.known) for one in left_out if one.why == body]:
            count = "a solution" if len(depths) == 1 else f"{len(depths)} solutions"
            said.append(f"Left out: {count} at {', '.join(depths)} mm, where the floater would overlap the {where}.")
    for one in left_out:
        place = f"equilibrium at {_distance(one.known)} mm"
        if one.why == why.FOLD:
            said.append(f"The {place} without {cause} ends at {one.part:.1%} of it, where it meets another (fold).")
        elif one.why == why.NOT_CONVERGED:
            said.append(
                f"Not known: what becomes of the {place} without {cause}. Newton's method did not converge beyond "
                f"{one.part:.1%} of it, so that there may be an equilibrium."
            )
        elif one.why == why.PAST_TABLE:
            said.append(f"Not known: the {place}, beyond the range of the plate's precomputed field, is left out.")
    return said


def comparison_words(compared: Mapping[str, Any] | None, plate: bool = False) -> list[str]:
    """Levitation distance by the point dipole against the finite magnets', both without a `plate` where one is."""
    if compared is None:
        return []
    rough, true, moment = (compared[f"{name}_distance_mm"] for name in ("dipole", "true", "true_moment"))
    best, apart, error = NAMES[compared["true_model"]], compared["difference_mm"], compared["difference_error_mm"]
    conditions = "same conditions without the plate" if plate else "same conditions"
    if rough is None:
        stability = STABILITIES[compared["true_stability"]]
        return [f"Point-dipole model, {conditions}: no equilibrium; with {best} {true:.2f} mm ({stability})."]
    stability = STABILITIES[compared["dipole_stability"]]
    kind = "" if compared["dipole_stability"] == compared["true_stability"] else f" ({stability})"
    said = f"Point-dipole model, {conditions}: levitation distance {rough:.2f} mm{kind}, "
    if true is None:
        said += f"where there is no equilibrium with {best}"
        error = 0.0
    elif abs(apart) <= max(error, SAME):
        return [f"{said}no difference beyond its error of {max(error, SAME):.0e} mm."]
    else:
        said += f"{bracketed(abs(apart), error, 2)} mm {'more' if apart > 0 else 'less'} than with {best}"
    if moment is None or abs(moment - rough) <= max(error, SAME):
        return [f"{said}."]
    return [f"{said}; with the magnets' true moments {moment:.2f} mm."]


def kind_of_flight(levitation: Levitation, flight: Trajectory) -> str:
    """Its kind; a trajectory that lasted, but had begun at an unstable equilibrium, is no stable one."""
    kind = flight_kind(flight)
    return kind if kind != STABLE or levitation.absolute or levitation.quiet.stability.stable else GROWING


def flight_words(levitation: Levitation, flight: Trajectory) -> str:
    kind, time = kind_of_flight(levitation, flight), f"{flight.levitated_s:.4g} s"
    if flight.levitated_s >= 7200:
        time += f" ({flight.levitated_s / 3600:.4g} h)"
    if flight.left_plate_table:
        return (
            f"Simulated {time}; then the floater left the region in which the plate's response could be computed, and "
            f"its further motion is not known. {levitation.no_wider}".rstrip()
        )
    if flight.ended_by in ("contact", "lost"):
        at = "" if flight.given is None else f" at {flight.lost_at_hz:.5g} Hz"
        how = "" if kind == LOST_AT_ONCE else f" ({kind})"
        return f"Levitated for {time}, then {'contact' if flight.ended_by == 'contact' else 'lost'}{at}{how}."
    if flight.given is not None:
        return f"Simulated {time}: still levitating at {flight.rate[-1] / (2 * math.pi):.5g} Hz."
    how = {DRIFTING: ", drifting slowly", GROWING: ", with a growing oscillation"}.get(kind, "")
    if not levitation.absolute and (efolding := levitation.quiet.stability.efolding_s):
        how = f", with a growing oscillation (e-folding time {spoken_time(efolding)})"
    return f"Simulated {time}: still levitating{how}."


def drive_words(levitation: Levitation, flight: Trajectory) -> list[str]:
    """What the motor gave, and between which frequencies the equilibria are stable; nothing without a drive."""
    if flight.given is None:
        return []
    momentum, work = flight.given[-1]
    torque, power = (float(given) / max(flight.levitated_s, 1e-300) for given in (momentum, work))
    said = f"{torque:.2g} N m and {power:.2g} W on the mean, {work:.2g} J in all."
    lines = [f"Motor, beside the rotor's own inertia and friction: {said}"]
    if stable := nearest_range(levitation.branch, levitation.scene.frequency):
        ends = [f"{end.parameter:.2f} Hz ({ENDS[end.kind]})" for end in (stable.low, stable.high)]
        plate = " without the plate" if levitation.scene.plate else ""
        lines.append(f"Equilibria at steady frequencies{plate} are stable from {ends[0]} to {ends[1]}.")
    return lines


def plate_words(levitation: Levitation) -> list[str]:
    memory, requested = levitation.flight_plate, levitation.models.plate_rtol
    if memory is None or memory.error <= requested:
        return []
    edges = "; an infinite slab leaves out the plate's edges" if memory.neglected > requested else ""
    return [f"Estimated relative error of the plate's response: {memory.error:.2g} ({requested:g} requested{edges})."]


def note_details(flight: Trajectory) -> None:
    beyond, changes = flight.beyond_plate_table, flight.field_changes
    detail(
        f"Energy balance and unit length of the moment violated by {flight.energy_error:.1e} at most; "
        f"{flight.realtime_factor:.3g} times real time."
    )
    if beyond:
        detail(f"For {beyond:.1%} of the time the floater was beyond the range of the plate's precomputed field.")
    if changes.count:
        detail(
            f"The floater changed {changes.count} times from one ball with an expansion of the field to another (error "
            f"up to {changes.error:.0e}), which changed its energy by {changes.energy:.1e}, not in the energy balance."
        )
