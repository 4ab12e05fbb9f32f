"""How do a plate's currents become a network of few states?"""

from .energy_basis import OrderedBasis as OrderedBasis, ordered_basis as ordered_basis
from .network_error import coupling_error as coupling_error, truncated as truncated
from .reaction import plate_reaction as plate_reaction
from .reduction import (
    NETWORK_SHARE as NETWORK_SHARE,
    STRICT as STRICT,
    PlateNetwork as PlateNetwork,
    checked_ranges as checked_ranges,
    reduce_plate as reduce_plate,
)
from .region import Region as Region
from .training import OtherSources as OtherSources, probe_places as probe_places, unit_power as unit_power
