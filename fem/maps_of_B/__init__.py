"""Measured and foreign maps of B as field tables."""
