"""Export of eddy-current fields to VTU on a regular grid of points, for ParaView and PyVista."""

from collections.abc import Sequence
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from .fields import current_density, reaction_flux_density
from .solver import EddyResponse
from .space import Source

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])


def write_vtu(
    path: Path, response: EddyResponse, sources: Sequence[Source], amplitudes: ArrayLike, axes: Sequence[Array]
) -> None:
    """Write J (A/m²) and the eddy currents' B (T), real and imaginary parts, on the grid of `axes`.

    Parameters
    ----------
    sources : those that `response` was solved for
    amplitudes : (n,) complex factor of each
    axes : grid coordinates along x, y and z, m, in the frame of the mesh; at least two each
    """
    shape = tuple(len(axis) for axis in axes)
    if min(shape) < 2:
        raise ValueError(f"Input axes must have at least two coordinates each; instead received {shape}.")
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    factors = np.asarray(amplitudes, complex)
    potentials = np.array([source.vector_potential(points) for source in sources])
    applied = np.tensordot(factors, potentials, axes=1)
    current = current_density(response, applied, factors, points)
    flux = reaction_flux_density(response, factors, points)
    numbers = np.arange(len(points)).reshape(shape)
    cells = np.stack([numbers[tuple(slice(c, n - 1 + c) for c, n in zip(corner, shape, strict=True))].ravel()
                      for corner in CORNERS], axis=1)  # fmt: skip
    data = {"J_real": current.real, "J_imag": current.imag, "B_real": flux.real, "B_imag": flux.imag}
    meshio.Mesh(points, [("hexahedron", cells)], point_data=data).write(path)
