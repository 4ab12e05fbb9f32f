"""What tests of several files share; and a cache of the session's own: never the user's."""

import ctypes
import gc
import os
import shutil
import tempfile

import pytest


def pytest_configure(config):
    """Before anything of the program is imported; xdist's workers inherit the environment.

    As in the program, BLAS, heyoka and NGSolve have one thread: others wait busily, and change the last bits.
    $SPINLEV_TEST_CACHE is a folder to keep for whoever runs one test again and again.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NGS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    if not hasattr(config, "workerinput"):
        os.environ["SPINLEV_CACHE"] = os.environ.get("SPINLEV_TEST_CACHE") or tempfile.mkdtemp(prefix="spinlev-tests-")


def pytest_unconfigure(config):
    if not hasattr(config, "workerinput") and not os.environ.get("SPINLEV_TEST_CACHE"):
        shutil.rmtree(os.environ["SPINLEV_CACHE"], ignore_errors=True)


def pytest_collection_finish():
    """The libraries and the tests live to the end: Python need not look through them again for what is unused."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True, scope="module")
def memory_given_back():
    """After each file."""
    yield
    give_memory_back()


@pytest.fixture
def memory_given_back_at_once():
    """After the test: a whole command leaves as much behind as a file of other tests."""
    yield
    give_memory_back()


def give_memory_back():
    """Compiled functions that later tests read again, and what glibc keeps of freed memory."""
    from spinlev.fem import compiled_code

    compiled_code._functions.clear()
    if hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
        libc.malloc_trim(0)


@pytest.fixture
def needs_3d():
    """Skips a test where nothing can be drawn in three dimensions, and says why."""
    from spinlev.studies.figures.renderer import unavailable

    reason = unavailable()
    if reason:
        pytest.skip(reason)


@pytest.fixture
def unprinted(monkeypatch):
    """Figures are drawn and not printed, which takes a second each: for tests of something else."""
    monkeypatch.setattr("spinlev.studies.figures.style.figure_bytes", lambda figure, kind: b"not printed")


@pytest.fixture
def undrawn(monkeypatch, unprinted):
    """The same, and without the process that draws in three dimensions, two seconds each time."""

    def written(pictures, progress=None):
        yield from [b"not drawn"] * len(pictures)

    monkeypatch.setattr("spinlev.studies.figures.renderer.drawn", written)
