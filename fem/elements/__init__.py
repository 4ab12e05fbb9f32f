"""What do all finite-element solvers of the program share?"""

from .condensed import OpenFactor as OpenFactor, solve_condensed as solve_condensed, solve_open as solve_open
from .gauge import edge_vertices as edge_vertices, region_edges as region_edges, tree_edges as tree_edges
from .integration_points import (
    IntegrationPoints as IntegrationPoints,
    surface_points as surface_points,
    value_matrix as value_matrix,
    volume_points as volume_points,
)
from .memory import TooLargeError as TooLargeError, require_memory as require_memory
from .open_boundary import OpenBoundary as OpenBoundary
from .parity import Parity as Parity
