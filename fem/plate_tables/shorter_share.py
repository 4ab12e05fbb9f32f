"""Harmonics of the rotor's share that the floater does not feel.

In a plate at rest the harmonic h of the signals drives the currents y_i = -ihω/(λ_i + ihω) r_i.  High ones are small
signals, and their field decays fast on the way to the floater; in the integration of the motion they cost most of all,
since the fastest motion among all states decides how long a step may be.
"""

from dataclasses import replace

import numpy as np

from ...geometry.basics import Array
from .plate_table import PlateTable
from .share import RotorShare

POINTS = (3, 3, 3)
"""Places in the region where the field of the rotor's currents is looked at."""
DEPTHS = 7
"""Depths of a plate that is lowered."""
MISSED = 0.2
"""Share of a table's tolerance for the harmonics left out."""


def without_high_harmonics(share: RotorShare, table: PlateTable, allowed: float) -> RotorShare:
    """The share without its highest harmonics, as many as the floater may miss.

    Parameters
    ----------
    table : of the same network
    allowed : sum over the harmonics left out of their part of the field of the rotor's currents, or of its gradient;
        it is added to the share's error
    """
    missed = np.append(np.cumsum(_parts(share, table)[::-1])[::-1], 0.0)  # by what begins with each harmonic
    kept = max(1, int(np.argmax(missed <= allowed)))
    return replace(share, series=share.series[: 2 * kept + 1], error=share.error + float(missed[kept]))


def _parts(share: RotorShare, table: PlateTable) -> Array:
    """(H,) largest part that harmonics 1…H have in field or gradient, at any place, depth and frequency."""
    functions, slopes = table.field_functions(table.region.grid(POINTS))
    turns = np.arange(1, len(share.series) // 2 + 1)
    depths = np.cos(np.pi * np.arange(DEPTHS) / (DEPTHS - 1)) if share.distance else np.zeros(1)
    signals = share.series @ np.polynomial.chebyshev.chebvander(depths, share.series.shape[2] - 1).T
    phasors = signals[1::2] - 1j * signals[2::2]
    found = np.zeros(len(turns))
    for frequency in (table.frequencies[0], float(np.sqrt(np.prod(table.frequencies))), table.frequencies[1]):
        rate = 2j * np.pi * frequency * turns[:, None]
        currents = phasors * (rate / (table.rates + rate))[:, :, None]
        for kind in (functions, slopes.reshape(*slopes.shape[:2], 9)):
            sizes = np.linalg.norm(np.einsum("hsd,psa->hpda", currents, kind, optimize=True), axis=3)
            whole = np.linalg.norm(sizes, axis=0)  # zero of a rotor without a field, or at rest
            parts = np.divide(sizes, whole, out=np.zeros_like(sizes), where=whole > 0)
            found = np.maximum(found, parts.max(axis=(1, 2)))
    return found
