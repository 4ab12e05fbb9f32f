"""Whether a map can be one of the magnets that a scene says: a wrong unit makes it wrong by powers of ten."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array, counted, millimetres
from ...geometry.magnets import Magnet
from ...geometry.shapes import Sphere
from ...geometry.solids import Part
from ..closed_forms.uniform import remanent_field
from .columns import METERS, TESLAS, UNITS, FieldMap, FieldMapError

SUBSET = 400  # Map points that are enough to compare
# Largest ratio of B of the map to that of the magnets, or the other way round; least mean cosine between both.
FACTOR, ALIGNED = 2.0, 0.5
ENOUGH = 0.1  # Least share of the points that lies outside the magnets where the units are right
# Units explain a map as well as the best ones up to so many times their deviation, or a deviation of so much.
AS_GOOD, GOOD = 3.0, 0.02
# A zero is no reading where the magnets' field is so many times the smallest that was read, and so much of |B|.
STEPS, COMPONENT = 30.0, 0.1


@dataclass(frozen=True)
class _Comparison:
    """Of a map with its magnets: median ratio of |B|, mean cosine, median relative deviation.

    `share` is that of the points that lie outside the spheres.
    """

    ratio: float
    cosine: float
    deviation: float
    share: float

    def agrees(self, magnets: Sequence[Magnet]) -> bool:
        contrast = max(magnet.contrast for magnet in magnets)
        most = FACTOR * max(1.0, contrast)  # iron makes the field of the remanent polarisation alone another one
        return 1 / most <= self.ratio <= most and (self.cosine >= ALIGNED or contrast > 1)


def require_plausible(field_map: FieldMap, magnets: Sequence[Magnet], radius: float) -> None:
    """Refuse a map that contradicts the magnets.

    The stronger half of `SUBSET` points outside the spheres of `radius` (m) about the magnets is compared with the
    field of the remanent polarisation. Raises FieldMapError: B larger or smaller by more than a factor of two than that
    of the magnets, along other directions, or exactly zero where they have a field; or no point outside. Where another
    unit would explain it, it is named.
    """
    if not any(magnet.polarization.any() for magnet in magnets):
        return
    rotor = [_with_closed_form(magnet) for magnet in magnets]
    found = _compared(field_map, rotor, radius)
    if found is not None and found.agrees(rotor):
        _require_no_zeros(field_map, rotor, radius)
        return
    likely = _likely_units(field_map, rotor, radius)
    if found is None:
        received = f"all {len(field_map.points)} points lie within, and no field can be fitted to them"
        rule = f"have points farther than {radius * 1e3:.4g} mm from the magnets' centres"
    else:
        received = _received(found)
        rule = f"agree with the magnets of the scene to a factor of {FACTOR:g}"
    raise FieldMapError(f"Input map must {rule}; instead {received}{_way_out(likely, field_map.read_as)}")


def _with_closed_form(magnet: Magnet) -> Magnet:
    """The magnet, or for a part from a file the sphere of its volume, which is near enough to a factor of two."""
    if not isinstance(body := magnet.body, Part):
        return magnet
    center = body.center + body.rotation @ body.centroid
    return replace(magnet, body=Sphere(float(np.cbrt(body.volume * 0.75 / np.pi)), center, body.rotation))


def _outside(points: Array, magnets: Sequence[Magnet], radius: float) -> NDArray[np.bool_]:
    away = np.array([np.linalg.norm(points - magnet.box.center, axis=1) for magnet in magnets])
    return np.asarray(away.min(axis=0) > radius)


def _compared(
    field_map: FieldMap, magnets: Sequence[Magnet], radius: float, length: float = 1.0, strength: float = 1.0
) -> _Comparison | None:
    """The map, its lengths and B multiplied by factors, with the magnets; None where no value lies outside of them."""
    observed = np.isfinite(field_map.field)
    (outside,) = np.nonzero(_outside(length * field_map.points, magnets, radius) & observed.any(axis=1))
    if not len(outside):
        return None
    some = outside[np.linspace(0, len(outside) - 1, min(len(outside), SUBSET)).astype(int)]
    expected = np.where(observed[some], remanent_field(magnets, length * field_map.points[some]), 0.0)
    field = np.where(observed[some], strength * field_map.field[some], 0.0)
    sizes = np.linalg.norm(expected, axis=1)
    strong = sizes >= np.median(sizes)
    field, expected, size = field[strong], expected[strong], sizes[strong] + np.finfo(float).tiny
    amplitude = np.linalg.norm(field, axis=1)
    cosine = np.sum(field * expected, axis=1) / (size * amplitude + np.finfo(float).tiny)
    deviation = np.linalg.norm(field - expected, axis=1) / size
    ratio, apart = float(np.median(amplitude / size)), float(np.median(deviation))
    return _Comparison(ratio, float(cosine.mean()), apart, len(outside) / len(observed))


def _likely_units(field_map: FieldMap, magnets: Sequence[Magnet], radius: float) -> list[tuple[str, str]]:
    """Units of length and of B that would explain the map, at most two, first those with one change."""
    length, field = (UNITS[unit] for unit in field_map.read_as)
    found: list[tuple[int, float, tuple[str, str]]] = []
    for units in product(METERS, TESLAS):
        changes = sum(unit != read for unit, read in zip(units, field_map.read_as, strict=True))
        one = _compared(field_map, magnets, radius, METERS[units[0]] / length, TESLAS[units[1]] / field)
        if one is not None and one.share > ENOUGH and one.agrees(magnets):
            found.append((changes, one.deviation, units))
    best = min((deviation for _, deviation, _ in found), default=0.0)
    alike = sorted(entry for entry in found if entry[1] <= max(AS_GOOD * best, GOOD))
    return [units for _, _, units in alike[:2]]


def _received(found: _Comparison) -> str:
    if 1 / FACTOR <= found.ratio <= FACTOR:
        return f"B is turned against theirs by {np.degrees(np.arccos(found.cosine)):.0f}° on the mean"
    factor, size = (found.ratio, "large") if found.ratio > 1 else (1 / max(found.ratio, 1e-300), "small")
    return f"B looks {float(f'{factor:.3g}'):g} times too {size} for this rotor"


def _way_out(likely: Sequence[tuple[str, str]], read_as: tuple[str, str]) -> str:
    if not likely:
        return ". Is it the map of another rotor, in another frame, or are the magnets' sizes or polarisations others?"
    words = ({"name": "lengths", "title": "x", "key": "length"}, {"name": "B", "title": "Bx", "key": "field"})
    guess, title, key = "{name} in {unit}, but read as {read}", "{title}_{unit}", 'rotor.map_{key}_unit = "{plain}"'

    def said(form: str) -> str:
        ways = [
            [
                form.format(**word, unit=unit, read=read, plain=unit.replace("µ", "u"))
                for word, unit, read in zip(words, units, read_as, strict=True)
                if unit != read
            ]
            for units in likely
        ]
        return ", or ".join(" and ".join(changed) for changed in ways)

    return (
        f": probably {said(guess)}. Correct the unit in the file (a title such as {said(title)}), or set {said(key)}."
    )


def _require_no_zeros(field_map: FieldMap, magnets: Sequence[Magnet], radius: float) -> None:
    """Raise FieldMapError for readings of exactly zero where the magnets have a field: what a lost mask leaves."""
    values = np.abs(field_map.field[np.isfinite(field_map.field) & (field_map.field != 0)])
    observed = np.isfinite(field_map.field)
    zero = ~np.any(observed & (field_map.field != 0), axis=1) & observed.any(axis=1)
    (rows,) = np.nonzero(zero & _outside(field_map.points, magnets, radius))
    if not len(rows) or not len(values):
        return
    whole = remanent_field(magnets, field_map.points[rows])
    seen = np.linalg.norm(np.where(observed[rows], whole, 0.0), axis=1)
    wrong = (seen > STEPS * values.min()) & (seen > COMPONENT * np.linalg.norm(whole, axis=1))
    if wrong.any():
        first = int(rows[np.argmax(wrong)])
        raise FieldMapError(
            f"Input B must be NaN or empty where it is not known; instead it is exactly zero at "
            f"{counted(int(wrong.sum()), 'point')} where the magnets have a field, such as "
            f"{millimetres(field_map.points[first])}. Leave these rows out."
        )
