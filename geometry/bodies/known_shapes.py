"""Which solids of STEP files are a cuboid, a cylinder, a ring or a sphere, for which there are closed forms.

Corners of the triangles on a solid's surface lie on the surface of the shape, and both have the same volume and area.
What is cut off between such corners, as by a chamfer, changes both.
"""

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from ..basics import Array, Box, Cylinder, Part, Ring, Solid, Sphere, moved

SAME = 1e-9
"""Distance of corners from the surface in sizes of the part, and relative difference of volumes and areas."""
ALONG, FACES = 1e-9, 40
"""Sine of an angle between directions that are one; flat faces that may be the end of a cylinder."""


def known_shape(part: Part) -> Solid | None:
    """The shape that the part has, in the same place, or None for a solid of any other shape.

    Its body axes are those of the shape: as near to the part's own as they can be.
    """
    for local in _candidates(part):
        distances = np.abs(local.distance(part.triangles.reshape(-1, 3)))
        alike = np.allclose([local.volume, _area(local)], [part.volume, part.area], rtol=SAME, atol=0.0)
        if alike and distances.max() < SAME * part.circumradius:
            return moved(local, part.center + part.rotation @ local.center, part.rotation @ local.rotation)
    return None


def _area(body: Solid) -> float:
    """Of its surface, m²."""
    if isinstance(body, Sphere):
        return 4 * np.pi * body.radius**2
    if isinstance(body, Cylinder):
        return 2 * np.pi * body.radius * (body.radius + body.height)
    if isinstance(body, Ring):
        return 2 * np.pi * (body.radius + body.inner_radius) * (body.radius - body.inner_radius + body.height)
    x, y, z = body.size
    return 2 * float(x * y + y * z + z * x)


def _candidates(part: Part) -> Iterator[Solid]:
    """Shapes of about the part's sizes about its centroid, along its body axes."""
    corners = part.triangles.reshape(-1, 3) - part.centroid
    yield Sphere(float(np.cbrt(part.volume * 0.75 / np.pi)), part.centroid)
    normals = _face_normals(part.triangles)
    for axis in normals[:FACES]:
        along = corners @ axis
        height = float(np.ptp(along))
        radius = float(np.linalg.norm(corners - np.outer(along, axis), axis=1).max())
        frame = _frame([axis])
        yield Cylinder(radius, height, part.centroid, frame)
        hole = radius**2 - part.volume / (np.pi * height)
        if hole > 0:
            yield Ring(radius, float(np.sqrt(hole)), height, part.centroid, frame)
    if len(normals) == 3:
        frame = _frame(normals)
        yield Box(np.ptp(corners @ frame, axis=0), part.centroid, frame)


def _face_normals(triangles: Array) -> list[Array]:
    """Directions of flat faces, the largest first; of opposite ones one."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    normals, areas = normals[areas > 0] / areas[areas > 0, None], areas[areas > 0]
    found, left = list[tuple[float, Array]](), np.ones(len(areas), bool)
    while left.any():
        first = normals[left][int(np.argmax(areas[left]))]
        alike = left & (np.linalg.norm(np.cross(normals, first), axis=1) < ALONG)
        found.append((float(areas[alike].sum()), first))
        left &= ~alike
    return [direction for _, direction in sorted(found, key=lambda pair: -pair[0])]


def _frame(directions: Sequence[Array]) -> Array:
    """(3, 3) right-handed axes from three normals, or with one direction the third; turned as little as they can be."""
    if len(directions) == 1:
        axis = directions[0] * np.sign(directions[0][np.argmax(np.abs(directions[0]))])
        across = np.eye(3)[int(np.argmin(np.abs(np.round(axis, 6))))]
        first = across - (across @ axis) * axis
        first /= np.linalg.norm(first)
        return _tidy(np.stack([first, np.cross(axis, first), axis], axis=1))
    best = max(permutations(directions), key=lambda order: sum(abs(order[k][k]) for k in range(3)))
    columns = [direction * (1.0 if direction[k] >= 0 else -1.0) for k, direction in enumerate(best)]
    first, second = columns[0], columns[1] - (columns[1] @ columns[0]) * columns[0]
    second /= np.linalg.norm(second)
    return _tidy(np.stack([first, second, np.cross(first, second)], axis=1))


def _tidy(frame: Array) -> Array:
    """Axes without the round-off of the file where they are those of the file."""
    straight = np.round(frame) + 0.0
    return straight if np.abs(frame - straight).max() < ALONG else frame
