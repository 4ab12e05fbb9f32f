from .branches import (
    BoundaryPoint as BoundaryPoint,
    BranchPoint as BranchPoint,
    Family as Family,
    Plane as Plane,
    follow_boundary as follow_boundary,
    follow_branch as follow_branch,
)
from .equilibria import Steps as Steps, find_equilibria as find_equilibria, survey as survey, with_plate as with_plate
from .flights import (
    Checkpoint as Checkpoint,
    FlightStopped as FlightStopped,
    StartError as StartError,
    Trajectory as Trajectory,
    flight_kind as flight_kind,
    initial_state as initial_state,
    simulate as simulate,
    starting_point as starting_point,
)
from .maps import (
    EquilibriumMap as EquilibriumMap,
    RotorFamily as RotorFamily,
    equilibrium_map as equilibrium_map,
    rotor_family as rotor_family,
)
from .motion import PlateMemory as PlateMemory, Rates as Rates
from .slow_drift import Drift as Drift, drift as drift
from .steady import (
    Equilibrium as Equilibrium,
    EquilibriumError as EquilibriumError,
    ForceCurve as ForceCurve,
    Survey as Survey,
)
