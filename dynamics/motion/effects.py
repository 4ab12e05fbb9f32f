"""Whether rotor and floater magnetise each other in a scene's motion."""

import numpy as np

from ...fem.mutual import unanswered
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import InputError
from ...geometry.scenes import Scene
from .rough_answer import rough_force

NOTHING_ANSWERS = "neither rotor nor floater is permeable"
NEAR = 2.0
"""Distance from the rotor, in floater radii, at which the answers are compared with the accuracy asked for."""


def mutual_choice(scene: Scene, table: FieldTable, asked: str, rtol: float) -> tuple[bool, str]:
    """Whether it is in the motion, for "rigid", "mutual" or "auto"; and why.

    Raises
    ------
    InputError : "mutual" is asked for with a measured map, or with magnets whose answer is not known
    """
    if asked == "rigid":
        return False, "as asked"
    magnets, floater = scene.rotor, scene.floater
    if floater.body is not None:
        if asked == "mutual":
            floater.must_be("sphere", where="for --interaction mutual", instead="Choose --interaction rigid.")
        return False, "the answer of a floater that is no sphere is not known"
    reasons = {k: why for k, magnet in enumerate(magnets, 1) if (why := unanswered(magnet))}
    if asked == "mutual":
        if table.model == "map":
            raise InputError(
                "Input --interaction must be rigid or auto with a measured map, which does not tell how the rotor "
                "answers; instead received mutual. Leave the map out (--model fem) to have the rotor's magnets answer."
            )
        if reasons:
            raise InputError(
                f"Input --interaction must be rigid or auto with such magnets; instead received mutual, and magnet "
                f"{min(reasons)} is {reasons[min(reasons)]}"
            )
    if floater.recoil_permeability == 1 and all(magnet.contrast == 0 for magnet in magnets):
        return False, NOTHING_ANSWERS
    if asked == "mutual":
        return True, "as asked"
    if table.model != "fem":
        return False, f"the field model {table.model} has no permeability"
    if reasons:
        return False, f"the answer of magnet {min(reasons)} is not known: it is {reasons[min(reasons)].split('.')[0]}"
    part = rough_part(scene, table)
    if part < rtol:
        return False, f"about {part:.0e} of the force near the rotor, less than --rtol asks for"
    return True, f"about {part:.1%} of the force near the rotor"


def rough_part(scene: Scene, table: FieldTable) -> float:
    """Roughly, what the answers add to the force near the rotor, relative to the rigid dipole's."""
    magnets, floater = scene.rotor, scene.floater
    lowest = min((float(corner[2]) for magnet in magnets for corner in magnet.box.corners), default=0.0)
    place, direction = np.array([0.0, 0.0, lowest - NEAR * floater.radius]), np.array([0.0, 0.0, 1.0])
    force = rough_force(magnets, floater, table, place, direction)
    return float(np.linalg.norm(force) / (floater.moment * np.linalg.norm(table.evaluate(place[None])[1][0])))
