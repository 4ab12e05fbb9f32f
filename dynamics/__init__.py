"""How the floater moves: equations of motion, integration, equilibria, stability."""

from .checkpoint import Checkpoint
from .equilibria import find_equilibria, survey, with_plate
from .equilibrium import Equilibrium, EquilibriumError, ForceCurve, Survey
from .flight_kind import flight_kind
from .memory import PlateMemory
from .rates import Rates
from .simulation import StartError, initial_state, simulate, starting_point
from .trajectory import Trajectory

__all__ = [
    "Checkpoint",
    "Equilibrium",
    "EquilibriumError",
    "ForceCurve",
    "PlateMemory",
    "Rates",
    "StartError",
    "Survey",
    "Trajectory",
    "find_equilibria",
    "flight_kind",
    "initial_state",
    "simulate",
    "starting_point",
    "survey",
    "with_plate",
]
