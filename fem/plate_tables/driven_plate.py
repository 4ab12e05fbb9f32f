"""A plate that both the floater's dipole and the turning rotor drive: one network, with field functions and share."""

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import InputError
from ...geometry.meshes import MeshRule
from ...geometry.scenes import Plate
from ..plate_network import OtherSources, Region, reduce_plate
from ..rotor_tables import RotorTable
from .plate_table import PlateTable
from .rotor_source import DOWN, posed_rotor, rotor_parts
from .share import RotorShare, rotor_share
from .share_trim import MISSED, trimmed
from .tabulate import tabulate

ANGLES, DEPTHS = 8, 5
"""Training: the rotor at so many angles of a turn and depths of the plate; probes stand between them."""
SHARE_PART = 0.1
"""Share of the tolerance for the series of the rotor's signals."""


def plate_and_rotor_table(
    plate: Plate,
    rotor: RotorTable,
    region: Region,
    frequencies: tuple[float, float] = (0.5, 250.0),
    rtol: float = 1e-3,
    rule: MeshRule | None = None,
) -> tuple[PlateTable, RotorShare]:
    """Table of `plate` and the rotor's share of its signals, of one network.

    Parameters
    ----------
    plate : with its pose at the start and its lowering
    rotor : field table; whatever it knows drives the plate
    region : where the floater may be, in the plate's frame, during all of its way: see `reachable_region`
    frequencies : lowest and highest, Hz, of currents in the plate.  The field of a turning rotor has all multiples of
        its frequency.  Of a cube on the axis all but the first are below 3e-4; of one 2 mm off it, the second is 3 to
        6 per cent and the third below 4e-3: then the highest should be twice the rotor's
    rtol : relative accuracy of reaction tensors in the region, and there of the field of the rotor's currents
    rule : mesh (default by `rtol`)

    Raises
    ------
    InputError : the plate is too near to the rotor
    ValueError : region in the plate, or a parameter out of range
    AccuracyError : `rtol` not reached
    """
    others = turning_rotor(plate, rotor)
    network = reduce_plate(plate, region, frequencies, rtol, rule, others)
    share = rotor_share(network, plate, rotor, SHARE_PART * rtol)
    table = tabulate(network, rtol)
    return table, trimmed(share, table, MISSED * rtol)


def turning_rotor(plate: Plate, rotor: RotorTable) -> OtherSources:
    """The rotor at some angles and depths of the plate, to train and to probe a network with."""
    parts = rotor_parts(rotor, plate)
    way = plate.lowering.distance if plate.lowering else 0.0
    depths = way * (1 - np.cos(np.pi * np.arange(DEPTHS) / (DEPTHS - 1))) / 2 if way else np.zeros(1)
    angles = 2 * np.pi * np.arange(ANGLES) / ANGLES
    step = angles[1]
    training = [posed_rotor(parts, plate, angle, depth) for depth in depths for angle in angles]
    between = (depths[1:] + depths[:-1]) / 2 if way else depths
    probes = [posed_rotor(parts, plate, angle + step / 2, depth) for depth in between for angle in angles[:3]]
    centers = np.array([magnet.box.center for magnet in rotor.magnets])
    return OtherSources(training, probes, plate.box.to_body(centers))


def reachable_region(plate: Plate, center: ArrayLike, half_edges: ArrayLike, radius: float = 0.0) -> Region:
    """Where a floater can come to in the plate's frame, during all of its lowering.

    The box about `center` and its image under the lowering are united; what is nearer to the plate than the floater's
    radius is cut off.

    Parameters
    ----------
    center, half_edges : (3,) m, box along the laboratory's axes, where the floater may be
    radius : of the floater, m

    Raises
    ------
    InputError : the centre is not farther than the radius from the plate's face, all the way
    """
    center, half = np.asarray(center, float), plate.box.half_edges
    way = plate.lowering.distance if plate.lowering else 0.0
    ends = plate.box.to_body(np.array([center, center - way * DOWN]))
    beyond = np.min(np.abs(ends) - half, axis=0)
    axis = int(np.argmax(beyond))
    if beyond[axis] <= radius or ends[0, axis] * ends[1, axis] < 0:
        raise InputError(
            f"Input center_mm must be farther than {radius * 1e3:.4g} mm from the plate's faces on all of its way; "
            f"instead received {np.round(center * 1e3, 6).tolist()}, {max(beyond[axis], 0) * 1e3:.4g} mm from them. "
            "Move the plate away."
        )
    signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3, indexing="ij"), -1).reshape(8, 3)
    corners = center + np.asarray(half_edges, float) * signs
    body = plate.box.to_body(np.concatenate([corners, corners - way * DOWN]))
    lower, upper = body.min(axis=0), body.max(axis=0)
    if ends[0, axis] > 0:
        lower[axis] = max(lower[axis], half[axis] + radius)
    else:
        upper[axis] = min(upper[axis], -half[axis] - radius)
    return Region(lower, upper)
