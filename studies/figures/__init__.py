"""Figures and three-dimensional pictures."""
