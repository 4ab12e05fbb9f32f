"""How does the floater fly?"""

from .ball_parts import (
    DEGREE as DEGREE,
    LARGE as LARGE,
    LOOSER as LOOSER,
    SMALL as SMALL,
    Parts as Parts,
    ball_equations as ball_equations,
    is_long as is_long,
)
from .checkpoint import Checkpoint as Checkpoint
from .compiled_flight import TOLERANCE as TOLERANCE
from .integration import fly_on as fly_on
from .kind import GROWING as GROWING, STABLE as STABLE, flight_kind as flight_kind
from .live import LiveFlight as LiveFlight, Piece as Piece
from .local_flight import LocalFlight as LocalFlight
from .pieces import (
    MOST_SAMPLES as MOST_SAMPLES,
    IntegrationError as IntegrationError,
    Log as Log,
    booked as booked,
    first_interval as first_interval,
    flown as flown,
    ledger_scale as ledger_scale,
)
from .recorder import Recorder as Recorder
from .simulation import (
    StartError as StartError,
    displaced as displaced,
    initial_state as initial_state,
    most_like_levitation as most_like_levitation,
    simulate as simulate,
    starting_point as starting_point,
)
from .trajectory import (
    DURATION as DURATION,
    FieldChanges as FieldChanges,
    FlightStopped as FlightStopped,
    Trajectory as Trajectory,
)
