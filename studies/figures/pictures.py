"""What is shown of a trajectory in three dimensions: its end, its frames, the field, and the currents in the plate."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...dynamics.motion.state import State
from ...fem.closed_forms.potentials import unit_dipoles
from ...fem.plate.eddy import Source, current_density, solve_eddy
from ...fem.plate.rotor_share import posed_rotor, rotor_parts
from ...fem.rotor.choice import rotor_table
from ...fem.rotor.table import FieldTable, RotorTable
from ...geometry.common import Array
from ...geometry.meshes.plate import MeshRule, plate_mesh
from ...geometry.scene.contents import Plate, Scene
from .view import FieldPlane, Frames, View, field_lines, frame_times, unit

ORDER = 3  # Of the elements: a picture needs no more
PATH = 12  # Turns of the rotor at the end of a trajectory whose path is drawn
LATEST = 200  # Samples at the end of a trajectory among which one is shown
ANGLES = 8  # Of the rotor, from which the part of its field at the rotor's frequency is taken


def last_view(scene: Scene, table: FieldTable, time: Array, motion: State) -> View:
    """The end of a trajectory as of `seen_from`, and the field by the rotor's `table`."""
    view, field = seen_from(scene, time, motion), drawn_field(scene, table)
    depth = max(abs(1e3 * float(view.position[2])), 10.0 * unit(scene))
    width = max(1.6 * depth, 30.0 * unit(scene))
    plane = FieldPlane(width, depth, field(1e-3 * FieldPlane.points(width, depth)))
    low, high = 1e-3 * np.array([(-width, -width, -1.6 * depth), (width, width, 0.8 * depth)])
    lines = field_lines(scene, lambda points: np.nan_to_num(field(points)), low, high)
    return replace(view, plane=plane, lines=lines)


def seen_from(scene: Scene, time: Array, motion: State) -> View:
    """The end of a trajectory of a `scene` with its path: `motion` along the rotor's axes at `time` (n,) s."""
    # Gravity across the axis keeps a floater on one side of it: its path is that in the laboratory, and it stands where
    # it is at an instant near the end at which the rotor's axes are the laboratory's.
    frame, last = "rotor's frame", len(time) - 1
    if np.any(scene.gravity[:2]):
        frame, angle = "laboratory", scene.angle(time)
        motion = motion.to_lab(angle)
        last -= int(np.argmax(np.cos(angle[:-LATEST:-1])))
    seconds = PATH / scene.frequency if scene.frequency else np.inf
    path = motion.position[(time <= time[last]) & (time >= time[last] - seconds)]  # all of it would be a solid band
    axes = None if motion.axes is None else motion.axes[last]
    return View(scene, motion.position[last], motion.moment[last], path, frame=frame, axes=axes)


def drawn_field(scene: Scene, table: FieldTable) -> Callable[[Array], Array]:
    """B (n, 3) T at points (n, 3) m by the table and, where that ends, the closed form; NaN inside the magnets."""
    sources = table, rotor_table(scene.rotor, "cuboid")

    def field(points: Array) -> Array:
        found = np.full(points.shape, np.nan)
        for source in sources:
            known = np.isnan(found[:, 0]) & source.in_range(points)
            found[known] = source.evaluate(points[known])[0]
        return found

    return field


def flight_frames(scene: Scene, time: Array, motion: State) -> Frames:
    """Frames of an animation, laboratory frame; `scene`, `time` and `motion` are as of `seen_from`."""
    instants = frame_times(scene, float(time[-1]))
    position, moment = (
        np.stack([np.interp(instants, time, component) for component in vectors.T], axis=-1)
        for vectors in (motion.position, motion.moment)
    )
    nearest = np.searchsorted(time, instants).clip(max=len(time) - 1)  # a turn is no sum of turns
    axes = None if motion.axes is None else motion.axes[nearest]
    standing = State(position, np.zeros_like(position), moment, np.zeros_like(moment), axes)
    laboratory = standing.to_lab(scene.angle(instants))
    return Frames(scene, instants, laboratory.position, laboratory.moment, laboratory.axes)


def plate_currents(scene: Scene, plate: Plate, table: RotorTable, floater: State, points: Array) -> Array:
    """Current density (n, 3), A/m², in a `plate` of a `scene` whose rotor and floater have long been turning.

    At `points` (n, 3) m inside the plate, laboratory frame, by the rotor's field `table` and the `floater` along the
    rotor's axes, at an instant at which these are the laboratory's; its place is taken as fixed. It is the part at the
    rotor's frequency.
    """
    turning = np.array([[1, 1j, 0], [-1j, 1, 0], [0, 0, 0]]) @ floater.moment
    place = plate.box.to_body(floater.position[None])
    angles = 2 * np.pi * np.arange(ANGLES) / ANGLES
    parts = rotor_parts(table, plate)
    sources: list[Source] = [*unit_dipoles(place), *(posed_rotor(parts, plate, angle, 0.0) for angle in angles)]
    own, rotor = scene.floater.moment * (plate.box.rotation.T @ turning), 2 / ANGLES * np.exp(-1j * angles)
    amplitudes = np.concatenate([own, rotor])
    mesh = plate_mesh(plate.body, plate.metal, place, scene.frequency, MeshRule())
    response = solve_eddy(mesh, ORDER, scene.frequency, sources)
    body = plate.box.to_body(points)
    applied = np.tensordot(amplitudes, np.array([source.vector_potential(body) for source in sources]), axes=1)
    return np.asarray(current_density(response, applied, amplitudes, body).real @ plate.box.rotation.T)
