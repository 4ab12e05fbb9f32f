"""How does the floater fly?"""

from .checkpoint import Checkpoint
from .kind import flight_kind
from .simulation import StartError, initial_state, simulate, starting_point
from .trajectory import FlightStopped, Trajectory

__all__ = [
    "Checkpoint",
    "FlightStopped",
    "StartError",
    "Trajectory",
    "flight_kind",
    "initial_state",
    "simulate",
    "starting_point",
]
