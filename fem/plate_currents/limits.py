"""How large a plate's finite-element problem may be, and what is said of one that is larger."""

from ...geometry.meshes import skin_depth
from ...geometry.scenes import Plate
from ..rotor_tables import AccuracyError

OPTION = "--plate-rtol (plate_rtol in Python, --rtol of the command plate)"
"""What messages call the tolerance of a plate."""
HIGHEST_ORDER = 5
MOST_UNKNOWNS = 80_000
"""Coupling unknowns that are solved at most: beyond, one frequency takes many minutes and several GB."""


class MeshTooLargeError(AccuracyError):
    """A mesh has more unknowns than are solved."""


def highest_order(cells: int) -> int:
    """The highest order, at most `HIGHEST_ORDER`, within `MOST_UNKNOWNS` on a mesh of so many hexahedra.

    Raises
    ------
    MeshTooLargeError : it is below 3
    """
    found = [p for p in range(3, HIGHEST_ORDER + 1) if cells * (3 * p * (p + 2) + 2 * p + 1) <= MOST_UNKNOWNS]
    if not found:
        raise MeshTooLargeError(
            f"Input mesh must have at most {MOST_UNKNOWNS} unknowns; instead one of {cells} cells has more. Lower the "
            "frequency, allow a larger error, or take the infinite slab (model slab), which has no such limit."
        )
    return found[-1]


def refusal(plate: Plate, frequency: float, rtol: float, best: float) -> str:
    """What to say where `best` is the smallest relative error reached; infinite if nothing was solved."""
    depth = 1e3 * skin_depth(plate.conductivity, frequency)
    if best < 1:
        return (
            f"Input rtol of the plate must be at least {best:.1e} at {frequency:g} Hz (skin depth {depth:.2g} mm); "
            f"instead received {rtol:.1e}."
        )
    return (
        f"Input frequency_hz must be lower for finite elements with {MOST_UNKNOWNS} unknowns: a skin depth of "
        f"{depth:.2g} mm is too small for this plate; instead received {frequency:g}. The infinite slab (model slab) "
        "has no such limit."
    )
