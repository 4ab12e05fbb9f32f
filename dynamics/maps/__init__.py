"""Which equilibria are there on a whole grid of parameters?"""

from .families import RotorFamily as RotorFamily, article_measure as article_measure, rotor_family as rotor_family
from .many_scenes import surveys as surveys
from .map_stability import EquilibriumMap as EquilibriumMap
from .mapping import equilibrium_map as equilibrium_map
