"""Harmonic fields: expansions inside and outside of spheres, and their symbolic and compiled forms."""
