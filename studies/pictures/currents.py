"""The eddy currents in the plate at one instant, for pictures."""

import numpy as np

from ...dynamics.motion import State
from ...fem.closed_forms import unit_dipoles
from ...fem.eddy_currents import Source, current_density, solve_eddy
from ...fem.plate_tables import posed_rotor, rotor_parts
from ...fem.rotor_tables import RotorTable
from ...geometry.basics import Array
from ...geometry.meshes import MeshRule, plate_mesh
from ...geometry.scenes import Plate, Scene

ORDER = 3
"""Of the elements: a picture needs no more."""
ANGLES = 8
"""Of the rotor, from which the part of its field at the rotor's frequency is taken."""


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
