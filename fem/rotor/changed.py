"""Fields of magnets that differ from those of a table: smooth functions of the magnets' numbers, and as exact."""

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ...geometry.solids import Part
from ..closed_forms.moments import carriers_of
from ..elements.surface_charges import SurfaceCharges
from ..harmonics.expansion import MultipoleExpansion, merged, uniform_moments
from .charges import bear_charges, charged_expansion
from .models import DEGREE, Accuracy, Rotor, extrapolated_tail
from .table import RotorTable

STEADY_NODES, STEADY_DEGREE = 16, 40  # of charges on surfaces whose fields are smooth functions of the magnets' numbers
STEADY_ERROR = 5e-5  # of what they add: less than that of stacks whose magnets were made 0.8 to 1.3 times as large


@dataclass(frozen=True, eq=False)
class ChangedTable(RotorTable):
    """The field of magnets that differ from those of a table, `origin`."""

    origin: RotorTable | None = None


def changed_table(table: RotorTable, rotor: Rotor, doubts: bool = False) -> ChangedTable:
    """The field of magnets that differ from a table's: a smooth function of their numbers, for differences.

    A lone `rotor` that is moved, turned, magnified or polarised more has the `table`'s own field, transformed. What
    else changes is added by closed forms, or by as many charges on surfaces; permeable magnets without these change as
    if of μr = 1. A changed table is taken as it was made; `doubts` only where asked for.
    """
    table = getattr(table, "origin", table)
    before = table.magnets
    if sizes := magnified(before, rotor):
        bare = table if doubts else replace(table, doubts={})
        whole = bare.transformed(before[0].body, rotor[0], *sizes)
        return ChangedTable(**{part.name: getattr(whole, part.name) for part in fields(RotorTable)}, origin=table)
    simple = {"dipole": lambda m: ((), tuple(uniform_moments(one, 1) for one in m))}.get(table.model, _closed)
    charged = _charged(table, before, rotor)
    (minus, less), (plus, more) = ((_with_charges if charged else simple)(m) for m in (before, rotor))
    uniform = plus
    if _numbers(table.uniform) != _numbers(minus):
        minus = tuple(replace(one, polarization=-one.polarization) for one in minus)
        uniform = (*table.uniform, *minus, *plus)
    added = *((part, -1) for part in less), *((part, 1) for part in more)
    parts, known = merged([*((part, 1) for part in table.expansions), *added]), dict(table.doubts) if doubts else {}
    if doubts and charged:
        known["charges"] = [replace(part, coefficients=STEADY_ERROR * part.coefficients) for part in (*less, *more)]
        known["charges' tail"] = extrapolated_tail(more)
    return ChangedTable(table.model, rotor, uniform, parts, known, table.provenance, table)


def follows(table: RotorTable, rotor: Rotor) -> bool:
    """Whether a `changed_table` of permeable magnets is as good as one of their own."""
    before = getattr(table, "origin", table).magnets
    return bool(magnified(before, rotor)) or (len(before) == len(rotor) and _charged(table, before, rotor))


def _charged(table: RotorTable, *rotors: Rotor) -> bool:
    return table.model in ("fem", "surface") and all(bear_charges(rotor, Accuracy()) for rotor in rotors)


def _numbers(rotor: Rotor) -> list[tuple[Any, ...]]:
    each = [(m.polarization, m.body.center, m.body.rotation, m.body.shape_numbers) for m in rotor]
    return [(type(m.body), *(part.tolist() for part in parts)) for m, parts in zip(rotor, each, strict=True)]


def _closed(rotor: Rotor) -> tuple[Rotor, tuple[MultipoleExpansion, ...]]:
    """Closed forms of the remanence, and dipoles of parts, which have none."""
    known = tuple(magnet for magnet in rotor if not isinstance(magnet.body, Part))
    return known, tuple(uniform_moments(magnet, DEGREE) for magnet in rotor if isinstance(magnet.body, Part))


@lru_cache(maxsize=8)  # of the magnets that others differ from it is asked for again and again
def _with_charges(rotor: Rotor) -> tuple[Rotor, tuple[MultipoleExpansion, ...]]:
    carriers = carriers_of(rotor)
    found = []
    if any(m.contrast for m in rotor):
        surfaces = SurfaceCharges(rotor, STEADY_NODES)
        charges = surfaces.beyond(carriers)
        found = [charged_expansion(surfaces, k, charges, STEADY_DEGREE) for k in range(len(surfaces.magnets))]
    return tuple(one for one in carriers if one.polarization.any()), tuple(found)


def magnified(rotor: Rotor, other: Rotor) -> tuple[float, float] | None:
    """Sizes and remanence of a lone magnet by those of another, wherever they are; None where they differ in more."""
    if not len(rotor) == len(other) == 1:
        return None
    (before,), (after,) = rotor, other
    kinds = [(type(m.body), m.recoil_permeability, m.transverse_permeability) for m in (before, after)]
    if kinds[0] != kinds[1] or kinds[0][0] is Part:
        return None
    numbers = [before.body.shape_numbers, after.body.shape_numbers]
    size = float(np.linalg.norm(numbers[1]) / np.linalg.norm(numbers[0]))
    strong = float(np.linalg.norm(after.polarization) / (np.linalg.norm(before.polarization) or 1.0))
    alike = [(numbers[0] * size, numbers[1]), (before.polarization * strong, after.polarization)]
    return (size, strong) if all(np.allclose(a, b, rtol=1e-13, atol=1e-15) for a, b in alike) else None
