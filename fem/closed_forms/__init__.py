"""Which fields, potentials and losses are known without any elements?"""

from .bodies import (
    closed_form_error as closed_form_error,
    fields_of_magnets as fields_of_magnets,
    fields_of_sphere as fields_of_sphere,
)
from .closed_moments import (
    added_by_closed_form as added_by_closed_form,
    by_cells as by_cells,
    carrier as carrier,
    closed_part as closed_part,
    first_order_moments as first_order_moments,
    uniform_cells as uniform_cells,
)
from .demagnetization import remanent_field as remanent_field
from .quadrature import oblique_contact as oblique_contact, volume_rule as volume_rule
from .racetrack import Racetrack as Racetrack
from .sphere_eddy import (
    ComplexArray as ComplexArray,
    rotating_torque as rotating_torque,
    skin_number as skin_number,
    thin_field_torque as thin_field_torque,
)
from .uniform import UniformField as UniformField, squared_distance as squared_distance
from .vector_potentials import (
    Dipole as Dipole,
    HomogeneousField as HomogeneousField,
    PolarizedCuboid as PolarizedCuboid,
    unit_dipoles as unit_dipoles,
)
