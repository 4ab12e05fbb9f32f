"""The field of magnets without permeability by Coulomb's law, in 80-bit numbers: slow, and without cancellation."""

from itertools import product

import numpy as np

from ...geometry.basics import Array
from ...geometry.bodies import Magnet

NODES = 60
"""A side of the Gauss rule on a face; farther than 1.2 half edges from the faces its error is below 1e-40."""


def coulomb_field(magnet: Magnet, points: Array) -> Array:
    """B (n, 3) T of a uniformly polarised box at points (n, 3) m outside: the charges J·n of its faces."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    v, w = np.meshgrid(nodes, nodes, indexing="ij")
    weight = np.longdouble(weights[:, None] * weights) / (4 * np.longdouble(np.pi))
    half = magnet.box.half_edges
    field = np.zeros((len(points), 3), dtype=np.longdouble)
    for axis, side in product(range(3), (-1, 1)):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        source = np.zeros((NODES, NODES, 3), dtype=np.longdouble)
        source[..., axis], source[..., b], source[..., c] = side * half[axis], v * half[b], w * half[c]
        charge = side * magnet.polarization[axis] * half[b] * half[c] * weight
        for k, seen in enumerate(magnet.box.to_body(points)):
            arm = seen - source
            field[k] += np.sum((charge / np.sum(arm**2, axis=-1) ** 1.5)[..., None] * arm, axis=(0, 1))
    return np.asarray(field.astype(float) @ magnet.box.rotation.T)
