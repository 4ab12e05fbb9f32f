"""Mirror planes of a set of magnets, found from their shapes and permeabilities.

A mirror plane of the bodies need not be one of their polarisation: any polarisation is the sum of parts that are even
or odd at every plane (`parity_parts`), and each part needs but the bodies' share on one side of all planes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from .common import Array
from .magnets import Magnet
from .shapes import Box, Sphere
from .solids import Part, Solid, moved

SAME_PLACE = 1e-9  # Positions that differ by less than this part of the bodies' size are the same
# A plane in a gap is left out if corners lie nearer to it than this part of the shortest edge: elements at the plane
# would be larger than their distance from the edges, whose singularity is resolved only where elements touch them.
NARROW_SIDE = 0.04


@dataclass(frozen=True, eq=False)
class Symmetry:
    """Mirror planes through one centre."""

    center: Array  # (3,) m
    axes: Array  # (3, 3) matrix whose columns are the axes of the mirrors' frame
    planes: tuple[int, ...]  # which of the planes across those axes mirror the bodies onto themselves

    def to_frame(self, magnet: Magnet) -> Magnet:
        """The magnet as seen in the mirrors' frame: planes are coordinate planes through the origin."""
        body, turn = magnet.body, self.axes.T
        return replace(magnet, body=moved(body, turn @ (body.center - self.center), turn @ body.rotation))


def find_symmetry(magnets: Sequence[Magnet]) -> Symmetry:
    """The frame, of the rotor or of the first magnet, in which the bodies have most mirror planes."""
    found = []
    for axes in (np.eye(3), magnets[0].body.rotation):
        ends = np.concatenate([_ends(magnet.body, axes) for magnet in magnets])
        symmetry = Symmetry(axes @ ((ends.min(axis=0) + ends.max(axis=0)) / 2), axes, ())
        seen = [symmetry.to_frame(magnet) for magnet in magnets]
        planes = [a for a in range(3) if mirror_images(seen, a) is not None and not _in_narrow_gap(seen, a)]
        found.append(replace(symmetry, planes=tuple(planes)))
    return max(found, key=lambda symmetry: len(symmetry.planes))


def _in_narrow_gap(magnets: Sequence[Magnet], axis: int) -> bool:
    """Whether the plane across a coordinate axis runs close by a corner of a body, but not through it."""
    bodies = [magnet.body for magnet in magnets]
    corners = [body.corners if isinstance(body, Box) else _ends(body, np.eye(3)) for body in bodies]
    heights = np.abs(np.concatenate(corners)[:, axis])
    shortest = min(float(body.size.min()) for body in bodies)
    return bool(np.any((heights > SAME_PLACE * shortest) & (heights < NARROW_SIDE * shortest)))


def _ends(body: Solid, axes: Array) -> Array:
    """(2, 3) coordinates along axes (columns) between which a body lies."""
    reach = body.reach(axes.T)
    return np.asarray(body.center @ axes + np.array([-reach, reach]))


def _same_body(body: Solid, other: Solid, flip: Array) -> bool:
    """Whether the mirror image of a body takes the place of another."""
    allowed = SAME_PLACE * max(body.circumradius, float(np.linalg.norm(body.center)))
    if body.kind != other.kind or np.linalg.norm(body.center * flip - other.center) > allowed:
        return False
    if isinstance(body, Box):
        distance = np.linalg.norm((body.corners * flip)[:, None] - other.corners, axis=-1)
        return bool(distance.min(axis=1).max() <= allowed)
    if isinstance(body, Part) or np.abs(body.shape_numbers - other.shape_numbers).max() > allowed:
        return False
    return isinstance(body, Sphere) or bool(abs((body.rotation[:, 2] * flip) @ other.rotation[:, 2]) > 1 - 1e-15)


def mirror_images(magnets: Sequence[Magnet], axis: int) -> list[int] | None:
    """Number of the body that is the mirror image of each, at the plane across a coordinate axis; None if one lacks."""
    images, flip = [], mirror(axis)
    for magnet in magnets:
        seen = magnet.permeability_in_rotor * flip[:, None] * flip
        for k, other in enumerate(magnets):
            alike = np.allclose(seen, other.permeability_in_rotor, rtol=0, atol=1e-12)
            if alike and _same_body(magnet.body, other.body, flip):
                images.append(k)
                break
        else:
            return None
    return images


def mirror(axis: int) -> Array:
    """(3,) factors that mirror a vector at the plane across a coordinate axis."""
    return np.where(np.arange(3) == axis, -1.0, 1.0)


def parity_parts(
    magnets: Sequence[Magnet], planes: tuple[int, ...], polarizations: Array | None = None
) -> list[tuple[tuple[int, ...], Array]]:
    """Parts of the polarisation that are even (+1) or odd (-1) at each of the `planes`, those that are zero left out.

    Of `polarizations` (..., n, 3) T, one or several sets, by default those of the `magnets`: pairs of the signs, one a
    plane, and the polarisations (..., n, 3), T. The potential has the same signs.
    """
    own = np.array([magnet.polarization_in_rotor for magnet in magnets])
    whole = own if polarizations is None else polarizations
    images = {axis: mirror_images(magnets, axis) for axis in planes}
    parts = []
    for signs in product((1, -1), repeat=len(planes)):
        part = whole
        for axis, sign in zip(planes, signs, strict=True):
            part = (part + sign * part[..., images[axis], :] * mirror(axis)) / 2
        if np.abs(part).max() > 1e-14 * np.abs(whole).max():
            parts.append((signs, part))
    return parts
