"""Moments of what the permeability adds that need no elements: those of the closed form H0 of the carriers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.magnet import Magnet
from .harmonics import Coefficients
from .quadrature import oblique_contact
from .remanent import closed_moments

OBLIQUE_NODES = (40, 64)
"""Of the rules for boxes that touch without being parallel; the error falls about as nodes⁻³."""


def added_by_closed_form(
    cut: Sequence[Sequence[Magnet]],
    magnets: Sequence[Magnet],
    carriers: Sequence[Magnet],
    degree: int,
    nodes: int | None = None,
) -> list[Coefficients]:
    """Moments of every piece that need no elements: (μ - 1) H0 + J - J' of the carriers' closed form H0."""
    rests = [whole.polarization - carried.polarization for whole, carried in zip(magnets, carriers, strict=True)]
    return [
        closed_moments(piece, rest, carriers, degree, nodes)
        for pieces, rest in zip(cut, rests, strict=True)
        for piece in pieces
    ]


def closed_part(
    cut: Sequence[Sequence[Magnet]], magnets: Sequence[Magnet], carriers: Sequence[Magnet], degree: int
) -> tuple[list[Coefficients], list[Coefficients]]:
    """`added_by_closed_form` and its error: round-off, but for boxes that touch obliquely the step to finer rules."""
    if not oblique_contact([magnet.box for magnet in magnets]):
        closed = added_by_closed_form(cut, magnets, carriers, degree)
        return closed, [np.zeros_like(c) for c in closed]
    coarse, fine = (added_by_closed_form(cut, magnets, carriers, degree, nodes) for nodes in OBLIQUE_NODES)
    return fine, [b - a for a, b in zip(coarse, fine, strict=True)]
