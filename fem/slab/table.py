"""The infinite slab as a plate table, with the rotor's share: exact modes instead of finite elements."""

import time
from dataclasses import replace

import numpy as np

from ...geometry.scenes import Plate
from ..plate_currents import Region
from ..plate_network import NETWORK_SHARE
from ..plate_tables import (
    FUNCTION_SHARE,
    MISSED,
    SHARE_PART,
    PlateErrors,
    PlateTable,
    RotorShare,
    rotor_share,
    turning_rotor,
    without_high_harmonics,
)
from ..rotor_tables import RotorTable
from .frame import rotor_reach, slab_frame
from .multipoles import slab_functions
from .reduction import SlabNetwork, train_slab

CONDUCTOR = "this plate, taken as an infinite slab, and this place of the floater"
"""In words, of which tolerances are told."""
ENDLESS = 1e6
"""Edges of a plate without edges, m."""


def slab_and_rotor_table(
    plate: Plate,
    rotor: RotorTable,
    region: Region,
    frequencies: tuple[float, float] = (0.5, 250.0),
    rtol: float = 1e-3,
) -> tuple[PlateTable, RotorShare]:
    """As `plate_and_rotor_table`, but for a plate that is infinite along its two longer edges.

    The errors do not tell how far the plate is from infinite.

    Raises
    ------
    InputError : the region is not over one of the plate's two largest faces, or the rotor not on its side of the slab
    ValueError : a parameter out of range
    AccuracyError : `rtol` not reached
    """
    frame = slab_frame(plate, region)
    far = rotor_reach(plate, rotor, frame)
    size = np.where(np.arange(3) == np.argmin(plate.box.size), plate.box.size, ENDLESS)
    endless = replace(plate, box=replace(plate.box, size=size))
    trained = train_slab(plate, region, frequencies, rtol, turning_rotor(endless, rotor), far)
    network = trained.network(NETWORK_SHARE * rtol)
    table = tabulate_slab(network, rtol)
    if table.errors.total > rtol:  # more states leave room for what the field functions miss
        network = trained.network(rtol - table.errors.functions)
        table = tabulate_slab(network, rtol)
        table.errors.check(rtol, CONDUCTOR)
    share = rotor_share(network, endless, rotor, SHARE_PART * rtol)
    return table, without_high_harmonics(share, table, MISSED * rtol)


def tabulate_slab(network: SlabNetwork, rtol: float) -> PlateTable:
    """Field functions of a slab's network as multipoles, whose errors may add up to more than `rtol`."""
    start = time.perf_counter()
    multipoles, weights, error = slab_functions(network, FUNCTION_SHARE * rtol)
    errors = PlateErrors(network.sums_error, network.state_error, error)
    provenance: dict[str, str | float] = {
        "conductor": "infinite slab",
        "wave_numbers": float(network.waves.modes.rates.shape[0]),
        "modes": float(network.waves.modes.rates.shape[1]),
        "rtol": rtol,
        "seconds": network.seconds + time.perf_counter() - start,
    }
    return PlateTable(
        network.plate.box.size, network.plate.conductivity, network.region, network.frequencies,
        np.concatenate([network.rates[0], *(np.tile(rates, 2) for rates in network.rates[1:])]),
        multipoles, weights, errors, provenance,
    )  # fmt: skip
