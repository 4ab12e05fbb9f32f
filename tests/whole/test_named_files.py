"""Every door that opens a path that a user names: what is no file of a sane size is refused at once."""

import contextlib
import io
import os
import signal

import pytest
from places import SCENES

from spinlev.studies.cli import main as cli

SCENE = (SCENES / "horizontal.toml").read_text()
STEP = """frequency_hz = 130.0
[[rotor.magnets]]
file = "it"
center_mm = [0.0, 0.0, 0.0]
polarization_T = [1.3, 0.0, 0.0]
[floater]
diameter_mm = 10.0
remanence_T = 1.3
density_kg_m3 = 7500.0
"""


def pipe(path):
    os.mkfifo(path)


def device(path):
    path.symlink_to("/dev/zero")


def endless(path):
    path.symlink_to("/proc/self/pagemap")


def folder(path):
    path.mkdir()


def loop(path):
    path.symlink_to(path.name)


def lost(path):
    path.symlink_to("nowhere")


def sparse(path):
    path.touch()
    os.truncate(path, 10**10)


def scene(folder):
    return folder / "it", ["equilibria", folder / "it"]


def points(folder):
    return folder / "it", ["field", SCENES / "horizontal.toml", "--points", folder / "it"]


def a_map(folder):
    (folder / "s.toml").write_text(SCENE.replace("[rotor]", '[rotor]\nfield_map = "it.csv"'))
    return folder / "it.csv", ["equilibria", folder / "s.toml"]


def part(folder):
    (folder / "s.toml").write_text(STEP)
    return folder / "it", ["equilibria", folder / "s.toml"]


def result(command):
    return lambda folder: (folder / "it.nc", [command, folder / "it.nc"])


def report(folder):
    return folder / "it.nc", ["report", folder]


def checkpoint(folder):
    arguments = ["simulate", SCENES / "horizontal.toml", "--duration-s", "0.01", "--model", "dipole", "--resume"]
    return folder / "checkpoint.npz", [*arguments, "--plate-model", "none", "--out", folder]


DOORS = {
    "scene": scene,
    "points": points,
    "map": a_map,
    "part": part,
    "cite": result("cite"),
    "show": result("show"),
    "figure": result("figure"),
    "report": report,
    "checkpoint": checkpoint,
}


@pytest.fixture(autouse=True)
def impatience():
    """A pipe that is opened would wait for ever; all of these take a fraction of a second but for loading."""

    def too_long(*_):
        raise AssertionError("it waits")

    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("kind", [pipe, device, endless, folder, loop, lost, sparse], ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("door", DOORS)
def test_what_is_no_file_is_refused_at_once(tmp_path, kind, door):
    path, arguments = DOORS[door](tmp_path)
    kind(path)
    said, answer = io.StringIO(), io.StringIO()
    with contextlib.redirect_stderr(said):
        assert cli._status([str(argument) for argument in arguments], answer) == 2
    assert answer.getvalue() == ""
    sentence = said.getvalue().splitlines()[-1]  # before a checkpoint is read, a model may be named
    assert " must be " in sentence
    assert path.name in sentence
    assert sentence.endswith(".")
