"""Which magnets are there, and how do they lie to each other?"""

from .article_rotors import horizontal as horizontal, tilt as tilt, vertical as vertical
from .cells import Cells as Cells, cells_of as cells_of
from .conductor import Conductor as Conductor, separate_pieces as separate_pieces
from .known_shapes import known_shape as known_shape
from .magnet import Magnet as Magnet, polarizability as polarizability
from .overlap import (
    TOUCHING as TOUCHING,
    apart as apart,
    body_overlap as body_overlap,
    closing_shifts as closing_shifts,
    deepest_overlap_in_a_turn as deepest_overlap_in_a_turn,
    largest_shift as largest_shift,
    overlapping_magnets as overlapping_magnets,
    separation as separation,
    shifted_magnet as shifted_magnet,
    sphere_overlap as sphere_overlap,
)
from .pieces import CONVERGENCE as CONVERGENCE, cut_magnets as cut_magnets
from .step_file import part_of as part_of, read_part as read_part
from .symmetry import (
    SAME_PLACE as SAME_PLACE,
    Symmetry as Symmetry,
    find_symmetry as find_symmetry,
    mirror as mirror,
    mirror_images as mirror_images,
    parity_parts as parity_parts,
)
