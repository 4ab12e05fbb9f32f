"""The command line in a test's own process, and a file of points."""

import sys

import pytest

from spinlev.studies.cli.main import _status


@pytest.fixture
def spinlev(tmp_path, monkeypatch, capsys, memory_given_back_at_once):
    """Run the command in this process, in an empty folder; gives exit status, standard output and error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["spinlev", "test"])

    def run(*arguments):
        status = _status([str(argument) for argument in arguments], sys.stdout)
        return status, *capsys.readouterr()

    return run


@pytest.fixture
def points(tmp_path):
    """A file of two points below the rotor."""
    path = tmp_path / "points.csv"
    path.write_text("x_mm,y_mm,z_mm\n0,0,-20\n1,2,-30\n")
    return path
