"""Tables that scenes share, and equations and equilibria of one scene without its plate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar, cast

from ..dynamics.equilibria.equilibrium import Survey
from ..dynamics.equilibria.search import FixedPoints, cached_points, survey
from ..dynamics.flights.flight import most_like_levitation
from ..dynamics.motion.effect import Interaction, interaction_of
from ..dynamics.motion.effects import BESIDE_METAL, WITHOUT_METAL, mutual_choice, with_effects
from ..dynamics.motion.equations import FORCE_ALONE
from ..dynamics.motion.rates import Rates
from ..dynamics.motion.rotor_effects import Mutual, RotorCurrents
from ..fem.maps_of_B.table import GriddedTable, map_table
from ..fem.mutual.making import cached_mutual_table, mutual_key
from ..fem.mutual.table import MutualTable
from ..fem.rotor.choice import cached_rotor_table, resolve_model, rotor_table
from ..fem.rotor.table import FieldTable, RotorTable
from ..fem.rotor_metal import Pieces, RotorLosses, cached_rotor_losses, check_metal, losses_key, pieces_of
from ..geometry.common import InputError, Watch, shown, unwatched
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import check_files, load_scene
from .cli.console import detail, note, stages
from .cli.options import FieldModel, Models, finite
from .plan import (
    RotorField,
    check_way,
    equations_key,
    field_key,
    nearest_faces,
)

Made = TypeVar("Made")
SceneLike = Scene | str | Path  # a scene, or the path of its file


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

        def told() -> Made:
            note(f"{title} ...")
            begun = perf_counter()
            with stages(title) as watch:
                made, found = make(watch)
            note("  from the cache." if found else f"  done in {perf_counter() - begun:.1f} s.")
            if found and name not in self.from_cache:
                self.from_cache.append(name)
            return made

        return self.once(key, told)


def given_scene(scene: SceneLike) -> Scene:
    """A scene as it is, or from the path of its file. Raises SceneError, and InputError for anything else."""
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, str | Path):
        return load_scene(scene)
    raise InputError(f"Input scene must be a Scene or the path of a scene file; instead received {shown(scene)}.")


def sources(table: RotorField) -> RotorTable:
    """The closed forms and expansions that make a table's field."""
    return table.expansions if isinstance(table, GriddedTable) else table


def _map(scene: Scene) -> GriddedTable:
    note("Rotor's field from its map ...")
    table = map_table(scene.field_map, scene.rotor, scene.map_reading)
    check_files(scene)  # the map may have been replaced since the scene was read
    return table


class SceneTables:
    """Field, effects and equilibria of one scene by the models that are asked for, all but its plate's currents.

    Every member is computed when it is first used and then kept.

    Parameters
    ----------
    scene, models, spin : as of `Levitation`
    """

    def __init__(self, scene: SceneLike, models: Models = Models(), spin: float = 0.0) -> None:
        self.scene = given_scene(scene)
        self.models = models.checked()
        self.spin = finite("spin", spin)
        self.searched = True  # whether the equilibria were searched for; else they were carried here from scenes nearby
        self._tables = SharedTables()

    # The rotor's field and what else acts

    @cached_property
    def table(self) -> RotorField:
        """The rotor's field by the model that was asked for; `auto` chooses and says why."""
        return self.field(self.models.model)

    def field(self, model: str) -> RotorField:
        """The rotor's field by any model, accurate wherever the floater can be: from its radius off the magnets on.

        Raises
        ------
        InputError : the map cannot be used
        """
        scene, rtol, nearest = self.scene, self.models.rtol, nearest_faces(self.scene.floater)
        key = partial(field_key, scene, rtol=rtol)
        name = model
        if model != "map":
            chosen = partial(resolve_model, scene.rotor, model, rtol, nearest)
            name, reason = self._tables.once(f"model {key(model)}", chosen)
            if model == "auto":
                detail(f"Field model: {name} ({reason})")
        if name == "fem":
            make = partial(cached_rotor_table, scene.rotor, name, rtol, note, nearest)
            return self._tables.table(key(name), name, "Rotor's field by finite elements", make)
        if name == "map":
            return self._tables.once(key(name), lambda: _map(scene))
        return self._tables.once(key(name), lambda: rotor_table(scene.rotor, name, rtol, nearest))

    @cached_property
    def answers(self) -> tuple[MutualTable | None, str]:
        """Mutual magnetisation of rotor and floater, or None; and why."""
        scene = self.scene
        known, why = mutual_choice(scene, self.table, self.models.interaction, self.models.rtol)
        if not known:
            return None, why
        title, make = (
            "Mutual magnetisation of rotor and floater",
            partial(cached_mutual_table, scene.rotor, scene.floater),
        )
        return self._tables.table(mutual_key(scene.rotor, scene.floater), "mutual", title, partial(make, note)), why

    def _metal(self) -> Pieces:
        """The rotor's pieces of metal, once they and the floater are found fit for a table of losses."""
        scene, pieces = self.scene, pieces_of(self.scene.rotor, self.scene.conductors)
        if pieces:
            scene.floater.must_be("sphere", where=BESIDE_METAL, instead=WITHOUT_METAL)
            check_metal(pieces, scene.frequency, scene.floater.radius)
        return pieces

    @cached_property
    def losses(self) -> RotorLosses | None:
        """The losses in the rotor's metal, or None where none has a conductivity.

        Raises
        ------
        InputError : the rotor turns too fast for its metal, or the floater is no sphere
        """
        scene = self.scene
        if not self._metal():
            return None
        make = partial(cached_rotor_losses, scene, note)
        return self._tables.table(losses_key(scene), "rotor losses", "Eddy currents in the rotor", make)

    @cached_property
    def interaction(self) -> Interaction:
        """The rotor's field with what else acts on the floater.

        Raises
        ------
        InputError : mutual magnetisation is asked for where it cannot be known, or the floater is a cuboid
        """
        self.scene.floater.must_be("sphere", "cylinder", where="where it moves", instead=FORCE_ALONE)
        self._metal()  # refused before the field's table is made, which takes minutes
        return self._with_effects(self.table)

    def _with_effects(self, table: RotorField) -> Interaction:
        answers, effects = self.answers[0], interaction_of(table)
        if answers is not None:
            effects = effects.joined(Mutual(answers, self.scene.floater.moment))
        if self.losses is not None:
            effects = effects.joined(RotorCurrents(self.losses))
        return with_effects(self.scene, effects)

    @cached_property
    def equations_key(self) -> str:
        """All that decides tables and equations; scenes where it is the same differ in parameters of the motion."""
        return equations_key(self.scene, self.models)

    @property
    def rates(self) -> Rates:
        """The equations of motion in the rotor's field, compiled."""
        return self._tables.once(f"rates {self.equations_key}", lambda: Rates(self.interaction))

    # Equilibria

    @cached_property
    def without_plate(self) -> Survey:
        """All equilibria as if there were no plate.

        Raises
        ------
        EquilibriumError : the rotor is at rest
        InputError : a conductor is in the floater's way, or the rotor turns too fast for its metal
        """
        interaction = self.interaction
        note("Equilibria ...")
        with stages("Equilibria") as watch:
            watch("compiling the equations of motion", 0.0)
            found = self._searched(interaction, self.equations_key, watch, self.rates)
        place = most_like_levitation(found.equilibria)
        if place is not None:
            check_way(self.scene, place.position)
        return found

    def survey_in(self, model: str) -> Survey:
        """All equilibria in the rotor's field alone by a model: without plate and without all that it brings about."""
        models = replace(self.models, model=cast(FieldModel, model), interaction="rigid")
        key = equations_key(self.scene, models)
        return self._searched(self.field(model), f"alone {key}", unwatched)

    def _searched(self, table: FieldTable, equations: str, watch: Watch, rates: Rates | None = None) -> Survey:
        """All equilibria in a table, from the cache if they were searched for before."""

        def remembered(search: Callable[[], FixedPoints]) -> FixedPoints:
            if self.scene.field_map:  # no number in a key stands for how a map is fitted
                return search()
            found, known = cached_points(self.scene, equations, self.spin, search, note)
            if known:
                detail("  from the cache.")
            return found

        return survey(self.scene, table, self.spin, rates=rates, remembered=remembered, watch=watch)
