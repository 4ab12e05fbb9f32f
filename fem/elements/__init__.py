"""Magnetostatics by finite elements."""
