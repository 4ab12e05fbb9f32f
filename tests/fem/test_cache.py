"""The cache's folder, its locks, and that nothing happens in it before something is asked of it."""

import errno
import multiprocessing
import os
import platform
import pwd
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from filelock import FileLock

from spinlev.fem import cache as cache_module
from spinlev.fem.cache import FORMATS, TableKind, cache_folder, owned, read_checked, write_checked
from spinlev.geometry.common import InputError
from spinlev.geometry.files import seal, write_whole

IMPORT_ALL = """
import importlib, os, pkgutil, spinlev
names = [m.name for m in pkgutil.walk_packages(spinlev.__path__, "spinlev.")]
for name in names:
    importlib.import_module(name)
import heyoka
print(len(names), "spinlev.fem.compiled_code" in names, heyoka.llvm_state.get_memcache_size())
"""


@pytest.fixture
def cache(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv("SPINLEV_CACHE", str(folder))
    return folder


def text(made):
    """Ask the cache for a text; gives it, whether it was there, and what was said."""
    said = []
    return (*TableKind("edges", str).cached((), lambda: made, said.append), said)


def test_importing_every_module_touches_no_file_and_compiles_nothing(tmp_path):
    home, others = tmp_path / "home", tmp_path / "others"
    home.mkdir()
    places = {"HOME": home, "SPINLEV_CACHE": home / "cache", "MPLCONFIGDIR": others, "DASK_CONFIG": others}
    environment = {k: v for k, v in os.environ.items() if not k.startswith("XDG_")} | {
        name: str(place) for name, place in places.items()
    }
    command = [sys.executable, "-P", "-c", IMPORT_ALL]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    number, whole, code = done.stdout.split()
    assert int(number) > 100
    assert (whole, code) == ("True", "0")
    assert list(home.iterdir()) == []


def test_where_the_cache_is(tmp_path, monkeypatch):
    monkeypatch.delenv("SPINLEV_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "spinlev"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "spinlev"
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path / "own"))
    assert cache_folder() == tmp_path / "own"


HOMES = ("no home", "a home that is not there", "a home in which nothing can be written")


@pytest.fixture
def homeless(tmp_path, monkeypatch, request):
    """A user without a home; gives the system's folder for temporary files."""
    for name in ("SPINLEV_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    if request.param == "no home":  # and no entry in the list of users

        def unknown(number):
            raise KeyError(f"getpwuid(): uid not found: {number}")

        monkeypatch.setattr(pwd, "getpwuid", unknown)
    else:
        monkeypatch.setenv("HOME", "/dev/null" if request.param == HOMES[1] else "/proc")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    cache_module._usable.cache_clear()
    yield tmp_path
    cache_module._usable.cache_clear()


@pytest.mark.parametrize("homeless", HOMES, indirect=True)
def test_who_has_no_home_has_a_cache_among_the_temporary_files(homeless, caplog):
    """It is the user's alone, is found again, and is told once."""
    with caplog.at_level("INFO", "spinlev"):
        assert cache_folder() == cache_folder() == homeless / f"spinlev-{os.getuid()}"
    (said,) = caplog.messages
    assert str(cache_folder()) in said
    assert "SPINLEV_CACHE" in said
    assert cache_folder().stat().st_mode & 0o777 == 0o700
    assert text("made") == ("made", False, [])
    cache_module._usable.cache_clear()
    assert text("another") == ("made", True, [])
    assert [path.name for path in homeless.iterdir()] == [cache_folder().name]


@pytest.mark.parametrize("homeless", HOMES[:1], indirect=True)
def test_who_has_no_home_does_not_take_what_others_can_write(homeless):
    (homeless / f"spinlev-{os.getuid()}").mkdir()
    (homeless / f"spinlev-{os.getuid()}").chmod(0o777)
    assert cache_folder().name.startswith(f"spinlev-{os.getuid()}-")
    assert cache_folder().stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("homeless", HOMES, indirect=True)
def test_who_can_write_nowhere_computes_without_a_cache(homeless, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", "/proc")
    found, there, said = text("made")
    assert (found, there) == ("made", False)
    assert "could not be cached" in said[0]
    assert list(homeless.iterdir()) == []


def test_the_tests_have_a_cache_of_their_own():
    assert os.environ.get("SPINLEV_TEST_CACHE", "spinlev-tests-") in str(cache_folder())


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_does_no_harm(cache, monkeypatch, number):
    def refused(*_):
        raise OSError(number, os.strerror(number))

    fcntl = pytest.importorskip("fcntl")
    monkeypatch.setattr(fcntl, "flock", refused)
    assert text("made") == ("made", False, ["The cache's file system has no locks."])
    assert text("anew") == ("made", True, ["The cache's file system has no locks."])


def slowly_made(log, said):
    """Ask the cache for a table that takes a while; every making is written down."""

    def make():
        with Path(log).open("a") as stream:
            stream.write("made\n")
        time.sleep(1.0)
        return "a table"

    said.put(TableKind("edges", str).cached((), make, said.put))


def test_two_processes_that_need_the_same_table_make_it_once(cache, tmp_path):
    context = multiprocessing.get_context("spawn")
    said, log = context.Queue(), tmp_path / "log"
    processes = [context.Process(target=slowly_made, args=(log, said)) for _ in range(2)]
    for process in processes:
        process.start()
    answers = [said.get(timeout=60) for _ in range(3)]
    for process in processes:
        process.join()
    assert log.read_text() == "made\n"
    assert sorted(a for a in answers if isinstance(a, tuple)) == [("a table", False), ("a table", True)]
    assert any("waiting for it" in a for a in answers if isinstance(a, str))


def test_a_killed_holder_frees_its_lock(cache):
    code = (
        "import os, signal; from spinlev.fem.cache import TableKind\n"
        "TableKind('edges', str).cached((), lambda: os.kill(os.getpid(), signal.SIGKILL), print)"
    )
    done = subprocess.run([sys.executable, "-P", "-c", code], check=False)
    assert done.returncode == -signal.SIGKILL
    assert len(list(cache.glob("*.lock"))) == 1
    assert text("made") == ("made", False, [])


@dataclass(frozen=True)
class Few:
    """A table."""

    x: np.ndarray


FEW = TableKind("edges", Few)


def numbers(name, values):
    """Ask the cache for an array; gives it, whether it was there, and what was said."""
    said = []
    found, there = FEW.cached((name,), lambda: Few(np.array(values)), said.append)
    return found.x.tolist(), there, said


def place(cache, name):
    """Where the array of a name is kept."""
    return cache / f"edges-{FEW.key(name)}.nc"


def test_a_table_under_another_name_is_not_used(cache):
    """Its name says what it is of; the whole folder may be moved."""
    numbers("one", [1.0])
    numbers("two", [2.0])
    place(cache, "two").write_bytes(place(cache, "one").read_bytes())
    found, there, (said,) = numbers("two", [2.0])
    assert (found, there) == ([2.0], False)
    assert "must be what its name says; instead it is the table of other inputs" in said
    assert numbers("two", [0.0]) == ([2.0], True, [])
    cache.rename(cache.with_name("moved"))
    os.environ["SPINLEV_CACHE"] = str(cache.with_name("moved"))
    assert numbers("one", [0.0]) == ([1.0], True, [])


def test_a_table_of_another_solver_is_not_used(cache, monkeypatch):
    """Its number is in the key, and in the file for who puts it under a new one."""
    numbers("one", [1.0])
    old = place(cache, "one")
    monkeypatch.setitem(FORMATS, "edges", FORMATS["edges"] + 1)
    old.rename(place(cache, "one"))
    found, there, (said,) = numbers("one", [2.0])
    assert (found, there) == ([2.0], False)
    assert f"must be a 'spinlev edges {FORMATS['edges']}'; instead received 'spinlev edges" in said


def test_the_longest_unused_tables_make_room(cache, monkeypatch):
    """A used one is kept, the newest in any case, and one that another process has locked."""
    for name in "abcd":
        numbers(name, [1.0])
        os.utime(place(cache, name), (1e9, 1e9 + ord(name)))
    size = place(cache, "a").stat().st_size
    monkeypatch.setenv("SPINLEV_CACHE_GB", str(3.5 * size * 1e-9))
    assert numbers("a", [0.0])[:2] == ([1.0], True)  # from now on the newest
    with FileLock(place(cache, "b").with_suffix(".lock")):
        numbers("e", [1.0])
    assert set(cache.glob("*.nc")) == {place(cache, name) for name in "abde"}
    numbers("f", [1.0])
    left = {place(cache, name) for name in "aef"}
    assert set(cache.iterdir()) == left | {path.with_suffix(".lock") for path in left}
    monkeypatch.setenv("SPINLEV_CACHE_GB", "1e-9")
    numbers("g", [1.0])
    assert list(cache.glob("*.nc")) == [place(cache, "g")]


@pytest.mark.parametrize("text", ["much", "-1", "0", "nan", "inf", "2 GB"])
def test_a_wrong_size_of_the_cache(cache, monkeypatch, text):
    monkeypatch.setenv("SPINLEV_CACHE_GB", text)
    with pytest.raises(InputError, match=f"SPINLEV_CACHE_GB must be a positive number; instead received '{text}'"):
        numbers("a", [1.0])


HOLD = """
import sys, time; from pathlib import Path; from spinlev.fem.cache import owned
with owned(Path(sys.argv[1])):
    print("mine", flush=True)
    sys.stdin.read()
"""


def test_a_folder_has_one_owner_and_a_dead_one_is_none(tmp_path):
    """Another process is refused while the first lives, and not once it was killed; no file is left."""
    command = [sys.executable, "-P", "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "mine\n"
        with (
            pytest.raises(InputError, match=f"instead process {process.pid} on .* choose another --out"),
            owned(tmp_path),
        ):
            pass
        process.kill()
    with owned(tmp_path), pytest.raises(InputError, match=f"process {os.getpid()} on"), owned(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_folder_on_a_file_system_without_locks_can_be_used(tmp_path, monkeypatch):
    def refused(*_):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", refused)
    with owned(tmp_path):
        assert (tmp_path / "in-use.lock").exists()
    assert list(tmp_path.iterdir()) == []


def test_an_error_frees_the_lock(cache):
    with pytest.raises(ZeroDivisionError):
        TableKind("edges", str).cached((), lambda: 1 / 0, print)
    assert text("made") == ("made", False, [])


def test_the_unfinished_file_of_a_process_that_lives_is_left_alone(tmp_path):
    """Process 1 lives always, and mostly is another user's."""
    left = tmp_path / f".r-{platform.node()}-1-x.nc"
    left.write_bytes(b"half")
    write_whole(tmp_path / "r.nc", b"whole")
    assert (tmp_path / "r.nc").read_bytes() == b"whole"
    assert left.exists()


def test_a_file_has_the_bytes_that_xarray_writes(tmp_path):
    """Texts, truths, NaN and attributes too; it is written without a cluster's libraries."""
    columns = {"B": ("axis", [0.1, float("nan"), -2.0], {"units": "T"}), "stable": ("k", [True, False])}
    dataset = xr.Dataset(columns, {"axis": ["x", "y", "z"]}, {"scene": "δx = 2", "number": 1.5})
    write_checked(dataset, tmp_path / "checked.nc")
    assert (tmp_path / "checked.nc").read_bytes() == seal(bytes(dataset.to_netcdf(engine="h5netcdf")))
    assert read_checked(tmp_path / "checked.nc").identical(dataset)
