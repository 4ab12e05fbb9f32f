"""From a flight and its tables to what is shown of it in three dimensions, the currents in the plate included."""

from dataclasses import replace

import numpy as np

from ...dynamics.motion import State
from ...fem.closed_forms import unit_dipoles
from ...fem.eddy_currents import Source, current_density, solve_eddy
from ...fem.plate_tables import posed_rotor, rotor_parts
from ...fem.rotor_tables import FieldTable, RotorTable, rotor_table
from ...geometry.basics import Array
from ...geometry.meshes import MeshRule, plate_mesh
from ...geometry.scenes import Plate, Scene
from ..rendering import FieldPlane, Frames, View, frame_times

ORDER = 3
"""Of the elements: a picture needs no more."""
LATEST = 200
"""Samples at the end of a flight among which one is shown."""
ANGLES = 8
"""Of the rotor, from which the part of its field at the rotor's frequency is taken."""


def last_view(scene: Scene, table: FieldTable, time: Array, motion: State) -> View:
    """The end of a flight (n, 3) along the rotor's axes at times (n,) s, with its path and the field."""
    view = seen_from(scene, time, motion)
    return replace(view, plane=_field_plane(scene, table, -1e3 * float(view.position[2])))


def seen_from(scene: Scene, time: Array, motion: State) -> View:
    """The end of a flight (n, 3) along the rotor's axes at times (n,) s, with its path.

    A floater that gravity across the axis keeps on one side of it does not turn with the rotor: its path is that in the
    laboratory, and it stands where it is at an instant near the end at which the rotor's axes are the laboratory's.
    """
    frame, last = "rotor's frame", len(time) - 1
    if np.any(scene.gravity[:2]):
        frame, angle = "laboratory", scene.angular_velocity * time
        motion = motion.to_lab(angle)
        last -= int(np.argmax(np.cos(angle[:-LATEST:-1])))
    return View(scene, motion.position[last], motion.moment[last], motion.position, frame=frame)


def _field_plane(scene: Scene, table: FieldTable, depth: float) -> FieldPlane:
    """The field as the table has it and, nearer to the magnets than its range, by the closed form."""
    depth = max(abs(depth), 10.0)
    width = max(1.6 * depth, 30.0)
    points = 1e-3 * FieldPlane.points(width, depth)
    field = np.full(points.shape, np.nan)
    for source in (rotor_table(scene.rotor, "cuboid"), table):
        known = source.in_range(points)
        field[known] = source.evaluate(points[known])[0]
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


def plate_currents(scene: Scene, plate: Plate, table: RotorTable, floater: State, points: Array) -> Array:
    """Current density (n, 3), A/m², laboratory frame, in a plate on which rotor and floater have long been turning.

    Parameters
    ----------
    floater : along the rotor's axes, at the instant at which these are the laboratory's; its place is taken as fixed
    points : (n, 3) m inside the plate, laboratory frame

    The part at the rotor's frequency only; harmonics are left out.
    """
    turning = np.array([[1, 1j, 0], [-1j, 1, 0], [0, 0, 0]]) @ floater.moment
    place = plate.box.to_body(floater.position[None])
    angles = 2 * np.pi * np.arange(ANGLES) / ANGLES
    parts = rotor_parts(table, plate)
    sources: list[Source] = [*unit_dipoles(place), *(posed_rotor(parts, plate, angle, 0.0) for angle in angles)]
    amplitudes = np.concatenate(
        [scene.floater.moment * (plate.box.rotation.T @ turning), 2 / ANGLES * np.exp(-1j * angles)]
    )
    mesh = plate_mesh(plate.box.size, plate.conductivity, place, scene.frequency, MeshRule())
    response = solve_eddy(mesh, ORDER, scene.frequency, sources)
    body = plate.box.to_body(points)
    applied = np.tensordot(amplitudes, np.array([source.vector_potential(body) for source in sources]), axes=1)
    return np.asarray(current_density(response, applied, amplitudes, body).real @ plate.box.rotation.T)
