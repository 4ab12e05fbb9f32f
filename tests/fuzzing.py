"""Broken inputs by the thousand: `python tests/fuzzing.py KIND NUMBER [SEED]`, or `make fuzz`.

Every input must end in exit status 0, 1 or 2 with a message, within seconds, and leave no partial file.
"""

import contextlib
import io
import os
import random
import signal
import string
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import meshio
import numpy as np
import places
import xarray as xr

from spinlev.fem.measured_maps import FieldMapError, readers
from spinlev.fem.rotor_tables import rotor_table
from spinlev.fem.rotor_tables.table_file import load_table, save_table
from spinlev.fem.storage import TableFileError, checked_files, whole_files, write_checked
from spinlev.fem.storage.foreign import look_through
from spinlev.geometry.bodies import horizontal
from spinlev.studies.command_line import cli

SCENES = sorted(places.SCENES.glob("*.toml"))
LONGEST = 60
"""Seconds after which an input counts as a hang."""
PATIENCE = 3
"""Seconds that HDF5 has for a file of another program, which it reads in a few milliseconds."""
ODD = [
    "",
    "0",
    "-1",
    "nan",
    "inf",
    "1e400",
    "1e-400",
    "'x'",
    "[]",
    "[1, 2]",
    "true",
    "{}",
    "1979-05-27",
    "\\u0000",
    "µ",
    '"',
    "=",
]


class HangError(BaseException):
    """An input took too long. No `except Exception` of the program shall take it for a failed computation."""


def mutated(text: str, chance: random.Random) -> str:
    """A text with a few faults of the kinds that people and editors make."""
    for _ in range(chance.randint(1, 4)):
        lines = text.split("\n")
        k = chance.randrange(len(lines))
        kind = chance.randrange(7)
        if kind == 0:
            del lines[k]
        elif kind == 1:
            lines.insert(chance.randrange(len(lines) + 1), lines[k])
        elif kind == 2 and "=" in lines[k]:
            lines[k] = lines[k].split("=")[0] + "= " + chance.choice(ODD)
        elif kind == 3 and lines[k]:
            place = chance.randrange(len(lines[k]))
            lines[k] = lines[k][:place] + chance.choice(string.printable) + lines[k][place + 1 :]
        elif kind == 4:
            lines[k] = "".join(chance.choice([c, c, c, c.upper(), ""]) for c in lines[k])
        elif kind == 5:
            lines = lines[: k + 1]
        else:
            digits = [j for j, c in enumerate(lines[k]) if c.isdigit()]
            if digits:
                j = chance.choice(digits)
                lines[k] = lines[k][:j] + chance.choice(["-", "9999999", "e", ".", "0", "_"]) + lines[k][j + 1 :]
        text = "\n".join(lines)
    return text


def damaged(content: bytes, chance: random.Random) -> bytes:
    """Bytes of which some are flipped, cut off, zeroed or doubled."""
    found = bytearray(content)
    for _ in range(chance.randint(1, 3)):
        place = chance.randrange(max(1, len(found)))
        kind = chance.randrange(4)
        if kind == 0 and found:
            found[place % len(found)] ^= 1 << chance.randrange(8)
        elif kind == 1:
            found = found[:place]
        elif kind == 2:
            length = chance.randint(1, 64)
            found[place : place + length] = bytes(min(length, max(0, len(found) - place)))
        else:
            found[place:place] = found[place : place + chance.randint(1, 200)]
    return bytes(found)


def answered(arguments: list[str]) -> int:
    """The exit status of the command line, in this process; a traceback or a silent failure is an error here."""
    said, answer = io.StringIO(), io.StringIO()
    with contextlib.redirect_stderr(said):
        status = cli._status(arguments, answer)
    assert status in (0, 1, 2), status
    assert "Traceback" not in said.getvalue()
    assert status == 0 or said.getvalue().strip(), "no message"
    if status == 1:  # rare: worth a look
        print(f"exit status 1: {arguments}: {said.getvalue().strip()[-300:]}", file=sys.__stderr__)
    assert status == 0 or not answer.getvalue(), "an answer in spite of a failure"
    return status


def fault_in_fork(path: Path) -> str | None:
    """`hdf5_fault` with a copy of this process instead of a new one, and less patience: 50 times as fast."""
    with warnings.catch_warnings():  # the copy of a process with threads that it does not use
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(PATIENCE)
        try:
            look_through(path)
        except BaseException:
            os._exit(1)
        os._exit(0)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return f"exit status {status} of HDF5" if status else None


def scene(chance: random.Random, folder: Path) -> int:
    path = folder / "scene.toml"
    path.write_text(mutated(chance.choice(SCENES).read_text(), chance), errors="replace")
    points = folder / "points.csv"
    points.write_text("x_mm,y_mm,z_mm\n0,0,-40\n")
    return answered(["field", str(path), "--points", str(points), "--model", "dipole", "--out", str(folder / "out")])


def points(chance: random.Random, folder: Path) -> int:
    rows = [",".join(f"{chance.uniform(-20, 20):.3f}" for _ in range(2)) + ",-40" for _ in range(5)]
    path = folder / "points.csv"
    path.write_text(mutated("\n".join(["x_mm,y_mm,z_mm", *rows]), chance), errors="replace")
    arguments = ["field", str(SCENES[0]), "--points", str(path), "--model", "dipole", "--out", str(folder / "out")]
    return answered(arguments)


def table(chance: random.Random, folder: Path) -> int:
    whole = folder / "whole.nc"
    if not whole.exists():
        save_table(rotor_table(horizontal(2e-3, 10e-3, 1.3, 1.0), "cuboid"), whole)
    path = folder / "table.nc"
    path.write_bytes(damaged(whole.read_bytes(), chance))
    try:
        load_table(path)
    except TableFileError:
        return 2
    return 0


def result(chance: random.Random, folder: Path) -> int:
    whole = folder / "whole" / "result.nc"
    if not whole.exists():
        time = np.linspace(0.0, 1.0, 20)
        vectors = {n: (("time", "axis"), np.ones((20, 3))) for n in ("position", "moment", "position_rotor_frame")}
        flight = xr.Dataset(vectors, {"time": time, "axis": list("xyz")}, {"study": "simulate", "scene": "x = 1"})
        write_checked(flight, whole)
    path = folder / "results" / "result.nc"
    path.parent.mkdir(exist_ok=True)
    content = whole.read_bytes()
    if chance.random() < 0.5:  # as another program would have written it: HDF5 must find the damage
        content = content[: -whole_files.LENGTH]
    path.write_bytes(damaged(content, chance))
    command = chance.choice(["figure", "show", "cite", "report"])
    with mock.patch("spinlev.studies.catalogue.drawings.save_figures", return_value=[]):
        return answered([command, str(path.parent if command == "report" else path), "--out", str(folder / "out")])


def field_map(chance: random.Random, folder: Path) -> int:
    """A measured map as CSV, as netCDF of another program (without our checksum), or as a mesh."""
    suffix = chance.choice([".csv", ".nc", ".vtu", ".vtk"])
    whole, path = folder / f"whole-map{suffix}", folder / f"map{suffix}"
    if not whole.exists():
        _write_map(whole)
    if suffix == ".csv":
        path.write_text(mutated(whole.read_text(), chance), errors="replace")
    else:
        path.write_bytes(damaged(whole.read_bytes(), chance))
    try:
        readers.read_field_map(path)
    except FieldMapError:
        return 2
    return 0


def _write_map(path: Path) -> None:
    places = np.stack(np.meshgrid(*[np.linspace(-0.02, 0.02, 4)] * 3), axis=-1).reshape(-1, 3) - [0.0, 0.0, 0.04]
    field = rotor_table(horizontal(2e-3, 10e-3, 1.3, 1.0), "cuboid").evaluate(places)[0]
    if path.suffix == ".csv":
        rows = [",".join(f"{value:.6g}" for value in row) for row in np.hstack([1e3 * places, field])]
        path.write_text("\n".join(["x_mm,y_mm,z_mm,Bx_T,By_T,Bz_T", *rows]))
    elif path.suffix == ".nc":
        columns = {n: ("point", v, {"units": "m"}) for n, v in zip("xyz", places.T, strict=True)}
        columns |= {f"B{n}": ("point", v, {"units": "T"}) for n, v in zip("xyz", field.T, strict=True)}
        xr.Dataset(columns).to_netcdf(path, engine="h5netcdf")
    else:
        meshio.Mesh(places, [("vertex", np.arange(len(places))[:, None])], point_data={"B": field}).write(path)


COMMANDS = {
    "run": ["--duration-s", "--spin", "--model", "--rtol", "--plate-model", "--plate-rtol", "--json", "--out"],
    "field": ["--points", "--model", "--rtol", "--json"],
    "equilibria": ["--spin", "--model", "--rtol", "--plate-model", "--json"],
    "simulate": ["--duration-s", "--resume", "--model", "--json"],
    "plate": ["--at", "--frequency-hz", "--model", "--rtol", "--json"],
    "study": ["--list", "--quick", "--vary", "--ask", "--at", "--workers", "--scheduler", "--json"],
    "figure": ["--json", "--out"],
    "show": ["--out"],
    "report": ["--out"],
    "cite": ["--json"],
}
VALUES = ["", "0", "1", "-1", "3.5", "1e-5", "nan", "inf", "dipole", "slab", "auto", "x", "1,2,3",
          "frequency_hz=1:2:1", "-0", "a=1", "--json", "team7", "tcp://", str(SCENES[0]),
          "/nonexistent", "../..", "ä", "9" * 400,
          "-1,0,-40"]  # fmt: skip
JOBS = [
    "one_scene.main_job", "one_scene.field_job", "one_scene.equilibria_job", "one_scene.simulate_job",
    "one_scene.plate_job", "catalogue.study_job", "catalogue.question_job", "catalogue.draw_result",
    "catalogue.show_job", "catalogue.report_job",
]  # fmt: skip


def command(chance: random.Random, folder: Path) -> int:
    """A random command line; the jobs themselves are replaced, so that what is tried is how lines are read."""
    name = chance.choice([*COMMANDS, "", "--help", "--version", "nonsense"])
    arguments = [name] if name else []
    for _ in range(chance.randrange(6)):
        arguments.append(chance.choice([*COMMANDS.get(name, ["--json"]), *VALUES]))
    with contextlib.ExitStack() as stack:
        for job in JOBS:
            pair = ((), []) if job.endswith(("show_job", "draw_result")) else ({}, [])
            stack.enter_context(mock.patch(f"spinlev.studies.{job}", return_value=pair[0] or pair))
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        return answered(arguments)


KINDS: dict[str, Callable[[random.Random, Path], int]] = {
    "scene": scene, "points": points, "table": table, "result": result, "map": field_map, "command": command,
}  # fmt: skip


def fuzz(kind: str, number: int, seed: int = 0) -> Counter[int]:
    """Try `number` inputs of a kind; the number of each exit status. AssertionError names the seed of a failure."""

    def too_long(*_: object) -> None:
        raise HangError

    def not_ignored(what: "sys.UnraisableHookArgs") -> None:
        ignored.append(what.exc_value)

    ignored: list[BaseException | None] = []
    sys.unraisablehook = not_ignored
    counts: Counter[int] = Counter()
    signal.signal(signal.SIGALRM, too_long)
    with (
        tempfile.TemporaryDirectory() as name,
        mock.patch.dict(os.environ, SPINLEV_CACHE=f"{name}/cache"),
        mock.patch.object(checked_files, "hdf5_fault", fault_in_fork),
        mock.patch.object(readers, "hdf5_fault", fault_in_fork),
    ):
        folder = Path(name)
        try:
            for k in range(seed, seed + number):
                signal.alarm(LONGEST)
                try:
                    counts[KINDS[kind](random.Random(f"{kind} {k}"), folder)] += 1
                except BaseException as error:
                    raise AssertionError(f"{kind}, seed {k}: {type(error).__name__}: {error}") from error
                finally:
                    signal.alarm(0)
                assert not ignored, f"{kind}, seed {k}: {ignored}"
                assert not [f for f in folder.glob("out/.*") if f.is_file()], f"{kind}, seed {k}: a partial file"
        finally:
            sys.unraisablehook = sys.__unraisablehook__
    return counts


if __name__ == "__main__":
    asked, many, first = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 0
    for one in KINDS if asked == "all" else [asked]:
        began = time.perf_counter()
        found = fuzz(one, many, first)
        print(f"{one:8} {dict(sorted(found.items()))} in {time.perf_counter() - began:.0f} s", flush=True)
