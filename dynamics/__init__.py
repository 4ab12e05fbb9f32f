"""How the floater moves: equations of motion, integration, equilibria, stability."""

from .arclength import Steps, follow_branch
from .averaged import Drift
from .boundary import follow_boundary
from .boundary_equations import BoundaryPoint, Plane
from .branch import Family, Point
from .checkpoint import Checkpoint
from .drift import drift
from .equilibria import find_equilibria, survey, with_plate
from .equilibrium import Equilibrium, EquilibriumError, ForceCurve, Survey
from .equilibrium_map import equilibrium_map
from .flight_kind import flight_kind
from .map_stability import EquilibriumMap
from .memory import PlateMemory
from .rates import Rates
from .rotor_family import RotorFamily, rotor_family
from .simulation import StartError, initial_state, simulate, starting_point
from .trajectory import FlightStopped, Trajectory

__all__ = [
    "BoundaryPoint",
    "Checkpoint",
    "Drift",
    "Equilibrium",
    "EquilibriumError",
    "EquilibriumMap",
    "Family",
    "FlightStopped",
    "ForceCurve",
    "Plane",
    "PlateMemory",
    "Point",
    "Rates",
    "RotorFamily",
    "StartError",
    "Steps",
    "Survey",
    "Trajectory",
    "drift",
    "equilibrium_map",
    "find_equilibria",
    "flight_kind",
    "follow_boundary",
    "follow_branch",
    "initial_state",
    "rotor_family",
    "simulate",
    "starting_point",
    "survey",
    "with_plate",
]
