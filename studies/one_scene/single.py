"""The commands that answer one question: field, equilibria, simulate."""

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...dynamics.flights import Checkpoint, FlightStopped, Trajectory, starting_point
from ...fem.rotor_tables import NEAR_RTOL, RotorTable, complete
from ...fem.storage import owned, program_of, write_whole
from ...geometry.basics import Array
from ...geometry.scenes import OffsetStart, Scene, scene_digest
from ..results import lowering_times, save_figures, trajectory_dataset, trajectory_figure, write_dataset
from ..terminal import COLUMNS, Models, note, to_json
from .answers import equilibria_answer, field_answer, flight_answer
from .levitation import Levitation
from .words import effects_words, equilibria_words, flight_words, left_out_words, plate_words, tell_details

Job = tuple[Mapping[str, Any], list[str]]
"""Numbers for a program, lines for a person."""


def field_job(scene: Scene, points: Array, asked: Models, out: Path) -> Job:
    """B and its gradient at points (n, 3) m; writes field.csv."""
    levitation = Levitation(scene, asked)
    table = levitation.table
    known = complete(table, max(asked.rtol, NEAR_RTOL)) if isinstance(table, RotorTable) else table
    values = field_answer(known, points)
    b, gradient, error = values["B_T"], values["dB_T_per_m"].reshape(-1, 9), values["B_relative_error"]
    slopes = (f"dB{i}_d{j}_T_per_m" for i in "xyz" for j in "xyz")
    stream = io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow([*COLUMNS, "Bx_T", "By_T", "Bz_T", *slopes, "B_relative_error"])
    writer.writerows(np.column_stack([points * 1e3, b, gradient, error]))
    write_whole(out / "field.csv", stream.getvalue().encode())
    lines = [f"{'x':>9} {'y':>9} {'z':>9} mm {'Bx':>14} {'By':>14} {'Bz':>14} T   relative error"]
    lines += [
        f"{x:9.3f} {y:9.3f} {z:9.3f}    {b[0]:14.6e} {b[1]:14.6e} {b[2]:14.6e}     {error:.1e}"
        for (x, y, z), b, error in zip(points[:20] * 1e3, b, error, strict=False)
    ]
    lines.append(f"Model {values['model']}; {len(points)} points with gradients in {out / 'field.csv'}")
    return {**values, "tables_from_cache": levitation.from_cache}, lines


def equilibria_job(scene: Scene, asked: Models, spin: float, out: Path) -> Job:
    """All synchronous equilibria and their stability; writes equilibria.json."""
    levitation = Levitation(scene, asked, spin)
    values = {**equilibria_answer(levitation), "tables_from_cache": levitation.from_cache}
    write_whole(out / "equilibria.json", f"{to_json(values)}\n".encode())
    return values, [*equilibria_words(levitation), *plate_words(levitation), *effects_words(values)]


def simulate_job(scene: Scene, asked: Models, duration: float, out: Path, resume: bool) -> Job:
    """The motion; writes trajectory.nc and its figure, and keeps a checkpoint while it lasts."""
    with owned(out):
        return _simulated(scene, asked, duration, out, resume)


def _simulated(scene: Scene, asked: Models, duration: float, out: Path, resume: bool) -> Job:
    asked_of = {"scene": scene_digest(scene), "duration_s": duration, **vars(asked)}
    identity = to_json({**asked_of, "program": program_of(__package__)})
    checkpoint = Checkpoint(out / "checkpoint.npz", identity)
    if not resume:
        checkpoint.remove()
    elif checkpoint.read() is None:
        note(f"No checkpoint in {out}: the flight begins at t = 0.")
    levitation = Levitation(scene, asked)
    if isinstance(scene.start, OffsetStart):
        for line in left_out_words(levitation, levitation.survey.unknown):
            note(line)
    begin = starting_point(levitation.equilibria) if isinstance(scene.start, OffsetStart) else None
    if begin is not None and not begin.stable:
        note(f"The flight begins at an unstable equilibrium: e-fold in {1 / begin.growth_per_s:.2g} s.")

    def keep(flight: Trajectory) -> None:
        labels = {**levitation.labels, **lowering_times(scene), "headline": flight_words(levitation, flight)}
        flown = trajectory_dataset(flight, levitation.flight_plate).assign_attrs(labels)
        write_dataset(flown, out / "trajectory.nc", scene)
        save_figures({"trajectory": trajectory_figure(flown)}, out)

    try:
        flight = levitation.flight(duration, checkpoint)
    except FlightStopped as stop:
        keep(stop.flown)
        note(f"{stop} It is in {out / 'trajectory.nc'}; --resume goes on from there.")
        raise
    keep(flight)
    checkpoint.remove()
    values = {
        **flight_answer(levitation, flight),
        "trajectory": str(out / "trajectory.nc"),
        "tables_from_cache": levitation.from_cache,
    }
    tell_details(flight)
    told = [flight_words(levitation, flight), *plate_words(levitation), *effects_words(values)]
    return values, [*told, f"Trajectory in {values['trajectory']}, figure in {out / 'trajectory.png'}"]
