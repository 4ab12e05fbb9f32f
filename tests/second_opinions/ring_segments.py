"""A permeable ring that answers to a dipole: an integral equation with segments of uniform magnetisation.

No finite elements and nothing of the program: P = χ (B0 + N P) for the polarisation P in a field B0 of outer sources,
with N, the segments' own field, from magpylib (F. Slanovc, J. Magn. Magn. Mater. 559, 169482 (2022)).  The part χ B0,
nearly all of it, is integrated as it is: only the χ² part of the answer feels that P is taken uniform in segments.
"""

from itertools import pairwise, product

import magpylib
import numpy as np

MU_0 = 4e-7 * np.pi
NODES, OWN_NODES = 6, 2
"""Gauss's points along each edge of a segment for the outer field, and for the segments' own."""


class RingOfSegments:
    """A ring about the z axis: inner and outer radius, height (m), χ, and segments along radius, angle and height."""

    def __init__(self, inner, outer, height, susceptibility, counts=(2, 16, 2)):
        radii, angles, heights = (
            np.linspace(0.0, 1.0, n + 1) * size + low
            for n, size, low in zip(counts, (outer - inner, 2 * np.pi, height), (inner, 0.0, -height / 2), strict=True)
        )
        self.susceptibility, sectors = susceptibility, counts[1]
        cells = [(*r, *angles[:2], *z) for r, z in product(pairwise(radii), pairwise(heights))]
        turns = [np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]) for a in angles[:-1]]
        self.fine, self.volumes = _all_round(turns, *_points(cells, NODES))
        own, shares = _all_round(turns, *_points(cells, OWN_NODES))
        shares = shares / shares.sum(axis=2, keepdims=True)
        first = np.array(
            [[_field(cell, axis, own) for axis in np.eye(3)] for cell in cells]
        )  # k, a, sector, i, point, b
        first = np.einsum("kasipb,sip->sibka", first, shares)
        size = 3 * len(cells)
        own = np.zeros((sectors, size, sectors, size))
        for s, t in product(range(sectors), range(sectors)):
            block = np.einsum("bc,ickd,ad->ibka", turns[s], first[(t - s) % sectors], turns[s])
            own[t, :, s, :] = block.reshape(size, size)
        self.own = own.reshape(sectors * size, -1)

    def tensor(self, place):
        """K (3, 3): the ring's energy for a dipole m (A m²) at a place (3,) m is -½ m·K m."""
        away = self.fine - place
        distance = np.linalg.norm(away, axis=-1)[..., None]
        fields = [1e-7 * (3 * away * away[..., a : a + 1] / distance**5 - np.eye(3)[a] / distance**3) for a in range(3)]
        direct = np.einsum("asipb,csipb,sip->ac", fields, fields, self.volumes)
        totals = self.volumes.sum(axis=2)
        means = np.einsum("asipb,sip->asib", fields, self.volumes) / totals[..., None]
        chi, flat = self.susceptibility, means.reshape(3, -1)
        polarized = np.linalg.solve(np.eye(len(self.own)) - chi * self.own, chi * flat.T)
        beyond = (flat * np.repeat(totals.ravel(), 3)) @ (self.own @ polarized)
        return chi * (direct + (beyond + beyond.T) / 2) / MU_0


def _points(cells, nodes):
    """Gauss's points (k, p, 3) of segments and their volumes (k, p)."""
    at, weights = np.polynomial.legendre.leggauss(nodes)
    shares = np.array(list(product((at + 1) / 2, repeat=3)))
    parts = np.prod(list(product(weights / 2, repeat=3)), axis=1)
    low, high = (np.array(cells)[:, k::2][:, None] for k in (0, 1))
    radius, angle, height = np.moveaxis(low + shares * (high - low), 2, 0)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=2)
    return points, parts * radius * np.prod(high - low, axis=2)


def _all_round(turns, points, volumes):
    return np.array([points @ turn.T for turn in turns]), np.array([volumes for _ in turns])


def _field(cell, polarization, points):
    """μ0 H (…, 3) T of a segment with a polarisation (3,) of 1 T."""
    inner, outer, begin, end, low, high = cell
    segment = magpylib.magnet.CylinderSegment(
        dimension=(inner, outer, high - low, *np.degrees([begin, end])),
        polarization=polarization,
        position=(0, 0, (low + high) / 2),
    )
    return MU_0 * segment.getH(points.reshape(-1, 3)).reshape(points.shape)
