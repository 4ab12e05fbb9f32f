"""Where currents are too weak to act back on the field that drives them: the range of the table.

The losses of a ball are by (ω μ0 σ R²)²/105 less than without that reaction (`closed_forms.sphere_eddy`), and a piece
of metal is taken as the ball of its volume.  The fastest change that the rotor sees of a floater in step with it is at
twice its own frequency, that of nutation.
"""

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import MU_0, InputError, Solid
from ...geometry.meshes import skin_depth
from .tabulate import Pieces

ALLOWED = 0.02
"""Relative error of the losses."""
ROUNDED = 0.995
"""What is named as the most that would do is less by so much, so that its three digits will do."""


def check_slow_enough(pieces: Pieces, frequency: float) -> None:
    """Refuse pieces of metal in which a rotor's frequency (Hz) is too high for losses without memory.

    Raises
    ------
    InputError : with the skin depth, and the conductivity or frequency up to which it would do
    """
    for bodies, conductivity in pieces:
        radius = _radius(bodies)
        if (error := slow_error([(bodies, conductivity)], frequency)) > ALLOWED:
            most = ROUNDED * np.sqrt(ALLOWED / error)
            place = ", ".join(f"{c * 1e3:.4g}" for c in np.mean([body.center for body in bodies], axis=0))
            depth, thickness = skin_depth(conductivity, 2 * frequency), 2 * radius
            raise InputError(
                f"Input conductivity_S_m of the rotor's metal at ({place}) mm must leave its skin depth large against "
                f"it; instead received {conductivity:.3g} S/m: {depth * 1e3:.3g} mm at {2 * frequency:.4g} Hz, twice "
                f"the rotor's frequency, in {thickness * 1e3:.3g} mm of metal. Take at most "
                f"{most * conductivity:.3g} S/m or {most * frequency:.3g} Hz, or leave this piece out."
            )


def slow_error(pieces: Pieces, frequency: float) -> float:
    """Largest relative error of the losses of pieces of metal without memory at a rotor's frequency, Hz."""
    reactions = [4 * np.pi * frequency * MU_0 * sigma * _radius(bodies) ** 2 for bodies, sigma in pieces]
    return float(max(reactions, default=0.0) ** 2 / 105)


def _radius(bodies: Sequence[Solid]) -> float:
    return float((3 * sum(body.volume for body in bodies) / (4 * np.pi)) ** (1 / 3))
