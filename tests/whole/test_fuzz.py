"""Broken inputs: no traceback, no hang, no partial file; thousands of them in `make fuzz`."""

import ast
import re
import subprocess
import sys

import pytest
from fuzzing import KINDS, fuzz
from places import TESTS

QUICK = ("points", "table", "result", "map", "command")
"""Kinds of which an input is tried within a second."""


@pytest.mark.parametrize(
    ("tried", "number"), [(QUICK, 8), pytest.param(tuple(KINDS), 120, marks=pytest.mark.slow)], ids=["quick", "all"]
)
def test_broken_inputs(tried, number):
    """In a process of its own: some are tried in its copies, which must not hold what other tests have loaded."""
    command = [sys.executable, str(TESTS / "fuzzing.py"), ",".join(tried), str(number)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    *kinds, last = done.stdout.splitlines()
    assert last == "0 faults"
    assert [line.split()[0] for line in kinds] == list(tried)
    for line in kinds:
        counts = ast.literal_eval(re.search(r"\{.*?\}", line)[0])
        assert sum(counts.values()) == number
        assert counts[2] > sum(counts.values()) // 6


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("table", 446),  # HDF5 did not return from reading an attribute; now the checksum is read before HDF5 sees it
        ("table", 3),  # h5netcdf printed a traceback from its destructor (files without checksum: test_faults)
        ("map", 1543),  # nor from files of others, which have no checksum: now another process looks through them first
        ("result", 62),
        ("command", 14),  # `cite` of a folder was taken for a failed computation
        ("command", 2606),
        ("command", 4617),  # so was a name that is too long for a file
    ],
)
def test_what_was_found_and_mended(kind, seed):
    """None of them is a traceback, a hang, or a failed computation (exit status 1)."""
    assert fuzz(kind, 1, seed)[1] == 0


def test_the_fuzzer_finds_faults(monkeypatch):
    monkeypatch.setitem(KINDS, "broken", lambda chance, folder: 1 // 0)
    with pytest.raises(AssertionError, match="broken, seed 5: ZeroDivisionError"):
        fuzz("broken", 1, 5)
