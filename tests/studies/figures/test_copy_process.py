"""A copy of a program draws as a process of its own does: whatever becomes of it, the program goes on."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from places import TESTS

HERE = Path(__file__).parent

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="copies are made on Linux alone")


@contextmanager
def program(what, folder):
    """A process of its own, for copies are made where there is one thread: xdist's workers have more."""
    path = os.pathsep.join([str(HERE), str(TESTS)])
    command = [sys.executable, str(HERE / "copies_that_draw.py"), what, str(folder)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, env=os.environ | {"PYTHONPATH": path}, **pipes) as process:
        try:
            yield process
        finally:
            process.kill()


def answer(what, folder):
    with program(what, folder) as process:
        said, faults = process.communicate(timeout=60)
    assert (process.returncode, faults) == (0, "")
    return said


def test_a_copy_draws_in_a_group_of_its_own(tmp_path):
    """What a library prints there is neither a picture nor heard."""
    group = answer("draws", tmp_path).strip()
    groups = {(tmp_path / name).read_text() for name in "ab"}
    assert len(groups) == 1
    assert groups != {group}


def test_a_copy_that_is_not_asked_ends(tmp_path):
    assert answer("is not asked", tmp_path) == "nothing to draw\n"


def test_what_was_finished_before_a_copy_died_stays(tmp_path):
    said = answer("dies", tmp_path)
    assert said.startswith("The 3-D pictures are left out (b): the process that draws them died (Segmentation fault)")
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize(
    ("what", "how"), [("waits", signal.SIGKILL), ("waits", signal.SIGINT), ("draws for ever", signal.SIGINT)]
)
def test_a_copy_ends_with_its_program(tmp_path, what, how):
    """Ctrl-C is heard by the program, which ends the copy; one that waits notices that nobody can ask it any more."""
    with program(what, tmp_path) as process:
        copy = int(process.stdout.readline())
        process.send_signal(how)
        process.communicate(timeout=60)
    assert process.returncode != 0
    for _ in range(100):
        try:
            os.kill(copy, 0)
        except ProcessLookupError:
            return
        time.sleep(0.1)
    os.kill(copy, signal.SIGKILL)
    pytest.fail("the copy lives on")
