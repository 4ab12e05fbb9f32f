"""Bodies of a scene must not overlap: rotor magnets, plate, and the floater where it starts."""

from ..bodies import TOUCHING, deepest_overlap_in_a_turn, overlapping_magnets, sphere_overlap
from .contents import AbsoluteStart, Scene


def overlap_faults(scene: Scene) -> list[str]:
    """Every overlap of the scene's bodies as a message with its depth; empty if there is none.

    The plate is checked against the rotor over a whole turn; touching is allowed.
    """
    faults = [
        f"Input rotor must have magnets that do not overlap; instead magnets {i + 1} and {j + 1} overlap by "
        f"{depth * 1e3:.4g} mm; move them apart by as much."
        for i, j, depth in overlapping_magnets(scene.rotor)
    ]
    if scene.plate:
        for i, magnet in enumerate(scene.rotor):
            depth = deepest_overlap_in_a_turn(magnet.box, scene.plate.box)
            if depth > TOUCHING:
                faults.append(
                    f"Input plate must stay clear of the turning rotor; instead it overlaps magnet {i + 1} by "
                    f"{depth * 1e3:.4g} mm; move the plate away or make it thinner."
                )
    if isinstance(scene.start, AbsoluteStart):
        faults += _start_overlaps(scene, scene.start)
    return faults


def _start_overlaps(scene: Scene, start: AbsoluteStart) -> list[str]:
    bodies = [(f"rotor magnet {i + 1}", magnet.box) for i, magnet in enumerate(scene.rotor)]
    if scene.plate:
        bodies.append(("the plate", scene.plate.box))
    place = ", ".join(f"{c * 1e3:g}" for c in start.position)
    depths = [(name, sphere_overlap(start.position, scene.floater.radius, box)) for name, box in bodies]
    return [
        f"Input start.position_mm must leave the floater clear of all bodies; instead received [{place}], where it "
        f"overlaps {name} by {depth * 1e3:.4g} mm."
        for name, depth in depths
        if depth > TOUCHING
    ]
