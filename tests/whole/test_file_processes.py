"""Each file of tests in a process of its own: a worker reports what a worker without this does, and a death besides."""

import os
import subprocess
import sys

import pytest
from places import TESTS

CONFTEST = """
from file_processes import FileProcesses

def pytest_configure(config):
    if hasattr(config, "workerinput"):
        config.pluginmanager.register(FileProcesses(config))
"""
FIRST = """
import os
import pytest

@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    (folder := tmp_path_factory.mktemp("first") / "file").write_text("begun")
    yield folder
    print("module is over", os.getpid())

def test_one(begun):
    print("process", os.getpid())

def test_two(begun):
    print("process", os.getpid())
    assert begun.read_text() == "begun"

def test_skipped():
    pytest.skip("for a reason")

@pytest.mark.xfail
def test_expected():
    assert False

def test_fails(begun):
    assert [1, 2] == [1, 3]
"""
SECOND = """
import os
import signal

def test_before(tmp_path_factory):
    print("process", os.getpid())
    assert tmp_path_factory.mktemp("first").name == "first1"

def test_dies():
    os.kill(os.getpid(), signal.SIGKILL)

def test_leaves():
    os._exit(0)

def test_after():
    print("process", os.getpid())
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Runs pytest with one worker on both files; lines of what it says."""
    folder = tmp_path_factory.mktemp("files")
    for name, text in (("conftest", CONFTEST), ("test_first", FIRST), ("test_second", SECOND)):
        (folder / f"{name}.py").write_text(text)

    def lines(*options):
        command = [sys.executable, "-m", "pytest", "-p", "xdist", "-n", "1", "-rA", *options]
        env = {**os.environ, "PYTHONPATH": str(TESTS), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
        return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True).stdout.splitlines()

    return lines


@pytest.fixture(scope="module")
def said(run):
    return run("--dist", "worksteal")


def processes(said, what):
    """The last words of the lines that begin with others."""
    return [line.split()[-1] for line in said if line.startswith(what)]


def test_every_outcome_comes_through(said):
    outcomes = ("PASSED", "FAILED", "XFAIL")
    told = {line.split()[1].partition("::")[2]: line.split()[0] for line in said if line.startswith(outcomes)}
    assert told == {
        **dict.fromkeys(("test_one", "test_two", "test_before", "test_after"), "PASSED"),
        **dict.fromkeys(("test_fails", "test_dies", "test_leaves"), "FAILED"),
        "test_expected": "XFAIL",
    }
    assert any(line.startswith("SKIPPED [1] test_first.py") and line.endswith("for a reason") for line in said)
    assert "3 failed, 4 passed, 1 skipped, 1 xfailed" in said[-1]
    assert any("At index 1 diff: 2 != 3" in line for line in said)


def test_a_death_is_told_of_the_test_that_ran(said):
    assert "The process of test_second.py was ended by SIGKILL." in said
    assert "The process of test_second.py ended before its test did." in said


def test_a_process_for_each_file_with_the_fixtures_of_its_module(said):
    """Another after each death; the module's end is reported once, of its last test."""
    one, two, before, after = processes(said, "process")
    assert one == two
    assert len({one, before, after}) == 3
    assert processes(said, "module is over") == [one]


def test_the_first_failure_ends_the_session_where_that_is_asked(run):
    """The module's fixture, which tests to come would have used, is undone."""
    said = run("-x", "-k", "fails or two or before")
    assert any("stopping after 1 failures" in line for line in said)
    assert "1 failed, 1 passed" in said[-1]
    assert len(processes(said, "module is over")) == 1
