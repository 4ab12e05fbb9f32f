"""How do a plate's currents become a network of few states?"""

from .energy_basis import OrderedBasis, ordered_basis
from .network_error import coupling_error, truncated
from .reduction import NETWORK_SHARE, PlateNetwork, checked_ranges, reduce_currents, reduce_plate

__all__ = [
    "NETWORK_SHARE",
    "OrderedBasis",
    "PlateNetwork",
    "checked_ranges",
    "coupling_error",
    "ordered_basis",
    "reduce_currents",
    "reduce_plate",
    "truncated",
]
