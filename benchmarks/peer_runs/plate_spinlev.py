"""spinlev: reaction of the plate to a dipole at three places, to a relative accuracy, from nothing.

It computes the whole tensors; the field of one moment at each place is compared.
"""

import sys
from importlib.metadata import version

import numpy as np
from problems import CONDUCTIVITY, FREQUENCIES, MOMENTS, PLACES, PLATE_SIZE
from said import measure, say

from spinlev.fem.plate.eddy import plate_reaction
from spinlev.geometry import Box, Plate

frequency, rtol = FREQUENCIES[sys.argv[1]], float(sys.argv[2])
plate = Plate(Box(PLATE_SIZE), CONDUCTIVITY)
found, seconds = measure(lambda: plate_reaction(plate, PLACES, frequency, rtol))
values = np.einsum("nij,nj->ni", found.tensors, MOMENTS)
say(values, seconds, found.coupling_unknowns, {"spinlev": version("spinlev")}, stated=float(found.error_estimate.max()))
