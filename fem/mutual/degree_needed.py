"""How many degrees the expansion of the magnets' field about the floater's centre needs."""

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import Array, Box, Solid, Sphere
from ...geometry.bodies import Magnet
from ..harmonics import Ball

DEGREES = range(6, 41)


def singular_ratio(magnets: Sequence[Magnet], ball: Ball) -> float:
    """Radius over the distance of the centre from the nearest edge of a magnet.

    The field continues analytically across a face, so that edges alone bound the convergence of its expansion, and the
    centre of a sphere or the axis of a cylinder; 1 in contact with an edge.
    """
    nearest = min(_singular_distance(magnet.body, ball.center) for magnet in magnets)
    return min(ball.radius / nearest, 1.0)


def enough_degree(magnets: Sequence[Magnet], ball: Ball, rtol: float = 1e-9) -> int:
    """Degree l at which ρ^2l, the share of degree l in the force, has fallen below `rtol`; between 6 and 40."""
    ratio = min(singular_ratio(magnets, ball), 0.99)
    return int(np.clip(np.ceil(np.log(rtol) / (2 * np.log(ratio))), DEGREES[0], DEGREES[-1]))


def _singular_distance(body: Solid, place: Array) -> float:
    """Distance (m) of a place (3,) m from where the field of a body cannot be continued."""
    local, half = body.to_body(place), body.half_edges
    if isinstance(body, Box):
        return float(body.edge_distance(place[None])[0])
    if isinstance(body, Sphere):
        return float(np.linalg.norm(local))
    across = float(np.hypot(local[0], local[1]))
    beyond = max(abs(float(local[2])) - float(half[2]), 0.0)
    return float(min(np.hypot(across, beyond), body.edge_distance(place[None])[0]))
