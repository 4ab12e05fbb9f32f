"""A plate's currents in many states as one netCDF file in the cache: the finite elements' part of a table.

Rows are kept in single precision: what couplings lose by it, about 1e-8, is far below any tolerance, and the fields of
the rounded rows make a passive network as well.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Watch, spread_points, unwatched
from ...geometry.meshes import MeshRule
from ...geometry.scenes import Plate
from ..elements import Parity
from ..storage import described, from_cache, program_of, read_checked, write_checked
from .current_space import CurrentSpace
from .region import Region
from .solution import PlateSolution, solve_currents
from .sources import OtherSources

FORMAT = "spinlev plate currents 1"
LOOKS = 20
"""Places in the plate at which the potential of a source is looked at to tell it from others."""


def save_solution(solution: PlateSolution, path: Path) -> None:
    """Write a solution; the file is whole or absent."""
    space = solution.space
    sizes = np.array([len(part) for part in space.fields])
    variables = {
        "box": (("number", "bound", "axis"), np.array([[b.lower, b.upper] for b in solution.boxes]), "m"),
        "frequency": (("bound",), np.array(solution.frequencies), "Hz"),
        "mirror": (("plane",), np.array(space.parity.mirrors, int), "1"),
        "point": (("node", "axis"), space.points, "m"),
        "root": (("component",), space.root, "S^1/2 m"),
        "size": (("class",), sizes, "1"),
        "field": (("state", "component"), np.concatenate(space.fields).astype(np.float32), "1"),
        "inductance": (("entry",), np.concatenate([part.ravel() for part in space.inductances]), "s"),
        "order_cells": (("whole_number",), np.array([space.order, space.cells]), "1"),
        "error": (("mesh_states",), np.array([solution.mesh_error, solution.space_error]), "1"),
        "probe": (("place", "axis"), solution.probes, "m"),
        "angular_frequency": (("trial",), solution.angular_frequencies, "rad/s"),
        "residual": (
            ("part", "trial", "source", "other"),
            np.stack([solution.residuals.real, solution.residuals.imag]),
            "J s",
        ),
    }
    write_checked(described(variables, {"format": FORMAT, "title": "Currents of a plate by finite elements"}), path)


def load_solution(path: Path) -> PlateSolution:
    """Read a solution; no time is spent on it.

    Raises
    ------
    TableFileError : the file is not one of this format, or its content is not what was written
    """
    data = {str(name): part.values for name, part in read_checked(path, FORMAT).data_vars.items()}
    sizes = data["size"]
    squares = np.split(data["inductance"], np.cumsum(sizes**2)[:-1])
    space = CurrentSpace(
        Parity(tuple(int(axis) for axis in data["mirror"])),
        data["point"],
        data["root"],
        tuple(np.split(data["field"].astype(float), np.cumsum(sizes)[:-1])),
        tuple(part.reshape(n, n) for part, n in zip(squares, sizes, strict=True)),
        *(int(number) for number in data["order_cells"]),
    )
    low, high = (float(f) for f in data["frequency"])
    mesh, states = (float(error) for error in data["error"])
    return PlateSolution(
        tuple(Region(*box) for box in data["box"]), (low, high), space, mesh, states,
        data["probe"], data["angular_frequency"], data["residual"][0] + 1j * data["residual"][1],
        0.0,
    )  # fmt: skip


def currents_key(
    plate: Plate, boxes: Sequence[Region], frequencies: tuple[float, float], rtol: float, others: OtherSources | None
) -> str:
    """SHA-256 of the programs and of what decides a solution; other sources by their potential in the plate."""
    numbers: list[ArrayLike] = [plate.box.size, [plate.conductivity, rtol], frequencies]
    numbers += [bound for box in boxes for bound in (box.lower, box.upper)]
    if others:
        places = spread_points(-plate.box.half_edges, plate.box.half_edges, LOOKS)
        numbers.append(np.round(others.places, 9))
        for source in (*others.training, *others.probes):
            potential = source.vector_potential(places)
            numbers.append(np.round(potential / np.abs(potential).max(), 9))
    return digest(f"{FORMAT} {program_of(__package__)}", numbers)


def digest(name: str, parts: Sequence[ArrayLike]) -> str:
    """SHA-256 of a name and of numbers."""
    found = hashlib.sha256(name.encode())
    for part in parts:
        found.update(np.ascontiguousarray(np.asarray(part) + 0.0, dtype="<f8").tobytes())
    return found.hexdigest()


def cached_solver(report: Callable[[str], None], watch: Watch = unwatched) -> Callable[..., PlateSolution]:
    """`solve_currents` that looks into the cache first."""

    def solve(
        plate: Plate,
        boxes: Sequence[Region],
        frequencies: tuple[float, float],
        rtol: float,
        rule: MeshRule | None = None,
        others: OtherSources | None = None,
    ) -> PlateSolution:
        if rule:
            return solve_currents(plate, boxes, frequencies, rtol, rule, others, watch)
        return from_cache(
            f"plate-currents-{currents_key(plate, boxes, frequencies, rtol, others)}.nc",
            load_solution,
            lambda: solve_currents(plate, boxes, frequencies, rtol, None, others, watch),
            save_solution,
            report,
        )[0]

    return solve
