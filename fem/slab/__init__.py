"""What would the plate do if it had no edges?"""

from .choice import PlateChoice, resolve_plate_model
from .edges import edge_error
from .reaction import Slab, reaction_tensor
from .table import slab_and_rotor_table

__all__ = ["PlateChoice", "Slab", "edge_error", "reaction_tensor", "resolve_plate_model", "slab_and_rotor_table"]
