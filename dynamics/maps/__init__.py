"""Equilibria over grids of frequencies and rotors."""
