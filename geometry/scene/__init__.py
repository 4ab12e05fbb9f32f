"""Scenes: the keys of a scene file, the scene in SI units, and what is wrong with one."""
