"""What do rotor and floater do to each other once both are permeable?"""

from .degree_needed import enough_degree
from .forces import TwoBody, TwoBodyError, Wrench, two_body, two_body_ladder
from .rotor_response import RotorResponse, closed_dipoles, permeability_tensor, rotor_ladder

__all__ = [
    "RotorResponse",
    "TwoBody",
    "TwoBodyError",
    "Wrench",
    "closed_dipoles",
    "enough_degree",
    "permeability_tensor",
    "rotor_ladder",
    "two_body",
    "two_body_ladder",
]
