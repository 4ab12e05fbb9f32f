"""What the edges of a plate change of an infinite slab's reaction."""

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Plate

EDGES = 5.0
"""Change of an infinite slab's reaction by the edges, in units of the source's share beyond them: in 82 comparisons
with finite elements at most 1.4 at 100 Hz, 1.9 at 5 Hz and, where resistance alone rules in thin plates, 4.5 at 0.5 Hz.
"""


def edge_error(plate: Plate, place: Array) -> float:
    """Estimated relative error of an infinite slab's reaction for a plate with edges, at most 1.

    It goes with the share of the source's squared potential that lies beyond the edges at the far face, for a
    source at `place` (3,) m.  Summed over the dipole's directions that falls as 1/r⁴, whose integral over the plane is
    π/depth².
    """
    body, normal = plate.box.to_body(place), int(np.argmin(plate.box.size))
    depth = abs(float(body[normal])) + plate.box.half_edges[normal]
    centre, half = np.delete(body, normal), np.delete(plate.box.half_edges, normal)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    lower, upper = np.arcsinh((-half - centre) / depth), np.arcsinh((half - centre) / depth)
    u = (lower + upper)[:, None] / 2 + (upper - lower)[:, None] / 2 * nodes
    (x, y), (wx, wy) = np.sinh(u), np.cosh(u) * weights * (upper - lower)[:, None] / 2
    inside = float(wx @ (1 + x[:, None] ** 2 + y**2) ** -2 @ wy)
    return min(1.0, EDGES * (1 - inside / np.pi))
