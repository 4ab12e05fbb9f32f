"""How the floater moves: equations of motion, integration, equilibria, stability."""

from .equilibria import find_equilibria, survey
from .equilibrium import Equilibrium, EquilibriumError, ForceCurve, Survey
from .simulation import StartError, initial_state, simulate
from .trajectory import Trajectory

__all__ = [
    "Equilibrium",
    "EquilibriumError",
    "ForceCurve",
    "StartError",
    "Survey",
    "Trajectory",
    "find_equilibria",
    "initial_state",
    "simulate",
    "survey",
]
