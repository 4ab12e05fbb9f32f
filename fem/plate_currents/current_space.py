"""A plate's currents as a network of many states, from which the few of a table are taken.

By parity class, it holds fields e_i with ∫ σ e_i·e_j dV = δ_ij and the inductance L_ij between their currents.  A
source with couplings b_i = ∫ σ e_i·A_s dV drives them as (1 + iωL) c = b, and couples with another one by -iω b'·c.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from ..closed_forms import ComplexArray
from ..eddy_currents import Source, dipole_images
from ..elements import Parity

CHUNK = 16
"""Sources handled at a time: bounds the memory."""


@dataclass(frozen=True, eq=False)
class CurrentSpace:
    """Fields of a plate's currents at the quadrature points of the meshed part.

    Parameters
    ----------
    parity : mirrors of the plate
    points : (n, 3) m
    root : (3n,) weights of the rows
    fields : (states, 3n) rows e_i of each parity class, orthonormal
    inductances : (states, states) of each parity class, s
    order, cells : of the finite elements
    """

    parity: Parity
    points: Array
    root: Array
    fields: tuple[Array, ...]
    inductances: tuple[Array, ...]
    order: int
    cells: int

    def couplings(self, sources: Sequence[Source]) -> list[Array]:
        """b (sources, states) of each parity class."""
        return self.image_couplings(source_images(self.parity, self.points, sources))

    def dipole_couplings(self, places: ArrayLike) -> list[Array]:
        """b (3 × places, states) of each parity class, of unit moments along x, y and z at places (m, 3), m."""
        places = np.asarray(places, float).reshape(-1, 3)
        images = dipole_images(self.parity, self.points, places)
        return self.image_couplings(part.reshape(len(part), -1, *part.shape[3:]) for part in images)

    def image_couplings(self, images: Iterable[Array]) -> list[Array]:
        """b (sources, states) of each parity class, of parts of potentials as `source_images` makes them."""
        weighted = [field * self.root for field in self.fields]
        found: list[list[Array]] = [[np.zeros((0, len(field)))] for field in weighted]
        for part in images:
            for rows, image, field in zip(found, part, weighted, strict=True):
                rows.append(image.reshape(len(image), -1) @ field.T)
        return [np.concatenate(rows) for rows in found]


def source_images(parity: Parity, points: Array, sources: Sequence[Source]) -> Iterable[Array]:
    """(classes, some sources, n, 3) parity parts of the sources' potentials at `points` (n, 3), T m."""
    flips = parity.flips
    mirrored = (points * flips[:, None]).reshape(-1, 3)
    for start in range(0, len(sources), CHUNK):
        some = [s.vector_potential(mirrored).reshape(len(flips), -1, 3) for s in sources[start : start + CHUNK]]
        yield parity.project(np.stack(some, axis=1) * flips[:, None, None])


def space_couplings(b: Sequence[Array], inductances: Sequence[Array], shift: complex) -> ComplexArray:
    """(sources, sources) -s b (1 + sL)⁻¹ bᵀ, summed over the parity classes; s is iω or a real shift, rad/s."""
    parts = [
        b_class @ np.linalg.solve(np.eye(len(induct)) + shift * induct, b_class.T)
        for b_class, induct in zip(b, inductances, strict=True)
    ]
    return np.asarray(-shift * sum(parts))
