"""What do all finite-element solvers of the program share?"""

from .condensed import solve_condensed
from .gauge import edge_vertices, region_edges, tree_edges
from .integration_points import IntegrationPoints, surface_points, volume_points
from .memory import TooLargeError, require_memory
from .open_boundary import OpenBoundary
from .open_solve import solve_open
from .parity import Parity

__all__ = [
    "IntegrationPoints",
    "OpenBoundary",
    "Parity",
    "TooLargeError",
    "edge_vertices",
    "region_edges",
    "require_memory",
    "solve_condensed",
    "solve_open",
    "surface_points",
    "tree_edges",
    "volume_points",
]
