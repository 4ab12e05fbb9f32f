"""Real processes that are stopped, killed, starved or run side by side; within one process: test_faults."""

import json
import os
import pty
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from places import HORIZONTAL

from spinlev.fem.cache import read_checked

pytestmark = pytest.mark.slow

SCENE = str(HORIZONTAL)
CALL = "import sys; from spinlev.studies.cli.start import main; sys.argv[0] = 'spinlev'; main()"
DIPOLE = ("--model", "dipole", "--plate-model", "none")
FIELD = ("field", SCENE, "--points", "points.csv", "--model", "fem", "--rtol", "3e-5", "--json")
FLIGHT = ("simulate", SCENE, "--duration-s", "300", *DIPOLE, "--json")
RUN = ("run", SCENE, "--duration-s", "0.2", "--rtol", "1e-3", *DIPOLE, "--json")
VARY = ("frequency_hz=92:120:0.1",)
"""281 points in five batches, so that the sweep goes on for seconds after its first."""
SWEEP = ("study", SCENE, "--vary", *VARY, *DIPOLE, "--json")
PHASES = {
    "field: the table is computed": (FIELD, "finite elements ...", 0.2),
    "simulate: equilibria": (FLIGHT, "Equilibria ...", 0.3),
    "simulate: motion": (FLIGHT, "Motion ...", 1.0),
    "run: table": (RUN, "finite elements ...", 0.2),
    "run: equilibria": (RUN, "Equilibria ...", 0.3),
    "run: files": (RUN, "Files and figures ...", 0.5),
    "sweep in one process": ((*SWEEP, "--workers", "1"), "000000-*.json", 0.1),
    "sweep: its cluster starts": ((*SWEEP, "--workers", "2"), "0*.json", 0.8),
    "sweep on a cluster": ((*SWEEP, "--workers", "2"), "000000-*.json", 0.1),
}
RESULTS = ("field.csv", "trajectory.nc", "result.nc", "question.nc")


@pytest.fixture
def spinlev(tmp_path, monkeypatch):
    """Start the command in an empty folder, as a group of processes like those of a terminal."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path / "cache"))
    Path("points.csv").write_text("x_mm,y_mm,z_mm\n0,0,-20\n3,1,-25\n")

    def start(*arguments, limit=None):
        with Path("said").open("w") as said, Path("answer").open("w") as answer:
            return subprocess.Popen(
                [sys.executable, "-c", CALL, *map(str, arguments)],
                stdout=answer,
                stderr=said,
                start_new_session=True,
                preexec_fn=limit,
            )

    return start


def reached(process, sign):
    """Wait until the phase has begun: its message, or a file of it."""
    while sign not in Path("said").read_text() and not list(Path("out").rglob(sign)):
        assert process.poll() is None, Path("said").read_text()
        time.sleep(0.01)


def numbers(folder):
    """What a finished command has left, as comparable values."""
    found = {}
    for path in sorted(Path(folder).rglob("*")):
        if path.name in RESULTS and path.suffix == ".nc":
            dataset = read_checked(path)
            found[path.name] = {str(k): v.values for k, v in dataset.variables.items() if v.dtype.kind == "f"}
        elif path.name == "field.csv":
            found[path.name] = {"table": np.loadtxt(path, delimiter=",", skiprows=1)[:, :15]}
    assert found
    return found


def same(folder, other):
    first, second = numbers(folder), numbers(other)
    assert first.keys() == second.keys()
    for name, columns in first.items():
        for key, values in columns.items():
            # Estimated errors are differences that cancel; a table made anew is the same to round-off.
            scale = np.nanmax(np.abs(values), initial=1e-300)
            rtol = 1e-7 if "error" in key else 1e-10
            np.testing.assert_allclose(second[name][key], values, rtol=rtol, atol=rtol * scale, err_msg=f"{name} {key}")


@pytest.mark.parametrize("blow", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=lambda blow: blow.name)
@pytest.mark.parametrize("phase", PHASES)
def test_a_blow_in_every_phase(spinlev, phase, blow):
    """Ctrl-C and SIGTERM end with status 1 and leave nothing half done; after SIGKILL the next run tidies up."""
    arguments, sign, later = PHASES[phase]
    process = spinlev(*arguments)
    reached(process, sign)
    time.sleep(later)
    assert process.poll() is None, "the phase was over already"
    os.killpg(process.pid, blow)
    status = process.wait(timeout=60)
    said = Path("said").read_text()
    assert "Traceback" not in said, said
    if blow == signal.SIGKILL:
        assert status == -signal.SIGKILL
    else:
        assert status == 1, said
        assert "stopped; what was finished is kept" in said
        assert Path("answer").read_text() == ""
        assert [path for path in Path().rglob(".*") if path.is_file()] == []
    again = (*arguments, "--resume") if arguments == FLIGHT else arguments
    assert spinlev(*again).wait(timeout=300) == 0, Path("said").read_text()
    assert json.loads(Path("answer").read_text())
    assert [path for path in Path().rglob(".*") if path.is_file()] == []
    assert spinlev(*arguments, "--out", "undisturbed").wait(timeout=300) == 0
    same("undisturbed", "out")


def test_a_terminal_that_is_closed_leaves_the_flight(spinlev):
    """It says so twice, and whatever is printed there then is an error."""
    process, terminal = pty.fork()
    if process == 0:
        os.execv(sys.executable, [sys.executable, "-c", CALL, *FLIGHT])
    shown = b""
    while b"Motion" not in shown:
        shown += os.read(terminal, 4096)
    while not list(Path("out").glob("checkpoint*")):  # some seconds of flight
        os.read(terminal, 4096)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == 1
    begun = read_checked("out/trajectory.nc")
    assert begun.attrs["ended_by"] == "stopped"
    assert begun.time[-1] > 0
    assert spinlev(*FLIGHT, "--resume").wait(timeout=300) == 0, Path("said").read_text()
    assert spinlev(*FLIGHT, "--out", "undisturbed").wait(timeout=300) == 0
    same("undisturbed", "out")


def test_two_processes_that_need_the_same_table(spinlev):
    processes = [spinlev(*FIELD, "--out", folder) for folder in ("one", "two")]
    assert [process.wait(timeout=300) for process in processes] == [0, 0]
    assert len(list(Path("cache").glob("rotor-*.nc"))) == 1
    same("one", "two")


@pytest.mark.parametrize("size", [0, 5_000, 60_000])
@pytest.mark.parametrize("arguments", [FIELD, RUN, (*SWEEP, "--workers", "1")], ids=["field", "run", "sweep"])
def test_a_disk_that_takes_no_more_than_so_many_bytes_a_file(spinlev, arguments, size):
    """Also of libraries that write themselves: status 1 in words where one does not fit, only whole files."""
    status = spinlev(*arguments, limit=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))).wait(
        timeout=300
    )
    said = Path("said").read_text()
    assert "Traceback" not in said
    assert [path for path in Path().rglob(".*") if path.is_file()] == []
    for path in Path().rglob("*.nc"):
        read_checked(path)
    assert spinlev(*arguments).wait(timeout=300) == 0, Path("said").read_text()
    assert spinlev(*arguments, "--out", "undisturbed").wait(timeout=300) == 0
    same("undisturbed", "out")
    largest = max(path.stat().st_size for path in Path("undisturbed").rglob("*") if path.is_file())
    if size:  # else not even messages can be written, and Python ends with 120
        assert status == (1 if largest > size else 0), said
    else:
        assert status in (1, 120)


@pytest.mark.parametrize("arguments", [FIELD, RUN], ids=["field", "run"])
def test_too_little_memory(spinlev, arguments):
    """2 MB of address space left (and NGSolve's heap) when the solve begins: refused in words; else all is well."""
    code = (
        "import resource, psutil; from spinlev.fem.elements import ladder as rotor_solution\n"
        "meshed, (_, most) = rotor_solution.mesh_magnets, resource.getrlimit(resource.RLIMIT_AS)\n"
        "def starved(*a):\n"
        "    resource.setrlimit(resource.RLIMIT_AS, (most, most))\n"
        "    mesh = meshed(*a)\n"
        "    resource.setrlimit(resource.RLIMIT_AS, (psutil.Process().memory_info().vms + 302_000_000, most))\n"
        "    return mesh\n"
        "rotor_solution.mesh_magnets = starved\n" + CALL
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stderr
    assert "of memory for" in done.stderr
    assert "use a machine with more" in done.stderr
    assert "Traceback" not in done.stderr
    assert spinlev(*arguments).wait(timeout=300) == 0


def test_a_full_pipe_that_nobody_reads(spinlev):
    """`spinlev ... | head -0`: status 1 in words."""
    arguments = [a if a != "fem" else "dipole" for a in FIELD]
    command = [sys.executable, "-c", CALL, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        said = process.stderr.read().decode()
        assert process.wait(timeout=60) == 1
    assert "standard output: Broken pipe" in said
    assert "Traceback" not in said
