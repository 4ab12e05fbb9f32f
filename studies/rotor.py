"""Tables of what a scene's rotor does to the floater, and the compiled equations in them: each is made once."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

from ..dynamics.motion.effect import Interaction
from ..dynamics.motion.rates import Rates
from ..fem.maps_of_B.table import GriddedTable, map_table
from ..fem.mutual.making import cached_mutual_table, mutual_key
from ..fem.mutual.table import MutualTable
from ..fem.rotor.choice import cached_rotor_table, resolve_model, rotor_key, rotor_table
from ..fem.rotor.table import RotorTable
from ..fem.rotor_metal import RotorLosses, cached_rotor_losses, losses_key, pieces_of
from ..geometry.common import Watch
from ..geometry.scene.contents import Floater, Scene
from ..geometry.scene.files import check_files, map_digest
from .cli.console import note, stages
from .cli.options import Models

RotorField = RotorTable | GriddedTable
"""A rotor's table: computed, or from a map."""
Cached = TypeVar("Cached", RotorTable, MutualTable, RotorLosses)
Made = TypeVar("Made")


class RotorTables:
    """Tables and equations for any number of scenes to share; a scene finds those that were made for what it needs."""

    def __init__(self) -> None:
        self.from_cache: list[str] = []
        """Names of the tables that were found in the user's cache."""
        self._known: dict[str, Any] = {}

    def model(self, scene: Scene, name: str, rtol: float) -> tuple[str, str]:
        """Name of the field model that is taken for `name`, and the reason in words."""
        nearest = nearest_faces(scene.floater)
        key = f"model {rotor_key(scene.rotor, name, rtol, nearest)}"
        return self.once(key, lambda: resolve_model(scene.rotor, name, rtol, nearest))

    def field(self, scene: Scene, name: str, rtol: float) -> RotorField:
        """The rotor's field by a model or from its map, accurate wherever the floater can be.

        Raises
        ------
        InputError : the map cannot be used
        """
        key = f"{rotor_key(scene.rotor, name, rtol, nearest_faces(scene.floater))} {_map_key(scene)}"
        return self.once(key, lambda: self._field(scene, name, rtol))

    def answers(self, scene: Scene) -> MutualTable:
        """What rotor and floater do to each other's magnetisation."""
        title, make = "Mutual magnetisation of rotor and floater", partial(cached_mutual_table, scene.rotor)
        key = mutual_key(scene.rotor, scene.floater)
        return self.once(key, lambda: self._in_stages("mutual", title, partial(make, scene.floater, note)))

    def losses(self, scene: Scene) -> RotorLosses:
        """The losses in the rotor's metal; some of it must conduct."""
        title, make = "Currents in the rotor's metal", partial(cached_rotor_losses, scene, note)
        return self.once(losses_key(scene), lambda: self._in_stages("rotor losses", title, make))

    def rates(self, key: str, interaction: Interaction) -> Rates:
        """The equations of motion, compiled; `key` is the scene's `equations_key`."""
        return self.once(f"rates {key}", lambda: Rates(interaction))

    def _field(self, scene: Scene, name: str, rtol: float) -> RotorField:
        if name == "map":
            note("Rotor's field from its map ...")
            table = map_table(scene.field_map, scene.rotor, scene.map_reading)
            check_files(scene)  # the map may have been replaced since the scene was read
            return table
        if name != "fem":  # closed forms are quicker to make than to read
            return rotor_table(scene.rotor, name, rtol, nearest_faces(scene.floater))
        make = partial(cached_rotor_table, scene.rotor, name, rtol, note, nearest_faces(scene.floater))
        return self._in_stages(name, "Rotor's field by finite elements", make)

    def _in_stages(self, name: str, title: str, make: Callable[[Watch], tuple[Cached, bool]]) -> Cached:
        def watched() -> tuple[Cached, bool]:
            with stages(title) as watch:
                return make(watch)

        return self._cached(name, title, watched)

    def _cached(self, name: str, title: str, make: Callable[[], tuple[Cached, bool]]) -> Cached:
        note(f"{title} ...")
        table, found = make()
        if found:
            self.from_cache.append(name)
        note("  from the cache." if found else f"  done in {table.provenance['seconds']:.1f} s.")
        return table

    def once(self, key: str, make: Callable[[], Made]) -> Made:
        """What was made under this key for any of the scenes, or else made now."""
        if key not in self._known:
            self._known[key] = make()
        made: Made = self._known[key]
        return made


ARTICLE_RADIUS, STEP = 6.35e-3, 2 ** (1 / 8)
"""Radii for which tables are made: that of the article's floater, m, and so many times the one before."""


def nearest_faces(floater: Floater) -> float:
    """Distance from the magnets' faces from which on a table is to be accurate, m.

    The floater's radius or up to a twelfth less, so that floaters between the same two steps share the rotor's table.
    """
    steps = math.floor(math.log(floater.radius / ARTICLE_RADIUS) / math.log(STEP) + 1e-9)
    return ARTICLE_RADIUS * STEP**steps


def equations_key(scene: Scene, models: Models) -> str:
    """All that decides a scene's tables and equations of motion without plate; what it leaves out are parameters."""
    return " ".join(
        (
            rotor_key(scene.rotor, models.model, models.rtol, nearest_faces(scene.floater)),
            _map_key(scene),
            f"{bool(scene.floater.conductivity)} {scene.drag.air} {models.interaction}",
            "" if models.interaction == "rigid" else mutual_key(scene.rotor, scene.floater),
            losses_key(scene) if pieces_of(scene.rotor, scene.conductors) else "",
            _shape_key(scene.floater),
        )
    )


def _map_key(scene: Scene) -> str:
    """What the map of a scene's field says: its content, and how it is read."""
    return f"{map_digest(scene)} {scene.map_reading}"


def _shape_key(floater: Floater) -> str:
    """What of a floater's shape is compiled into the equations; nothing of a sphere's."""
    if floater.body is None:
        return ""
    return f"{floater.shape} {floater.body.shape_numbers.tolist()} {floater.recoil_permeability!r}"
