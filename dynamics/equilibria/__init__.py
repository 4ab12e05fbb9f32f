"""Synchronous equilibria, their modes, and the periodic motions they become."""
