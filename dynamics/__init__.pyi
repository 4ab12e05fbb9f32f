from .continuation.branch import BranchPoint as BranchPoint, Family as Family, follow_branch as follow_branch
from .continuation.map import EquilibriumMap as EquilibriumMap, equilibrium_map as equilibrium_map
from .continuation.slow_drift import Drift as Drift, drift as drift
from .equilibria.equilibrium import (
    Equilibrium as Equilibrium,
    EquilibriumError as EquilibriumError,
    ForceCurve as ForceCurve,
    Survey as Survey,
)
from .equilibria.path import Steps as Steps
from .equilibria.search import find_equilibria as find_equilibria, survey as survey, with_plate as with_plate
from .flights.flight import (
    StartError as StartError,
    initial_state as initial_state,
    simulate as simulate,
    starting_point as starting_point,
)
from .flights.trajectory import (
    Checkpoint as Checkpoint,
    FlightStopped as FlightStopped,
    Trajectory as Trajectory,
    flight_kind as flight_kind,
)
from .motion.plate import PlateMemory as PlateMemory
from .motion.rates import Rates as Rates
