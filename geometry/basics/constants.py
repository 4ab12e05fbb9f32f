"""Constants of nature, and of the experiment's materials."""

import math

MU_0 = 4e-7 * math.pi
"""Vacuum permeability, T m/A (the value before 2019; the relative difference is 5e-10)."""
MAGNET_CONDUCTIVITY = 6.7e5
"""Electrical conductivity of sintered NdFeB, S/m; makers give 6.2e5 to 9e5."""
