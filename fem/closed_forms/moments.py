"""Moments of what the permeability adds that need no elements: those of the closed form H0 of remanent bodies.

To first order a permeability adds the magnetisation (μ - 1) H0. Its moments are integrals over the faces: with
H0 = -grad φ and harmonic Υ, ∫ H0·grad Υ dV = -∮ φ ∂Υ/∂n dS, and φ is continuous.

A permeable magnet is polarised by its own field too. With the mean N of its demagnetising tensor its mean polarisation
is about J' = (1 + (μ - 1) N)⁻¹ J (exact for an ellipsoid). Split off with J' instead of J, the closed form leaves
little to the elements: for μr = 1000 a thousandth.
"""

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import Array, Box, Part, Solid, Sphere, moved
from ...geometry.bodies import Cells, Magnet, cells_of
from ..harmonics import Coefficients, MultipoleExpansion, curvature_moments, moments_of_magnetization, uniform_moments
from .demagnetization import demagnetizing_tensor, remanent_field, remanent_potential
from .quadrature import enough_nodes, face_rule, oblique_contact, volume_rule

NODES = 6
"""Of the rule for N, which need not be exact: elements and moments make up for it."""
CELL_NODES, CELL_DEGREE = 28, 40
"""Of the rule over a body of several cells, where high degrees only place the sum of its cells' fields; and degree."""
OBLIQUE_NODES, OBLIQUE_NODES_ANISOTROPIC = (96, 128), (40, 64)
"""Of the rules for boxes that touch without being parallel, over faces, and in volumes where faces do not suffice.

A 6 mm cube across the face of a 10 mm one: 5e-7 of B is wrong with 40 and 64, 9e-8 with 96, 4e-8 with 128."""


def carrier(magnet: Magnet) -> Magnet:
    """The magnet with μr = 1 and the mean polarisation J'; the magnet itself if its permeability is 1.

    A part has no closed form, and all of its remanence is left to the elements.
    """
    if isinstance(magnet.body, Part):
        return Magnet(magnet.body, np.zeros(3))
    if not magnet.contrast:
        return magnet
    turn = magnet.body.rotation
    susceptibility = turn.T @ (magnet.permeability_in_rotor - np.eye(3)) @ turn
    polarization = np.linalg.solve(np.eye(3) + susceptibility @ _mean_tensor(magnet.body), magnet.polarization)
    return Magnet(magnet.body, np.asarray(polarization, float))


def _mean_tensor(body: Solid) -> Array:
    """Mean demagnetising tensor N (3, 3) in body axes, of trace 1: mean H = -N J."""
    upright = moved(body, np.zeros(3), np.eye(3))
    points, weights = volume_rule(upright, (), NODES)
    diagonal = -np.einsum("n,nii->i", weights, demagnetizing_tensor(upright, points))
    return np.diag(diagonal / diagonal.sum())


def induced_moments(body: Magnet, sources: Sequence[Magnet], degree: int, nodes: int | None = None) -> Coefficients:
    """Coefficients (T) of (μ - 1) H0 in a body, about its centre with radius its circumradius.

    Accuracy with the default number of nodes: round-off for boxes whose axes are parallel or that do not touch, and for
    bodies that do not touch.
    """
    if not all(isinstance(part.body, Box) for part in (body, *sources)):
        return cell_moments(body, np.zeros(3), sources, degree, cells_of(body.body, np.inf), nodes)[0]
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


def cell_moments(
    body: Magnet, rest: Array, sources: Sequence[Magnet], degree: int, cells: Cells, nodes: int | None = None
) -> list[Coefficients]:
    """Coefficients (T) of (μ - 1) H0 and of a uniform `rest` (3,) T in body axes, of every cell of any body.

    By integrals over the volume, graded towards edges and faces.
    """
    others = [source.body for source in sources]
    enough = enough_nodes(degree) if len(cells.radii) == 1 else CELL_NODES
    points, weights = volume_rule(body.body, others, nodes or enough)
    susceptibility = body.permeability_in_rotor - np.eye(3)
    field = remanent_field(sources, points) @ susceptibility + body.body.rotation @ rest
    return by_cells(points, weights, field, cells, degree)


def by_cells(points: Array, weights: Array, field: Array, cells: Cells, degree: int) -> list[Coefficients]:
    """Coefficients (T) of every cell, of a magnetisation (n, 3) T at points (n, 3) m with weights (n,) m³."""
    owner = cells.which(points)
    return [
        moments_of_magnetization(points[mine], weights[mine], field[mine], center, float(radius), degree)
        for k, (center, radius) in enumerate(zip(cells.centers, cells.radii, strict=True))
        for mine in (owner == k,)
    ]


def uniform_cells(magnet: Magnet, nearest: float) -> list[MultipoleExpansion]:
    """The remanent polarisation of a round magnet (μr = 1) as expansions that converge from `nearest` (m) on.

    With `CELL_DEGREE`, to 1e-6 of the field there; a sphere is one dipole.
    """
    if isinstance(magnet.body, Sphere):
        return [uniform_moments(magnet, 1)]
    cells = cells_of(magnet.body, nearest)
    if len(cells.radii) == 1:
        return [uniform_moments(magnet, CELL_DEGREE)]
    points, weights = volume_rule(magnet.body, (), CELL_NODES)
    field = np.broadcast_to(magnet.polarization_in_rotor, points.shape)
    found = by_cells(points, weights, field, cells, CELL_DEGREE)
    return [MultipoleExpansion(c, float(r), part) for c, r, part in zip(cells.centers, cells.radii, found, strict=True)]


def closed_moments(
    body: Magnet, rest: Array, sources: Sequence[Magnet], degree: int, nodes: int | None = None
) -> Coefficients:
    """As `induced_moments`, and those of a uniform polarisation `rest` (3,) T in body axes beside."""
    uniform = uniform_moments(Magnet(body.box, rest), degree).coefficients
    return np.asarray(induced_moments(body, sources, degree, nodes) + uniform)


def first_order_moments(body: Magnet, sources: Sequence[Magnet], degree: int) -> Coefficients:
    """What the permeability of a body adds, to a few per cent: (μ - 1) H0 / (1 + χ/3), χ the largest of μ - 1.

    A part, whose H0 has no closed form, counts as the cuboid of its volume with the proportions of the box about it.
    """
    return induced_moments(body, [_closed(source) for source in sources], degree) / (1 + body.contrast / 3)


def _closed(magnet: Magnet) -> Magnet:
    if not isinstance(magnet.body, Part):
        return magnet
    box = magnet.box
    size = box.size * (magnet.body.volume / box.volume) ** (1 / 3)
    return Magnet(Box(size, box.center, box.rotation), magnet.polarization)


def added_by_closed_form(
    cut: Sequence[Sequence[Magnet]],
    magnets: Sequence[Magnet],
    carriers: Sequence[Magnet],
    degree: int,
    nodes: int | None = None,
    cells: Sequence[Cells] | None = None,
) -> list[Coefficients]:
    """Moments of every cell of every piece that need no elements: (μ - 1) H0 + J - J' of the carriers' H0.

    Without `cells` every piece is one.
    """
    rests = [whole.polarization - carried.polarization for whole, carried in zip(magnets, carriers, strict=True)]
    pieces = [(piece, rest) for whole, rest in zip(cut, rests, strict=True) for piece in whole]
    known = cells or [cells_of(piece.body, np.inf) for piece, _ in pieces]
    found: list[Coefficients] = []
    for (piece, rest), own in zip(pieces, known, strict=True):
        if all(isinstance(part.body, Box) for part in (piece, *carriers)):
            found.append(closed_moments(piece, rest, carriers, degree, nodes))
        else:
            found += cell_moments(piece, rest, carriers, degree, own, nodes)
    return found


def closed_part(
    cut: Sequence[Sequence[Magnet]],
    magnets: Sequence[Magnet],
    carriers: Sequence[Magnet],
    degree: int,
    cells: Sequence[Cells] | None = None,
) -> tuple[list[Coefficients], list[Coefficients]]:
    """`added_by_closed_form` and its error: round-off, but for bodies in contact the step to finer rules.

    Parallel boxes may touch.
    """
    if not oblique_contact([magnet.body for magnet in magnets]):
        closed = added_by_closed_form(cut, magnets, carriers, degree, None, cells)
        return closed, [np.zeros_like(c) for c in closed]
    only_faces = all(magnet.isotropic and isinstance(magnet.body, Box) for magnet in magnets)
    rules = OBLIQUE_NODES if only_faces else OBLIQUE_NODES_ANISOTROPIC
    coarse, fine = (added_by_closed_form(cut, magnets, carriers, degree, nodes, cells) for nodes in rules)
    return fine, [b - a for a, b in zip(coarse, fine, strict=True)]
