"""What do the finite elements stand on?"""

from .conductors import MILLIMETRE, PLANES, ConductorMesh
from .export import to_meshio
from .grading import graded_partition
from .hexahedra import Block, hex_mesh
from .magnets import MagnetMesh, MeshSettings, mesh_magnets
from .plate import MeshRule, plate_mesh, skin_depth
from .two_bodies import TwoBodyMesh

__all__ = [
    "MILLIMETRE",
    "PLANES",
    "Block",
    "ConductorMesh",
    "MagnetMesh",
    "MeshRule",
    "MeshSettings",
    "TwoBodyMesh",
    "graded_partition",
    "hex_mesh",
    "mesh_magnets",
    "plate_mesh",
    "skin_depth",
    "to_meshio",
]
