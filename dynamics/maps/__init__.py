"""Which equilibria are there on a whole grid of parameters?"""

from .families import RotorFamily, rotor_family
from .map_stability import EquilibriumMap
from .mapping import equilibrium_map

__all__ = ["EquilibriumMap", "RotorFamily", "equilibrium_map", "rotor_family"]
