"""What do the finite elements stand on?"""

from .conductors import MILLIMETRE as MILLIMETRE, PLANES as PLANES, ConductorMesh as ConductorMesh
from .export import to_meshio as to_meshio
from .hexahedra import Block as Block, graded_partition as graded_partition, hex_mesh as hex_mesh
from .magnets import MagnetMesh as MagnetMesh, MeshSettings as MeshSettings, mesh_magnets as mesh_magnets
from .metal import MetalMesh as MetalMesh, mesh_metal as mesh_metal
from .plate import MeshRule as MeshRule, plate_mesh as plate_mesh, skin_depth as skin_depth
from .solids import OTHERWISE as OTHERWISE, part_rule as part_rule
from .step_writing import (
    Body as Body,
    Facets as Facets,
    Segment as Segment,
    lies_within as lies_within,
    step_text as step_text,
)
