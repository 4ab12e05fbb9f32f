"""Constants of nature."""

import math

MU_0 = 4e-7 * math.pi
"""Vacuum permeability, T m/A (the value before 2019; the relative difference is 5e-10)."""
