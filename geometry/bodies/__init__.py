"""Which magnets are there, and how do they lie to each other?"""

from .article_rotors import horizontal as horizontal, tilt as tilt, vertical as vertical
from .magnet import Magnet as Magnet
from .narrow_gaps import (
    closing_shifts as closing_shifts,
    largest_shift as largest_shift,
    shifted_magnet as shifted_magnet,
)
from .overlap import (
    TOUCHING as TOUCHING,
    deepest_overlap_in_a_turn as deepest_overlap_in_a_turn,
    overlapping_magnets as overlapping_magnets,
    separation as separation,
    sphere_overlap as sphere_overlap,
)
from .pieces import CONVERGENCE as CONVERGENCE, cut_magnets as cut_magnets
from .symmetry import (
    SAME_PLACE as SAME_PLACE,
    Symmetry as Symmetry,
    find_symmetry as find_symmetry,
    mirror as mirror,
    parity_parts as parity_parts,
)
