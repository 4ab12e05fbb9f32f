"""How well a plate's current space holds the currents of sources that it was not made for.

The potential of such a source at the plate is taken as a sum over that of dipoles at the space's probes, whose
residuals are known, and a rest.  Galerkin's orthogonality bounds the error of its field at a dipole by ω |ρ_d| times
the residual of any field in the space: that of the sum of the dipoles' fields is theirs and the whole rest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import Array
from ..eddy_currents import Source, dipole_images
from .current_space import CurrentSpace, source_images
from .solution import PlateSolution

INDEPENDENT = 1e-9
"""Combinations of dipoles with less than this share of the largest squared potential are left out."""


def error_of(solution: PlateSolution, sources: Sequence[Source]) -> float:
    """Bound of the largest relative error of the sources' fields at the probes in the first box.

    Parameters
    ----------
    sources : in the plate's frame; dipoles in the second box stand for them
    """
    inside = solution.boxes[0].contains(solution.probes)
    standing = solution.boxes[1].contains(solution.probes)
    images = np.concatenate(list(source_images(solution.space.parity, solution.space.points, sources)), axis=1)
    amplitudes, rest = _fitted(solution.space, solution.probes[standing], images)
    stands, hears = np.repeat(standing, 3), np.repeat(inside, 3)
    driving = solution.space.image_couplings([images])
    testing = solution.space.dipole_couplings(solution.probes[inside])
    worst = 0.0
    for omega, residuals in zip(solution.angular_frequencies, solution.residuals, strict=True):
        left = np.sqrt(np.sum(amplitudes @ residuals[np.ix_(stands, stands)].real * amplitudes, axis=1)) + rest
        fields = sum(
            d @ np.linalg.solve(np.eye(len(induct)) + 1j * omega * induct, t.T)
            for d, t, induct in zip(driving, testing, solution.space.inductances, strict=True)
        )
        errors = (
            left * np.sqrt(np.trace(residuals[np.ix_(hears, hears)]).real) / np.linalg.norm(np.asarray(fields), axis=1)
        )
        worst = max(worst, float(errors.max()))
    return worst


def _fitted(space: CurrentSpace, places: Array, images: Array) -> tuple[Array, Array]:
    """Amplitudes (sources, 3 × places) of dipoles that stand for the sources, and norms (sources,) of the rest."""
    wanted = images.reshape(*images.shape[:2], -1)
    standing = np.concatenate(
        [p.reshape(len(p), -1, space.root.size) for p in dipole_images(space.parity, space.points, places)], axis=1
    )
    squares = space.root**2
    products = sum((part * squares) @ part.T for part in standing)
    overlaps = sum((part * squares) @ other.T for part, other in zip(standing, wanted, strict=True))
    energies, vectors = np.linalg.eigh(np.asarray(products))
    kept = energies > INDEPENDENT * energies[-1]
    amplitudes = (vectors[:, kept] / energies[kept] @ vectors[:, kept].T @ np.asarray(overlaps)).T
    powers = np.zeros(images.shape[1])
    for part, other in zip(standing, wanted, strict=True):
        powers += ((other - amplitudes @ part) ** 2) @ squares
    return amplitudes, np.sqrt(powers)
