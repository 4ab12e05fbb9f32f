"""Finite-element meshes of magnets, plates and metal."""
