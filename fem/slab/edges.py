"""What the edges of a plate change of an infinite slab's reaction: a bound, and measured by coarse finite elements.

Both solutions, with and without edges on the same cells, miss alike of what is near the floater, so that their
difference is known far better than either.  They are taken at real shifts s = 2πf, where the reaction is a sum of
positive parts as at iω, for a quarter of the work: of a plate of 100 × 240 × 30 mm, 20 mm away, edges change 9.0 per
cent at s = ω so measured and 7.8 at iω by converged elements.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...geometry.basics import Array
from ...geometry.meshes import MeshRule, plate_mesh
from ...geometry.scenes import Plate
from ..closed_forms import unit_dipoles
from ..eddy_currents import EddySpace, solve_shifted
from ..plate_currents import digest
from ..storage import described, from_cache, program_of, read_checked, write_checked

EDGES = 5.0
"""Change of an infinite slab's reaction by the edges, in units of the source's share beyond them: in 82 comparisons
with finite elements at most 1.4 at 100 Hz, 1.9 at 5 Hz and, where resistance alone rules in thin plates, 4.5 at 0.5 Hz.
"""
ORDER, RULE = 2, MeshRule(reach=4.0)
LOW = 10.0
"""Hz, of the floater's slow motions: edges count more there than at the rotor's frequency."""
DOUBT = 1.5
"""Against converged elements at iω, changes were 0.75 and 0.81 times the truth at 10 Hz, 1.14 to 1.34 at 110 Hz."""
FORMAT = "spinlev edges 1"


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


def measured_edge_error(plate: Plate, places: Array, frequency: float) -> float:
    """Relative error of an infinite slab's reaction at `places` (n, 3) m, for a plate with edges.

    The first place's own tensor at a low frequency and, of a rotor that turns, at `frequency` (Hz), where also the
    field there of dipoles at the others.
    """
    body = plate.box.to_body(places)
    changes = [_change(plate, body[:1], LOW)]
    if frequency:
        changes.append(_change(plate, body, frequency))
    return DOUBT * max(changes)


def _change(plate: Plate, body: Array, frequency: float) -> float:
    with_edges, endless = (
        solve_shifted(
            EddySpace(plate_mesh(plate.box.size, plate.conductivity, body, frequency, RULE, without), ORDER),
            2 * np.pi * frequency,
            unit_dipoles(body),
        ).couplings[:3]
        for without in (False, True)
    )
    parts = [part.reshape(3, -1, 3) for part in (with_edges - endless, endless)]
    changes, sizes = (np.linalg.norm(part, axis=(0, 2)) for part in parts)
    return float(np.max(changes / sizes))


def cached_edge_error(plate: Plate, places: Array, frequency: float, report: Callable[[str], None]) -> float:
    """`measured_edge_error` at places and frequency rounded to 0.1 mm and 1 Hz, from the cache if it is there."""
    places, frequency = np.round(places, 4), float(round(frequency))
    body = plate.box.to_body(places)
    key = digest(f"{FORMAT} {program_of(__package__)}", [plate.box.size, [plate.conductivity, frequency], body])

    def save(error: float, path: Path) -> None:
        write_checked(described({"error": ((), error, "1")}, {"format": FORMAT}), path)

    return from_cache(
        f"edges-{key}.nc",
        lambda path: float(read_checked(path, FORMAT)["error"]),
        lambda: measured_edge_error(plate, places, frequency),
        save,
        report,
    )[0]
