"""How large mutual magnetisation about is, without its table: the magnets as spheres of their volume."""

from collections.abc import Sequence

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import MU_0, Array
from ...geometry.bodies import Magnet, polarizability
from ...geometry.scenes import Floater

STEP = 0.02
"""Of the differences, in floater radii."""


def rough_force(
    magnets: Sequence[Magnet], floater: Floater, table: FieldTable, place: Array, direction: Array
) -> Array:
    """Force (3,) N that the answers add at a place (3,) m for a direction of the moment; good to a factor of two."""
    step = STEP * floater.radius
    places = place + step * np.concatenate([np.eye(3), -np.eye(3)])
    field = table.evaluate(places)[0]
    energy = -floater.polarizability / 2 * np.sum(field**2, axis=1)
    for magnet in magnets:
        offset = places - magnet.box.center
        distance = np.linalg.norm(offset, axis=1)
        along = offset @ direction / distance
        square = (MU_0 / (4 * np.pi) * floater.moment / distance**3) ** 2 * (1 + 3 * along**2)
        energy -= polarizability(magnet.body.volume, 1 + magnet.contrast) / 2 * square
    return np.asarray((energy[3:] - energy[:3]) / (2 * step))
