"""What do independent methods say of the same fields?"""

from .coulomb import coulomb_field as coulomb_field
from .scikit_fem import magnet_dipoles as magnet_dipoles
