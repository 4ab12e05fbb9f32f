"""Whether rotor and floater magnetise each other in a scene's motion."""

from dataclasses import replace

import numpy as np

from ...fem.mutual.making import all_points, without_response
from ...fem.rotor.choice import PERMEABLE
from ...fem.rotor.floater import floater_sources
from ...fem.rotor.table import FieldFormula, FieldTable
from ...fem.rotor_metal import cached_rotor_losses, check_metal, pieces_of
from ...geometry.common import InputError
from ...geometry.scene.contents import Scene
from .body_shape import INDUCED_SHAPE, BodyShape, InducedShape
from .coils import with_coils
from .effect import Interaction
from .floater_effects import FLOATER_CURRENTS, FLOATER_SHAPE, REAL_AIR, FloaterShape, check_floater_metal, scene_effects
from .rotor_effects import MUTUAL, ROTOR_CURRENTS, STEP, Mutual, RotorCurrents, rough_force

NOTHING_PERMEABLE = "neither rotor nor floater is permeable"
LARGEST = 5000  # Points in the magnets with which mutual magnetisation is computed at all: minutes
MOST_POINTS = 1000  # In them, up to which mutual magnetisation is chosen: a floater of 3 mm below a cube of 10 mm
NEAR = 2.0  # Distance from the rotor, in floater radii, at which induced forces are compared with `rtol`


def mutual_choice(scene: Scene, table: FieldTable, requested: str, rtol: float) -> tuple[bool, str]:
    """Whether mutual magnetisation is in the motion of `scene` in the field of `table`, and why.

    `requested` is "rigid", "mutual" or "auto": included where it is worth `rtol`.

    Raises InputError: "mutual" is asked for with a measured map, or with magnets whose response is not known.
    """
    if requested == "rigid":
        return False, "as requested"
    magnets, floater = scene.rotor, scene.floater.ball
    which, why = next(((k, why) for k, m in enumerate(magnets, 1) if (why := without_response(m))), (0, ""))
    if requested == "mutual":
        if table.model == "map":
            raise InputError(
                "Input --interaction must be rigid or auto with a measured map, which does not tell what the "
                "floater induces in the rotor; instead received mutual. Leave the map out (--model fem) to include it."
            )
        if why:
            raise InputError(
                f"Input --interaction must be rigid or auto with such magnets; instead received mutual, and magnet "
                f"{which} is {why}"
            )
    if floater.recoil_permeability == 1 and all(magnet.contrast == 0 for magnet in magnets):
        return False, NOTHING_PERMEABLE
    points = 0 if why else all_points(magnets, floater.radius)
    if requested == "mutual":
        if points > LARGEST:
            raise InputError(
                "Input --interaction must be rigid or auto for a floater so small beside its magnets; instead received "
                f"mutual, for which the magnets would respond at {points} points ({LARGEST} at most)."
            )
        return True, "as requested"
    if table.model not in PERMEABLE:
        return False, f"the field model {table.model} has no permeability"
    if why:
        return False, f"what is induced in magnet {which} is not known: it is {why.split('.')[0]}"
    if points > LARGEST:
        return False, f"so small a floater would need {points} points in the magnets"
    part = rough_part(scene, table)
    if part < rtol:
        return False, f"about {part:.0e} of the force near the rotor, less than --rtol asks for"
    said = f"about {part:.1%} of the force near the rotor"
    if points > MOST_POINTS:
        why = f"so small a floater needs {points} points in the magnets, which takes minutes"
        return False, f"{said}; {why}; --interaction mutual includes it"
    return True, said


def rough_part(scene: Scene, table: FieldTable) -> float:
    """Roughly, what induced magnetisation adds to the force near the rotor, relative to the rigid dipole's."""
    magnets, floater = scene.rotor, scene.floater.ball
    lowest = min((float(corner[2]) for magnet in magnets for corner in magnet.box.corners), default=0.0)
    direction, deep = np.array([0.0, 0.0, 1.0]), lowest - NEAR * floater.radius * 2.0 ** np.arange(10)
    known = table.in_range((deep[:, None] + STEP * floater.radius) * direction)  # not near, of a tiny floater
    place = deep[int(np.argmax(known))] * direction
    force = rough_force(magnets, floater, table, place, direction)
    return float(np.linalg.norm(force) / (floater.moment * np.linalg.norm(table.evaluate(place[None])[1][0])))


def with_effects(scene: Scene, table: FieldFormula) -> Interaction:
    """A table with the field of a scene's coils, and with the effects of its conductivities and air; others stay.

    Those of the rotor's conductivity are from the cache.

    Raises InputError: the rotor turns too fast for its metal or the floater's.
    """
    whole = with_coils(scene, table)
    check_floater_metal(scene)
    effects, known = scene_effects(scene), {effect.name for effect in whole.effects}
    if not scene.floater.is_sphere and FLOATER_SHAPE not in known:
        if scene.floater.round and not scene.floater.mean:
            effects.append(FloaterShape.of(scene.floater, floater_sources(scene.floater), whole.field))
        else:
            effects.append(BodyShape.of(scene.floater, whole.field, [magnet.body for magnet in scene.rotor]))
    if MUTUAL in known and INDUCED_SHAPE not in known and not scene.floater.is_sphere:
        mutual = next((effect for effect in whole.effects if isinstance(effect, Mutual)), None)
        effects.append(InducedShape.of(scene.floater, mutual))
    if pieces := pieces_of(scene.rotor, scene.conductors):
        check_metal(pieces, scene.fastest, scene.floater.radius)
    if pieces and ROTOR_CURRENTS not in known:
        effects.append(RotorCurrents(cached_rotor_losses(scene, lambda _: None)[0]))
    return replace(whole.joined(*effects), turning=not scene.floater.round)


def mean_over_turns(scene: Scene, table: FieldFormula) -> tuple[Scene, Interaction, Interaction]:
    """The scene with the floater's mean over turns about its moment, and the `table` with what acts on that.

    The last is the same with the mean's multipoles about its moment as dipoles up to degree 7, for searches.
    """
    whole, round_scene = with_coils(scene, table), replace(scene, floater=scene.floater.averaged)
    # Beside what its shape decides all effects are those of a round body as well.
    of_shape = FLOATER_SHAPE, INDUCED_SHAPE, FLOATER_CURRENTS, REAL_AIR
    others = replace(whole, turning=False, effects=tuple(e for e in whole.effects if e.name not in of_shape))
    rough = FloaterShape.of(round_scene.floater, floater_sources(round_scene.floater), whole.field)
    return round_scene, with_effects(round_scene, others), with_effects(round_scene, others.joined(rough))
