"""Which magnets are there, and how do they lie to each other?"""

from .article_rotors import horizontal, tilt, vertical
from .magnet import Magnet
from .narrow_gaps import closing_shifts, largest_shift, shifted_magnet
from .overlap import TOUCHING, deepest_overlap_in_a_turn, overlapping_magnets, separation, sphere_overlap
from .pieces import CONVERGENCE, cut_magnets
from .symmetry import SAME_PLACE, Symmetry, find_symmetry, mirror, parity_parts

__all__ = [
    "CONVERGENCE",
    "SAME_PLACE",
    "TOUCHING",
    "Magnet",
    "Symmetry",
    "closing_shifts",
    "cut_magnets",
    "deepest_overlap_in_a_turn",
    "find_symmetry",
    "horizontal",
    "largest_shift",
    "mirror",
    "overlapping_magnets",
    "parity_parts",
    "separation",
    "shifted_magnet",
    "sphere_overlap",
    "tilt",
    "vertical",
]
