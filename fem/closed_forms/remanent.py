"""Moments of the magnetisation that the closed-form field H0 of the remanent polarisation makes in the magnets.

To first order a permeability adds the magnetisation (μ - 1) H0. Its moments are integrals over the faces: with
H0 = -grad φ and harmonic Υ, ∫ H0·grad Υ dV = -∮ φ ∂Υ/∂n dS, and φ is continuous.
"""

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import Array
from ...geometry.bodies import Magnet
from ..harmonics import Coefficients, curvature_moments, moments_of_magnetization, uniform_moments
from .demagnetization import remanent_potential
from .quadrature import enough_nodes, face_rule, volume_rule


def induced_moments(body: Magnet, sources: Sequence[Magnet], degree: int, nodes: int | None = None) -> Coefficients:
    """Coefficients (T) of (μ - 1) H0 in a body, about its centre with radius its circumradius.

    Accuracy with the default number of nodes: round-off for boxes whose axes are parallel or that do not touch.
    """
    box, nodes = body.box, nodes or enough_nodes(degree)
    others = [source.box for source in sources]
    points, areas = face_rule(box, others, nodes)
    flux = -remanent_potential(sources, points)[:, None] * areas
    susceptibility = body.permeability_in_rotor - np.eye(3)
    sphere = (box.center, box.circumradius)
    result = moments_of_magnetization(points, np.ones(len(points)), flux @ susceptibility, *sphere, degree)
    if not body.isotropic:
        points, weights = volume_rule(box, others, nodes)
        source = weights * remanent_potential(sources, points)
        result += curvature_moments(points, source, susceptibility, *sphere, degree)
    return result


def closed_moments(
    body: Magnet, rest: Array, sources: Sequence[Magnet], degree: int, nodes: int | None = None
) -> Coefficients:
    """As `induced_moments`, and those of a uniform polarisation `rest` (3,) T in body axes beside."""
    uniform = uniform_moments(Magnet(body.box, rest), degree).coefficients
    return np.asarray(induced_moments(body, sources, degree, nodes) + uniform)


def first_order_moments(body: Magnet, sources: Sequence[Magnet], degree: int) -> Coefficients:
    """What the permeability of a body adds, to a few per cent: (μ - 1) H0 / (1 + χ/3), χ the largest of μ - 1."""
    return induced_moments(body, sources, degree) / (1 + body.contrast / 3)
