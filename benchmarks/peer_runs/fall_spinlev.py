"""spinlev: the plate's table to a relative accuracy, from nothing, then its currents along the motion.

Of every current q' = -λ q - s', with s = b(x)·m linear between 2000 times a turn, solved exactly in between.
"""

import sys
from importlib.metadata import version

import numpy as np
from problems import (
    CONDUCTIVITY,
    FALL_FROM,
    FALL_TO,
    OBSERVED,
    PLATE_SIZE,
    TURN_RATE,
    TURNS,
    falling,
)
from said import measure, say

from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import plate_table
from spinlev.geometry import Box, Plate

rtol, top = float(sys.argv[2]), PLATE_SIZE[2] / 2
region = Region(np.array([0.004, -0.001, top + FALL_TO - 1e-3]), np.array([0.006, 0.001, top + FALL_FROM + 1e-3]))
plate = Plate(Box(PLATE_SIZE), CONDUCTIVITY)
times = np.arange(2000 * TURNS + 1) / (2000 * TURN_RATE)


def reaction():
    """What the plate answers to the falling magnet, by its table."""
    table = plate_table(plate, region, (0.5, 1000.0), rtol)
    positions, moments = (np.array(part) for part in zip(*map(falling, times), strict=True))
    functions = table.field_functions(positions)[0]
    flux = np.einsum("nia,na->ni", functions, moments)
    step = times[1]
    kept, gained = np.exp(-table.rates * step), -np.expm1(-table.rates * step) / (table.rates * step)
    current, currents = np.zeros(len(table.rates)), [np.zeros(len(table.rates))]
    for change in np.diff(flux, axis=0):
        current = kept * current - gained * change
        currents.append(current)
    field = np.einsum("nia,ni->na", functions, currents)
    return table, np.array([np.interp(OBSERVED, times, component) for component in field.T]).T


(table, values), seconds = measure(reaction, rounds=1)
say(values, seconds, len(table.rates), {"spinlev": version("spinlev")}, stated=table.errors.total)
