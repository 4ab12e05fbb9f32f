"""The command `export`: the fields of a scene for ParaView and all that reads VTU.

Rotor and floater as they are at t = 0, at the first equilibrium or where the scene says. Outside the magnets B is that
of the field's table; inside them, and nearer than the table reaches, it is the closed form, with the magnetisation
M = J/μ0 + (μr - 1) H to first order in the recoil permeability. The floater is a uniformly magnetised sphere; one of
another shape is as the magnets are. The field of the plate's currents is not in B.
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from ...dynamics.equilibria import free_of_bodies
from ...dynamics.motion import State
from ...fem.closed_forms import closed_form_error, fields_of_magnets, fields_of_sphere
from ...fem.storage import write_whole
from ...geometry.basics import MU_0, Array, Box, InputError
from ...geometry.scenes import AbsoluteStart, Scene
from ..one_scene import Levitation, sources
from ..pictures import plate_currents
from ..terminal import Models, note

MARGIN = 8e-3
"""Air around rotor and floater, m."""
STEPS, PLATE_STEPS = 64, (41, 41, 9)
"""Points along the longest edge of the grid about rotor and floater, and along the edges of the plate."""
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
AIR, ROTOR, FLOATER, PLATE = range(4)


def export_job(scene: Scene, asked: Models, path: Path) -> tuple[Mapping[str, Any], list[str]]:
    """Write B (T), H and M (A/m), J (A/m²) and the body's number at the points of two grids.

    Raises
    ------
    InputError : the file's name does not end in .vtu
    """
    if path.suffix != ".vtu":
        raise InputError(f"Input OUT must end in .vtu; instead received {path}.")
    levitation = Levitation(scene, asked)
    state = _floater_state(levitation)
    about, cells = _grid(*_bounds(scene, state), STEPS)
    parts = [(about, cells, _fields(levitation, state, about))]
    if scene.plate is not None and scene.frequency and state is not None:
        note("Currents in the plate ...")
        inside, cells = _plate_grid(scene.plate.box)
        current = plate_currents(scene, scene.plate, sources(levitation.table), state, inside)
        data = _fields(levitation, state, inside)
        parts.append((inside, cells, {**data, "J": current, "body": np.full(len(inside), PLATE)}))
    _write(path, parts)
    count = sum(len(points) for points, _, _ in parts)
    values = {
        "model": levitation.table.model,
        "error_estimate": closed_form_error(scene.rotor),
        "file": str(path),
        "points": count,
        "floater": state is not None,
    }
    return values, [f"B, H, M and J at {count} points in {path}"]


def _floater_state(levitation: Levitation) -> State | None:
    """The floater at t = 0, (3,) along the rotor's axes; None where the scene tells no place for it."""
    start = levitation.scene.start
    if isinstance(start, AbsoluteStart):
        return State(start.position, start.velocity, start.moment, start.spin)
    known = free_of_bodies(levitation.scene, levitation.without_plate) if levitation.scene.frequency else None
    if known is None or not known.equilibria:
        note("There is no equilibrium: the floater is left out.")
        return None
    return known.equilibria[0].start


def _bounds(scene: Scene, state: State | None) -> tuple[Array, Array]:
    corners = [magnet.box.corners for magnet in scene.rotor]
    if state is not None:
        corners += [state.position[None] + s * scene.floater.radius for s in (-1, 1)]
    together = np.concatenate(corners)
    return together.min(axis=0) - MARGIN, together.max(axis=0) + MARGIN


def _grid(lower: Array, upper: Array, steps: int) -> tuple[Array, Array]:
    """Points (n, 3) m of a grid with cubic cells, and the cells."""
    counts = np.maximum(2, np.round(steps * (upper - lower) / (upper - lower).max()).astype(int))
    return _lattice([np.linspace(lower[k], upper[k], counts[k]) for k in range(3)])


def _plate_grid(box: Box) -> tuple[Array, Array]:
    """Points a little inside the plate's faces, where the current is known from within."""
    body, cells = _lattice(
        [np.linspace(-0.499, 0.499, n) * size for n, size in zip(PLATE_STEPS, box.size, strict=True)]
    )
    return box.center + body @ box.rotation.T, cells


def _lattice(axes: list[Array]) -> tuple[Array, Array]:
    shape = tuple(len(axis) for axis in axes)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    numbers = np.arange(len(points)).reshape(shape)
    corner = [tuple(slice(c, n - 1 + c) for c, n in zip(place, shape, strict=True)) for place in CORNERS]
    return points, np.stack([numbers[part].ravel() for part in corner], axis=1)


def _fields(levitation: Levitation, state: State | None, points: Array) -> dict[str, Array]:
    """B, H, M, no J, and the number of the body at points (n, 3) m."""
    scene, table = levitation.scene, levitation.table
    h, magnetization = fields_of_magnets(scene.rotor, points)
    body = np.full(len(points), AIR)
    for magnet in scene.rotor:
        body[magnet.body.distance(points) <= 0] = ROTOR
    known = (body == AIR) & table.in_range(points)
    h[known] = table.evaluate(points[known])[0] / MU_0
    if state is not None:
        moment, radius = scene.floater.moment * state.moment, scene.floater.radius
        if scene.floater.body is None:
            own, inside = fields_of_sphere(moment, state.position, radius, points)
        else:
            own, inside = fields_of_magnets([scene.floater.magnet(state.position, state.moment)], points)
        h, magnetization = h + own, magnetization + inside
        body[inside.any(axis=1)] = FLOATER
    return {"B": MU_0 * (h + magnetization), "H": h, "M": magnetization, "J": np.zeros_like(points), "body": body}


def _write(path: Path, parts: list[tuple[Array, Array, dict[str, Array]]]) -> None:
    """One file of all grids."""
    starts = np.cumsum([0, *(len(points) for points, _, _ in parts)])
    cells = np.concatenate([part + start for start, (_, part, _) in zip(starts, parts, strict=False)])
    data = {name: np.concatenate([part[name] for _, _, part in parts]) for name in parts[0][2]}
    mesh = meshio.Mesh(np.concatenate([points for points, _, _ in parts]), [("hexahedron", cells)], point_data=data)
    write_grids(path, mesh)


def write_grids(path: Path, mesh: meshio.Mesh) -> None:
    """Write a mesh as VTU; the file is whole or absent."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fields.vtu"
        mesh.write(file)
        write_whole(path, file.read_bytes())
