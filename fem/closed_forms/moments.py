"""Moments of what closed-form fields magnetise, by Gauss rules pressed towards their kinks and logarithms."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ...geometry.common import Array
from ...geometry.cutting import Cells, cells_of
from ...geometry.magnets import Magnet
from ...geometry.meshes.solids import part_rule
from ...geometry.overlap import separation
from ...geometry.shapes import Box, Sphere
from ...geometry.solids import Part, Solid, moved
from ..harmonics import expansion
from ..harmonics.expansion import MultipoleExpansion, uniform_moments
from ..harmonics.solid import Coefficients, gauss_legendre
from .uniform import demagnetizing_tensor, remanent_field, remanent_potential

PART_ORDER = 20  # of the rule over a part
NEAR = 0.1  # gaps below this part of the shortest edge are as contact to a rule


def enough_nodes(degree: int) -> int:
    """Nodes per panel for solid harmonics up to a degree beside such a field: round-off."""
    return max(20, degree + 6)


def oblique_contact(bodies: Sequence[Solid]) -> bool:
    """Whether two bodies but parallel boxes (nearly) touch: then kinks run across the panels of the rules."""
    oblique = (pair for pair in combinations(bodies, 2) if not parallel(*pair))
    return any(separation(a, b)[0] < NEAR * min(a.size.min(), b.size.min()) for a, b in oblique)


def parallel(first: Solid, second: Solid) -> bool:
    """Whether both are boxes, of the same axes."""
    along = np.abs(first.rotation.T @ second.rotation).max(axis=0)
    return isinstance(first, Box) and isinstance(second, Box) and np.allclose(along, 1, rtol=0, atol=1e-12)


def graded_rule(breaks: Array, nodes: int) -> tuple[Array, Array]:
    """Points and weights on panels between `breaks`, by x = (15 t - 10 t³ + 3 t⁵)/8: t log t at ends to nodes⁻¹²."""
    t, weights = gauss_legendre(nodes)
    place, weight = (15 * t - 10 * t**3 + 3 * t**5) / 8, 1.875 * weights * (1 - t * t) ** 2
    middle, half = (breaks[1:] + breaks[:-1]) / 2, np.diff(breaks) / 2
    return (middle[:, None] + half[:, None] * place).ravel(), (half[:, None] * weight).ravel()


def panel_breaks(box: Box, others: Sequence[Solid]) -> list[Array]:
    """Ends of the panels along each body axis: the faces, and where faces of parallel boxes lie between them."""
    result = []
    corners = [np.zeros((0, 3)), *(box.to_body(other.corners) for other in others if parallel(box, other))]
    for half, places in zip(box.half_edges, np.concatenate(corners).T, strict=True):
        ordered = np.unique(np.append(places[np.abs(places) < half * (1 - 1e-9)], [-half, half]))
        result.append(ordered[np.diff(ordered, prepend=-np.inf) > 1e-9 * half])
    return result


def face_rule(box: Box, others: Sequence[Solid], nodes: int) -> tuple[Array, Array]:
    """Points (n, 3) m on a `box`'s faces, outward normals times weight; `others`, `nodes`: as of `volume_rule`."""
    rules = [graded_rule(breaks, nodes) for breaks in panel_breaks(box, others)]
    points, areas = [], []
    for axis in range(3):
        second, third = (axis + 1) % 3, (axis + 2) % 3
        v, w = np.meshgrid(rules[second][0], rules[third][0], indexing="ij")
        weight = np.outer(rules[second][1], rules[third][1]).ravel()
        for side in (-1, 1):
            face = np.zeros((v.size, 3))
            face[:, axis], face[:, second], face[:, third] = side * box.half_edges[axis], v.ravel(), w.ravel()
            points.append(box.center + face @ box.rotation.T)
            areas.append(side * weight[:, None] * box.rotation[:, axis])
    return np.concatenate(points), np.concatenate(areas)


def volume_rule(body: Solid, others: Sequence[Solid], nodes: int) -> tuple[Array, Array]:
    """Points (n, 3) m inside a `body` and weights (n,) m³, graded towards faces and edges, by panels of `nodes`.

    They end where faces of the `others`, which make the field, lie across a box.
    """
    if isinstance(body, Box):
        return expansion.box_rule(body, [graded_rule(breaks, nodes) for breaks in panel_breaks(body, others)])
    if isinstance(body, Part):
        return part_rule(body, PART_ORDER)
    if isinstance(body, Sphere):
        radial, other = graded_rule(np.array([0.0, body.radius]), nodes), expansion.gauss(-1.0, 1.0, nodes)
    else:
        radial = graded_rule(np.array([body.inner_radius, body.radius]), nodes)
        other = graded_rule(np.array([-0.5, 0.5]) * body.height, nodes)
    return expansion.round_rule(body, radial, other, 2 * nodes)


NODES = 6  # of the rule for N, which need not be exact: elements and moments make up for it
# Of the rule over a body of several cells, where high degrees only place the sum of its cells' fields; and degree
CELL_NODES, CELL_DEGREE = 28, 40
# Of the rules for boxes that touch without being parallel, over faces, and in volumes where faces do not suffice. A 6
# mm cube across the face of a 10 mm one: 5e-7 of B is wrong with 40 and 64, 9e-8 with 96, 4e-8 with 128.
OBLIQUE_NODES, OBLIQUE_NODES_ANISOTROPIC = (96, 128), (40, 64)


def carrier(magnet: Magnet) -> Magnet:
    """See `carriers_of`."""
    return carriers_of([magnet])[0]


def carriers_of(magnets: Sequence[Magnet]) -> tuple[Magnet, ...]:
    """The magnets with μr = 1 and mean polarisations J'; a part, left to the elements, has none."""
    found = [Magnet(one.body, np.zeros(3)) if isinstance(one.body, Part) else one for one in magnets]
    for k, one in ((k, one) for k, one in enumerate(found) if one.contrast):
        upright, turn = moved(one.body, np.zeros(3), np.eye(3)), one.body.rotation
        points, weights = volume_rule(upright, (), NODES)
        # mean demagnetising tensor N in body axes, mean H = -N J; its trace is 1
        diagonal = -np.einsum("n,nii->i", weights, demagnetizing_tensor(upright, points))
        susceptibility = turn.T @ (one.permeability_in_rotor - np.eye(3)) @ turn
        factors = np.eye(3) + susceptibility * (diagonal / diagonal.sum())
        found[k] = Magnet(one.body, np.linalg.solve(factors, one.polarization))
    return tuple(found)


def induced_moments(body: Magnet, sources: Sequence[Magnet], degree: int, nodes: int | None = None) -> Coefficients:
    """Coefficients (T) of (μ - 1) H0 in a body, about its centre with radius its circumradius.

    Because the harmonics have no Laplacian, faces and H0's potential suffice for boxes. H0 is that of `sources`,
    magnets with μr = 1. They are up to a `degree`; `nodes` are of each panel of the rule (None: enough for round-off,
    but where boxes of other axes, or other bodies, touch).
    """
    if not all(isinstance(part.body, Box) for part in (body, *sources)):
        return cell_moments(body, np.zeros(3), sources, degree, cells_of(body.body, np.inf), nodes)[0]
    box, nodes = body.box, nodes or enough_nodes(degree)
    others = [source.box for source in sources]
    points, areas = face_rule(box, others, nodes)
    flux = -remanent_potential(sources, points)[:, None] * areas
    susceptibility = body.permeability_in_rotor - np.eye(3)
    sphere = (box.center, box.circumradius)
    result = expansion.moments_of_magnetization(points, np.ones(len(points)), flux @ susceptibility, *sphere, degree)
    if not body.isotropic:
        points, weights = volume_rule(box, others, nodes)
        source = weights * remanent_potential(sources, points)
        result += expansion.curvature_moments(points, source, susceptibility, *sphere, degree)
    return result


def cell_moments(
    body: Magnet, rest: Array, sources: Sequence[Magnet], degree: int, cells: Cells, nodes: int | None = None
) -> list[Coefficients]:
    """`induced_moments` and those of a uniform `rest` (3,) T, of each of `cells` of any `body`.

    By integrals over the volume; `sources`, `degree` and `nodes` are as there.
    """
    others = [source.body for source in sources]
    enough = enough_nodes(degree) if len(cells.radii) == 1 else CELL_NODES
    points, weights = volume_rule(body.body, others, nodes or enough)
    susceptibility = body.permeability_in_rotor - np.eye(3)
    field = remanent_field(sources, points) @ susceptibility + body.body.rotation @ rest
    return by_cells(points, weights, field, cells, degree)


def by_cells(points: Array, weights: Array, field: Array, cells: Cells, degree: int) -> list[Coefficients]:
    """Coefficients (T), up to a `degree` and cell by cell, of a magnetisation in the nearest of `cells`.

    It is `field`, μ0 M (n, 3) T, at `points` (n, 3) m with `weights` (n,) m³.
    """
    owner = cells.which(points)
    return [
        expansion.moments_of_magnetization(points[mine], weights[mine], field[mine], center, float(radius), degree)
        for k, (center, radius) in enumerate(zip(cells.centers, cells.radii, strict=True))
        for mine in (owner == k,)
    ]


def uniform_cells(magnet: Magnet, nearest: float) -> list[MultipoleExpansion]:
    """The remanent polarisation of a round magnet as expansions that are right to 1e-6 from `nearest` (m) on."""
    if isinstance(magnet.body, Sphere):
        return [uniform_moments(magnet, 1)]
    cells = cells_of(magnet.body, nearest)
    if len(cells.radii) == 1:
        return [uniform_moments(magnet, CELL_DEGREE)]
    points, weights = volume_rule(magnet.body, (), CELL_NODES)
    field = np.broadcast_to(magnet.polarization_in_rotor, points.shape)
    found = by_cells(points, weights, field, cells, CELL_DEGREE)
    return [MultipoleExpansion(c, float(r), part) for c, r, part in zip(cells.centers, cells.radii, found, strict=True)]


def first_order_moments(body: Magnet, sources: Sequence[Magnet], degree: int) -> Coefficients:
    """What a permeability adds, to a few per cent: `induced_moments` over 1 + χ/3, χ the largest of μ - 1.

    A part of a `body`, without closed form, counts as a cuboid of its box's proportions; `sources`, `degree`: as there.
    """
    closed = list(sources)
    for k, (magnet, box) in enumerate((magnet, magnet.box) for magnet in sources):
        if isinstance(magnet.body, Part):
            size = box.size * (magnet.body.volume / box.volume) ** (1 / 3)
            closed[k] = Magnet(replace(box, size=size), magnet.polarization)
    return induced_moments(body, closed, degree) / (1 + body.contrast / 3)


def added_by_closed_form(
    cut: Sequence[Sequence[Magnet]],
    magnets: Sequence[Magnet],
    carriers: Sequence[Magnet],
    degree: int,
    nodes: int | None = None,
    cells: Sequence[Cells] | None = None,
) -> list[Coefficients]:
    """Moments (T) of every cell of every piece that need no elements: (μ - 1) H0 + J - J' of the carriers' H0.

    `cut`: pieces of each of `magnets`; `carriers` have J', see `carriers_of`; `degree`, `nodes`: of `induced_moments`;
    `cells`: of every piece (None: it is one).
    """
    rests = [whole.polarization - carrier.polarization for whole, carrier in zip(magnets, carriers, strict=True)]
    pieces = [(piece, rest) for whole, rest in zip(cut, rests, strict=True) for piece in whole]
    known = cells or [cells_of(piece.body, np.inf) for piece, _ in pieces]
    found: list[Coefficients] = []
    for (piece, rest), own in zip(pieces, known, strict=True):
        if all(isinstance(part.body, Box) for part in (piece, *carriers)):
            uniform = uniform_moments(Magnet(piece.box, rest), degree).coefficients
            found.append(np.asarray(induced_moments(piece, carriers, degree, nodes) + uniform))
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
    """`added_by_closed_form` of `cut`, `magnets`, `carriers`, `degree`, `cells`, and its error."""
    if not oblique_contact([magnet.body for magnet in magnets]):
        closed = added_by_closed_form(cut, magnets, carriers, degree, None, cells)
        return closed, [np.zeros_like(c) for c in closed]
    only_faces = all(magnet.isotropic and isinstance(magnet.body, Box) for magnet in magnets)
    rules = OBLIQUE_NODES if only_faces else OBLIQUE_NODES_ANISOTROPIC
    coarse, fine = (added_by_closed_form(cut, magnets, carriers, degree, nodes, cells) for nodes in rules)
    return fine, [b - a for a, b in zip(coarse, fine, strict=True)]
