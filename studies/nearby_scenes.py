"""The equations of scenes that differ from one in a number, in tables of one mesh, so that differences are smooth.

The rotor's field and the effects at a few values of a number: a lone magnet's table is moved, turned and magnified;
others, which no such law gives, are made anew beside it, with as many points.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from ..dynamics.equilibria.derivatives import Nearby, Setting
from ..dynamics.motion.effect import Interaction, interaction_of
from ..dynamics.motion.effects import mean_over_turns, with_effects
from ..dynamics.motion.equations import parameters
from ..dynamics.motion.floater_effects import FloaterShape
from ..dynamics.motion.plate import PlateForce, PlateMemory
from ..dynamics.motion.rotor_effects import Mutual, RotorCurrents
from ..dynamics.motion.state import Scales
from ..fem.mutual.making import moved_mutual, mutual_table_beside
from ..fem.mutual.table import MutualTable, StrongerMutual
from ..fem.rotor.choice import changed_table, magnified
from ..fem.rotor.floater import floater_sources
from ..fem.rotor.table import FieldTable, RotorTable
from ..fem.rotor_metal import MovedLosses, RotorLosses, cached_rotor_losses
from ..geometry.common import Array, InputError
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import changed, scene_numbers
from ..geometry.scene.messages import SceneError
from .cli.console import note
from .levitation import Levitation

# Step of differences by a number, by its size or by one that such a number usually has, by the end of its key
STEP, USUAL = 2e-3, {"mm": 10.0, "deg": 20.0, "T": 1.0, "m_s2": 9.81}
# The same where a table is made anew, and of which order the difference is. Of mutual magnetisation the fit leaves 4e-6
# of a derivative at a tenth of this step, and the fourth order 1e-7 at it; of losses what its points leave is smooth
WIDE = {"mutual": (0.01, 4), "losses": (0.02, 2)}
# Steps, weights of fourth order, and of second order
CENTRAL = ((1, 2 / 3, 1 / 2), (-1, -2 / 3, -1 / 2), (2, -1 / 12, 0.0), (-2, 1 / 12, 0.0))
# Where a number has an end
FORWARD = ((0, -25 / 12, -3 / 2), (1, 4.0, 2.0), (2, -3.0, -1 / 2), (3, 4 / 3, 0.0), (4, -1 / 4, 0.0))


def unknown_over_plate(key: str) -> str:
    """Why derivatives by a key are not known where a plate's currents act; empty where they are."""
    if key.startswith("plate.") and not key.startswith(("plate.center_mm", "plate.rotation_deg", "plate.conductivity")):
        return "derivatives by sizes of a plate whose currents act are not known"
    return ""


def unknown_of_locked(key: str) -> str:
    """Why derivatives of a frequency-locked equilibrium by a key are not known; empty where they are."""
    # so little resists a turn about its moment that what charges or elements leave in its tensors would decide
    if key.startswith("floater.") and key.rstrip(".0123456789").endswith(("_mm", "permeability")):
        return "derivatives of frequency-locked equilibria by the floater's sizes and permeability are not known"
    return ""


def _moves_rotor(key: str) -> bool:
    """Whether a number changes the rotor's field in the plate in more than its strength."""
    still = ("rotor.remanence_T", "rotor.conductivity_S_m")
    return key.startswith(("rotor.", "plate.center_mm", "plate.rotation_deg")) and not key.startswith(still)


def shape_beside(near: Scene, scene: Scene, field: FieldTable) -> FloaterShape | None:
    """What the shape of the floater of a `scene` adds in a `field`, by elements of one `near`; None of a sphere."""
    floater = scene.floater
    if floater.is_sphere or floater.mean or not floater.round:
        return None
    return FloaterShape.of(floater, floater_sources(floater, near=near.floater), interaction_of(field).field)


@dataclass(frozen=True, eq=False)
class NearbyScenes:
    """A scene's equations, and those of scenes that differ from it in one number."""

    levitation: Levitation
    scene: Scene
    averaged: bool  # the motion of the floater's mean over turns about its moment
    with_plate: bool
    _shares: dict[str, Array] = field(default_factory=dict, init=False)
    _beside: dict[tuple[str, str], list[tuple[float, Any]]] = field(default_factory=dict, init=False)

    @cached_property
    def numbers(self) -> dict[str, float]:
        return scene_numbers(self.scene)[1]

    def around(self, key: str) -> list[Nearby]:
        return [
            Nearby(offset, weight, lower, self.at(scene, {key: offset}))
            for offset, weight, lower, scene in self._scenes(key)
        ]

    def _scenes(self, key: str, times: float = 1.0) -> list[tuple[float, float, float, Scene]]:
        """Offsets of a number, weights of their differences of fourth and of second order, and the scenes."""
        value = self.numbers[key]
        usual = next((size for end, size in USUAL.items() if key.rstrip(".0123456789").endswith(f"_{end}")), 0.0)
        step = times * STEP * (max(abs(value), usual) or 1.0)
        for steps, sign in ((CENTRAL, step), (FORWARD, step), (FORWARD, -step)):
            with suppress(SceneError):
                return [
                    (k * sign, weight / sign, lower / sign, changed(self.scene, {key: value + k * sign}))
                    for k, weight, lower in steps
                ]
        raise InputError(f"Input {key} must have room to change for a derivative; instead it has none.")

    def of_scenes(self, key: str, quantity: Callable[[Scene], Any]) -> Any:
        """Derivative by a number of a quantity that the scene decides alone."""
        return sum(weight * quantity(scene) for _, weight, _, scene in self._scenes(key))

    @cached_property
    def setting(self) -> Setting:
        plate = self.levitation.plate if self.with_plate else None
        return self._setting(self.scene, self.levitation.interaction, plate)

    def _setting(self, scene: Scene, interaction: Interaction, plate: PlateMemory | None) -> Setting:
        if self.averaged:
            scene, interaction, _ = mean_over_turns(scene, interaction)
        scales = Scales.of(scene)
        values = parameters(scene, scales, frozen_spin=scene.floater.round)
        rates = self.levitation.rates
        if interaction is not self.levitation.interaction or self.averaged:
            rates = (self.setting.rates if "setting" in self.__dict__ else rates).elsewhere(interaction)
        return Setting(scales, rates, values, PlateForce(plate, values) if plate else None)

    def at(self, scene: Scene, offsets: Mapping[str, float]) -> Setting:
        """The equations of a scene in which numbers are larger by `offsets`, by key."""
        table, of_rotor = self.levitation.table, any(key.startswith("rotor.") for key in offsets)
        field = changed_table(table, scene.rotor) if of_rotor and isinstance(table, RotorTable) else table
        effects = interaction_of(field)
        if (mutual := self.levitation.answers[0]) is not None:
            effects = effects.joined(Mutual(self._mutual(mutual, scene, offsets), scene.floater.moment))
        if (losses := self.levitation.losses) is not None:
            effects = effects.joined(RotorCurrents(self._losses(losses, scene, offsets)))
        if any(key.startswith("floater.") for key in offsets) and (shape := shape_beside(self.scene, scene, field)):
            effects = effects.joined(shape)
        plate = self._plate(scene, offsets) if self.with_plate else None
        return self._setting(scene, with_effects(scene, effects), plate)

    def _strong(self, scene: Scene) -> float:
        before, after = (float(np.linalg.norm(one.rotor[0].polarization)) for one in (self.scene, scene))
        return after / (before or 1.0)

    def _mutual(self, table: MutualTable, scene: Scene, offsets: Mapping[str, float]) -> Any:
        lone, found = magnified(self.scene.rotor, scene.rotor), cast(Any, moved_mutual(table, scene.rotor))
        for key, offset in offsets.items():
            moves = key.startswith("rotor.") and lone and lone[0] == 1.0
            if moves or key.endswith("remanence_T") or not key.startswith(("rotor.", "floater.")):
                continue
            if key.startswith("floater.") and not key.endswith(("_mm", "permeability")):
                continue
            beside = self._tables(
                "mutual", key, lambda there: mutual_table_beside(table, there.rotor, there.floater.ball, note)
            )
            found = _Line(found, beside, offset)
        strong = self._strong(scene) if "rotor.remanence_T" in offsets else 1.0
        return found if strong == 1.0 else StrongerMutual(found, strong)

    def _losses(self, losses: RotorLosses, scene: Scene, offsets: Mapping[str, float]) -> Any:
        before, after = self.scene.rotor, scene.rotor
        found: Any = losses
        alone = not self.scene.conductors and len({magnet.conductivity for magnet in after}) == 1
        lone = alone and magnified(before, after)
        if alone and "rotor.conductivity_S_m" in offsets:
            ratio = float(after[0].conductivity / before[0].conductivity)  # type: ignore[operator]
            found = replace(losses, weights=losses.weights * np.sqrt(ratio))
        if lone:
            return MovedLosses(found, before[0], after[0], lone[0])
        for key, offset in offsets.items():
            if key.startswith("rotor.") and not key.endswith(
                ("remanence_T", "recoil_permeability", "rotor.conductivity_S_m")
            ):
                beside = self._tables("losses", key, lambda there: cached_rotor_losses(there, note)[0])
                found = _Line(found, beside, offset)
        return found

    def _plate(self, scene: Scene, offsets: Mapping[str, float]) -> PlateMemory | None:
        memory = self.levitation.plate
        assert memory is not None
        assert scene.plate is not None
        if "plate.conductivity_S_m" in offsets:
            rates = memory.table.rates * (memory.plate.conductivity / scene.plate.conductivity)
            memory = replace(memory, table=replace(memory.table, rates=rates))
        if "rotor.remanence_T" in offsets:
            series = self._strong(scene) * memory.share.series
            memory = replace(memory, share=replace(memory.share, series=series))
        if any(key.startswith(("plate.center_mm", "plate.rotation_deg")) for key in offsets):
            memory = replace(memory, plate=replace(memory.plate, body=scene.plate.body))
        moves = {key: offset for key, offset in offsets.items() if _moves_rotor(key)}
        if moves:  # about a plate that has not gone down
            series = memory.share.series @ memory.share.by_depth(0.0)
            series = series + sum(offset * self._shares[key] for key, offset in moves.items())
            memory = replace(memory, share=replace(memory.share, distance=0.0, series=series[:, :, None]))
        return memory

    def prepare(self, keys: Sequence[str]) -> None:
        """Differentiate the rotor's share of the plate's signals by keys that move both against each other."""
        wanted = [key for key in keys if _moves_rotor(key)] if self.with_plate else []
        memory, requested = self.levitation.plate, self.levitation.requested_plate
        table = self.levitation.table
        if not wanted or memory is None or requested is None or not isinstance(table, RotorTable):
            return
        near = {key: self._scenes(key) for key in wanted}
        others = [
            (replace(memory.plate, body=scene.plate.body), changed_table(table, scene.rotor))
            for scenes in near.values()
            for *_, scene in scenes
            if scene.plate is not None  # as all have one
        ]
        note("The rotor's share of the plate's currents by what moves both ...")
        found = iter(requested.changed_shares((memory.table, memory.share), others, note))
        for key, scenes in near.items():
            self._shares[key] = np.sum([weight * next(found) for _, weight, *_ in scenes], axis=0)

    def _tables(self, name: str, key: str, make: Callable[[Scene], Any]) -> list[tuple[float, Any]]:
        """Tables that are made `WIDE` steps beside a number, each after its weight in a derivative by it."""
        if (name, key) not in self._beside:
            wide, order = WIDE[name]
            weighted = [(row[1] if order == 4 else row[2], row[3]) for row in self._scenes(key, wide / STEP)]
            self._beside[name, key] = [(weight, make(scene)) for weight, scene in weighted if weight]
        return self._beside[name, key]


@dataclass(frozen=True, eq=False)
class _Line:
    """A table among others: the numbers of `base`, and an `offset` times their derivative by tables `beside` it."""

    base: Any
    beside: Sequence[tuple[float, Any]]  # each after its weight
    offset: float

    @property
    def _tables(self) -> list[tuple[float, Any]]:
        return [(1.0, self.base), *((self.offset * weight, table) for weight, table in self.beside)]

    @property
    def polarizability(self) -> float:
        return sum(weight * float(table.polarizability) for weight, table in self._tables)

    def derivatives(self, places: Array, moments: Array) -> tuple[Array, ...]:
        each = [[weight * part for part in table.derivatives(places, moments)] for weight, table in self._tables]
        return tuple(sum(parts) for parts in zip(*each, strict=True))

    def products(self, places: Array) -> Array:
        return np.asarray(sum(weight * table.products(places) for weight, table in self._tables))
