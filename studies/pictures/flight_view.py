"""From a flight and its tables to what is shown of it in three dimensions."""

import numpy as np

from ...dynamics.motion import State
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..rendering import FieldPlane, Frames, View, frame_times


def last_view(scene: Scene, table: FieldTable, motion: State) -> View:
    """The end of a flight (n, 3) along the rotor's axes, with its path and the field."""
    position, moment = motion.position[-1], motion.moment[-1]
    return View(scene, position, moment, motion.position, _field_plane(table, -1e3 * float(position[2])))


def _field_plane(table: FieldTable, depth: float) -> FieldPlane:
    width = max(1.2 * depth, 30.0)
    points = 1e-3 * FieldPlane.points(width, depth)
    field = np.full(points.shape, np.nan)
    known = table.in_range(points)
    field[known] = table.evaluate(points[known])[0]
    return FieldPlane(width, depth, field)


def flight_frames(scene: Scene, time: Array, motion: State) -> Frames:
    """The frames of an animation of a flight (n, 3) along the rotor's axes at times (n,) s."""
    instants = frame_times(scene, float(time[-1]))
    position, moment = (
        np.stack([np.interp(instants, time, component) for component in vectors.T], axis=-1)
        for vectors in (motion.position, motion.moment)
    )
    standing = State(position, np.zeros_like(position), moment, np.zeros_like(moment))
    laboratory = standing.to_lab(scene.angular_velocity * instants)
    return Frames(scene, instants, laboratory.position, laboratory.moment)
