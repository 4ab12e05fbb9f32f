"""What the commands answer, as mappings ready for JSON."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...dynamics.flights import Trajectory, flight_kind
from ...dynamics.motion import PlateMemory
from ...dynamics.steady import Equilibrium
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ..results import EQUILIBRIUM_FIELDS
from .effects import effects_answer
from .levitation import Levitation

MILLI = 1e-3
PLATE_NOT_MODELLED = "The plate's eddy currents are left out: the plate is only an obstacle."
ANSWERS_NOT_MODELLED = (
    "The floater is a rigid dipole: that rotor and floater magnetise each other is not in the motion "
    "(--interaction mutual)."
)


def field_answer(table: FieldTable, points: Array) -> dict[str, Any]:
    """B, its gradient and their estimated errors at points (n, 3) m."""
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


def equilibrium_answer(equilibrium: Equilibrium) -> dict[str, Any]:
    """One synchronous equilibrium."""
    return {
        **{field.key: field.shown(equilibrium) for field in EQUILIBRIUM_FIELDS if field.key},
        "frequencies_hz": equilibrium.frequencies_hz,
        "modes": [vars(mode) for mode in equilibrium.modes],
        "with_plate": equilibrium.currents is not None,
        "without_plate": None if equilibrium.without is None else equilibrium_answer(equilibrium.without),
    }


def equilibria_answer(levitation: Levitation, equilibria: Sequence[Equilibrium] | None = None) -> dict[str, Any]:
    """All equilibria, or those given; the error estimate is the field's largest relative error at any of them."""
    found = levitation.equilibria if equilibria is None else equilibria
    places = np.array([e.position for e in found]).reshape(-1, 3)
    return {
        "model": levitation.table.model,
        "error_estimate": float(levitation.table.relative_error(places)[0].max()) if len(places) else None,
        **effects_answer(levitation, found),
        **plate_answer(levitation.plate),
        "equilibria": [equilibrium_answer(equilibrium) for equilibrium in found],
        "not_modelled": omissions(levitation),
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
        **plate_answer(levitation.plate),
        "beyond_plate_table": flight.beyond_plate_table,
        "levitated_s": flight.levitated_s,
        "ended_by": flight.ended_by,
        "kind": flight_kind(flight),
        "energy_error": flight.energy_error,
        "field_changes": vars(flight.field_changes),
        "realtime_factor": flight.realtime_factor,
    }


def omissions(levitation: Levitation) -> list[str]:
    """What is in the scene but not in the computation."""
    scene = levitation.scene
    left_out = [PLATE_NOT_MODELLED] if scene.plate and levitation.plate is None else []
    permeabilities = [scene.floater.recoil_permeability, *(magnet.recoil_permeability for magnet in scene.rotor)]
    if any(permeability != 1 for permeability in permeabilities) and levitation.interaction_model == "rigid":
        left_out.append(ANSWERS_NOT_MODELLED)
    return left_out


def equilibria_lines(levitation: Levitation, equilibria: Sequence[Equilibrium] | None = None) -> list[str]:
    """The equilibria, all or those given, as a table for a person."""
    scene, memory = levitation.scene, levitation.plate
    equilibria = levitation.equilibria if equilibria is None else equilibria
    head = f"{'x':>9} {'y':>9} {'z (mm)':>9} {'± mm':>9} {'polar °':>8} {'lag °':>8}  stable   growth (1/s)"
    lines = [f"Synchronous equilibria at {scene.frequency:g} Hz (rotor's frame): {len(equilibria)}"]
    lines += [head] if equilibria else []
    for e in equilibria:
        x, y, z = e.position / MILLI
        lines.append(
            f"{x:9.4f} {y:9.4f} {z:9.4f} {e.position_error / MILLI:9.1e} {e.polar_angle_deg:8.3f} {e.lag_deg:8.3f}"
            f"  {'yes' if e.stable else 'no ':6} {e.growth_per_s:12.3e}"
            f"{'  (without the plate)' if memory is not None and e.currents is None else ''}"
        )
    return lines + ([] if memory is None else _plate_lines(equilibria, memory))


def _plate_lines(equilibria: Sequence[Equilibrium], memory: PlateMemory) -> list[str]:
    """What the plate does to the first equilibrium that feels it."""
    first = next((e for e in equilibria if e.without is not None and e.currents is not None), None)
    if first is None or first.without is None:
        return ["The plate undoes the equilibria within its table's range."]
    x, y, z = (first.position - first.without.position) / MILLI
    return [
        f"The plate (error {memory.error:.0e}) moves the first one by ({x:+.4f}, {y:+.4f}, {z:+.4f}) mm and takes its "
        f"growth rate from {first.without.growth_per_s:.3g} to {first.growth_per_s:.3g} /s."
    ]


def flight_lines(flight: Trajectory) -> list[str]:
    """How a flight went, for a person."""
    beyond, changes = flight.beyond_plate_table, flight.field_changes
    told = (
        f"The floater changed {changes.count} times from one ball with an expansion of the field to another "
        f"(error up to {changes.error:.0e}); that changed its energy by {changes.energy:.1e}, beside the ledger."
    )
    return [
        f"Flight of {flight.levitated_s:.4g} s ({flight_kind(flight)}), ended by {flight.ended_by}; violation of the "
        f"energy ledger and of unit length {flight.energy_error:.1e}; {flight.realtime_factor:.3g} times real time.",
        *([f"For {beyond:.1%} of the flight the floater was beyond the range of the plate's table."] if beyond else []),
        *([told] if changes.count else []),
    ]
