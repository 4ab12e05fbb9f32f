"""Moments of what the permeability adds that need no elements: those of the closed form H0 of the carriers."""

from collections.abc import Sequence

import numpy as np

from ...geometry.bodies import Magnet
from ..harmonics import Coefficients
from .quadrature import oblique_contact
from .remanent import closed_moments

OBLIQUE_NODES, OBLIQUE_NODES_ANISOTROPIC = (96, 128), (40, 64)
"""Of the rules for boxes that touch without being parallel, over faces, and in volumes where faces do not suffice.

A 6 mm cube across the face of a 10 mm one: 5e-7 of B is wrong with 40 and 64, 9e-8 with 96, 4e-8 with 128."""


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
    rules = OBLIQUE_NODES if all(magnet.isotropic for magnet in magnets) else OBLIQUE_NODES_ANISOTROPIC
    coarse, fine = (added_by_closed_form(cut, magnets, carriers, degree, nodes) for nodes in rules)
    return fine, [b - a for a, b in zip(coarse, fine, strict=True)]
