"""Equilibria followed in parameters: branches, limits of stability, maps, and the slow drift of the spin."""
