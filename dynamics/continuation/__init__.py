"""Equilibria followed in a parameter: folds, limits of stability, and the slow drift of the spin."""
