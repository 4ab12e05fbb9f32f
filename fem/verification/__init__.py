"""What do independent methods say of the same fields?"""

from .coulomb import coulomb_field
from .scikit_fem import magnet_dipoles

__all__ = ["coulomb_field", "magnet_dipoles"]
