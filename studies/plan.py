"""Which models a scene's motion is computed by, each with its reason, and the tables that scenes share.

The rotor's field is the cheapest that meets the tolerance (`resolve_model`); rotor and floater magnetise each other
where that matters at this tolerance (`mutual_choice`); the plate is an obstacle, an infinite slab or the network of the
finite elements (`resolve_plate_model`), for the neighbourhood of the place where the floater levitates or, thrown from
far off, for all of its way.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

from ..dynamics.motion.floater_effects import scene_effects
from ..dynamics.motion.plate import PlateMemory
from ..fem.cache import key_of
from ..fem.maps_of_B.table import GriddedTable, map_table
from ..fem.mutual.making import mutual_key
from ..fem.plate.choice import resolve_plate_model
from ..fem.plate.table import Region
from ..fem.rotor.table import ROTOR, RotorTable
from ..fem.rotor_metal import losses_key, pieces_of
from ..geometry.common import Array, Watch
from ..geometry.overlap import TOUCHING, sphere_overlap
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import check_files, load_scene, map_digest
from ..geometry.scene.floater import Floater
from .cli.console import detail, note, stages
from .cli.options import Models, refused, wrong

Made = TypeVar("Made")
SceneLike = Scene | str | Path  # a scene, or the path of its file
RotorField = RotorTable | GriddedTable  # a rotor's table: computed, or from a map
# Radii for which tables are made: that of the article's floater, m, and so many times the one before.
ARTICLE_RADIUS, STEP = 6.35e-3, 2 ** (1 / 8)
LOOSER, ROUGHEST = 4.0, 0.1  # times more error that a plate's table may have for a large region, and the most
PLATE_WORDS = {
    "none": "only an obstacle, without eddy currents",
    "slab": "taken as an infinite slab, {thickness:.4g} mm thick",
    "reduced": "finite, {size}",
}


class SharedTables:
    """Tables and equations for any number of scenes to share; a scene finds those that were made for what it needs."""

    def __init__(self) -> None:
        self.from_cache: list[str] = []  # names of the tables that were found in the user's cache
        self._known: dict[str, Any] = {}

    def once(self, key: str, make: Callable[[], Made]) -> Made:
        """The thing of this key, made now unless it was made for another scene."""
        if key not in self._known:
            self._known[key] = make()
        made: Made = self._known[key]
        return made

    def table(self, key: str, name: str, title: str, make: Callable[[Watch], tuple[Made, bool]]) -> Made:
        """A table under its `key`, reported by `title`; `make` says whether it was cached, as which `name` is noted."""

        def announced() -> Made:
            note(f"{title} ...")
            begun = perf_counter()
            with stages(title) as watch:
                made, found = make(watch)
            note("  from the cache." if found else f"  done in {perf_counter() - begun:.1f} s.")
            if found and name not in self.from_cache:
                self.from_cache.append(name)
            return made

        return self.once(key, announced)


def given_scene(scene: SceneLike) -> Scene:
    """A scene as it is, or from the path of its file. Raises SceneError, and InputError for anything else."""
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, str | Path):
        return load_scene(scene)
    raise refused("scene", "be a Scene or the path of a scene file", scene)


def levitating_scene(scene: SceneLike) -> Scene:
    """A scene of one floater below a rotor, as `given_scene` has it; InputError: coils alone, or several floaters."""
    found = given_scene(scene)
    if found.carried_by_coils:
        alone = "the scene has coils alone, which carry a conductor: spinlev simulate computes its motion"
        raise wrong("rotor", "be given here", f"{alone} and nothing else.")
    if found.companions:
        several = "the scene has several, of which spinlev simulate computes the trajectories and nothing else."
        raise wrong("floater", "be one here", several)
    return found


def sources(table: RotorField) -> RotorTable:
    """The closed forms and expansions that make a table's field."""
    return table.expansions if isinstance(table, GriddedTable) else table


def map_of(scene: Scene) -> GriddedTable:
    """The table of a scene's map of the field. Raises SceneError where it was replaced since the scene was read."""
    note("Rotor's field from its map ...")
    table = map_table(scene.field_map, scene.rotor, scene.map_reading)
    check_files(scene)  # the map may have been replaced since the scene was read
    return table


@dataclass(frozen=True, eq=False)
class PlatePlan:
    """A plate's model in the motion and what is asked of its table."""

    model: str  # "none", "slab" or "reduced"
    edges: float  # relative error by edges that the model leaves out
    rtol: float  # relative accuracy of the table
    # Where the floater may be, in the frame of the plate; None: near the place where it levitates
    region: Region | None = None


def plate_plan(scene: Scene, models: Models, place: Array | None, tables: SharedTables) -> PlatePlan:
    """Model of a `scene`'s plate by `models` for a floater at a `place` (3,) m; said once for all of `tables`."""
    choice = resolve_plate_model(scene, models.plate_model, place, models.plate_rtol, note)
    if scene.plate is not None:
        edges = 1e3 * scene.plate.box.size
        size = f"{' × '.join(f'{edge:.4g}' for edge in edges)} mm"
        text = f"Plate: {PLATE_WORDS[choice.model].format(size=size, thickness=min(edges))}"
        tables.once(text, lambda: note(text))
        detail(f"Plate model: {choice.model} ({choice.reason})")
    return PlatePlan(choice.model, choice.edges, models.plate_rtol)


def far_plan(plan: PlatePlan, models: Models, slab: PlateMemory) -> PlatePlan:
    """The `plan` by `models` for a way foreseen by a `slab`: this, where its edges matter little, as it is fast."""
    region = slab.table.region
    if models.plate_model != "auto":
        return replace(plan, region=region)
    edges = f"edges change an infinite slab's response by {slab.neglected:.2g} of itself at most"
    if slab.neglected <= ROUGHEST:
        note(
            f"The floater goes so far that finite elements take long; {edges}, which is what is computed. "
            "Choose --plate-model fem for the edges."
        )
        return PlatePlan("slab", slab.neglected, models.plate_rtol, region)
    rtol = looser(models.plate_rtol)
    note(f"The floater goes so far that finite elements take long, and {edges}: {rtol:.2g} is asked for.")
    return PlatePlan(plan.model, plan.edges, rtol, region)


def looser(rtol: float) -> float:
    return max(rtol, min(LOOSER * rtol, ROUGHEST))


def nearest_faces(floater: Floater) -> float:
    """Distance from faces from which on tables are accurate, m: a radius in steps, so that floaters share a table."""
    steps = math.floor(math.log(floater.radius / ARTICLE_RADIUS) / math.log(STEP) + 1e-9)
    return ARTICLE_RADIUS * STEP**steps


def field_key(scene: Scene, model: str, rtol: float) -> str:
    """All that decides a `scene`'s rotor field by a `model` to `rtol`: also its map's content, and how it is read."""
    known = ROTOR.key(scene.rotor, model, rtol, nearest_faces(scene.floater))
    return f"{known} {map_digest(scene)} {scene.map_reading}"


def equations_key(scene: Scene, models: Models) -> str:
    """All that decides a scene's tables and equations of motion without plate; what it leaves out are parameters."""
    floater = scene.floater
    parts = [
        field_key(scene, models.model, models.rtol),
        f"{scene_effects(scene)} {models.interaction}",
        "" if models.interaction == "rigid" else mutual_key(scene.rotor, floater.ball),
        losses_key(scene) if pieces_of(scene.rotor, scene.conductors) else "",
        "" if floater.is_sphere else key_of("equilibria", floater.magnets, floater.round, floater.mean),
    ]
    return " ".join([*parts, key_of("equilibria", scene.coils)] if scene.coils else parts)


def check_coils(scene: Scene) -> None:
    """A coil whose field does not stand still in the rotor's frame is a wrong scene for equilibria: InputError."""
    for k, coil in enumerate(scene.coils):
        if not coil.axial:
            where = "its current changes" if not coil.steady else f"it is {1e3 * np.hypot(*coil.center[:2]):.4g} mm off"
            still = "as else its field does not stand still in the rotor's frame"
            rule = f"have a steady current about the rotor's axis for equilibria, {still}"
            raise wrong(f"coils[{k}]", rule, f"{where}. spinlev simulate computes such motions.")


def check_drive(scene: Scene, duration: float) -> None:
    """A drive that is not over after `duration` (s) is a wrong scene: InputError."""
    total = float(scene.knots[0, -1])
    if total > duration * (1 + 1e-9):
        rule = f"end within the {duration:g} s that are simulated"
        raise wrong("drive", rule, f"its steps take {total:g} s. Simulate longer, or shorten them.")


def check_way(scene: Scene, place: Array) -> None:
    """A conductor of the rotor where the floater, at `place` (3,) m, would levitate is a wrong scene: InputError."""
    for k, conductor in enumerate(scene.conductors):
        depth = sphere_overlap(place, scene.floater.radius, conductor.body)
        if depth > TOUCHING:
            there = f"{depth * 1e3:.4g} mm where it levitates, at {np.round(place * 1e3, 3).tolist()} mm"
            instead = f"it overlaps the floater by {there}; make it smaller or move it away."
            raise wrong(f"rotor.conductors[{k}]", "leave the floater's way free", instead)


def check_room(scene: Scene, place: Array, when: str = "") -> None:
    """A plate that leaves a floater at `place` (3,) m no room is a wrong scene: InputError, which says `when`."""
    depth = sphere_overlap(place, scene.floater.inner_radius, scene.plate.body) if scene.plate else 0.0
    if scene.plate and depth > TOUCHING:
        center, levitates = (np.round(c * 1e3, 3).tolist() for c in (scene.plate.box.center, place))
        by = f"{depth * 1e3:.4g} mm where it levitates{when}, at {levitates} mm"
        instead = f"received {center}: the plate overlaps it by {by}; move the plate away."
        raise wrong("plate.center_mm", "leave room for the floater", instead)
