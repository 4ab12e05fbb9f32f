"""What the commands answer, as mappings ready for JSON."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...dynamics.flights import GROWING, STABLE, Trajectory, flight_kind
from ...dynamics.motion import PlateMemory
from ...dynamics.steady import Equilibrium, LeftOut, Survey
from ...fem.rotor_tables import CompleteTable, FieldTable
from ...geometry.basics import MU_0, Array, millimetres
from ..results import EQUILIBRIUM_FIELDS
from .effects import effects_answer
from .levitation import Levitation


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
