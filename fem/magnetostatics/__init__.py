"""What field do permeable magnets make?"""

from .inner_field import in_ball as in_ball, potential_slopes as potential_slopes
from .permeable_regions import PermeableRegions as PermeableRegions, assemble_regions as assemble_regions
from .refinement_ladder import refined as refined, refinement_of as refinement_of, strongest as strongest
from .rotor_solution import Refinement as Refinement, RotorSolution as RotorSolution, solve_rotor as solve_rotor
from .solver import Formulation as Formulation
