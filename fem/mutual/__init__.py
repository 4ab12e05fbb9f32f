"""Mutual magnetisation of rotor and floater."""
