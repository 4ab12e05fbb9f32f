"""Broken inputs by the thousand: `python tests/fuzzing.py KIND NUMBER [SEED]`, or `make fuzz`.

Every input must end in exit status 0, 1 or 2 with a message, no traceback, within seconds, and leave no partial file.
Scenes are tried in processes of their own: none may warn, be silent for a minute, or take 2 GB.
"""

import base64
import contextlib
import io
import json
import os
import pickle
import random
import re
import signal
import socket
import string
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock
from urllib.parse import parse_qsl, quote, quote_plus, urlencode, urlsplit

import devtools
import meshio
import netgen.occ as occ
import numpy as np
import places
import psutil
import xarray as xr
from tornado import httpclient

from spinlev.fem import cache as checked_files
from spinlev.fem.cache import TableFileError, write_checked
from spinlev.fem.maps_of_B import read as readers
from spinlev.fem.maps_of_B.columns import FieldMapError
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.table import ROTOR
from spinlev.geometry import files as own_files, step_file
from spinlev.geometry.files import look_through
from spinlev.geometry.magnets import horizontal
from spinlev.geometry.meshes import solids
from spinlev.geometry.scene.files import load_scene
from spinlev.studies.cli import main as cli
from spinlev.studies.page.state import first_state

SCENES = sorted(places.SCENES.glob("*.toml"))
LONGEST = 60
"""Seconds of silence after which an input counts as a hang."""
MOST = 2_000_000_000
"""Bytes of memory that a scene may take."""
TOLD = 100
"""Inputs after which the numbers so far are told."""
GIVEN_UP = 300
"""Seconds after which a scene that says how far it is is left alone."""
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


OTHERS = [
    """frequency_hz = 120.0
[rotor]
configuration = "tilt"
angle_deg = 8.0
shape = "cylinder"
diameter_mm = 11.0
height_mm = 9.0
remanence_T = 1.28
coercivity_kA_m = 900.0
conductivity_S_m = 6.7e5
[floater]
shape = "cylinder"
diameter_mm = 9.0
height_mm = 8.0
remanence_T = 1.3
density_kg_m3 = 7600.0
""",
    """frequency_hz = 90.0
gravity_m_s2 = [0.0, 9.81, 0.0]
[[rotor.magnets]]
shape = "ring"
diameter_mm = 17.0
inner_diameter_mm = 7.0
height_mm = 5.2
center_mm = [1.5, 0.0, 0.0]
polarization_T = [0.0, 0.2, 1.18]
recoil_permeability = [1.05, 1.15]
[[rotor.magnets]]
shape = "sphere"
diameter_mm = 8.0
center_mm = [0.0, 0.0, 14.0]
rotation_deg = [10.0, 20.0, 30.0]
polarization_T = [1.3, 0.0, 0.0]
[[rotor.magnets]]
size_mm = [4.0, 5.0, 6.0]
center_mm = [0.0, 20.0, 0.0]
polarization_T = [0.0, 0.0, -1.2]
recoil_permeability = 1.0
[[rotor.conductors]]
shape = "cylinder"
diameter_mm = 5.0
height_mm = 30.0
center_mm = [0.0, 0.0, 40.0]
conductivity_S_m = 5.8e7
[floater]
shape = "cuboid"
size_mm = [6.0, 6.0, 7.0]
remanence_T = 1.3
recoil_permeability = 1.1
density_kg_m3 = 7500.0
[drag]
model = "stokes"
""",
    """frequency_hz = 150.0
[rotor]
configuration = "vertical"
displacement_mm = 15.0
shape = "sphere"
diameter_mm = 9.0
remanence_T = 1.3
field_map = "map.csv"
[floater]
diameter_mm = 6.0
remanence_T = 1.3
density_kg_m3 = 7500.0
conductivity_S_m = 1.0e6
[plate]
size_mm = [100.0, 100.0, 10.0]
center_mm = [0.0, 0.0, -60.0]
rotation_deg = [0.0, 15.0, 0.0]
conductivity_S_m = 5.8e7
[plate.lowering]
start_s = 0.001
speed_mm_s = 5.0
distance_mm = 20.0
[drag]
model = "air"
[start]
position_mm = [0.0, 0.0, -30.0]
velocity_mm_s = [1.0, 0.0, 0.0]
moment = [1.0, 0.0, -0.2]
spin_hz = [0.0, 0.0, 150.0]
""",
]
"""Scenes with all keys that the shipped ones lack."""
NUMBER = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")
EXTREMES = ["0.0", "-0.0", "5e-324", "1e-310", "1e-300", "1e-30", "1e30", "1e300", "1.7e308", "-5e-324", "9" * 400]
BREAKERS = [
    "[" * 5000 + "]" * 5000, "{a=" * 3000 + "1" + "}" * 3000, "[" * 80 + "]" * 80, "9" * 5000, "0x" + "f" * 5000,
    "1" + "0" * 400, "18446744073709551616", "'" + "x" * 100_000 + "'", r'"\u001b[2J\u0007"', "1979-05-27", "07:32:00",
    "130,5", "[nan, inf, -inf]", "[true, true, true]", "[[1.0, 2.0, 3.0]]", "{diameter_mm = 1.0}", "'../../etc/passwd'",
    "'/dev/zero'", "'a\\u0000b'", "'.'", "'map.csv'", '"a\\u0000b"',
]  # fmt: skip
KEYS = [
    ".".join(["a"] * 20_000), '"fr\\u0435quency_hz"', '""', "'a.b'", '"\\u001b[2J"', "k" * 10_000, "rotor.x.y",
    "plate.size_mm",
]  # fmt: skip


def stretched(text: str, chance: random.Random) -> str:
    """A scene with a number, or all of a body's, made larger or smaller by up to six decades, or extreme."""
    lines = text.split("\n")
    valued = [k for k, line in enumerate(lines) if NUMBER.search(line.partition("=")[2].partition("#")[0])]
    if not valued:
        return text
    first = chance.choice(valued)
    factor, extreme = 10 ** chance.uniform(-6, 6), chance.choice(EXTREMES)
    kind = chance.randrange(4)  # a number; an extreme; all lengths from there on; all lengths
    for k in [first] if kind < 2 else valued:
        if (kind == 2 and k < first) or (kind > 1 and "_mm" not in lines[k]):
            continue
        key, _, value = lines[k].partition("=")
        value = value.partition("#")[0]
        if kind == 1:
            value = NUMBER.sub(extreme, value, count=1)
        else:
            value = NUMBER.sub(lambda number: f"{float(number[0]) * factor:.6g}", value)
        lines[k] = f"{key}={value}"
    return "\n".join(lines)


def broken(text: str, chance: random.Random) -> str:
    """A scene with what parsers break on: as a value, as a key, or in the text."""
    lines = text.split("\n")
    k = chance.randrange(len(lines))
    if chance.random() < 0.6 and "=" in lines[k]:
        lines[k] = f"{lines[k].partition('=')[0]}= {chance.choice(BREAKERS)}"
    elif chance.random() < 0.5:
        lines.insert(k, f"{chance.choice(KEYS)} = {chance.choice(['1.0', *BREAKERS])}")
    else:
        lines[k] = chance.choice(["\ufeff", "\0", "\x1b[2J", "\r", "\u202e", "\ud800", "[a]", "[[rotor]]"]) + lines[k]
    return "\n".join(lines)


def unusual(path: Path, content: bytes, chance: random.Random) -> None:
    """Something in the place of a file."""
    kind = chance.randrange(8)
    if kind == 0:
        os.mkfifo(path)
    elif kind == 1:
        path.mkdir()
    elif kind < 6:
        path.symlink_to(["/dev/zero", path.name, "nowhere", "/proc/self/pagemap"][kind - 2])
    elif kind == 6:
        path.touch()
        os.truncate(path, 10**10)
    else:
        path.write_bytes(
            chance.choice([content.decode(errors="replace").encode("utf-16"), content[::-1], b"\xff", b""])
        )


class Heard(io.StringIO):
    """What a command says; whoever says something has another minute."""

    def write(self, text: str) -> int:
        signal.alarm(LONGEST)
        return super().write(text)


def answered(arguments: list[str]) -> int:
    """The exit status of the command line, in this process; a traceback or a silent failure is an error here."""
    said, answer = Heard(), io.StringIO()
    with contextlib.redirect_stderr(said):
        status = cli._status(arguments, answer)
    assert status in (0, 1, 2), status
    assert "Traceback" not in said.getvalue()
    assert status == 0 or said.getvalue().strip(), "no message"
    if status == 1:  # rare: worth a look
        print(f"exit status 1: {arguments}: {said.getvalue().strip()[-300:]}", file=sys.__stderr__)
    assert status == 0 or not answer.getvalue(), "an answer in spite of a failure"
    return status


def called_in_fork(seconds: float, function: Callable[..., Any], *given: Any) -> Any:
    """`call_apart` with a copy of this process instead of a new one: 20 times as fast."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():  # the copy of a process with threads that it does not use
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        signal.alarm(0)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        try:
            with os.fdopen(writing, "wb") as stream:
                stream.write(own_files.sent_answer(pickle.dumps((seconds, function, given))))
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as stream:
        sent = stream.read()
    _, status, used = os.wait4(child, 0)
    PEAKS["MB"], PEAKS["s"] = max(PEAKS["MB"], used.ru_maxrss / 1e3), max(PEAKS["s"], used.ru_utime + used.ru_stime)
    return own_files.outcome(os.waitstatus_to_exitcode(status), sent)


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
    """A scene with faults of all kinds, and a cheap command about it, in a process of its own."""
    signal.alarm(0)  # `apart` looks at the time
    path, points = folder / "scene.toml", folder / "points.csv"
    for file in (path, points):
        _remove(file)
    if not (folder / "map.csv").exists():
        _write_map(folder / "map.csv")
        _load(folder)
    text = chance.choice([*(shipped.read_text() for shipped in SCENES), *OTHERS])
    for change in chance.choices([mutated, stretched, broken], [3, 6, 1], k=chance.choice([1, 1, 1, 2, 3])):
        text = change(text, chance)
    content = text.encode(errors="surrogatepass")
    if chance.random() < 0.01:
        unusual(path, content, chance)
    else:
        path.write_bytes(content)
    if chance.random() < 0.01:
        unusual(points, b"x_mm,y_mm,z_mm\n0,0,-40\n", chance)
    else:
        points.write_text("x_mm,y_mm,z_mm\n0,0,-40\n")
    asked = chance.choices(list(SCENE_COMMANDS), [40, 2, 2, 2, 1])[0]
    arguments = [part.format(points=points) for part in SCENE_COMMANDS[asked]]
    return apart([asked.partition(" ")[0], str(path), *arguments, "--out", str(folder / "out")], folder)


SCENE_COMMANDS = {
    "field": ["--points", "{points}", "--model", "dipole"],
    "field map": ["--points", "{points}", "--model", "map"],
    "equilibria": ["--model", "dipole", "--plate-model", "none", "--interaction", "rigid"],
    "simulate": ["--model", "dipole", "--plate-model", "none", "--interaction", "rigid", "--duration-s", "0.01"],
    "plate": ["--at", "0,0,-40", "--frequency-hz", "100", "--model", "slab"],
}
"""Cheap commands about a scene."""


def _load(folder: Path) -> None:
    """Let this process load all that its copies need: they would do so again and again."""
    points = folder / "few.csv"
    points.write_text("x_mm,y_mm,z_mm\n0,0,-40\n")
    for asked, arguments in SCENE_COMMANDS.items():
        if asked != "field map":
            told = [part.format(points=points) for part in arguments]
            answered([asked, str(places.SCENES / "tilt-over-plate.toml"), *told, "--out", str(folder / "out")])


PEAKS = {"MB": 0.0, "s": 0.0}
"""Most memory and time that a scene has taken so far."""


def apart(arguments: list[str], folder: Path) -> int:
    """The exit status of the command line in a copy of this process; what it must not do is an error here."""
    said, rest = folder / "said", folder / "tmp"
    rest.mkdir(exist_ok=True)
    with warnings.catch_warnings():  # the copy of a process with threads that it does not use
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        _tried(arguments, said, rest)
    began = heard = time.monotonic()
    size, ended, status, used = -1, 0, 0, None
    while not ended:
        time.sleep(0.005 if time.monotonic() < began + 1 else 0.1)
        ended, status, used = os.wait4(child, os.WNOHANG)
        if said.exists() and said.stat().st_size != size:
            size, heard = said.stat().st_size, time.monotonic()
        if not ended and (time.monotonic() > heard + LONGEST or time.monotonic() > began + GIVEN_UP):
            os.kill(child, signal.SIGKILL)
    text = said.read_text(errors="replace")
    said.unlink()
    PEAKS["MB"] = max(PEAKS["MB"], used.ru_maxrss / 1e3)
    PEAKS["s"] = max(PEAKS["s"], time.monotonic() - began)
    code = os.waitstatus_to_exitcode(status)
    told = f"{' '.join(arguments)}: {text[-600:]}"
    assert time.monotonic() < heard + LONGEST, f"silent for a minute: {told}"
    assert code in (0, 1, 2) or time.monotonic() > began + GIVEN_UP, f"ended with {code}: {told}"
    assert used.ru_maxrss * 1024 < MOST, f"took {used.ru_maxrss / 1e6:.1f} GB: {told}"
    assert code == 0 or text.strip(), f"no message: {told}"
    for word in ("Traceback", "Warning", "failed at", "Error:"):
        assert word not in text, f"{word}: {told}"
    assert not any(rest.iterdir()), f"left behind: {list(rest.iterdir())}: {told}"
    return code


def _tried(arguments: list[str], said: Path, rest: Path) -> None:
    """The command line in the copy, whose end this is."""
    status = 70
    try:
        signal.alarm(0)
        with said.open("w") as heard:
            os.dup2(heard.fileno(), 2)
            sys.stderr = heard
            tempfile.tempdir = str(rest)
            warnings.simplefilter("always")
            status = cli._status(arguments, io.StringIO())
    finally:
        os._exit(status)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        path.rmdir()
    else:
        path.unlink(missing_ok=True)


def points(chance: random.Random, folder: Path) -> int:
    rows = [",".join(f"{chance.uniform(-20, 20):.3f}" for _ in range(2)) + ",-40" for _ in range(5)]
    path = folder / "points.csv"
    path.write_text(mutated("\n".join(["x_mm,y_mm,z_mm", *rows]), chance), errors="replace")
    arguments = ["field", str(SCENES[0]), "--points", str(path), "--model", "dipole", "--out", str(folder / "out")]
    return answered(arguments)


def table(chance: random.Random, folder: Path) -> int:
    whole = folder / "whole.nc"
    if not whole.exists():
        ROTOR.save(rotor_table(horizontal(2e-3, 10e-3, 1.3, 1.0), "cuboid"), whole)
    path = folder / "table.nc"
    path.write_bytes(damaged(whole.read_bytes(), chance))
    try:
        ROTOR.load(path)
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
        content = content[: -own_files.LENGTH]
    path.write_bytes(damaged(content, chance))
    command = chance.choice(["figure", "show", "cite", "report"])
    with mock.patch("spinlev.studies.catalogue.runner.save_figures", return_value=[]):
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
    "run.main_job", "run.field_job", "run.equilibria_job", "run.simulate_job", "run.plate_job",
    *(f"catalogue.runner.{job}" for job in ("study_job", "question_job", "draw_result", "show_job")),
    "catalogue.report.report_job",
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


class Explored:
    """`spinlev explore` as a process of its own, what it logs and how much memory it and its processes take."""

    most = 1.5e9
    """Bytes that they may take together, what they share counted once; 0.85 to 0.93e9 were seen."""

    def __init__(self, folder: Path) -> None:
        start = "import sys; from spinlev.studies.cli.start import main; sys.argv[0] = 'spinlev'; main()"
        command = [sys.executable, "-P", "-c", start, "explore", str(SCENES[0]), "--no-browser"]
        self.log, self.peak = folder / "explore.log", 0
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
        self.address = self.process.stdout.readline().strip()
        self.parts = urlsplit(self.address)

    def sent(self, content: bytes) -> int:
        """Status of what is answered to bytes; 0 where the line is closed without a word."""
        with socket.create_connection((self.parts.hostname, self.parts.port), timeout=LONGEST) as line:
            with contextlib.suppress(OSError):
                line.sendall(content)
                line.shutdown(socket.SHUT_WR)
            with contextlib.suppress(OSError):
                first = line.makefile("rb").readline(100).split()
                return int(first[1]) if len(first) > 1 else 0
        return 0

    def opened(self, query: str) -> devtools.LivePage:
        """A page, as soon as there are few enough."""
        while True:
            page = devtools.LivePage(self.address, query)
            if "more are not served" not in page.until(lambda page=page: page.shown).get("message", ""):
                return page
            page.close()
            time.sleep(0.2)

    def watched(self) -> None:
        """Look at memory and log."""
        mine = psutil.Process(self.process.pid)
        taken = 0
        for one in [mine, *mine.children(recursive=True)]:
            with contextlib.suppress(psutil.Error):
                taken += one.memory_full_info().pss  # copies of one process share what they do not change
        self.peak = max(self.peak, taken)
        assert taken < self.most, f"{taken / 1e9:.2f} GB"
        assert b"Traceback" not in self.log.read_bytes(), self.log.read_text(errors="replace")[-2000:]

    def close(self) -> None:
        """A normal page answers at the end; then it ends as it should."""
        try:
            page = self.opened("")
            page.answered()
            page.close()
            self.watched()
            print(f"explore: peak {self.peak / 1e9:.2f} GB, log {self.log.stat().st_size} bytes", file=sys.__stderr__)
            self.process.terminate()
            assert self.process.wait(30) == 0, self.log.read_text(errors="replace")[-1000:]
        finally:
            self.process.kill()
            self.process.wait()
            self.process.stdout.close()


EXPLORED: dict[Path, Explored] = {}
"""The server of a run of the fuzzer, by its folder."""
FILES = ["/etc/passwd", "/dev/zero", "/proc/self/environ", "../../x.step", "\\x00", "/nonexistent", "x" * 5000]
HEADERS = ["Host: evil.example", "Host: 127.0.0.1:x", "Host: [::1", "Host:", "Origin: http://evil.example",
           "Content-Length: 94000000", "Content-Length: -1", "Content-Length: x", "Transfer-Encoding: chunked",
           "Expect: 100-continue", "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
           "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol: x.y", "Cookie: \xff=\xfe; a",
           "Range: bytes=5-1", "If-None-Match: \xff", f"X: {'y' * 60_000}",
           "Accept-Encoding: gzip;q=x", "X-Forwarded-For: ::x", "\x00: \x00", " folded"]  # fmt: skip
METHODS = ["GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT", "get", "", "X" * 3000, "PRI"]
PATHS = ["/", "/ws", "/page.js", "/page.html", "/static/js/../x", "//", "*", "http://x/",
         "/%2e%2e/etc/passwd", "/autoload.js", "/metadata", "/\xff", "/%ff", "/%", ""]  # fmt: skip


def query_of(chance: random.Random) -> str:
    """The state of a scene as an address has it, with faults in keys, values and their encoding."""
    pairs = dict(parse_qsl(first_state(load_scene(chance.choice(SCENES))).query()))
    for _ in range(chance.randint(1, 4)):
        key = chance.choice([*pairs, "rotor.magnets", "rotor.field_map", "rotor.conductors", "plate", "token", "spin"])
        kind = chance.randrange(7)
        magnet = {"file": chance.choice(FILES), "center_mm": [0.0, 0.0, 0.0], "polarization_T": [0.0, 0.0, 1.0]}
        if kind == 0:
            pairs[key] = json.dumps([magnet] * chance.choice([1, 2, 70]))
        elif kind == 1:
            pairs[mutated(key, chance)] = pairs.pop(key, "1")
        elif kind == 2:
            pairs[key] = chance.choice(FILES)
        elif kind == 3:
            pairs[key] = chance.choice(
                ["[" * 3000, "9" * 5000, "1e999", "{}", '{"a": 1}', "[[]]", "null", "NaN", "true"]
            )
        elif kind == 4:
            pairs.pop(key, None)
        else:
            pairs[key] = mutated(pairs.get(key, "1.0"), chance) if kind == 5 else chance.choice(ODD)
    text = urlencode(pairs, quote_via=chance.choice([quote, quote_plus]))
    return mutated(text, chance) if chance.random() < 0.2 else text


def addresses(chance: random.Random, folder: Path) -> int:
    """What a running page is asked: mutated addresses, requests of any kind, and scenes that are opened in it."""
    server, kind = EXPLORED[folder], chance.random()
    if kind < 0.4:
        token = chance.choice([server.parts.query, "token=x", "", f"{server.parts.query}&token=y"])
        path = f"{chance.choice(PATHS)}?{token}&{chance.choice(['', query_of(chance)])}"
        version = chance.choice(["HTTP/1.1", "HTTP/1.1", "HTTP/1.0", "HTTP/9", ""])
        head = [f"{chance.choice(METHODS) if chance.random() < 0.4 else 'GET'} {path} {version}"]
        head += [f"Host: {server.parts.netloc}"] if chance.random() < 0.8 else []
        head += [chance.choice(HEADERS) for _ in range(chance.randrange(4))] + ["Connection: close"]
        body = bytes(chance.choice([0, 0, 10, 1_000_000]))
        content = "\r\n".join([*head, "", ""]).encode("latin-1", "replace") + body
        status = server.sent(damaged(content, chance) if chance.random() < 0.2 else content)
        assert status < 500, content[:500]
        server.watched()
        return 0 if status in (101, 200) else 2
    if kind < 0.8:
        query = query_of(chance)
        try:
            page = server.opened(query)
        except (httpclient.HTTPError, ConnectionError) as error:
            status = getattr(error, "code", 0)
        else:
            status = 200
            page.until(lambda: "frequency_hz" in page.names)
        if status != 200:
            assert status < 500, query
            server.watched()
            return 2
    else:
        page = server.opened("")
        text = mutated(chance.choice(SCENES).read_text(), chance).encode(errors="replace")
        content = base64.b64encode(damaged(text, chance) if chance.random() < 0.3 else text).decode()
        name = chance.choice(["scene.toml", *FILES])
        page.say("open", name, mutated(content, chance) if chance.random() < 0.1 else content)
        page.say("move", "frequency_hz", 123.5)  # to which something is said in any case
        page.until(lambda: "123.5" in page.shown.get("address", "") or page.shown.get("message"))
    said = page.shown.get("message")
    page.close()
    server.watched()
    return 2 if said else 0


NUMBERS = ["nan", "1.E400", "-0.", "1.E-300", "0.", "-1.", "9999999999", "1.E15", "$", "*", "#1", "''"]
"""In place of a number of a STEP file."""
PART = """frequency_hz = 100.0
[[rotor.magnets]]
file = "part.step"
center_mm = [0.0, 0.0, 0.0]
polarization_T = [0.3, 0.0, 1.0]
recoil_permeability = 1.05
[floater]
diameter_mm = 12.7
remanence_T = 1.3
density_kg_m3 = 7500.0
"""


def step(chance: random.Random, folder: Path) -> int:
    """A part whose STEP file is damaged as editors, exporters and disks do it."""
    whole = folder / f"{chance.choice(list(_solids()))}.step"
    if not whole.exists():
        _solids()[whole.stem]().WriteStep(str(whole))
    content = _damaged_step(whole.read_text(), chance).encode()
    (folder / "part.step").write_bytes(damaged(content, chance) if chance.random() < 0.2 else content)
    (folder / "scene.toml").write_text(PART)
    (folder / "points.csv").write_text("x_mm,y_mm,z_mm\n0,0,-40\n")
    given = ["field", str(folder / "scene.toml"), "--points", str(folder / "points.csv"), "--model", "dipole"]
    return answered([*given, "--out", str(folder / "out")])


def _solids() -> dict[str, Callable[[], Any]]:
    cube = occ.Box(occ.Pnt(-5, -5, -5), occ.Pnt(5, 5, 5))
    return {
        "cube": lambda: cube,
        "chamfered": lambda: cube.MakeChamfer(cube.edges, 1.0),
        "cylinder": lambda: occ.Cylinder(occ.Pnt(0, 0, 0), occ.Z, r=5, h=8),
        "two": lambda: occ.Compound([cube, occ.Box(occ.Pnt(8, 0, 0), occ.Pnt(9, 1, 1))]),
    }


def _damaged_step(text: str, chance: random.Random) -> str:
    entities = text.split(";\n")
    for _ in range(chance.randint(1, 4)):
        k, kind = chance.randrange(len(entities)), chance.randrange(6)
        number = re.compile(r"(?<![\w#'])-?\d+\.?\d*(?:E[+-]?\d+)?")
        if kind == 0:
            del entities[k : k + chance.choice([1, 1, 1, 20])]
        elif kind == 1:
            entities.insert(chance.randrange(len(entities) + 1), entities[k])
        elif kind == 2:
            entities = entities[: k + 1]
        elif kind == 3:
            entities[k] = re.sub(r"#\d+(?=[,)])", lambda _: f"#{chance.randint(1, 400)}", entities[k], count=1)
        elif kind == 4 and (found := list(number.finditer(entities[k]))):
            start, end = chance.choice(found).span()
            entities[k] = entities[k][:start] + chance.choice(NUMBERS) + entities[k][end:]
        else:
            other = chance.randrange(len(entities))
            entities[k], entities[other] = entities[other], entities[k]
        entities = entities or [""]
    return ";\n".join(entities)


KINDS: dict[str, Callable[[random.Random, Path], int]] = {
    "scene": scene, "points": points, "table": table, "result": result, "map": field_map, "command": command,
    "addresses": addresses, "step": step,
}  # fmt: skip


def fuzz(kind: str, number: int, seed: int = 0, faults: list[str] | None = None) -> Counter[int]:
    """Try `number` inputs of a kind; the number of each exit status.

    AssertionError names the seed of the first failure, unless `faults` takes them all.
    """

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
        mock.patch.object(step_file, "call_apart", called_in_fork),
        mock.patch.object(step_file, "LONGEST", PATIENCE),
        mock.patch.object(solids, "call_apart", called_in_fork),
    ):
        folder = Path(name)
        if kind == "addresses":
            EXPLORED[folder] = Explored(folder)
        try:
            for k in range(seed, seed + number):
                try:
                    counts[_one(kind, k, folder, ignored)] += 1
                except AssertionError as error:
                    if faults is None:
                        raise
                    faults.append(str(error))
                    print(error, file=sys.__stderr__, flush=True)
                if faults is not None and (k + 1 - seed) % TOLD == 0:
                    peak = f"{PEAKS['MB']:.0f} MB, {PEAKS['s']:.0f} s"
                    told = f"{k + 1 - seed} of {number}: {dict(sorted(counts.items()))}, {peak}, {len(faults)} faults"
                    print(told, file=sys.__stderr__, flush=True)
        finally:
            sys.unraisablehook = sys.__unraisablehook__
            if folder in EXPLORED:
                EXPLORED.pop(folder).close()
    return counts


def _one(kind: str, seed: int, folder: Path, ignored: list[BaseException | None]) -> int:
    """The exit status of one input. Raises AssertionError where it is not what it must be."""
    signal.alarm(LONGEST)
    try:
        status = KINDS[kind](random.Random(f"{kind} {seed}"), folder)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise AssertionError(f"{kind}, seed {seed}: {type(error).__name__}: {error}") from error
    finally:
        signal.alarm(0)
    assert not ignored, f"{kind}, seed {seed}: {ignored}"
    assert not [f for f in folder.glob("out/.*") if f.is_file()], f"{kind}, seed {seed}: a partial file"
    return status


if __name__ == "__main__":
    asked, many, first = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 0
    kinds = list(KINDS) if asked == "all" else asked.split(",")
    if not set(kinds) <= set(KINDS):
        sys.exit(f"Input KIND must be all, or some of {','.join(KINDS)}; instead received {asked!r}.")
    wrong: list[str] = []
    for one in kinds:
        began = time.perf_counter()
        number = many // 10 if asked == "all" and one == "addresses" else many  # pages take a second each
        found = fuzz(one, number, first, wrong)
        most = f", at most {PEAKS['MB']:.0f} MB and {PEAKS['s']:.0f} s" if one in ("scene", "step") else ""
        print(f"{one:8} {dict(sorted(found.items()))} in {time.perf_counter() - began:.0f} s{most}", flush=True)
    print(f"{len(wrong)} faults")
    sys.exit(bool(wrong))
