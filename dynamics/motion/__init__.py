"""Which equations does the floater obey?"""

from .blend import blend_tables, chebyshev_points
from .equations import Equations, equations_of_motion, parameters
from .events import CONTACT, clearance, flight_events, lost_distance, plate_depth, plate_legs, plate_places, rotor_gap
from .movable import MovableField, Move, Rotation, Translation
from .plate_force import PlateForce
from .plate_terms import PlateMemory
from .rates import Rates
from .state import Scales, State, turned_about_z
from .symbols import Parameter

__all__ = [
    "CONTACT",
    "Equations",
    "MovableField",
    "Move",
    "Parameter",
    "PlateForce",
    "PlateMemory",
    "Rates",
    "Rotation",
    "Scales",
    "State",
    "Translation",
    "blend_tables",
    "chebyshev_points",
    "clearance",
    "equations_of_motion",
    "flight_events",
    "lost_distance",
    "parameters",
    "plate_depth",
    "plate_legs",
    "plate_places",
    "rotor_gap",
    "turned_about_z",
]
