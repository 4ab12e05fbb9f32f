from .apart import CrashError as CrashError, LostError as LostError, call_apart as call_apart
from .arrays import (
    MAGNET_CONDUCTIVITY as MAGNET_CONDUCTIVITY,
    MU_0 as MU_0,
    Array as Array,
    even_directions as even_directions,
    frozen_array as frozen_array,
    spread_points as spread_points,
)
from .box import Box as Box, rotation_angles as rotation_angles, rotation_matrix as rotation_matrix
from .cylinder import Cylinder as Cylinder
from .errors import (
    ComputationError as ComputationError,
    InputError as InputError,
    MeshError as MeshError,
    SpinlevError as SpinlevError,
    printable as printable,
    shown as shown,
)
from .files import file_content as file_content, regular_file as regular_file
from .part import Part as Part
from .pose import Posed as Posed
from .ring import Ring as Ring
from .solid import (
    Solid as Solid,
    moved as moved,
    places_off as places_off,
    solid_of as solid_of,
)
from .sphere import Sphere as Sphere
from .text import (
    counted as counted,
    html_table as html_table,
    listed as listed,
    millimetre_size as millimetre_size,
    millimetres as millimetres,
)
from .watch import Watch as Watch, unwatched as unwatched, watched as watched
