"""How many degrees the expansion of the magnets' field about the floater's centre needs."""

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import Array
from ...geometry.bodies import Magnet
from ..harmonics import Ball

DEGREES = range(6, 41)


def singular_ratio(magnets: Sequence[Magnet], ball: Ball) -> float:
    """Radius over the distance of the centre from the nearest edge of a magnet.

    The field continues analytically across a face, so that edges alone bound the convergence of its expansion; 1 in
    contact with an edge.
    """
    nearest = min(_edge_distance(magnet.box.to_body(ball.center), magnet.box.half_edges) for magnet in magnets)
    return min(ball.radius / nearest, 1.0)


def enough_degree(magnets: Sequence[Magnet], ball: Ball, rtol: float = 1e-9) -> int:
    """Degree l at which ρ^2l, the share of degree l in the force, has fallen below `rtol`; between 6 and 40."""
    ratio = min(singular_ratio(magnets, ball), 0.99)
    return int(np.clip(np.ceil(np.log(rtol) / (2 * np.log(ratio))), DEGREES[0], DEGREES[-1]))


def _edge_distance(body: Array, half: Array) -> float:
    """Distance of a point from the edges of a box, both in body axes."""
    to_faces = np.abs(body) - half
    along = np.maximum(to_faces, 0.0)
    squares = [to_faces[(a + 1) % 3] ** 2 + to_faces[(a + 2) % 3] ** 2 + along[a] ** 2 for a in range(3)]
    return float(np.sqrt(min(squares)))
