"""Permeable cylinders and rings polarised along their axis, by their surface charge: no mesh, no elements.

With σ = μ0 M·n the charge (T) of the magnetisation μ0 M = J + (μ - 1) μ0 H, whose divergence is zero,

    σ (1 + χ/2) - χ n·PV∫ K σ = J·n,        χ = μ - 1,

on the meridian, K the field of a charged circle. Panels shrink by halves towards the edges, where σ goes as a power of
the distance; on each σ is a polynomial through Gauss's points. Where a panel is near to a point its integral is one
over pieces that shrink towards that point.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

NODES, LEVELS, FINE = 8, 20, 10
"""Gauss's points on a panel, halvings towards an edge, and points on each piece of a near panel."""
NEAR, PIECES = 1.5, 18
"""Distance, in panels' lengths, within which a panel is near; halvings towards the point."""
LEGENDRE = np.polynomial.legendre.leggauss(NODES)


def circle_field(across, height, radius):
    """H (T) across the axis and along it of circles of charge, 1 T m a circle's length, at heights from them."""
    square, apart = (across + radius) ** 2 + height**2, (across - radius) ** 2 + height**2
    rest = apart / square
    first, second = scipy.special.ellipkm1(rest), scipy.special.ellipe(1 - rest)
    root = np.sqrt(square)
    along = radius / np.pi * height * second / (root * apart)
    outward = first - second * (radius**2 - across**2 + height**2) / apart
    return radius * outward / (2 * np.pi * np.maximum(across, 1e-300) * root), along


@dataclass
class RoundMagnet:
    """Of an outer and an inner radius (0: none) and a height, m, about the origin, polarised along z (T).

    `parts` (6, n): both ends of each panel on the meridian (across, along), and its normal.
    """

    radius: float
    inner_radius: float
    height: float
    polarization: float
    permeability: float

    def __post_init__(self):
        r, a, h = self.radius, self.inner_radius, self.height / 2
        sides = [((a, h), (r, h), (0, 1)), ((r, h), (r, -h), (1, 0)), ((r, -h), (a, -h), (0, -1))]
        sides += [((a, -h), (a, h), (-1, 0))] if a else []
        self.parts = np.array([panel for side in sides for panel in self._panels(*side)])
        t = LEGENDRE[0]
        ends = self.parts[:, :2], self.parts[:, 2:4]
        places = ends[0][:, None] + (t[:, None] + 1) / 2 * (ends[1] - ends[0])[:, None]
        self.places = places.reshape(-1, 2)
        normals = np.repeat(self.parts[:, 4:], NODES, axis=0)
        chi = self.permeability - 1
        matrix = np.empty((len(self.places),) * 2)
        for row in range(len(self.places)):
            field = self._columns(self.places[row])
            matrix[row] = -chi * normals[row] @ field
        matrix[np.diag_indices_from(matrix)] += 1 + chi / 2
        self.charge = np.linalg.solve(matrix, self.polarization * normals[:, 1])

    def _panels(self, start, end, normal):
        """Panels of a straight side, halved towards its ends where they are edges."""
        start, end = np.array(start), np.array(end)
        steps = 0.5 ** np.arange(LEVELS, 0, -1)
        first = np.concatenate([[0.0], steps]) if start[0] else np.array([0.0, 0.25, 0.5])
        last = 1 - np.concatenate([[0.0], steps])[::-1] if end[0] else np.array([0.5, 0.75, 1.0])
        lines = np.unique(np.concatenate([first, last]))
        return [(*(start + s * (end - start)), *(start + t * (end - start)), *normal) for s, t in pairwise(lines)]

    def _columns(self, point):
        """H (2, n) at a point of the meridian of a charge of 1 T at each node."""
        field = np.empty((2, len(self.parts), NODES))
        start, way = self.parts[:, :2], self.parts[:, 2:4] - self.parts[:, :2]
        length = np.linalg.norm(way, axis=1)
        foot = np.clip(np.sum((point - start) * way, axis=1) / length**2, 0, 1)
        near = np.linalg.norm(start + foot[:, None] * way - point, axis=1) < NEAR * length
        weight = LEGENDRE[1]
        places = self.places.reshape(-1, NODES, 2)
        with np.errstate(divide="ignore", invalid="ignore"):  # at the point's own node, which is near
            parts = circle_field(point[0], point[1] - places[..., 1], places[..., 0])
        field[:] = np.array(parts) * weight / 2 * length[:, None]
        for k in np.flatnonzero(near):
            s, share = _pieces(foot[k])
            places = start[k] + s[:, None] * way[k]
            parts = np.array(circle_field(point[0], point[1] - places[:, 1], places[:, 0]))
            own = abs((point - start[k]) @ self.parts[k, 4:]) < 1e-13 * self.height
            if own:  # across its own side: of a plane nothing, of a mantle what its curvature makes
                parts[int(self.parts[k, 4] == 0)] *= float(self.parts[k, 4] != 0)
            field[:, k] = (parts * share * length[k]) @ _lagrange(2 * s - 1)
        return field.reshape(2, -1)

    def flux_density(self, points):
        """B (n, 3) T at points (n, 3) m off the surface."""
        found = []
        for point in np.asarray(points, float):
            across = np.hypot(*point[:2])
            outward, along = self._columns(np.array([max(across, 1e-12), point[2]])) @ self.charge
            field = np.array([*(outward * point[:2] / max(across, 1e-12)), along])
            inside = self.inner_radius < across < self.radius and abs(point[2]) < self.height / 2
            found.append(self.permeability * field + [0, 0, self.polarization] if inside else field)
        return np.array(found)


def _pieces(foot):
    """Places (n,) in 0 … 1 and weights of Gauss's rule on pieces that shrink towards a place, an end of two of them."""
    steps = np.concatenate([[0.0], 0.5 ** np.arange(PIECES, -1, -1.0)])
    lines = np.unique(np.concatenate([foot - foot * steps, foot + (1 - foot) * steps]))
    t, weight = np.polynomial.legendre.leggauss(FINE)
    lower, width = lines[:-1], np.diff(lines)
    return (lower[:, None] + width[:, None] * (t + 1) / 2).ravel(), (width[:, None] * weight / 2).ravel()


def _lagrange(places):
    """Values (n, NODES) of the polynomials through Gauss's points at places in -1 … 1."""
    vandermonde = np.polynomial.legendre.legvander(LEGENDRE[0], NODES - 1)
    return np.linalg.solve(vandermonde.T, np.polynomial.legendre.legvander(places, NODES - 1).T).T
