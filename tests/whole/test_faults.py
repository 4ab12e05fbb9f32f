"""Faults injected into the program itself: nothing is lost, no number is wrong, the next run repairs (docs/faults.md).

The same with signals to real processes is in test_faults_processes.py.
"""

import errno
import json
import os
import pickle
import re
import shutil
import subprocess
import sys
import threading
import zlib
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import h5py
import meshio
import numpy as np
import places
import pytest
import xarray as xr

from spinlev.fem.cache import cache_folder, read_checked, write_checked
from spinlev.fem.elements import spaces as memory
from spinlev.fem.maps_of_B.columns import FieldMapError
from spinlev.fem.maps_of_B.read import read_field_map
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.files import hdf5_fault, replacing, seal, write_whole
from spinlev.geometry.scene.files import load_scene
from spinlev.studies.cli.main import _status
from spinlev.studies.cli.start import STOPPED

SCENE, OVER_PLATE = str(places.HORIZONTAL), str(places.OVER_PLATE)
DIPOLE = ("--model", "dipole", "--plate-model", "none")
FIELD = ("field", SCENE, "--points", "points.csv", "--model", "fem", "--rtol", "1e-2")
TIMES = ("seconds", "realtime_factor", "tables_from_cache")


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A cache that has the table of `FIELD`."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SPINLEV_CACHE", str(folder))
        (folder / "points.csv").write_text("x_mm,y_mm,z_mm\n0,0,-20\n3,1,-25\n")
        patch.chdir(folder)
        assert _status([*FIELD, "--out", str(folder / "out")], sys.stderr) == 0
    return next(folder.glob("rotor-*.nc"))


@pytest.fixture
def spinlev(tmp_path, monkeypatch, capsys, unprinted):
    """Run the command line in this process in an empty folder; gives exit status, answer and messages.

    Tables have a cache of their own there; compiled code is that of the session, for it is no matter of these tests.
    """
    session = cache_folder()
    monkeypatch.setattr("spinlev.fem.compiled_code.cache_folder", lambda: session)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("sys.argv", ["spinlev", "test"])
    Path("points.csv").write_text("x_mm,y_mm,z_mm\n0,0,-20\n3,1,-25\n")

    def run(*arguments):
        with Path("answer").open("w") as out:
            status = _status([*map(str, arguments), "--json"], out)
        said = Path("answer").read_text()
        answer = {key: value for key, value in json.loads(said).items() if key not in TIMES} if said else None
        return status, answer, capsys.readouterr().err

    return run


def same(answer, expected):
    """Numbers of a table made anew: to round-off; estimated errors are differences of such numbers, which cancel."""
    assert answer.keys() == expected.keys()
    for key, value in expected.items():
        if "error" in key:
            np.testing.assert_allclose(answer[key], value, rtol=1e-8)
        elif key in ("B_T", "dB_T_per_m"):
            np.testing.assert_allclose(answer[key], value, rtol=1e-12, atol=1e-12 * np.abs(value).max())
        else:
            assert str(answer[key]).replace("out/", "undisturbed/") == str(value).replace("out/", "undisturbed/")


def hidden(folder):
    """Files that were begun and not finished."""
    return [path for path in Path(folder).rglob(".*") if path.is_file()]


def flipped(content, chance):
    found = bytearray(content)
    found[chance.integers(len(found))] ^= 1 << chance.integers(8)
    return bytes(found)


def of_another_version(path):
    dataset = read_checked(path)
    write_checked(dataset.assign_attrs(format="spinlev rotor table 0"), path)


def in_its_place_a_folder(path):
    path.unlink()
    path.mkdir()


def quick(cases, *names):
    """All cases, of which only the named ones are in the fast suite."""
    return [case if case in names else pytest.param(case, marks=pytest.mark.slow) for case in cases]


DAMAGES = {
    "cut off": lambda path: path.write_bytes(path.read_bytes()[:1000]),
    "cut off by the checksum": lambda path: path.write_bytes(path.read_bytes()[:-79]),
    "empty": lambda path: path.write_bytes(b""),
    "other bytes": lambda path: path.write_bytes(b"\x89HDF" * 500),
    "a bit": lambda path: path.write_bytes(flipped(path.read_bytes(), np.random.default_rng(1))),
    "another bit": lambda path: path.write_bytes(flipped(path.read_bytes(), np.random.default_rng(2))),
    "of another version": of_another_version,
    "a folder": in_its_place_a_folder,
}


@pytest.mark.parametrize("damage", quick(DAMAGES, "cut off", "a bit", "of another version", "a folder"))
def test_a_damaged_cache_entry_is_named_and_made_anew(spinlev, table, damage):
    Path("cache").mkdir()
    entry = Path(shutil.copy(table, "cache"))
    whole = spinlev(*FIELD)
    assert whole[0] == 0
    assert "from the cache" in whole[2]
    DAMAGES[damage](entry)
    status, answer, said = spinlev(*FIELD)
    assert status == 0
    assert "damaged and is computed anew" in said
    same(answer, whole[1])
    if damage != "a folder":
        assert "from the cache" in spinlev(*FIELD)[2]
    assert hidden(".") == []


def test_every_flipped_bit_is_found(table, tmp_path):
    content, chance = table.read_bytes(), np.random.default_rng(0)
    for _ in range(300):
        (tmp_path / "t.nc").write_bytes(flipped(content, chance))
        with pytest.raises(ValueError, match="checksum"):
            read_checked(tmp_path / "t.nc", "spinlev rotor table 1")


class Planted:
    """What runs a command where it is unpickled."""

    def __reduce__(self):
        return os.system, ("touch planted",)


def test_nothing_that_lies_in_the_cache_is_run(spinlev):
    """Whoever wrote it, sealed or not; compiled code, which is the user's alone: `test_code_cache`."""
    undisturbed = spinlev(*FIELD, "--out", "undisturbed")
    files = [path for path in Path("cache").rglob("*") if path.is_file()]
    assert any(path.suffix == ".nc" for path in files)
    for content in (
        pickle.dumps(Planted()),
        seal(pickle.dumps(Planted())),
        seal(zlib.compress(pickle.dumps(Planted()))),
    ):
        for path in files:
            path.write_bytes(content)
        status, answer, said = spinlev(*FIELD)
        assert status == 0
        assert "damaged and is computed anew" in said
        same(answer, undisturbed[1])
    assert not Path("planted").exists()
    pickle.loads(pickle.dumps(Planted()))
    assert Path("planted").exists()


def test_a_cache_that_cannot_be_written_costs_time_only(spinlev, monkeypatch, table):
    Path("cache").mkdir()
    shutil.copy(table, "cache")
    expected = spinlev(*FIELD)[1]
    for place in (Path("points.csv", "below-a-file").absolute(), "/proc/spinlev"):
        monkeypatch.setenv("SPINLEV_CACHE", str(place))
        status, answer, said = spinlev(*FIELD)
        assert status == 0
        same(answer, expected)
        assert "could not be cached" in said


VARY = ("study", SCENE, "--vary", "frequency_hz=100,110", "--workers", "1")
SWEEP = (*VARY, "--ask", "field", "--model", "cuboid")
WRITERS = {
    "field.csv": ("field", SCENE, "--points", "points.csv", "--model", "dipole"),
    "equilibria.json": ("equilibria", SCENE, *DIPOLE),
    "trajectory.nc": ("simulate", SCENE, "--duration-s", "0.1", *DIPOLE),
    "plate.json": ("plate", OVER_PLATE, "--at", "0,0,-20", "--frequency-hz", "50", "--model", "slab"),
    "000000.json": SWEEP,
    "question.nc": SWEEP,
    "question.png": SWEEP,
}


@pytest.mark.parametrize("name", quick(WRITERS, "field.csv", "000000.json"))
def test_a_full_disk(spinlev, monkeypatch, name):
    """Half of a file is written, then there is no space: named, nothing of that file is left, the next run is whole."""
    write = Path.write_bytes

    def full(path, content):
        if re.match(rf"\.{Path(name).stem}-", path.name) and path.suffix == Path(name).suffix:
            write(path, content[: len(content) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(path, content)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        status, answer, said = spinlev(*WRITERS[name])
    assert status == 1
    assert answer is None
    stem, suffix = Path(name).stem, Path(name).suffix
    assert re.search(rf"{stem}\S*{suffix}: No space left on device", said.replace("\n", ""))
    assert not list(Path("out").rglob(f"{stem}*{suffix}"))
    assert hidden("out") == []
    assert spinlev(*WRITERS[name])[0] == 0
    assert Path("out", "question.pdf" if WRITERS[name] == SWEEP else name).exists()


def test_results_go_to_memory_before_the_disk_since_hdf5_crashes_on_a_full_one(tmp_path):
    """A child that may write 20 kB: an error in words (HDF5 itself, on a real full disk, ended with SIGSEGV)."""
    code = (
        "import resource, sys, numpy, xarray; from spinlev.fem.cache import write_checked\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "write_checked(xarray.Dataset({'a': ('x', numpy.arange(9999.0))}), sys.argv[1])\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "r.nc")]
    unmeasured = {key: value for key, value in os.environ.items() if not key.startswith("COVERAGE")}  # it writes a file
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=unmeasured)
    assert done.returncode == 1
    assert done.stderr.strip().endswith(f"OSError: [Errno 27] File too large: '{tmp_path / 'r.nc'}'")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["points.csv", "points.csv/below", "/proc/spinlev"])
def test_an_output_folder_that_cannot_be_written(spinlev, place):
    """A file in its place, and a file system that even root may not write."""
    status, answer, said = spinlev(*WRITERS["field.csv"], "--out", place)
    assert (status, answer) == (1, None)
    assert "failed to write or read" in said
    assert "--out" in said


def test_a_full_disk_behind_standard_output(spinlev, capsys):
    with Path("/dev/full").open("w") as full:
        status = _status([*WRITERS["field.csv"]], full)
        assert status == 1
        assert "standard output: No space left on device" in capsys.readouterr().err
        os.dup2(os.open("/dev/null", os.O_WRONLY), full.fileno())  # so that it can be closed


PHASES = {
    "table": ("spinlev.fem.rotor.choice.rotor_table", FIELD),
    "table, when it is written": ("spinlev.fem.cache.write_whole", FIELD),
    "equilibria": ("spinlev.studies.levitation.survey", WRITERS["equilibria.json"]),
    "files": ("spinlev.studies.run.write_whole", WRITERS["equilibria.json"]),
    "sweep": ("spinlev.fem.rotor.choice.rotor_table", SWEEP),
    "sweep, when a point is kept": ("spinlev.studies.sweep.write_whole", SWEEP),
    "sweep, when all are joined": ("spinlev.studies.catalogue.runner.write_dataset", SWEEP),
    "figures": ("spinlev.studies.catalogue.runner.save_figures", SWEEP),
}


@pytest.mark.parametrize("phase", quick(PHASES, "table, when it is written", "sweep"))
def test_ctrl_c_in_every_phase(spinlev, monkeypatch, phase):
    """Exit status 1 with a word, nothing half done, and the next run says what an undisturbed one does."""
    place, arguments = PHASES[phase]
    undisturbed = spinlev(*arguments, "--out", "undisturbed")
    shutil.rmtree("cache", ignore_errors=True)
    calls = []

    def pressed(*_, **__):
        calls.append(1)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(place, pressed)
        status, answer, said = spinlev(*arguments)
    assert calls
    assert (status, answer) == (1, None)
    assert "stopped; what was finished is kept" in said
    assert hidden(".") == []
    status, answer, _ = spinlev(*arguments)
    assert status == 0
    same(answer, undisturbed[1])


@pytest.mark.parametrize(
    ("library", "blow"),
    [("cyclopts", "SIGTERM"), ("numpy", "SIGINT"), ("matplotlib", "SIGINT"), ("numpy", "SIGHUP")],
)
def test_ctrl_c_while_the_program_is_loaded(library, blow):
    """When it first looks for a library, which may make something else of it."""
    code = (
        "import os, signal, sys\n"
        "class Pressed:\n"
        "    def find_spec(self, name, *_):\n"
        f"        if name == '{library}': os.kill(os.getpid(), signal.{blow})\n"
        "sys.meta_path.insert(0, Pressed())\n"
        "from spinlev.studies.cli.start import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code, "study", "--list"], capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stderr
    assert done.stderr == "spinlev: stopped; what was finished is kept.\n"


def test_ctrl_c_that_falls_into_a_destructor_is_not_lost():
    """Python drops what is raised there; the program would go on."""
    code = (
        "import os, signal, threading\n"
        "from spinlev.studies.cli import main as cli, start\n"
        "class Dropped:\n"
        "    def __del__(self):\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "def answer(*_):\n"
        "    Dropped()\n"
        "    threading.Event().wait(60)\n"
        "cli._answer = answer\n"
        "start.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.strip() == "spinlev: stopped; what was finished is kept."


ANSWERED = (
    "import os, signal\n"
    "from spinlev.studies.cli import main as cli, start\n"
    "def answer(_, out):\n"
    "    {}\n"
    "    print('answered', file=out, flush=True)\n"
    "cli._answer = answer\n"
    "start.main()\n"
)
"""The command line with another thing to do."""


def test_sighup_is_heard_but_where_it_is_ignored():
    """As `nohup` starts a program; a second one comes while the first is answered."""
    ignoring = f"signal.signal(signal.SIGHUP, signal.SIG_IGN)\n{ANSWERED}".replace("import os, signal\n", "", 1)
    hang_up = "os.kill(os.getpid(), signal.SIGHUP)"
    twice = f"try: {hang_up}\n    finally: {hang_up}"
    for code, status, said in ((ANSWERED, 1, STOPPED), (f"import os, signal\n{ignoring}", 0, "")):
        command = [sys.executable, "-P", "-c", code.replace("{}", twice)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr.strip()) == (status, said)
        assert done.stdout == ("" if status else "answered\n")


@pytest.mark.parametrize(
    ("closed", "status", "answer", "said"),
    [
        ("<&-", 0, "answered\n", ""),
        ("2>&-", 0, "answered\n", ""),
        ("<&- 2>&-", 0, "answered\n", ""),
        (">&-", 1, "", "standard output: Bad file descriptor"),
        (">&- 2>&-", 1, "", ""),
        ("<&- >&- 2>&-", 1, "", ""),
    ],
)
def test_streams_that_are_closed(tmp_path, closed, status, answer, said):
    """What is opened next does not get what libraries print; an answer that nobody can read is an error."""
    do = "f = open('file', 'w'); assert f.fileno() > 2; os.system('echo printed >&2'); os.write(1, b'printed')"
    shell = ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-P", "-c", ANSWERED.replace("{}", do)]
    done = subprocess.run(shell, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (status, answer)
    assert (said in done.stderr) if said else "spinlev" not in done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "file").read_text() == ""


@pytest.mark.slow
def test_a_shell_that_allows_too_few_open_files(tmp_path):
    """40 are enough; of fewer one sentence says what to do."""
    arguments = ("equilibria", SCENE, *DIPOLE, "--json", "--out", str(tmp_path))
    code = "from spinlev.studies.cli.start import main; main()"
    for number, status in ((40, 0), (5, 1)):
        shell = ["sh", "-c", f'ulimit -n {number}; exec "$@"', "sh", sys.executable, "-P", "-c", code, *arguments]
        done = subprocess.run(shell, capture_output=True, text=True, check=False)
        assert done.returncode == status, done.stderr
        assert "Traceback" not in done.stderr
        assert ("ulimit -n 256" in done.stderr) == bool(status)


def test_a_user_without_a_home_or_a_name(tmp_path):
    """What is kept goes among the temporary files, for libraries too, and one sentence says so."""
    code = (
        "import os, pwd, tempfile\n"
        "def unknown(number): raise KeyError(number)\n"
        "pwd.getpwuid = unknown\n"
        f"tempfile.tempdir = {str(tmp_path)!r}\n"
    ) + ANSWERED.replace("{}", "import matplotlib; print(matplotlib.get_cachedir(), cli.__name__, file=out)")
    environment = {name: value for name, value in os.environ.items() if name not in ("HOME", "SPINLEV_CACHE")}
    environment = {k: v for k, v in environment.items() if not k.startswith(("XDG_", "MPLCONFIGDIR"))}
    for home in ({}, {"HOME": "/dev/null"}):
        command = [sys.executable, "-P", "-c", code]
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, cwd=tmp_path, env=environment | home
        )
        place = tmp_path / f"spinlev-{os.getuid()}"
        (said,) = done.stderr.splitlines()
        assert f"there is no home folder: {place} takes its place" in said
        assert done.returncode == 0
        assert done.stdout.startswith(str(place))
        assert [path.name for path in tmp_path.iterdir()] == [place.name]


def test_ctrl_c_that_a_library_takes_for_its_own_failure(spinlev, monkeypatch, capsys):
    """vtk makes an ImportError of a KeyboardInterrupt while it is loaded."""
    stop = threading.Event()

    def pressed(*_):
        stop.set()
        raise ImportError("No module named vtk")

    monkeypatch.setattr("spinlev.studies.run.write_whole", pressed)
    assert _status([*WRITERS["field.csv"]], sys.stderr, stop) == 1
    assert "stopped; what was finished is kept" in capsys.readouterr().err


def pressing(monkeypatch, after):
    """Ctrl-C in the flights, after a number of looks at what has been flown."""
    looks = []

    def advance(done):
        looks.append(done)
        if len(looks) > after:
            raise KeyboardInterrupt

    @contextmanager
    def progress(label):
        yield advance

    monkeypatch.setattr("spinlev.studies.levitation.progress", progress)


def test_ctrl_c_in_a_flight_keeps_it_and_it_goes_on_to_the_last_bit(spinlev, monkeypatch):
    arguments = ("simulate", SCENE, "--duration-s", "3", *DIPOLE)
    undisturbed = spinlev(*arguments, "--out", "undisturbed")[1]
    with monkeypatch.context() as patch:
        pressing(patch, 2)
        status, answer, said = spinlev(*arguments)
    assert (status, answer) == (1, None)
    assert "--resume goes on" in said
    begun = read_checked("out/trajectory.nc")
    assert begun.attrs["ended_by"] == "stopped"
    status, answer, _ = spinlev(*arguments, "--resume")
    assert status == 0
    assert answer["energy_error"] == undisturbed["energy_error"]
    whole, resumed = (read_checked(f"{folder}/trajectory.nc") for folder in ("undisturbed", "out"))
    xr.testing.assert_equal(whole, resumed)
    assert 0 < begun.attrs["levitated_s"] < 3
    assert not Path("out/checkpoint.npz").exists()


def test_a_stopped_flight_is_no_point_of_a_sweep(spinlev, monkeypatch):
    """Ctrl-C in the second of two flights: the first is kept, the second is flown anew, not taken as it was."""
    arguments = (*VARY, "--ask", "flight", "--duration-s", "0.5", *DIPOLE)
    assert spinlev(*arguments, "--out", "undisturbed")[0] == 0
    looks = []

    def pressed(done):
        looks.append(done)
        if looks.count(1.0) and done < 1.0:
            raise KeyboardInterrupt

    @contextmanager
    def progress(label):
        yield pressed

    with monkeypatch.context() as patch:
        patch.setattr("spinlev.studies.levitation.progress", progress)
        assert spinlev(*arguments)[0] == 1
    assert [path.name[:7] for path in Path("out/question.points").iterdir()] == ["000000-"]
    status, _, said = spinlev(*arguments)
    assert status == 0
    assert "1 of 2 points are there" in said
    xr.testing.assert_equal(*(read_checked(f"{folder}/question.nc") for folder in ("undisturbed", "out")))


def as_map(strength):
    """A map of the field of a cube of 10 mm, 2 mm off the axis."""
    (magnet,) = load_scene(SCENE).rotor
    rotor = (replace(magnet, polarization=strength * magnet.polarization, recoil_permeability=1.0),)
    ticks = np.arange(-0.03, 0.031, 0.01)
    points = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), -1).reshape(-1, 3)
    points = points[np.linalg.norm(points, axis=1) > 0.0075]
    rows = np.hstack([1e3 * points, RotorTable("cuboid", rotor, rotor).evaluate(points)[0]])
    np.savetxt("named", rows, "%.10g", ",", header="x_mm,y_mm,z_mm,Bx_T,By_T,Bz_T", comments="")


def as_step(strength, bored=False):
    """A cube, or with a hole what has no closed form."""
    import netgen.occ as occ

    half = 5.0 * strength ** (1 / 3)
    solid = occ.Box(occ.Pnt(-half, -half, -half), occ.Pnt(half, half, half))
    (solid - occ.Cylinder(occ.Pnt(1, 0, -9), occ.Z, r=1, h=18) if bored else solid).WriteStep("named")


NAMED = {
    "known shape": (as_step, "[[rotor.magnets]]\ncenter_mm = [2.0, 0.0, 0.0]\npolarization_T = [1.3, 0.0, 0.0]\nfile"),
    "part": (
        partial(as_step, bored=True),
        "[[rotor.magnets]]\ncenter_mm = [2.0, 0.0, 0.0]\npolarization_T = [1.3, 0.0, 0.0]\nfile",
    ),
    "map": (
        as_map,
        "[rotor]\nconfiguration = 'horizontal'\ndisplacement_mm = 2.0\nedge_mm = 10.0\nremanence_T = 1.305\nfield_map",
    ),
}


@pytest.fixture(params=["known shape", pytest.param("part", marks=pytest.mark.slow), "map"])
def replaceable(request, spinlev):
    """The command line beside a scene with a file, and what gives that file another content."""
    write, rotor = NAMED[request.param]
    floater = "[floater]\ndiameter_mm = 12.7\nremanence_T = 1.3\ndensity_kg_m3 = 7500.0\n"
    Path("my.toml").write_text(f"frequency_hz = 110.0\n{floater}{rotor} = 'named'\n")
    write(1.0)
    model = ("--model", "map" if request.param == "map" else "dipole")

    def run(command, *arguments):
        return spinlev(command, "my.toml", *model, *arguments)

    return run, write


def while_it_runs(monkeypatch, act):
    """Do something after the first point of a sweep."""

    @contextmanager
    def progress(label):
        yield lambda done: act() if 0 < done < 1 else None

    monkeypatch.setattr("spinlev.studies.sweep.progress", progress)


def stopped():
    raise KeyboardInterrupt


FREQUENCIES = ("--vary", "frequency_hz=100:112:2", "--workers", "1", "--ask", "field")
"""Seven points in two batches."""


def test_a_file_replaced_between_two_parts_of_a_sweep(replaceable, monkeypatch):
    """The points of the other file are put aside: those that follow and those that were there are of one file."""
    run, write = replaceable
    with monkeypatch.context() as patch:
        while_it_runs(patch, stopped)
        assert run("study", *FREQUENCIES)[0] == 1
    assert list(Path("out/question.points").glob("0*.json"))
    write(0.9)
    status, _, said = run("study", *FREQUENCIES)
    assert status == 0
    assert "of files that were replaced" in said
    assert "points are there" not in said
    assert run("study", *FREQUENCIES, "--out", "undisturbed")[0] == 0
    xr.testing.assert_equal(*(read_checked(f"{folder}/question.nc") for folder in ("undisturbed", "out")))


def test_a_file_replaced_while_a_sweep_runs(replaceable, monkeypatch):
    """One sentence, whatever the number of points that are left, and no result of two files."""
    run, write = replaceable
    with monkeypatch.context() as patch:
        while_it_runs(patch, lambda: write(0.9))
        status, answer, said = run("study", *FREQUENCIES)
    assert (status, answer) == (2, None)
    assert said.count("must stay as it was when the scene was read; instead its content is another one") == 1
    assert not Path("out/question.nc").exists()


@pytest.mark.parametrize("replaceable", ["known shape", pytest.param("map", marks=pytest.mark.slow)], indirect=True)
def test_a_file_replaced_before_a_flight_goes_on(replaceable, monkeypatch):
    run, write = replaceable
    flight = ("--duration-s", "1", "--plate-model", "none", "--interaction", "rigid")
    with monkeypatch.context() as patch:
        pressing(patch, 2)
        assert run("simulate", *flight)[0] == 1
    before, named = Path("out/checkpoint.npz").read_bytes(), Path("named").read_bytes()
    write(0.9)
    status, answer, said = run("simulate", *flight, "--resume")
    assert (status, answer) == (2, None)
    assert "must be a checkpoint of this trajectory; instead it was kept by another scene" in said
    Path("named").write_bytes(named)  # writing the same shape again gives it another date
    assert run("simulate", *flight, "--ramp", "100:90:1")[0] == 2  # a ramp of 10 s, refused before anything begins
    assert Path("out/checkpoint.npz").read_bytes() == before
    assert run("simulate", *flight, "--resume")[0] == 0
    assert not Path("out/checkpoint.npz").exists()


def test_no_solve_is_begun_that_the_memory_does_not_hold(spinlev, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(memory, "free_memory", lambda: 2e6)
        status, answer, said = spinlev(*FIELD)
    assert (status, answer) == (1, None)
    assert re.search(
        r"need about 0\.\d+ GB of memory for \d+ coupled unknowns; 0\.002 GB are free\. Allow .*--rtol", said
    )
    assert spinlev(*FIELD)[0] == 0


def test_files_of_killed_processes_are_tidied_and_those_of_living_ones_are_not(tmp_path):
    """A process that dies between two bytes leaves a file under a temporary name; the next writer removes it."""
    code = (
        "import os, signal, sys; from spinlev.geometry.files import replacing\n"
        "with replacing(sys.argv[1]) as temporary:\n"
        "    temporary.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    path = tmp_path / "result.nc"
    for _ in range(2):
        subprocess.run([sys.executable, "-c", code, str(path)], check=False)
    assert len(hidden(tmp_path)) == 1  # the second has tidied up after the first
    other = tmp_path / ".result-another-machine-12-x.nc"
    other.write_text("of another machine, which may be alive")
    with replacing(path) as mine:
        mine.write_bytes(b"half of mine")
        write_whole(path, b"whole")
        assert mine.exists()
        mine.write_bytes(b"whole of mine")
    assert path.read_bytes() == b"whole of mine"
    assert hidden(tmp_path) == [other]


@pytest.mark.slow
def test_a_result_and_its_summary_are_of_the_same_run(spinlev, monkeypatch):
    """A run that dies after its result is written leaves no summary of the run before."""
    Path("out").mkdir()
    Path("out/summary.json").write_text("{}")
    monkeypatch.setattr("spinlev.studies.run.write_dataset", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    status, _, said = spinlev("run", SCENE, "--duration-s", "0.1", "--rtol", "1e-2", *DIPOLE)
    assert status == 1
    assert "stopped" in said
    assert not Path("out/summary.json").exists()


def crashing(patch, folder, script):
    """Python processes that run `script` die of a segmentation fault as they begin, while `patch` holds."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(
        "import os, signal, sys\n"
        f"if any({script!r} in argument for argument in sys.orig_argv):\n"
        "    os.kill(os.getpid(), signal.SIGSEGV)\n"
    )
    patch.setenv("PYTHONPATH", str(folder))


@pytest.mark.slow
def test_a_renderer_that_dies_takes_no_result_with_it(spinlev, monkeypatch, tmp_path):
    """As VTK makes it without graphics libraries: a line on the console; all but these pictures is whole."""
    arguments = ("run", SCENE, "--duration-s", "0.1", "--rtol", "1e-2", *DIPOLE)
    Path("out").mkdir()
    Path("out/scene.png").write_text("of an older result")
    with monkeypatch.context() as patch:
        crashing(patch, tmp_path / "dies", "spinlev.studies.processes")
        patch.setattr("spinlev.studies.catalogue.runner.plate_currents", lambda *given: np.zeros_like(given[-1]))
        status, answer, said = spinlev(*arguments)
        shown = spinlev("show", "out/result.nc")
    assert status == 0
    (line,) = [line for line in said.splitlines() if "3-D" in line]
    assert line.startswith("The 3-D pictures are left out (scene.png): No process can begin: it died (Segmentation")
    assert sorted(path.name for path in Path("out").glob("*.png")) == ["field.png", "force.png", "trajectory.png"]
    assert len(read_checked("out/result.nc")["time"]) > 10
    summary = json.loads(Path("out/summary.json").read_text())
    assert answer["levitated_s"] == summary["levitated_s"] == 0.1
    assert shown[:2] == (1, None)
    assert "result-scene.png, result-flight.gif" in shown[2]
    assert spinlev("report", "out")[0] == 0


@pytest.mark.parametrize("step", [970, pytest.param(97, marks=pytest.mark.slow)])
def test_files_that_others_wrote_are_read_as_far_as_they_are_whole(spinlev, step):
    """Without our checksum HDF5 must find the damage: a message, whatever it raises."""
    with h5py.File("r.nc", "w") as file:
        file.attrs["study"] = "run"
    content = Path("r.nc").read_bytes()
    for length in range(0, len(content), step):
        Path("r.nc").write_bytes(content[:length])
        status, _, said = spinlev("cite", "r.nc")
        assert status == 2
        assert "Traceback" not in said


def foreign_file(name):
    """A result as another program may write it, and where its attributes' texts are (HDF5's global heap)."""
    with h5py.File(name, "w") as file:
        file.attrs["study"] = "run"
    return Path(name).read_bytes(), Path(name).read_bytes().index(b"GCOL")


def test_a_foreign_file_that_hdf5_does_not_return_from_is_given_up(tmp_path):
    """An object of no length in the heap: HDF5 goes round in a loop that no signal ends."""
    path = tmp_path / "r.nc"
    content, heap = foreign_file(path)
    path.write_bytes(content[: heap + 16] + bytes(16) + content[heap + 32 :])
    assert hdf5_fault(path, longest=2.0) == "HDF5 does not come to an end with it"


def test_a_foreign_file_that_hdf5_crashes_on_is_refused(spinlev, monkeypatch, tmp_path):
    """The process that looks through it dies, as HDF5 has made it on damaged files; the program does not."""
    foreign_file("r.nc")
    crashing(monkeypatch, tmp_path / "dies", "geometry.files.look")
    status, _, said = spinlev("cite", "r.nc")
    assert status == 2
    assert "HDF5 crashes on it" in said.replace("\n", " ")


def test_hdf5_of_a_mesh_is_looked_through_too(monkeypatch, tmp_path):
    points = np.random.default_rng(0).uniform(-1e-2, 1e-2, (8, 3))
    meshio.Mesh(points, [("vertex", np.arange(8)[:, None])], {"B": points}).write(tmp_path / "map.xdmf")
    np.testing.assert_array_equal(read_field_map(tmp_path / "map.xdmf").field, points)
    crashing(monkeypatch, tmp_path / "dies", "geometry.files.look")
    with pytest.raises(FieldMapError, match="HDF5 crashes on it"):
        read_field_map(tmp_path / "map.xdmf")
