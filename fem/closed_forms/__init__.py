"""Which fields, potentials and losses are known without any elements?"""

from .carriers import carrier
from .closed_moments import added_by_closed_form, closed_part
from .demagnetization import remanent_field
from .phasor import ComplexArray
from .quadrature import oblique_contact, volume_rule
from .racetrack import Racetrack
from .remanent import first_order_moments
from .sphere_eddy import rotating_torque
from .uniform import UniformField, squared_distance
from .vector_potentials import Dipole, HomogeneousField, PolarizedCuboid, unit_dipoles

__all__ = [
    "ComplexArray",
    "Dipole",
    "HomogeneousField",
    "PolarizedCuboid",
    "Racetrack",
    "UniformField",
    "added_by_closed_form",
    "carrier",
    "closed_part",
    "first_order_moments",
    "oblique_contact",
    "remanent_field",
    "rotating_torque",
    "squared_distance",
    "unit_dipoles",
    "volume_rule",
]
