"""Tables of the models that leave something out, and what they leave out as their doubts."""

import time
from dataclasses import replace

import numpy as np

from ...geometry.basics import Part
from ...geometry.bodies import Magnet, cut_magnets
from ..closed_forms import first_order_moments, uniform_cells
from ..harmonics import MultipoleExpansion, trimmed_expansions, uniform_moments
from .accuracy import Accuracy, error_points
from .table import KNOWN, RotorTable

DEGREE = 25
"""Degree up to which the part that a model leaves out is computed."""
FIRST_ORDER_SAFETY = 1.1
"""The first-order magnetisation is right to a few per cent at low degrees, to χ at high ones, for χ = μ - 1 ≤ 0.2."""
Rotor = tuple[Magnet, ...]


def dipole_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """Moments J V/μ0 of the remanence at the magnets' centres."""
    start = time.perf_counter()
    dipoles = tuple(uniform_moments(magnet, 1) for magnet in rotor)
    doubts = {"shape": tuple(_without_dipole(uniform_moments(magnet, DEGREE)) for magnet in rotor)}
    return _finished(RotorTable("dipole", rotor, (), dipoles, doubts), accuracy, start)


def moments_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """As many moments of the remanence about the magnets' pieces as the accuracy needs."""
    start = time.perf_counter()
    points, scale = error_points(rotor, accuracy.clearance(rotor))
    pieces = [piece for whole in cut_magnets(rotor, accuracy.clearance(rotor)) for piece in whole]
    full = [uniform_moments(piece, 2 * DEGREE - 1) for piece in pieces]
    kept, dropped = trimmed_expansions(full, points, scale * accuracy.rtol / 2)
    return _finished(RotorTable("moments", rotor, (), tuple(kept), {KNOWN: tuple(dropped)}), accuracy, start)


def cuboid_table(rotor: Rotor, accuracy: Accuracy) -> RotorTable:
    """The closed form of the remanence; moments of parts, which have none."""
    start = time.perf_counter()
    known = tuple(magnet for magnet in rotor if not isinstance(magnet.body, Part))
    parts = [magnet for magnet in rotor if isinstance(magnet.body, Part)]
    moments = tuple(cell for magnet in parts for cell in uniform_cells(magnet, accuracy.clearance(rotor)))
    return _finished(RotorTable("cuboid", rotor, known, moments), accuracy, start)


def _finished(table: RotorTable, accuracy: Accuracy, start: float) -> RotorTable:
    doubts = {**table.doubts, "permeability": neglected_permeability(table.magnets, accuracy)}
    known = {cause: parts for cause, parts in doubts.items() if parts}
    return replace(table, doubts=known, provenance={"seconds": time.perf_counter() - start})


def neglected_permeability(rotor: Rotor, accuracy: Accuracy) -> tuple[MultipoleExpansion, ...]:
    """What the permeability adds, to first order, about every piece of the magnets that have one."""
    found = []
    for magnet, pieces in zip(rotor, cut_magnets(rotor, accuracy.clearance(rotor)), strict=True):
        factor = FIRST_ORDER_SAFETY * np.sqrt(1 + magnet.contrast)
        for piece in pieces if magnet.contrast else ():
            coefficients = factor * first_order_moments(piece, rotor, DEGREE)
            found.append(MultipoleExpansion(piece.box.center, piece.box.circumradius, coefficients))
    return tuple(found)


def _without_dipole(expansion: MultipoleExpansion) -> MultipoleExpansion:
    rest = np.array(expansion.coefficients)
    rest[1] = 0.0
    return MultipoleExpansion(expansion.center, expansion.radius, rest)
