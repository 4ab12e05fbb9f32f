"""What would the plate do if it had no edges?"""

from .around_place import (
    PlateAround as PlateAround,
    plate_around as plate_around,
    rotor_nearby as rotor_nearby,
    wider_region as wider_region,
)
from .choice import PlateChoice as PlateChoice, resolve_plate_model as resolve_plate_model
from .edges import cached_edge_error as cached_edge_error, edge_error as edge_error
from .reaction import Slab as Slab, reaction_tensor as reaction_tensor
from .table import slab_and_rotor_table as slab_and_rotor_table
