"""The plate of a scene for its motion, as the console tells it, and whether it leaves the floater room."""

from time import perf_counter

import numpy as np

from ...dynamics.motion import PlateMemory
from ...fem.plate_currents import Region
from ...fem.plate_tables import PlateTable, RotorShare
from ...fem.rotor_tables import RotorTable
from ...fem.slab import PlateAround, plate_around
from ...geometry.basics import Array, InputError
from ...geometry.bodies import TOUCHING, sphere_overlap
from ...geometry.scenes import Plate, Scene
from ..terminal import detail, note, stages
from .rotor_of_scene import RotorTables


def plate_memory(
    scene: Scene,
    plate: Plate,
    model: str,
    table: RotorTable,
    place: Array,
    rtol: float,
    edges: float = 0.0,
    tables: RotorTables | None = None,
    region: Region | None = None,
) -> tuple[PlateMemory, bool]:
    """The plate's currents for a floater about `place` (3,) m that turns with the rotor; whether they were cached.

    `edges`: relative error by edges that the model leaves out. `tables` are shared with other scenes. `region`: where
    the floater may be, if not near the place, in the frame of the plate. Errors are those of `plate_around` and of its
    model.
    """
    asked = plate_around(plate, model, table, place, scene.floater.radius, scene.frequency, rtol, region)
    made, share, found = (tables or RotorTables()).once(asked.key, lambda: _told(asked))
    return PlateMemory(asked.plate, made, share, model, edges), found


def _told(asked: PlateAround) -> tuple[PlateTable, RotorShare, bool]:
    note("Plate's currents ...")
    begun = perf_counter()
    with stages("Plate's currents") as watch:
        made, share, found = asked.made(note, watch)
    note("  from the cache." if found else f"  done in {perf_counter() - begun:.1f} s.")
    detail(f"  {len(made.rates)} states, estimated relative error {made.errors.total:.1e}.")
    return made, share, found


def check_way(scene: Scene, place: Array) -> None:
    """A conductor of the rotor where the floater, at `place` (3,) m, would levitate is a wrong scene.

    Raises
    ------
    InputError : it overlaps the floater
    """
    for k, conductor in enumerate(scene.conductors):
        depth = sphere_overlap(place, scene.floater.radius, conductor.body)
        if depth > TOUCHING:
            raise InputError(
                f"Input rotor.conductors[{k}] must leave the floater's way free; instead it overlaps the floater by "
                f"{depth * 1e3:.4g} mm where it levitates, at {np.round(place * 1e3, 3).tolist()} mm; make it smaller "
                "or move it away."
            )


def check_room(scene: Scene, place: Array) -> None:
    """A plate that leaves a floater at `place` (3,) m no room is a wrong scene.

    Raises
    ------
    InputError : it overlaps the floater
    """
    depth = sphere_overlap(place, scene.floater.inner_radius, scene.plate.box) if scene.plate else 0.0
    if scene.plate and depth > TOUCHING:
        center, levitates = (np.round(c * 1e3, 3).tolist() for c in (scene.plate.box.center, place))
        raise InputError(
            f"Input plate.center_mm must leave room for the floater; instead received {center}: the plate overlaps it "
            f"by {depth * 1e3:.4g} mm where it levitates, at {levitates} mm; move the plate away."
        )
