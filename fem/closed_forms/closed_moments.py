"""Moments of what the permeability adds that need no elements: those of the closed form H0 of remanent bodies.

To first order a permeability adds the magnetisation (μ - 1) H0. Its moments are integrals over the faces: with
H0 = -grad φ and harmonic Υ, ∫ H0·grad Υ dV = -∮ φ ∂Υ/∂n dS, and φ is continuous.

A permeable magnet is polarised by its own field too. With the mean N of its demagnetising tensor its mean polarisation
is about J' = (1 + (μ - 1) N)⁻¹ J (exact for an ellipsoid). Split off with J' instead of J, the closed form leaves
little to the elements: for μr = 1000 a thousandth.
"""

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import Array, Box
from ...geometry.bodies import Magnet
from ..harmonics import Coefficients, curvature_moments, moments_of_magnetization, uniform_moments
from .demagnetization import demagnetizing_tensor, remanent_potential
from .quadrature import enough_nodes, face_rule, oblique_contact, volume_rule

NODES = 6
"""Of the rule for N, which need not be exact: elements and moments make up for it."""
OBLIQUE_NODES, OBLIQUE_NODES_ANISOTROPIC = (96, 128), (40, 64)
"""Of the rules for boxes that touch without being parallel, over faces, and in volumes where faces do not suffice.

A 6 mm cube across the face of a 10 mm one: 5e-7 of B is wrong with 40 and 64, 9e-8 with 96, 4e-8 with 128."""


def carrier(magnet: Magnet) -> Magnet:
    """The magnet with μr = 1 and the mean polarisation J'; the magnet itself if its permeability is 1."""
    if not magnet.contrast:
        return magnet
    turn = magnet.box.rotation
    susceptibility = turn.T @ (magnet.permeability_in_rotor - np.eye(3)) @ turn
    polarization = np.linalg.solve(np.eye(3) + susceptibility @ _mean_tensor(magnet.box), magnet.polarization)
    return Magnet(magnet.box, np.asarray(polarization, float))


def _mean_tensor(box: Box) -> Array:
    """Mean demagnetising tensor N (3, 3) in body axes, of trace 1: mean H = -N J."""
    upright = Box(box.size)
    points, weights = volume_rule(upright, (), NODES)
    diagonal = -np.einsum("n,nii->i", weights, demagnetizing_tensor(upright, points))
    return np.diag(diagonal / diagonal.sum())


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
