"""How do a plate's currents become a network of few states?"""

from .energy_basis import OrderedBasis, ordered_basis
from .network_error import coupling_error, truncated
from .reaction import plate_reaction
from .reduction import NETWORK_SHARE, STRICT, PlateNetwork, checked_ranges, reduce_plate
from .region import Region
from .training import OtherSources, probe_places, unit_power

__all__ = [
    "NETWORK_SHARE",
    "STRICT",
    "OrderedBasis",
    "OtherSources",
    "PlateNetwork",
    "Region",
    "checked_ranges",
    "coupling_error",
    "ordered_basis",
    "plate_reaction",
    "probe_places",
    "reduce_plate",
    "truncated",
    "unit_power",
]
