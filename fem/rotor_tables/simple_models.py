"""Tables of the models that leave something out, and what they leave out as their doubts."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...geometry.basics import Part, Sphere
from ...geometry.bodies import Magnet, cut_magnets
from ..closed_forms import first_order_moments, uniform_cells
from ..harmonics import Coefficients, MultipoleExpansion, trimmed_expansions, uniform_moments
from .accuracy import Accuracy, error_points
from .home import added_moments, shape_moments
from .table import KNOWN, RotorTable

DEGREE = 25
"""Degree up to which the part that a model leaves out is computed."""
PART_ERROR = 1e-8
"""How exactly curved elements fill a part, relative to its dipole; seen: 4e-10 of a third of a ring."""
NEAREST = 1 / 8
"""Of the smallest edge of the magnets: distance from faces down to which series of what is left out converge."""
FIRST_ORDER_SAFETY = 1.1
"""The first-order magnetisation is right to a few per cent at low degrees, to χ at high ones, for χ = μ - 1 ≤ 0.2."""
Rotor = tuple[Magnet, ...]


def dipole_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """Moments J V/μ0 of the remanence at the magnets' centres."""
    start = time.perf_counter()
    dipoles = tuple(uniform_moments(magnet, 1) for magnet in rotor)
    doubts = {"shape": tuple(_without_dipole(magnet) for magnet in rotor)}
    return _finished(RotorTable("dipole", rotor, (), dipoles, doubts), accuracy, start)


def moments_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """As many moments of the remanence about the magnets' pieces as the accuracy needs."""
    start = time.perf_counter()
    points, scale = error_points(rotor, accuracy.clearance(rotor))
    pieces = [piece for whole in _cut(rotor, accuracy) for piece in whole]
    full = [uniform_moments(piece, 2 * DEGREE - 1) for piece in pieces]
    apart = [np.linalg.norm(points - one.center, axis=1) > one.nearest for one in full]
    there = np.all(apart, axis=0)  # elsewhere, as in the hole of a ring, no number of moments makes the field
    kept, dropped = trimmed_expansions(full, points[there], scale[there] * accuracy.rtol / 2)
    return _finished(RotorTable("moments", rotor, (), tuple(kept), {KNOWN: tuple(dropped)}), accuracy, start)


def cuboid_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """The closed form of the remanence; moments of parts, which have none."""
    start = time.perf_counter()
    known = tuple(magnet for magnet in rotor if not isinstance(magnet.body, Part))
    parts = [magnet for magnet in rotor if isinstance(magnet.body, Part)]
    moments = tuple(cell for magnet in parts for cell in uniform_cells(magnet, accuracy.clearance(rotor)))
    return _finished(RotorTable("cuboid", rotor, known, moments, part_doubts(rotor)), accuracy, start)


def part_doubts(rotor: Rotor) -> dict[str, tuple[MultipoleExpansion, ...]]:
    """What curved elements leave out of parts or add to them: a share of the dipole of each."""
    found = []
    for magnet in rotor:
        body = magnet.body
        if isinstance(body, Part):
            dipole = uniform_moments(
                Magnet(Sphere(body.circumradius, body.center, body.rotation), magnet.polarization), 1
            )
            share = PART_ERROR * body.volume / Sphere(body.circumradius).volume
            found.append(replace(dipole, coefficients=share * dipole.coefficients))
    return {"part": tuple(found)} if found else {}


def _finished(table: RotorTable, accuracy: Accuracy, start: float) -> RotorTable:
    doubts = {**table.doubts, "permeability": neglected_permeability(table.magnets, accuracy)}
    known = {cause: parts for cause, parts in doubts.items() if parts}
    return replace(table, doubts=known, provenance={"seconds": time.perf_counter() - start})


def neglected_permeability(rotor: Rotor, accuracy: Accuracy) -> tuple[MultipoleExpansion, ...]:
    """What the permeability adds, to first order, about every piece of the magnets that have one."""
    found = []
    for magnet, pieces in zip(rotor, _cut(rotor, accuracy), strict=True):
        if magnet.contrast:
            alone = len(rotor) == 1
            added = added_moments(magnet, pieces, DEGREE) if alone else _added_together(rotor, pieces)
            factor = FIRST_ORDER_SAFETY * np.sqrt(1 + magnet.contrast)
            found += [
                MultipoleExpansion(piece.body.center, piece.body.circumradius, factor * one)
                for piece, one in zip(pieces, added, strict=True)
            ]
    return tuple(found)


def _cut(rotor: Rotor, accuracy: Accuracy) -> tuple[Rotor, ...]:
    """Pieces whose series converge as near as is asked, or as `NEAREST` of an edge: nearer by they say too much.

    Their number grows with the cube of edge by distance: for a floater of 1 mm below a cube of 10 mm it was 2000, of
    which each keeps some 10 kB and takes tenths of a second.
    """
    edge = min(float(magnet.box.size.min()) for magnet in rotor)
    return cut_magnets(rotor, max(accuracy.clearance(rotor), NEAREST * edge))


def _added_together(rotor: Rotor, pieces: Sequence[Magnet]) -> list[Coefficients]:
    return [first_order_moments(piece, rotor, DEGREE) for piece in pieces]


def _without_dipole(magnet: Magnet) -> MultipoleExpansion:
    rest = np.array(shape_moments(magnet, DEGREE))
    rest[1:2] = 0.0
    return MultipoleExpansion(magnet.body.center, magnet.body.circumradius, rest)
