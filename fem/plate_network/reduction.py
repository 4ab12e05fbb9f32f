"""Reduction of a box-shaped plate to a passive network, to a wanted accuracy in a region and a range of frequencies.

Sources for training stand on a grid in the region; their potentials in the plate are compressed to few modes, which
are solved at a low, a middle and the highest frequency.  Dipoles at places off the grid are solved along, as probes:
the network takes as many states as their reaction tensors need.  Then all is repeated at a frequency that was not
used; where the error is too large there, it joins the snapshots, and another is tried.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from ...geometry.meshes import MeshRule
from ...geometry.scenes import Plate
from ..eddy_currents import EddySpace, Source
from ..rotor_tables import AccuracyError
from .network_error import truncated
from .reaction import raise_order
from .region import Region
from .snapshots import Group, group_rows
from .training import OtherSources, prepare_training

MESH_SHARE, NETWORK_SHARE = 0.6, 0.9
"""Shares of the tolerance for the finite elements, and for them and the truncated basis together; the rest is the
field functions'."""
STRICT, STRICT_SHARES = 5e-4, (0.6, 0.8)
"""Tolerances below this have a finer mesh, and leave more to the field functions."""
MOST_FREQUENCIES = 8


@dataclass(frozen=True, eq=False)
class PlateNetwork:
    """Currents in a plate as states: dp_i/dt = -λ_i (p_i - s_i), with y_i = p_i - s_i the current of field e_i.

    Parameters
    ----------
    plate : the conductor; fields and region are in its own frame
    region : where the floater may be
    frequencies : lowest and highest, Hz
    space : finite-element space
    groups : parity groups
    rates : (states,) λ_i, 1/s, for each group
    fields : (states, width) weighted rows of e_i, of unit inductance, for each group
    mesh_error, state_error : estimated relative errors of reaction tensors
    solved : frequencies of the finite-element solutions, Hz
    seconds : time spent
    """

    plate: Plate
    region: Region
    frequencies: tuple[float, float]
    space: EddySpace
    groups: tuple[Group, ...]
    rates: tuple[Array, ...]
    fields: tuple[Array, ...]
    mesh_error: float
    state_error: float
    solved: tuple[float, ...]
    seconds: float

    def couplings(self, sources: Sequence[Source]) -> list[Array]:
        """s_i = ∫ σ e_i·A_s dV, √J, of sources in the plate's frame: (sources, states) for each group."""
        rows = group_rows(self.space, self.groups, sources)
        return [row @ fields.T for row, fields in zip(rows, self.fields, strict=True)]


def reduce_plate(
    plate: Plate,
    region: Region,
    frequencies: tuple[float, float] = (0.5, 250.0),
    rtol: float = 1e-3,
    rule: MeshRule | None = None,
    others: OtherSources | None = None,
) -> PlateNetwork:
    """The network of a plate for dipoles in `region` and all frequencies between the two (Hz).

    Parameters
    ----------
    rtol : relative accuracy of reaction tensors (Frobenius norm); the network's share of it is used here
    rule : mesh (default by `rtol`)
    others : more sources whose currents the network shall hold: the rotor's

    Raises
    ------
    ValueError : region in the plate, frequencies not 0 < lowest < highest, or rtol not between 0 and 1
    AccuracyError : the mesh is too coarse for `rtol`, or the frequencies do not suffice
    """
    start = time.perf_counter()
    low, high = checked_ranges(frequencies, rtol)
    rule = rule or (MeshRule() if rtol >= STRICT else MeshRule(1.0, 1.6, 1.4))
    mesh_share, network_share = (MESH_SHARE, NETWORK_SHARE) if rtol >= STRICT else STRICT_SHARES
    others = others or OtherSources()
    places = np.concatenate([region.grid((2, 2, 2), fold=True), others.places])
    response, error = raise_order(plate, places, high, mesh_share * rtol, rule)
    if error.max() > mesh_share * rtol:
        raise AccuracyError(
            f"Input rtol must be at least {error.max() / mesh_share:.1e} for the mesh rule {rule}; instead received "
            f"{rtol:.1e}."
        )
    allowed = network_share * rtol - float(error.max())
    training = prepare_training(response.space, region, rtol, others)
    middle = low**0.25 * high**0.75
    used, tried = [low, middle, high], [np.sqrt(middle * high), np.sqrt(low * middle)]
    for frequency in used:
        training.solve(frequency)
    while len(training.reactions) < MOST_FREQUENCIES:
        training.solve(tried[0])
        basis = training.basis(used)
        if training.error(basis, tried[0]) <= allowed / 2:
            break
        used = sorted([*used, tried.pop(0)])
        tried += [float(np.sqrt(used[-1] * used[-2])), float(np.sqrt(used[-2] * used[-3]))]
    chosen, state_error = truncated(training.worst, basis, allowed)
    if state_error > allowed:
        raise AccuracyError(
            f"Input rtol must be larger: the states leave {state_error:.1e}, allowed is {allowed:.1e}; "
            f"instead received {rtol:.1e}."
        )
    diagonal = [part.diagonalised() for part in chosen]
    return PlateNetwork(
        plate, region, frequencies, response.space, tuple(m.group for m in training.modes),
        tuple(d[0] for d in diagonal), tuple(d[1] for d in diagonal),
        float(error.max()), state_error, tuple(sorted(training.reactions)),
        time.perf_counter() - start,
    )  # fmt: skip


def checked_ranges(frequencies: tuple[float, float], rtol: float) -> tuple[float, float]:
    """The frequencies (Hz), once they and the tolerance are found good.

    Raises
    ------
    ValueError : they are not
    """
    low, high = frequencies
    if not 0 < low < high < np.inf:
        raise ValueError(f"Input frequencies_hz must be positive and increasing; instead received {frequencies}.")
    if not 0 < rtol < 1:
        raise ValueError(f"Input rtol must be between 0 and 1; instead received {rtol}.")
    return low, high
