"""The commands that answer one question: field, equilibria, simulate."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...dynamics.equilibria import survey, with_plate
from ...dynamics.flights import Checkpoint, FlightStopped, Trajectory, simulate, starting_point
from ...dynamics.motion import PlateMemory, Rates
from ...dynamics.steady import Equilibrium, Survey
from ...fem.rotor_tables import FieldTable
from ...fem.storage import program_of, write_whole
from ...geometry.basics import Array
from ...geometry.scenes import OffsetStart, Scene
from ..results import trajectory_dataset, write_dataset
from ..terminal import Tables, note, progress, to_json
from .answers import equilibria_answer, equilibria_lines, field_answer, flight_answer, flight_lines, omissions
from .points_file import COLUMNS
from .shelf import RotorField, Shelf

Job = tuple[Mapping[str, Any], list[str]]
"""Numbers for a program, lines for a person."""


def field_job(scene: Scene, points: Array, asked: Tables, out: Path) -> Job:
    """B and its gradient at points (n, 3) m; writes field.csv."""
    shelf = Shelf(scene, asked)
    values = field_answer(shelf.table(), points)
    header = [
        *COLUMNS,
        "Bx_T",
        "By_T",
        "Bz_T",
        *(f"dB{i}_d{j}_T_per_m" for i in "xyz" for j in "xyz"),
        "B_relative_error",
    ]
    rows = zip(
        points * 1e3, values["B_T"], values["dB_T_per_m"].reshape(-1, 9), values["B_relative_error"], strict=True
    )
    stream = io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow(header)
    writer.writerows([*place, *b, *gradient, error] for place, b, gradient, error in rows)
    write_whole(out / "field.csv", stream.getvalue().encode())
    lines = [f"{'x':>9} {'y':>9} {'z':>9} mm {'Bx':>14} {'By':>14} {'Bz':>14} T   relative error"]
    lines += [
        f"{x:9.3f} {y:9.3f} {z:9.3f}    {b[0]:14.6e} {b[1]:14.6e} {b[2]:14.6e}     {error:.1e}"
        for (x, y, z), b, error in zip(points[:20] * 1e3, values["B_T"], values["B_relative_error"], strict=False)
    ]
    lines.append(f"Model {values['model']}; {len(points)} points with gradients in {out / 'field.csv'}")
    return {**values, "tables_from_cache": shelf.from_cache}, lines


def equilibria_job(scene: Scene, asked: Tables, spin: float, out: Path) -> Job:
    """All synchronous equilibria and their stability; writes equilibria.json."""
    shelf = Shelf(scene, asked)
    table = shelf.table()
    found, memory = surveyed(shelf, table, spin)
    values = {
        **equilibria_answer(table, found.equilibria, memory),
        "not_modelled": omissions(scene, table, found.equilibria, memory),
        "tables_from_cache": shelf.from_cache,
    }
    write_whole(out / "equilibria.json", f"{to_json(values)}\n".encode())
    return values, [*equilibria_lines(scene, found.equilibria, memory), *values["not_modelled"]]


def simulate_job(scene: Scene, asked: Tables, duration: float, out: Path, resume: bool) -> Job:
    """The motion; writes trajectory.nc, and keeps a checkpoint while it lasts."""
    identity = to_json({"scene": scene.text, "duration_s": duration, **vars(asked), "program": program_of(__package__)})
    checkpoint = Checkpoint(out / "checkpoint.npz", identity)
    if not resume:
        checkpoint.remove()
    elif checkpoint.read() is None:
        note(f"No checkpoint in {out}: the flight begins at t = 0.")
    shelf = Shelf(scene, asked)
    table = shelf.table()
    if isinstance(scene.start, OffsetStart):
        note("Equilibria ...")
        found, memory = surveyed(shelf, table)
        chosen = starting_point(found.equilibria)
        if chosen is not None and not chosen.stable:
            note(f"The flight begins at an unstable equilibrium: e-fold in {1 / chosen.growth_per_s:.2g} s.")
    else:
        found, memory = None, shelf.memory(table, ())
    equilibria = found.equilibria if found else ()
    table = shelf.in_flight(table, memory, equilibria)
    models = {"model": table.model, "plate_model": memory.model if memory else "none"}

    def keep(flight: Trajectory) -> None:
        write_dataset(trajectory_dataset(flight).assign_attrs(models), out / "trajectory.nc", scene)

    try:
        flight = fly(scene, table, duration, equilibria, memory, checkpoint)
    except FlightStopped as stop:
        keep(stop.flown)
        note(f"{stop} It is in {out / 'trajectory.nc'}; --resume goes on from there.")
        raise
    keep(flight)
    checkpoint.remove()
    values = {
        **flight_answer(table, flight, memory),
        "not_modelled": omissions(scene, table, equilibria, memory),
        "trajectory": str(out / "trajectory.nc"),
        "tables_from_cache": shelf.from_cache,
    }
    return values, [*flight_lines(flight), *values["not_modelled"], f"Trajectory in {values['trajectory']}"]


def surveyed(shelf: Shelf, table: RotorField, spin: float = 0.0) -> tuple[Survey, PlateMemory | None]:
    """Equilibria with the plate of the scene, and that plate."""
    rates = Rates.of(shelf.scene, table)
    found = survey(shelf.scene, table, spin, rates=rates)
    memory = shelf.memory(table, found.equilibria)
    return (found if memory is None else with_plate(shelf.scene, table, found, memory, rates)), memory


def fly(
    scene: Scene,
    table: FieldTable,
    duration: float,
    found: tuple[Equilibrium, ...],
    memory: PlateMemory | None,
    checkpoint: Checkpoint | None = None,
) -> Trajectory:
    """Simulate with a progress bar."""
    note("Motion ...")
    with progress("Motion") as advance:
        return simulate(scene, table, duration, found, progress=advance, memory=memory, checkpoint=checkpoint)
