"""The closed-form field of the remanent polarisation inside the magnets, and its moments.

H0 is the field of all magnets with μr = 1. To first order a recoil permeability adds the magnetisation (μr - 1) H0.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..geometry.box import Array, Box
from ..geometry.magnet import Magnet
from .compiled import CompiledField
from .harmonics import Coefficients
from .multipole import moments_of_magnetization
from .table import RotorTable

NODES = 24
"""Integration points per axis; degrees up to 31 of a polynomial are far below the error of the logarithms."""


def remanent_h(magnets: tuple[Magnet, ...], inside: int, points: Array) -> Array:
    """μ0 H0 (n, 3) T at `points` (n, 3) m in magnet number `inside`, off its edges."""
    return np.asarray(_closed_form(magnets)(points)[0] - magnets[inside].polarization_in_rotor)


def remanent_moments(magnets: tuple[Magnet, ...], inside: int, degree: int) -> Coefficients:
    """Coefficients (T) of H0 in magnet number `inside`, about its centre with radius its circumradius.

    Accuracy: 5e-8 of the leading coefficient, from the logarithm of the distance to the edges.
    """
    box = magnets[inside].box
    points, weights = edge_graded_gauss(box, NODES)
    field = remanent_h(magnets, inside, points)
    return moments_of_magnetization(points, weights, field, box.center, box.circumradius, degree)


def first_order_moments(magnets: tuple[Magnet, ...], inside: int, degree: int) -> Coefficients:
    """Coefficients (T) of χ H0 / (1 + χ/3), χ = μr - 1: what the permeability adds, to a few per cent of itself."""
    susceptibility = magnets[inside].recoil_permeability - 1
    return susceptibility / (1 + susceptibility / 3) * remanent_moments(magnets, inside, degree)


def edge_graded_gauss(box: Box, nodes: int) -> tuple[Array, Array]:
    """Points (n, 3) m and weights (n,) m³ inside the box, pressed towards its faces by x = (3 t - t³)/2.

    The logarithm of the distance from an edge is integrated to about 10 nodes⁻⁶.
    """
    t, weights = np.polynomial.legendre.leggauss(nodes)
    place, weight = (3 * t - t**3) / 2, 1.5 * weights * (1 - t * t)
    grid = np.stack(np.meshgrid(place, place, place, indexing="ij"), -1).reshape(-1, 3)
    volume = (weight[:, None, None] * weight[:, None] * weight).ravel() * box.volume / 8
    return box.center + (grid * box.half_edges) @ box.rotation.T, volume


@lru_cache(maxsize=4)
def _closed_form(magnets: tuple[Magnet, ...]) -> CompiledField:
    return CompiledField(RotorTable("cuboid", magnets, uniform=magnets).expressions)
