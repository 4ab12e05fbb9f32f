"""Where is the floater at rest in the rotor's frame, and what do small motions there do?"""

from .balance import AXIAL, EVERY, LATERAL, Balance, Indices, moved, solve, tangent_basis
from .equilibrium import Equilibrium, EquilibriumError, ForceCurve, Survey
from .floquet import floquet_modes
from .harmonic_balance import Orbit, OrbitProblem, kept, orbit_near, periodic_orbit
from .mode_names import SIDE, TILT, named_modes
from .stability import Modes, is_stable, modes, spectra

__all__ = [
    "AXIAL",
    "EVERY",
    "LATERAL",
    "SIDE",
    "TILT",
    "Balance",
    "Equilibrium",
    "EquilibriumError",
    "ForceCurve",
    "Indices",
    "Modes",
    "Orbit",
    "OrbitProblem",
    "Survey",
    "floquet_modes",
    "is_stable",
    "kept",
    "modes",
    "moved",
    "named_modes",
    "orbit_near",
    "periodic_orbit",
    "solve",
    "spectra",
    "tangent_basis",
]
