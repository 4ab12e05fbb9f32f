"""The field models of a rotor, the choice between them, and fields of magnets that differ from those of a table."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from ...geometry.common import Report, Watch, unwatched
from ...geometry.cutting import united
from ...geometry.shapes import Box
from ...geometry.solids import Part
from ..closed_forms.moments import carriers_of
from ..elements.surface import smooth
from ..elements.surface_charges import SurfaceCharges
from ..harmonics.expansion import MultipoleExpansion, merged, uniform_moments
from . import models
from .charges import bear_charges, charged_expansion, surface_table, without_charges
from .models import Accuracy, Rotor, cuboid_table, dipole_table, fem_table, moments_table
from .table import ROTOR, RotorTable, alike

# From the cheapest to the dearest in evaluation
MODELS: dict[str, Callable[[Rotor, Accuracy], RotorTable]] = {
    "dipole": dipole_table,
    "moments": moments_table,
    "cuboid": cuboid_table,
    "surface": surface_table,
    "fem": fem_table,
}
# Models that know the permeability, and what they are by
PERMEABLE = {"surface": "charges on the magnets' surfaces", "fem": "finite elements"}
# Magnets, and accuracy, from which on charges on the surfaces are far quicker than finite elements
MANY, ROUGH = 3, 1e-5
SURELY = 10  # what permeability does to the moments, by the tolerance, from which on it surely matters
FEW_MOMENTS = 16  # coefficients per magnet up to which moments are quicker to evaluate than the closed form


def resolve_model(rotor: Rotor, model: str, rtol: float = 3e-6, nearest: float | None = None) -> tuple[str, str]:
    """Name of the model that `rotor_table` uses for `model`, and the reason in words.

    `auto` is the cheapest of dipole, moments and closed form that meets the accuracy, else charges on the surfaces
    where these are quicker, else finite elements. `rotor`, `rtol` and `nearest` are as there. Raises ValueError:
    unknown model, or rtol not between 0 and 1.
    """
    if model in MODELS:
        return model, "as requested"
    if model != "auto":
        raise ValueError(f"Input model must be one of {', '.join([*MODELS, 'auto'])}; instead received {model!r}.")
    rotor, accuracy = united(rotor), Accuracy(rtol, nearest)
    clearance = accuracy.clearance(rotor)
    points, scale = models.error_points(rotor, clearance)
    where = f"at {clearance * 1e3:.3g} mm from the magnets' faces and beyond, where {rtol:.1e} is asked for"
    permeability = models.moment_error(rotor, points, scale)
    if permeability <= SURELY * rtol:  # else its whole field, in seconds, would say no other
        permeability = float(np.max(cuboid_table(rotor, accuracy).absolute_error(points)[0] / scale))
    if permeability > rtol:
        reason = f"leaving out the recoil permeability is wrong by {permeability:.1e} {where}"
        if not without_charges(rotor, accuracy, points) and smooth(rotor):
            if len(rotor) >= MANY or (len(rotor) > 1 and not all(isinstance(m.body, Box) for m in rotor)):
                return "surface", f"{reason}, and elements of {len(rotor)} magnets take minutes and gigabytes"
            if rtol >= ROUGH:
                return "surface", f"{reason}, and charges on the surfaces take a fraction of the elements' time"
        return "fem", reason
    for table in (dipole_table(rotor, accuracy), moments_table(rotor, accuracy)):
        error = float(np.max(table.absolute_error(points)[0] / scale))
        count = sum(np.count_nonzero(expansion.coefficients) for expansion in table.expansions)
        if error <= rtol and count <= FEW_MOMENTS * len(rotor) and table.in_range(points).all():
            return table.model, f"with {count} coefficients it is wrong by {error:.1e} {where}"
    if permeability == 0:
        return "cuboid", "every recoil permeability is 1, so that the closed form is exact"
    return "cuboid", f"leaving out the recoil permeability is wrong by only {permeability:.1e} {where}"


def rotor_table(
    rotor: Rotor, model: str = "auto", rtol: float = 3e-6, nearest: float | None = None, watch: Watch = unwatched
) -> RotorTable:
    """Table of the field of a `rotor`, magnets in its own frame, that states its own error.

    `model`: "dipole", "moments" (more of them) and "cuboid" (closed form, μr = 1), of the remanence alone as in the
    article: a cube with μr = 1.05 has 0.984 of its moment, so that their field is 1.6 % too strong by convention;
    "surface" and "fem", with recoil permeability and mutual demagnetisation, by charges on the surfaces or by finite
    elements; or "auto", see `resolve_model`. `rtol`: relative accuracy of B asked of "moments", "surface" and "fem"
    from `nearest` on, m from the magnets' faces (None: 0.8 of the largest magnet's edge, if it were a cube); errors of
    "dipole" and "cuboid" are computed to first order in μr - 1. `watch` gets the progress. Raises ValueError: unknown
    model, no magnet, or rtol not between 0 and 1.
    """
    accuracy = Accuracy(rtol, nearest)
    if not rotor:
        raise ValueError("Input rotor must hold at least one magnet; instead received none.")
    name, _ = resolve_model(rotor, model, rtol, nearest)
    rotor = _bodies(rotor, name)
    lone = alike(rotor)
    if name == "surface":
        return surface_table(lone, accuracy, watch).posed(rotor)
    if name == "fem":
        return fem_table(lone, accuracy, watch=watch).posed(rotor)
    return MODELS[name](lone, accuracy).posed(rotor)


def _bodies(rotor: Rotor, model: str) -> Rotor:
    """The magnets of a model's table: each has a dipole of its own, else those that are one are one."""
    return rotor if model == "dipole" else united(rotor)


def cached_rotor_table(
    rotor: Rotor, model: str, rtol: float, report: Report, nearest: float | None = None, watch: Watch = unwatched
) -> tuple[RotorTable, bool]:
    """`rotor_table` of `rotor`, `model`, `rtol`, `nearest`, `watch` from the cache if there, and whether it was.

    A lone magnet has one, wherever it is; `report` is called with a message where the cache is damaged.
    """
    rotor = _bodies(rotor, model)
    lone = alike(rotor)
    make = partial(rotor_table, lone, model, rtol, nearest, watch)
    table, found = ROTOR.cached((lone, model, rtol, nearest), make, report)
    return table.posed(rotor), found


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
        known["charges' tail"] = models.extrapolated_tail(more)
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
    return known, tuple(uniform_moments(magnet, models.DEGREE) for magnet in rotor if isinstance(magnet.body, Part))


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
