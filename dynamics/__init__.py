"""How the floater moves: equations of motion, integration, equilibria, stability."""

from .arclength import Steps, follow_branch
from .averaged import Drift
from .branch import Family, Point
from .checkpoint import Checkpoint
from .drift import drift
from .equilibria import find_equilibria, survey, with_plate
from .equilibrium import Equilibrium, EquilibriumError, ForceCurve, Survey
from .flight_kind import flight_kind
from .memory import PlateMemory
from .rates import Rates
from .simulation import StartError, initial_state, simulate, starting_point
from .trajectory import Trajectory

__all__ = [
    "Checkpoint",
    "Drift",
    "Equilibrium",
    "EquilibriumError",
    "Family",
    "ForceCurve",
    "PlateMemory",
    "Point",
    "Rates",
    "StartError",
    "Steps",
    "Survey",
    "Trajectory",
    "drift",
    "find_equilibria",
    "flight_kind",
    "follow_branch",
    "initial_state",
    "simulate",
    "starting_point",
    "survey",
    "with_plate",
]
