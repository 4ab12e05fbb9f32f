"""A lone magnet at home, its centre the origin and its axes the frame's: what is known of it there it takes along."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...geometry.common import Array
from ...geometry.magnets import Magnet
from ...geometry.shapes import Box
from ...geometry.solids import Part, moved, solid_of
from ..closed_forms.moments import first_order_moments
from ..harmonics.expansion import MultipoleExpansion, uniform_moments, without_noise
from ..harmonics.solid import Coefficients, rotated_harmonics
from .table import RotorTable

DIGITS = 13
"""Of shapes that are alike."""
Numbers = tuple[float, ...]
Alike = tuple[Numbers, Numbers, float, float | None]
"""What magnets have in common that differ in size and pose: shape in circumradii, polarisation, permeabilities."""


def at_home(rotor: tuple[Magnet, ...]) -> tuple[Magnet, ...]:
    """A lone magnet about the origin with its axes along the frame's; any other rotor as it is."""
    if len(rotor) != 1:
        return rotor
    return (replace(rotor[0], body=moved(rotor[0].body, np.zeros(3), np.eye(3))),)


def taken_along(table: RotorTable, rotor: tuple[Magnet, ...]) -> RotorTable:
    """The table of a rotor from that of `at_home(rotor)`: the same field and errors, moved, but for round-off."""
    if len(rotor) != 1:
        return table
    body = rotor[0].body

    def there(parts: Sequence[MultipoleExpansion]) -> tuple[MultipoleExpansion, ...]:
        return tuple(
            replace(
                part,
                center=body.center + body.rotation @ part.center,
                coefficients=_turned(part.coefficients, body.rotation),
                axes=body.rotation @ part.axes,
            )
            for part in parts
        )

    return replace(
        table,
        magnets=rotor,
        uniform=tuple(replace(form, body=body) for form in table.uniform),
        expansions=there(table.expansions),
        doubts={cause: there(parts) for cause, parts in table.doubts.items()},
    )


def shape_moments(magnet: Magnet, degree: int) -> Coefficients:
    """Coefficients (T) of a magnet's remanence about its centre, with radius its circumradius."""
    if isinstance(magnet.body, Part):
        return uniform_moments(magnet, degree).coefficients
    return _turned(_remanent(_alike(magnet), degree), magnet.body.rotation)


def added_moments(magnet: Magnet, pieces: Sequence[Magnet], degree: int) -> list[Coefficients]:
    """Coefficients (T) of what the permeability adds to a lone magnet, to first order, about each of its pieces."""
    if isinstance(magnet.body, Part):
        return [first_order_moments(piece, (magnet,), degree) for piece in pieces]
    cut = pieces if len(pieces) > 1 else ()
    boxes = tuple(_numbers([*magnet.body.to_body(piece.body.center), *piece.box.size], magnet) for piece in cut)
    return [_turned(one, magnet.body.rotation) for one in _added(_alike(magnet), boxes, degree)]


def _turned(coefficients: Coefficients, axes: Array) -> Coefficients:
    """Turned, without what symmetry forbids and round-off makes."""
    turned = rotated_harmonics(coefficients, axes)
    return turned if turned is coefficients else without_noise(turned, 1e-15)


def _alike(magnet: Magnet) -> Alike:
    shape = _numbers(magnet.body.shape_numbers, magnet)
    return shape, tuple(magnet.polarization), magnet.recoil_permeability, magnet.transverse_permeability


def _numbers(lengths: Array | list[float], magnet: Magnet) -> Numbers:
    return tuple(np.round(np.asarray(lengths) / magnet.body.circumradius, DIGITS) + 0.0)


def _unit(alike: Alike) -> Magnet:
    shape, polarization, along, across = alike
    return Magnet(solid_of(np.array(shape), np.zeros(3), np.eye(3)), np.array(polarization), along, across)


@lru_cache(maxsize=64)
def _remanent(alike: Alike, degree: int) -> Coefficients:
    return uniform_moments(_unit(alike), degree).coefficients


@lru_cache(maxsize=64)
def _added(alike: Alike, boxes: tuple[Numbers, ...], degree: int) -> tuple[Coefficients, ...]:
    whole = _unit(alike)
    pieces = [replace(whole, body=Box(np.array(box[3:]), np.array(box[:3]))) for box in boxes] or [whole]
    return tuple(first_order_moments(piece, (whole,), degree) for piece in pieces)
