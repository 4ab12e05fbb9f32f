"""How does the floater fly?"""

from .checkpoint import Checkpoint as Checkpoint
from .kind import flight_kind as flight_kind
from .simulation import (
    StartError as StartError,
    initial_state as initial_state,
    simulate as simulate,
    starting_point as starting_point,
)
from .trajectory import FlightStopped as FlightStopped, Trajectory as Trajectory
