"""What would the plate do if it had no edges?"""

from .reaction import Slab, reaction_tensor
from .table import slab_and_rotor_table

__all__ = ["Slab", "reaction_tensor", "slab_and_rotor_table"]
