"""The rotor's field and its eddy currents as precomputed tables with stated errors."""
