"""Which equations does the floater obey?"""

from .blend import blend_tables as blend_tables, chebyshev_points as chebyshev_points
from .equations import Equations as Equations, equations_of_motion as equations_of_motion, parameters as parameters
from .events import (
    CONTACT as CONTACT,
    clearance as clearance,
    flight_events as flight_events,
    lost_distance as lost_distance,
    plate_depth as plate_depth,
    plate_legs as plate_legs,
    plate_places as plate_places,
    rotor_gap as rotor_gap,
)
from .movable import MovableField as MovableField, Move as Move, Rotation as Rotation, Translation as Translation
from .plate_force import PlateForce as PlateForce
from .plate_terms import PlateMemory as PlateMemory
from .rates import Rates as Rates
from .state import Scales as Scales, State as State, turned_about_z as turned_about_z
from .symbols import Parameter as Parameter
