"""Tables in a few lines, as a notebook shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..geometry.scene_text import millimetres

if TYPE_CHECKING:
    from .gridded import GriddedTable
    from .plate_table import PlateTable
    from .table import RotorTable

FARTHER = 20e-3
"""Distance from the rotor's origin, down its axis, at which a table's error is told, m."""


def rotor_table_text(table: RotorTable) -> str:
    """Model, parts, error below the rotor and how the table was made."""
    kept = sum(int(np.count_nonzero(part.coefficients)) for part in table.expansions)
    degrees = max((part.degree for part in table.expansions), default=0)
    parts = [_counted(len(table.uniform), "closed form")] if table.uniform else []
    parts += [f"{_counted(kept, 'moment')} up to degree {degrees}"] if kept else []
    lines = [f"RotorTable {table.model!r}: {' and '.join(parts) or 'no field'}", *_error(table)]
    made = table.provenance
    if "elements" in made:
        elements = f"{made['elements']} elements of order {made['order']}, {made['unknowns']} unknowns"
        lines.append(f"  {elements}, made in {float(made['seconds']):.2g} s")
    return "\n".join(lines)


def gridded_table_text(table: GriddedTable) -> str:
    """Parts and error of a table that stands for a map."""
    parts = [f"degree {part.degree} about {millimetres(part.center)}" for part in table.expansions.expansions]
    return "\n".join([f"GriddedTable {table.model!r}: {', '.join(parts)}", *_error(table)])


def plate_table_text(table: PlateTable) -> str:
    """States, error and range of a plate's table."""
    lower, upper = millimetres(table.region.lower), millimetres(table.region.upper)
    slowest, fastest = 1e3 / table.rates.min(), 1e3 / table.rates.max()
    return "\n".join([
        f"PlateTable of {millimetres(table.size)}, {table.conductivity:.3g} S/m: {len(table.rates)} currents",
        f"  memory from {fastest:.2g} to {slowest:.3g} ms; {len(table.multipoles.kinds)} multipoles",
        f"  relative error {table.errors.total:.1e} up to {table.frequencies[1]:g} Hz",
        f"  from {lower} to {upper} from the plate's centre",
    ])  # fmt: skip


def _error(table: RotorTable | GriddedTable) -> list[str]:
    place = np.array([[0.0, 0.0, -FARTHER]])
    if not table.in_range(place)[0]:
        return []
    b, gradient = (float(error[0]) for error in table.relative_error(place))
    return [f"  relative error {b:.1e} of B and {gradient:.1e} of its gradient {FARTHER * 1e3:g} mm below the rotor"]


def _counted(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"
