"""What field do permeable magnets make?"""

from .permeable_regions import PermeableRegions, assemble_regions
from .refinement_ladder import climb, rung, strongest
from .rotor_solution import Refinement, RotorSolution, solve_rotor
from .solver import Formulation

__all__ = [
    "Formulation",
    "PermeableRegions",
    "Refinement",
    "RotorSolution",
    "assemble_regions",
    "climb",
    "rung",
    "solve_rotor",
    "strongest",
]
