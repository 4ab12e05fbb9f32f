"""A rotor's table with only the coefficients that count from some distance on.

An expansion that is to hold close to the magnets needs several times the coefficients, and in the motion each of them
costs time at every step.
"""

from dataclasses import replace

import numpy as np

from ..harmonics import trimmed_expansions
from .accuracy import BETWEEN, Accuracy, error_points, guards
from .fem_model import BESIDE, nonzero
from .table import KNOWN, RotorTable

AT_LEAST = 0.5
"""Share of the tolerance that what is left out may always have, even if the table itself does not meet it."""


def shortened_table(table: RotorTable, accuracy: Accuracy) -> RotorTable:
    """The same field within `accuracy.rtol` from `accuracy.nearest` off the magnets' faces on.

    What is left out is known and a doubt of the new table, which still says how wrong it is, nearer too.  A table
    without expansions stays as it is.
    """
    if not table.expansions:
        return table
    points, scale = error_points(table.magnets, accuracy.clearance(table.magnets))
    beside, scale_beside = guards(table.magnets, accuracy.clearance(table.magnets))
    rest = table.absolute_error(points)[0]
    allowed = np.maximum(BETWEEN * (scale * accuracy.rtol - rest), AT_LEAST * scale * accuracy.rtol)
    kept, dropped = trimmed_expansions(
        table.expansions,
        np.concatenate([points, beside]),
        np.concatenate([allowed, AT_LEAST * BESIDE * accuracy.rtol * scale_beside]),
    )
    doubts = {**table.doubts, KNOWN: (*table.doubts.get(KNOWN, ()), *nonzero(dropped))}
    return replace(table, expansions=nonzero(kept), doubts={cause: parts for cause, parts in doubts.items() if parts})
