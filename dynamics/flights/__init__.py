"""How does the floater fly?"""

from .ball_parts import (
    DEGREE as DEGREE,
    LARGE as LARGE,
    LOOSER as LOOSER,
    SMALL as SMALL,
    Parts as Parts,
    ball_equations as ball_equations,
)
from .checkpoint import Checkpoint as Checkpoint
from .compiled_flight import TOLERANCE as TOLERANCE
from .integration import fly_on as fly_on
from .kind import GROWING as GROWING, STABLE as STABLE, flight_kind as flight_kind
from .local_flight import LocalFlight as LocalFlight
from .pieces import IntegrationError as IntegrationError
from .simulation import (
    StartError as StartError,
    initial_state as initial_state,
    simulate as simulate,
    starting_point as starting_point,
)
from .trajectory import DURATION as DURATION, FlightStopped as FlightStopped, Trajectory as Trajectory
