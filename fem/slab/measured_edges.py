"""What the edges of a plate change, measured: coarse finite elements with and without edges, on the same cells.

Both solutions miss alike of what is near the floater, so that their difference is known far better than either.  They
are taken at real shifts s = 2πf, where the reaction is a sum of positive parts as at iω, for a quarter of the work.
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

ORDER, RULE = 2, MeshRule(reach=4.0)
LOW = 10.0
"""Hz, of the floater's slow motions: edges count more there than at the rotor's frequency."""
DOUBT = 1.5
"""By how much the edges' change may be larger than measured."""
FORMAT = "spinlev edges 1"


def measured_edge_error(plate: Plate, places: Array, frequency: float) -> float:
    """Relative error of an infinite slab's reaction at `places` (n, 3) m, for a plate with edges.

    The first place's own tensor, and the field there of dipoles at the others; at `frequency` (Hz) and a low one.
    """
    body = plate.box.to_body(places)
    return DOUBT * max(_change(plate, body, f) for f in (LOW, frequency))


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
    """`measured_edge_error`, from the cache if it is there; places count to a tenth of a millimetre."""
    rounded = np.round(plate.box.to_body(places), 4)
    key = digest(
        f"{FORMAT} {program_of(__package__)}", [plate.box.size, [plate.conductivity, round(frequency)], rounded]
    )

    def save(error: float, path: Path) -> None:
        write_checked(described({"error": ((), error, "1")}, {"format": FORMAT}), path)

    return from_cache(
        f"edges-{key}.nc",
        lambda path: float(read_checked(path, FORMAT)["error"]),
        lambda: measured_edge_error(plate, places, frequency),
        save,
        report,
    )[0]
