"""How does the floater fly?"""

from .ball_parts import DEGREE, LARGE, LOOSER, SMALL, Parts, ball_equations
from .checkpoint import Checkpoint
from .compiled_flight import TOLERANCE
from .integration import fly_on
from .kind import flight_kind
from .local_flight import LocalFlight
from .pieces import IntegrationError
from .simulation import StartError, initial_state, simulate, starting_point
from .trajectory import DURATION, FlightStopped, Trajectory

__all__ = [
    "DEGREE",
    "DURATION",
    "LARGE",
    "LOOSER",
    "SMALL",
    "TOLERANCE",
    "Checkpoint",
    "FlightStopped",
    "IntegrationError",
    "LocalFlight",
    "Parts",
    "StartError",
    "Trajectory",
    "ball_equations",
    "flight_kind",
    "fly_on",
    "initial_state",
    "simulate",
    "starting_point",
]
