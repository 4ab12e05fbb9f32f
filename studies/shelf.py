"""The tables that one command uses, and where each came from."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..fem.cache import cached_rotor_table
from ..fem.models import resolve_model, rotor_table
from ..fem.table import RotorTable
from ..geometry.scene import Scene
from .console import note


@dataclass
class Shelf:
    """Rotor tables of a scene by model, each computed once.

    The accuracy holds wherever the floater can be: its centre comes no nearer to a magnet than its radius.

    Parameters
    ----------
    scene : whose rotor
    rtol : relative accuracy of B asked of the field
    from_cache : names of the models that were found in the cache
    """

    scene: Scene
    rtol: float
    from_cache: list[str] = field(default_factory=list)
    _tables: dict[str, RotorTable] = field(default_factory=dict)

    @property
    def nearest(self) -> float:
        """Distance from the magnets' faces from which on the accuracy is asked for, m."""
        return self.scene.floater.radius

    def table(self, model: str) -> RotorTable:
        """The table of a model; `auto` chooses and says why."""
        name, reason = resolve_model(self.scene.rotor, model, self.rtol, self.nearest)
        if model == "auto" and name not in self._tables:
            note(f"Field model: {name} ({reason})")
        if name not in self._tables:
            self._tables[name] = self._made(name)
        return self._tables[name]

    def _made(self, name: str) -> RotorTable:
        if name != "fem":  # closed forms are quicker to make than to read
            return rotor_table(self.scene.rotor, name, self.rtol, self.nearest)
        note("Rotor's field by finite elements ...")
        table, found = cached_rotor_table(self.scene.rotor, name, self.rtol, note, self.nearest)
        if found:
            self.from_cache.append(name)
        note("  from the cache." if found else f"  done in {table.provenance['seconds']:.1f} s.")
        return table
