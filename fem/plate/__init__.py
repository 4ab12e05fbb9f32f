"""Eddy currents in a conducting plate, as passive networks."""
