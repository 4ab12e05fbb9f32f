"""The tables that one command uses, and where each came from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ...dynamics.flights import starting_point
from ...dynamics.motion import PlateMemory
from ...dynamics.steady import Equilibrium
from ...fem.measured_maps import GriddedTable, map_table
from ...fem.rotor_tables import RotorTable, cached_rotor_table, resolve_model, rotor_table
from ...geometry.basics import Array
from ...geometry.scenes import AbsoluteStart, Scene
from ..terminal import Tables, note
from .plate_shelf import check_room, plate_memory, resolve_plate_model, table_in_flight

RotorField = RotorTable | GriddedTable
"""A rotor's table: computed, or from a map."""


@dataclass
class Shelf:
    """Tables of a scene by model, each computed once.

    The accuracy holds wherever the floater can be: its centre comes no nearer to a magnet than its radius.

    Parameters
    ----------
    scene : whose rotor and plate
    asked : for which tables
    from_cache : names of the models that were found in the cache
    """

    scene: Scene
    asked: Tables
    from_cache: list[str] = field(default_factory=list)
    _tables: dict[str, RotorField] = field(default_factory=dict)

    @property
    def nearest(self) -> float:
        """Distance from the magnets' faces from which on the accuracy is asked for, m."""
        return self.scene.floater.radius

    def table(self, model: str | None = None) -> RotorField:
        """The table of a model, by default the one asked for; `auto` chooses and says why."""
        model = model or self.asked.model
        name, reason = "map", ""
        if model != "map":
            name, reason = resolve_model(self.scene.rotor, model, self.asked.rtol, self.nearest)
        if model == "auto" and name not in self._tables:
            note(f"Field model: {name} ({reason})")
        if name not in self._tables:
            self._tables[name] = self._made(name)
        return self._tables[name]

    def memory(self, table: RotorField, without: Sequence[Equilibrium]) -> PlateMemory | None:
        """The plate in the motion, around where the floater begins; None where no currents are modelled.

        Parameters
        ----------
        without : equilibria without the plate
        """
        place = self._place(without)
        if place is not None:
            check_room(self.scene, place)
        name, reason = resolve_plate_model(self.scene, self.asked.plate_model, place, self.asked.plate_rtol)
        if self.scene.plate is not None:
            note(f"Plate model: {name} ({reason})")
        if name == "none" or self.scene.plate is None or place is None:
            return None
        memory, found = plate_memory(self.scene, self.scene.plate, name, sources(table), place, self.asked.plate_rtol)
        if found:
            self.from_cache.append("plate")
        return memory

    def in_flight(self, table: RotorField, memory: PlateMemory | None, without: Sequence[Equilibrium]) -> RotorField:
        """The table for the motion: beside a plate, whose own table reaches no farther, `table_in_flight`."""
        place = self._place(without)
        if memory is None or place is None or not isinstance(table, RotorTable):
            return table
        return table_in_flight(self.scene, table, place, self.asked.rtol)

    def _place(self, without: Sequence[Equilibrium]) -> Array | None:
        """Where the floater is while it levitates, (3,) m."""
        if isinstance(self.scene.start, AbsoluteStart):
            return self.scene.start.position
        chosen = starting_point(without) or next(iter(without), None)
        return None if chosen is None else chosen.position

    def _made(self, name: str) -> RotorField:
        if name == "map":
            note("Rotor's field from its map ...")
            return map_table(self.scene.field_map, self.scene.rotor)
        if name != "fem":  # closed forms are quicker to make than to read
            return rotor_table(self.scene.rotor, name, self.asked.rtol, self.nearest)
        note("Rotor's field by finite elements ...")
        table, found = cached_rotor_table(self.scene.rotor, name, self.asked.rtol, note, self.nearest)
        if found:
            self.from_cache.append(name)
        note("  from the cache." if found else f"  done in {table.provenance['seconds']:.1f} s.")
        return table


def sources(table: RotorField) -> RotorTable:
    """The closed forms and expansions that make a table's field."""
    return table.expansions if isinstance(table, GriddedTable) else table
