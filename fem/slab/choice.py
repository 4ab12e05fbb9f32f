"""Which model of the plate a scene needs, and what the edges change of an infinite slab's reaction."""

import numpy as np

from ...geometry.basics import MU_0, Array
from ...geometry.scenes import Plate, Scene

EDGES = 5.0
"""Change of an infinite slab's reaction by the edges, in units of the source's share beyond them: in 82 comparisons
with finite elements at most 1.4 at 100 Hz, 1.9 at 5 Hz and, where resistance alone rules in thin plates, 4.5 at 0.5 Hz.
"""
NEGLIGIBLE = 1e-6
"""Part of the floater's weight below which the largest conceivable force of the plate is left out."""


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


def resolve_plate_model(scene: Scene, model: str, place: Array | None, rtol: float) -> tuple[str, str]:
    """The plate's model in the motion, and the reason in words.

    `auto` is none where even a perfect conductor's image would not be felt, the infinite slab where the edges are too
    far to matter, and else the reduced network of the finite elements.
    """
    plate = scene.plate
    if plate is None:
        return "none", "the scene has no plate"
    if place is None:
        return "none", "there is no equilibrium around which to make a table"
    if model == "fem":
        return "reduced", "in the motion the finite elements enter by their reduced network"
    if model != "auto":
        return model, "as asked"
    gap = float(plate.box.distance(place))
    mirror = 3 * MU_0 * scene.floater.moment**2 / (32 * np.pi * gap**4)
    weight = scene.floater.mass * float(np.linalg.norm(scene.gravity) or 9.81)
    if mirror < NEGLIGIBLE * weight:
        return "none", f"at {gap * 1e3:.3g} mm the plate pushes with less than {NEGLIGIBLE:.0e} of the weight"
    body, normal = plate.box.to_body(place), int(np.argmin(plate.box.size))
    if abs(body[normal]) > plate.box.half_edges[normal]:
        error = edge_error(plate, place)
        if error <= rtol:
            return "slab", f"the plate's edges take at most {error:.1e} of its reaction"
        return "reduced", f"edges may take {error:.1e} of an infinite slab's reaction, {rtol:.1e} is allowed"
    return "reduced", "the floater is beside the plate's edge"
