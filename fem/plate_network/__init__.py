"""How do a plate's currents become a network of few states?"""

from .energy_basis import OrderedBasis as OrderedBasis, ordered_basis as ordered_basis
from .network_error import (
    ENOUGH as ENOUGH,
    coupling_error as coupling_error,
    fewest_fields as fewest_fields,
    refuse as refuse,
)
from .reduction import (
    NETWORK_SHARE as NETWORK_SHARE,
    PlateNetwork as PlateNetwork,
    checked_ranges as checked_ranges,
    reduce_currents as reduce_currents,
    reduce_plate as reduce_plate,
)
