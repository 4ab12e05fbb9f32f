"""Materials of the experiment."""

MAGNET_CONDUCTIVITY = 6.7e5
"""Electrical conductivity of sintered NdFeB, S/m; makers give 6.2e5 to 9e5."""
