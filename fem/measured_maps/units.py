"""Units of the columns of a map."""

from .field_map import FieldMapError

AXES = ("x", "y", "z")
METERS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
TESLAS = {"T": 1.0, "mT": 1e-3, "uT": 1e-6, "µT": 1e-6, "G": 1e-4}
UNITS = {**METERS, **TESLAS}


def unit_scale(name: str, unit: object) -> float:
    """SI value of the unit of a column: of length for x, y, z and `length_unit`, of B for all others."""
    allowed = METERS if name in (*AXES, "length_unit") else TESLAS
    if unit not in allowed:
        raise FieldMapError(f"Input unit of {name} must be one of {', '.join(allowed)}; instead received {unit!r}.")
    return UNITS[str(unit)]
