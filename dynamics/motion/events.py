"""What ends a trajectory: contact with a magnet, a plate or a coil, and loss.

The distance of the floater's centre from a box is exact, faces, edges and corners.  A Taylor step knows only the part
of the box that was nearest when it began; a contact that this may miss is found by `clearance` at the samples.
"""

from dataclasses import dataclass, replace

import heyoka as hy
import numpy as np

from ...geometry.common import Array
from ...geometry.overlap import TOUCHING, body_overlap, parting
from ...geometry.scene.contents import Scene, Stretch
from ...geometry.shapes import Box, Cylinder
from ...geometry.solids import Solid
from .plate import PlateMemory, raised, seen_by_plate
from .state import STEADY, Parameter, Scales, Turn, Vector, turned_about_z

# The last: where the range of a plate's table ends, beyond which nobody knows its currents' field.
CONTACT, LOST, BEYOND = "contact", "lost", "beyond"


# What ends a stretch of motion where it becomes negative, and the meaning of that.
Events = list[tuple[hy.expression, str]]


def flight_events(scene: Scene, position: Vector, turn: Turn = STEADY) -> Events:
    """Contact with bodies of a `scene`, and loss: scaled `position` (3,), rotor's frame, the rotor's `turn`."""
    length = hy.par[Parameter.LENGTH]
    metres = [length * p for p in position]
    inner = scene.floater.inner_radius
    gaps = [_excess(body, metres, inner) for body in scene.turning_bodies]
    gaps += [_excess(body, raised(position, turn), inner) for body in scene.standing_bodies]
    within = (scene.floater.inner_radius / scene.floater.radius) ** 2  # its own contact is found at the samples
    reach = hy.par[Parameter.LOST_DISTANCE] ** 2.0 - hy.sum([p * p for p in position])
    return [*((gap / (length * length) - within, CONTACT) for gap in gaps), (reach, LOST)]


def range_events(memory: PlateMemory, position: Vector, turn: Turn = STEADY) -> Events:
    """Ends of the range of the table of `memory`, by its faces in pairs; `position`, `turn` as of `flight_events`."""
    region = memory.table.region
    away = [x - float(c) for x, c in zip(seen_by_plate(memory.plate, position, turn), region.center, strict=True)]
    half = (region.upper - region.lower) / 2
    return [(1.0 - (a * a) / float(h) ** 2, BEYOND) for a, h in zip(away, half, strict=True)]


def _excess(body: Solid, position: Vector, contact: float) -> hy.expression:
    """Squared distance of a point outside a body from its surface, m²; from the wall of a hole exact at a `contact`, m.

    Elsewhere in the hole it is larger, as a root that vanishes on the axis would make all steps short.
    """
    shifted = [position[i] - float(body.center[i]) for i in range(3)]
    turn, half = body.rotation, [float(size / 2) for size in body.size]
    along = [hy.sum([float(turn[i, axis]) * shifted[i] for i in range(3) if turn[i, axis]]) for axis in range(3)]
    beyond = [hy.relu(x - edge) + hy.relu(-x - edge) for x, edge in zip(along, half, strict=True)]
    if not isinstance(body, Box):  # the root is never that of zero
        radius, square = half[0], along[0] * along[0] + along[1] * along[1]
        across = hy.sqrt(radius**2 + hy.relu(square - radius**2)) - radius
        hole = body.inner_radius if isinstance(body, Cylinder) else 0.0
        if hole > contact:
            across = across + hy.relu(hole**2 - square) / (2 * hole - contact)
        beyond = [across, beyond[2]]
    return hy.sum([b * b for b in beyond])


def clearance(scene: Scene, time: Array, position: Array, orientation: Array | None = None) -> Array:
    """Smallest gap (n,) in m between floater and bodies of `scene` at `time` (n,) s, `position` (n, 3) m (rotor's).

    Of a floater that is no sphere the gap of the smallest one about it where that is positive, else its own; without
    its `orientation` (see `State`), that of the sphere.
    """
    gaps = [body.distance(position) for body in scene.turning_bodies]
    if scene.standing_bodies:
        seen = turned_about_z(position, scene.angle(time))
        seen[:, 2] += scene.plate.depth(time) if scene.plate else 0.0
        gaps += [body.distance(seen) for body in scene.standing_bodies]
    found = np.min(gaps, axis=0) - scene.floater.radius if gaps else np.full(len(position), np.inf)
    if not scene.floater.is_sphere and orientation is not None:
        for k in np.flatnonzero(found < 0):
            pairs = _pairs(scene, float(time[k]), position[k], orientation[k])
            found[k] = min(-body_overlap(*pair) for pair in pairs)
    return found


def first_contact(scene: Scene, time: Array, position: Array, orientation: Array) -> int | None:
    """First of close instants at which the floater overlaps something, or None; arguments as of `clearance`."""
    near = np.flatnonzero(clearance(scene, time, position) < -TOUCHING)
    if scene.floater.is_sphere:
        return int(near[0]) if len(near) else None
    ways: dict[int, Array] = {}
    for k in near.tolist():
        for n, pair in enumerate(_pairs(scene, float(time[k]), position[k], orientation[k])):
            way = parting(*pair, ways.get(n))
            if way is None:
                return int(k)
            ways[n] = way
    return None


def _pairs(scene: Scene, time: float, position: Array, orientation: Array) -> list[tuple[Solid, Solid]]:
    parts = scene.floater.placed(position, orientation)
    found = [(body, part) for body in scene.turning_bodies for part in parts]
    if scene.standing_bodies:
        turn = scene.angle(time)
        seen = turned_about_z(position, turn)
        seen[2] += scene.plate.depth(time) if scene.plate else 0.0
        floater = scene.floater.placed(seen, turned_about_z(scene.floater.axes(orientation).T, turn).T)
        found += [(body, part) for body in scene.standing_bodies for part in floater]
    return found


def rotor_gap(scene: Scene, position: Array, orientation: Array | None = None) -> float:
    """Gap in m between floater at `position` (3,) m, rotor's frame, and rotor of `scene`; negative where they overlap.

    Coils about the axis, which stand still in that frame, count as the rotor. See `clearance` for a floater that is no
    sphere, whose `orientation` it needs.
    """
    pointing = None if orientation is None else orientation[None]
    alone = replace(scene, plate=None, coils=scene.axial_coils)
    return float(clearance(alone, np.zeros(1), position[None], pointing)[0])


@dataclass(frozen=True)
class Leg:
    """A stretch in which plate, drive and currents go on steadily; all but `end` as at t = 0, had they always. SI."""

    end: float
    depth: float  # of the plate
    speed: float
    angle: float  # of the rotor
    rate: float
    acceleration: float = 0.0
    way: Stretch | None = None  # of a rotor that is moved

    def write(self, values: Array, scales: Scales, scene: Scene) -> None:
        """Set the runtime parameters (p,) that say so."""
        speed, way = scales.length / scales.time, self.way
        values[Parameter.PLATE_DEPTH], values[Parameter.PLATE_SPEED] = self.depth / scales.length, self.speed / speed
        values[Parameter.ANGLE], values[Parameter.RATE] = self.angle, self.rate * scales.time
        values[Parameter.ACCELERATION] = self.acceleration * scales.time**2
        if way is not None:
            turned = way.axes.T
            values[Parameter.TILT_X : Parameter.TILT_Y + 1] = (turned @ way.about)[:2]
            values[Parameter.TILT], values[Parameter.TILT_RATE] = -way.rate * way.start, way.rate * scales.time
            values[Parameter.MOVE_X : Parameter.MOVE_Z + 1] = turned @ way.velocity / speed
            values[Parameter.GRAVITY_X : Parameter.GRAVITY_Z + 1] = turned @ scene.gravity * scales.time / speed


def motion_legs(scene: Scene, duration: float) -> list[Leg]:
    """The stretches of so many seconds, in turn."""
    plate = [(duration, 0.0, 0.0)]
    if scene.plate and (down := scene.plate.lowering) and down.speed:
        sinking = down.start + down.distance / down.speed, -down.start * down.speed, down.speed
        plate = [(down.start, 0.0, 0.0), sinking, (duration, down.distance, 0.0)]
    plate = [(min(end, duration), depth, speed) for end, depth, speed in plate]
    times, rates, angles = scene.knots
    slopes = np.append(np.diff(rates) / np.diff(times), 0.0)
    begins = rates - slopes * times
    angles = angles - (begins + rates) / 2 * times
    ends = [min(end, duration) for end in (*times[1:].tolist(), duration)]
    corners = [end for coil in scene.coils for end in coil.corners if 0 < end < duration]
    legs = []
    for end in sorted({*ends, *corners, *(end for end, _, _ in plate)}):
        _, depth, speed = next(leg for leg in plate if end <= leg[0])
        k = next(k for k, last in enumerate(ends) if end <= last)
        way = scene.stretches[k] if scene.moving else None
        legs.append(Leg(end, depth, speed, float(angles[k]), float(begins[k]), float(slopes[k]), way))
    return legs
