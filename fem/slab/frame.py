"""A slab in the frame of a plate, and a cylinder whose axis stands on its face.

The slab is the plate without its edges: its thickness is the plate's shortest edge, and the region lies over one of
its faces.  In the cylinder's frame the face is z = 0, with the slab below.  Where the face is square to the rotor's
axis, that is the cylinder's, and a turning rotor only turns the phases of its waves; else the axis goes through the
middle of the region.
"""

from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array, InputError, rotation_matrix
from ...geometry.scenes import Plate
from ..plate_currents import Region
from ..plate_tables import DOWN
from ..rotor_tables import RotorTable
from .reaction import Slab

PARALLEL = 1e-9
"""Sine of an angle that still counts as none."""
ANGLES = 72
"""Angles of a turn at which the rotor's reach is looked at."""


@dataclass(frozen=True, eq=False)
class SlabFrame:
    """Frame of the cylinder.

    Parameters
    ----------
    slab : conductivity and thickness
    origin : (3,) m, foot of the axis on the face, in the frame of the plate
    axes : (3, 3) its columns are the cylinder's x, y and z in the frame of the plate
    """

    slab: Slab
    origin: Array
    axes: Array

    def to_local(self, points: Array) -> Array:
        """Coordinates (n, 3), m, in the cylinder's frame of points in the plate's."""
        return (points - self.origin) @ self.axes

    def to_plate(self, points: Array) -> Array:
        """The inverse of `to_local`."""
        return np.asarray(self.origin + points @ self.axes.T)


def slab_frame(plate: Plate, region: Region) -> SlabFrame:
    """The slab that stands for `plate` under `region` (plate's frame).

    Raises
    ------
    InputError : the region is not over one of the plate's two largest faces
    """
    normal, half = int(np.argmin(plate.box.size)), plate.box.half_edges
    others = [(normal + 1) % 3, (normal + 2) % 3]
    apart = (region.lower >= half) | (region.upper <= -half)
    if apart[others].any() or not (region.lower[normal] > half[normal] or region.upper[normal] < -half[normal]):
        bounds = " to ".join(str(np.round(bound * 1e3, 6).tolist()) for bound in (region.lower, region.upper))
        raise InputError(
            "Input region must be over one of the plate's two largest faces for the plate to be taken as an infinite "
            f"slab; instead received {bounds} mm in the plate's frame, with half edges {(half * 1e3).tolist()} mm. "
            "Move the plate, or model it by finite elements."
        )
    side = np.sign(region.center[normal])
    axes = np.eye(3)[:, [*others, normal]] * [1.0, side, side]
    square_to_axis = np.linalg.norm(np.cross(plate.box.rotation[:, normal], DOWN)) < PARALLEL
    origin = plate.box.to_body(np.zeros(3)) if square_to_axis else region.center.copy()
    origin[normal] = side * half[normal]
    return SlabFrame(Slab(plate.conductivity, float(plate.box.size[normal])), origin, axes)


def corners(region: Region, frame: SlabFrame) -> Array:
    """(8, 3) m, of a region, in the cylinder's frame."""
    points = np.stack(np.meshgrid(*np.stack([region.lower, region.upper], axis=1), indexing="ij"), -1).reshape(-1, 3)
    return frame.to_local(points)


def rotor_reach(plate: Plate, rotor: RotorTable, frame: SlabFrame) -> Array:
    """Corners (n, 3) m of the rotor's magnets at many angles, and both ends of the plate's way, in cylinder's frame.

    Raises
    ------
    InputError : they are not all on the region's side of the slab
    """
    own = np.concatenate([magnet.box.corners for magnet in rotor.magnets])
    turns = [rotation_matrix((0.0, 0.0, angle)) for angle in np.linspace(0.0, 360.0, ANGLES, endpoint=False)]
    way = plate.lowering.distance if plate.lowering else 0.0
    places = np.concatenate([own @ turn.T - depth * DOWN for turn in turns for depth in (0.0, way)])
    found = frame.to_local(plate.box.to_body(places))
    if found[:, 2].min() <= 0:
        raise InputError(
            "Input plate, continued to an infinite slab, must have all of the rotor on the floater's side; instead "
            f"the rotor comes {-found[:, 2].min() * 1e3:.4g} mm below its face. "
            "Move the plate, or model it by finite elements."
        )
    return found
