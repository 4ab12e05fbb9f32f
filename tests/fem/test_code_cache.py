"""Compiled code on disk: found again by what was compiled and for what, bounded, and never run when damaged."""

import ast
import os
import pickle
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import heyoka as hy
import numpy as np
import pytest
from places import modules

from spinlev.fem import cache, compiled_code
from spinlev.fem.cache import make_room
from spinlev.fem.compiled_code import compiled, compiled_later, one_thread
from spinlev.geometry import files as whole_files
from spinlev.geometry.files import seal, unsealed

CONSTANT = 3.1640625
VALUE = CONSTANT * np.sin(1.0) + np.exp(1.0)
CALLS = []


RUN = []


class Planted:
    """What runs code where it is unpickled."""

    def __reduce__(self):
        return RUN.append, (1,)


def counted(*arguments, **options):
    """heyoka's compiler, every call of which is counted."""
    CALLS.append(arguments)
    return hy.cfunc(*arguments, **options)


def refused(*_):
    """A compiler that fails."""
    raise ZeroDivisionError


def value():
    """A compiled function's value, and whether it had to be compiled."""
    hy.llvm_state.clear_memcache()
    before, (x,) = len(CALLS), [hy.make_vars("x")]
    function = compiled(counted, [hy.sin(x) * CONSTANT + hy.exp(x)], [x])
    return function([1.0])[0], len(CALLS) > before


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The code of a cache of its own."""
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))
    return tmp_path / f"code-{os.getuid()}"


@pytest.fixture
def file(folder):
    """The file of the code of `value`."""
    assert value() == (VALUE, True)
    (file,) = folder.iterdir()
    return file


def flip(content, place, bit):
    return content[:place] + bytes([content[place] ^ 1 << bit]) + content[place + 1 :]


def test_code_is_compiled_once(file):
    assert value() == (VALUE, False)
    assert list(file.parent.iterdir()) == [file]


def settings():
    """heyoka's, which hold for all of a process."""
    states = hy.llvm_state
    return hy.get_nthreads(), states.get_memcache_limit(), states.get_diskcache_enabled()


@pytest.fixture
def two_threads(monkeypatch):
    """Of heyoka's, as a user has them who has not said otherwise."""
    monkeypatch.delenv("OMP_NUM_THREADS")
    before = hy.get_nthreads()
    hy.set_nthreads(2)
    yield
    hy.set_nthreads(before)


@pytest.mark.usefixtures("two_threads")
def test_heyokas_settings_stay_those_of_the_user_and_it_keeps_nothing_by_itself(folder, monkeypatch):
    """Neither a key nor code that is compiled, read or run changes them; what is compiled here is kept here alone."""
    before = settings()
    compiled_code._target.cache_clear()
    assert value() == (VALUE, True)
    compiled_code._functions.clear()
    assert value() == (VALUE, False)
    with pytest.raises(ZeroDivisionError):
        compiled(refused, [1.25])
    assert settings() == before
    assert hy.llvm_state.get_memcache_size() == 0


def test_nothing_is_compiled_but_by_the_module_that_keeps_code():
    """heyoka would keep it by itself, in a database without checksums, and run what it finds there."""
    kinds = {"cfunc", "taylor_adaptive", "taylor_adaptive_batch"}
    calls = {
        path.name
        for path, tree in modules().items()
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr in kinds
    }
    assert calls == {"compiled_code.py"}


def test_each_expression_has_its_place_in_the_name(folder):
    """Also where they have parts in common, which are written once."""
    x = hy.make_vars("x")
    shared = hy.sin(x) + 1.25
    for factors in ([1.0, 2.0], [2.0, 1.0], [1.0, 3.0], [2.0]):
        function = compiled(hy.cfunc, [factor * shared for factor in factors], [x])
        np.testing.assert_allclose(function([1.0]), np.array(factors) * (np.sin(1.0) + 1.25), rtol=1e-14)
    assert len(list(folder.iterdir())) == 4


@pytest.mark.slow
def test_the_same_code_has_the_same_name_in_every_process(folder):
    code = (
        "import heyoka as hy; from spinlev.fem.compiled_code import compiled; x, y = hy.make_vars('x', 'y')\n"
        "r = hy.sqrt(x**2 + y**2 + 1.5); compiled(hy.cfunc, [y / r**3, hy.diff(x * y / r, x)], [x, y], fast_math=True)"
    )
    for seed in "123":
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        subprocess.run([sys.executable, "-P", "-c", code], check=True, env=environment)
    assert len(list(folder.iterdir())) == 1


def test_other_options_and_other_processors_are_other_code(folder, monkeypatch):
    x = hy.make_vars("x")
    for level in (0, 3):
        compiled(hy.cfunc, [x + 1.25], [x], opt_level=level)
    assert len(list(folder.iterdir())) == 2
    monkeypatch.setattr(compiled_code, "_target", lambda: "another processor")
    compiled(hy.cfunc, [x + 1.25], [x], opt_level=0)
    assert len(list(folder.iterdir())) == 3


def test_an_integrator_from_the_disk_flies_to_the_same_bits_and_hears_its_events(folder):
    x, v = hy.make_vars("x", "v")
    end = hy.t_event(x - 0.5, direction=hy.event_direction.negative)
    flown = []
    for _ in range(2):
        integrator = compiled(hy.taylor_adaptive, [(x, v), (v, -hy.sin(x))], [1.0, 0.0], tol=1e-16, t_events=[end])
        outcome = integrator.propagate_until(10.0)[0]
        flown.append((outcome, integrator.time, *integrator.state))
        hy.llvm_state.clear_memcache()
    assert flown[0][0] == hy.taylor_outcome(-1)
    assert flown[0] == flown[1]
    assert len(list(folder.iterdir())) == 1


def test_a_flipped_bit_of_a_constant_is_not_computed_with(file):
    """Without the checksum it would be: wherever the constant is in the machine code, the value is another one."""
    whole = file.read_bytes()
    content = zlib.decompress(unsealed(file))
    pattern = struct.pack("<d", CONSTANT)
    places = [k for k in range(len(content)) if content.startswith(pattern, k)]
    ran = []
    for place in places:
        damaged = zlib.compress(flip(content, place + 6, 1))
        hy.llvm_state.clear_memcache()
        changed = hy.cfunc_dbl.__new__(hy.cfunc_dbl)
        changed.__setstate__((zlib.decompress(damaged).split(b"\n", 2)[2], {}))
        ran.append(changed([1.0])[0])
        file.write_bytes(damaged + whole[-len(seal(b"")) :])
        assert value() == (VALUE, True)
        assert file.read_bytes() == whole
    assert any(one != VALUE for one in ran)


def test_any_flipped_bit_leaves_the_value_as_it_was(file):
    whole, chance = file.read_bytes(), np.random.default_rng(0)
    for _ in range(50):
        file.write_bytes(flip(whole, chance.integers(len(whole)), chance.integers(8)))
        assert value() == (VALUE, True)
        assert file.read_bytes() == whole


DAMAGES = {
    "cut off": lambda content, name: content[:1000],
    "empty": lambda content, name: b"",
    "other bytes": lambda content, name: b"\x89HDF" * 999,
    "without a checksum": lambda content, name: content[: -len(seal(b""))],
    "whole, but no code": lambda content, name: seal(b"something else"),
    "of a heyoka that was built otherwise": lambda content, name: seal(
        zlib.compress(f"{name}\ncfunc_dbl\nsomething else".encode())
    ),
    "of another kind": lambda content, name: seal(zlib.compress(f"{name}\nexpression\n".encode() + pickle.dumps(2))),
    "a pickle": lambda content, name: seal(zlib.compress(pickle.dumps(Planted()))),
    "a pickle under a known name": lambda content, name: seal(  # heyoka takes newer ones' first bytes for half a GB
        zlib.compress(f"{name}\ncfunc_dbl\n".encode() + pickle.dumps(Planted(), protocol=2))
    ),
    "a bare pickle": lambda content, name: pickle.dumps(Planted()),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_made_anew_and_a_planted_one_runs_nothing(file, damage):
    whole = file.read_bytes()
    file.write_bytes(DAMAGES[damage](whole, file.name))
    assert value() == (VALUE, True)
    assert file.read_bytes() == whole
    assert RUN == []


def other(path, monkeypatch):
    """Make a file another user's: really where root tests, else for this program."""
    if os.getuid() == 0:
        os.chown(path, 12345, -1)
    else:
        taken, user = path.stat(), os.getuid()

        def ours(found):
            return found.st_uid in (0, user) and not os.path.samestat(found, taken)

        monkeypatch.setattr(cache, "ours", ours)
        monkeypatch.setattr(whole_files, "ours", ours)


DOORS = {
    "the folder is open to all": (0o777, 0o755, "chmod go-w "),
    "the folder is open to a group": (0o770, 0o755, "chmod go-w "),
    "the cache is open to all": (0o700, 0o777, "share it"),
    "the cache is open to a group": (0o700, 0o2775, "share it"),
}


@pytest.mark.parametrize("door", DOORS)
def test_code_is_neither_read_nor_written_where_others_may_write(file, door, caplog):
    """It is compiled; one line says so, once, and what it names mends it."""
    mode, outer, mends = DOORS[door]
    evil = seal(b"code of somebody else")
    file.write_bytes(evil)
    file.parent.chmod(mode)
    file.parent.parent.chmod(outer)
    compiled_code._say.cache_clear()
    with caplog.at_level("INFO", "spinlev"):
        for _ in range(2):
            compiled_code._functions.clear()
            assert value() == (VALUE, True)
    (said,) = caplog.messages
    assert mends in said
    assert file.read_bytes() == evil
    command = said.partition("chmod ")[2].partition(" mends it")[0].split()
    subprocess.run(["chmod", *command], check=True)
    compiled_code._functions.clear()
    assert value() == (VALUE, True)
    compiled_code._functions.clear()
    assert value() == (VALUE, False)


@pytest.mark.parametrize("place", ["file", "folder", "cache"])
def test_code_that_is_another_users_is_not_read(file, place, caplog, monkeypatch):
    """Also where it was left from a time when the folder was open."""
    path = {"file": file, "folder": file.parent, "cache": file.parent.parent}[place]
    before = file.read_bytes()
    other(path, monkeypatch)
    compiled_code._say.cache_clear()
    compiled_code._functions.clear()
    with caplog.at_level("INFO", "spinlev"):
        assert value() == (VALUE, True)
    assert [f"{path} belongs to another user" in text for text in caplog.messages] == (
        [] if place == "file" else [True]
    )
    assert file.read_bytes() == before


def test_a_link_to_what_is_another_users_is_not_read(file, tmp_path, monkeypatch):
    elsewhere = file.rename(tmp_path / "elsewhere")
    file.symlink_to(elsewhere)
    other(elsewhere, monkeypatch)
    compiled_code._functions.clear()
    assert value() == (VALUE, True)


def test_a_link_in_the_place_of_the_folder_is_not_followed(file, tmp_path, caplog):
    elsewhere = file.parent.rename(tmp_path / "elsewhere")
    file.parent.symlink_to(elsewhere)
    compiled_code._say.cache_clear()
    compiled_code._functions.clear()
    with caplog.at_level("INFO", "spinlev"):
        assert value() == (VALUE, True)
    assert f"{file.parent} is a link" in caplog.text


def test_a_cache_that_users_share_has_a_folder_for_each(folder, tmp_path, monkeypatch):
    """As in /tmp: everybody may write, and remove only what is his own; a colleague has made it."""
    tmp_path.chmod(0o1777)
    other(tmp_path, monkeypatch)
    before = os.umask(0)
    try:
        assert value() == (VALUE, True)
        compiled_code._functions.clear()
        assert value() == (VALUE, False)
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert [file.stat().st_mode & 0o022 for file in folder.iterdir()] == [0]


def test_a_new_cache_is_closed_to_a_group_whatever_the_users_mask_is(tmp_path, monkeypatch):
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path / "new" / "cache"))
    before = os.umask(0o002)
    try:
        assert value() == (VALUE, True)
    finally:
        os.umask(before)
    assert (tmp_path / "new" / "cache").stat().st_mode & 0o777 == 0o755
    compiled_code._functions.clear()
    assert value() == (VALUE, False)


def test_where_nothing_can_be_kept_code_is_compiled(file, tmp_path, monkeypatch):
    file.unlink()
    file.mkdir()
    assert value() == (VALUE, True)
    (tmp_path / "file").touch()
    for place in (tmp_path / "file", Path("/proc/spinlev")):
        monkeypatch.setenv("SPINLEV_CACHE", str(place))
        assert value() == (VALUE, True)


def test_what_was_not_used_for_the_longest_time_makes_room(tmp_path):
    for age, name in enumerate(("new", "used", "old", "oldest")):
        (tmp_path / f"{name}.code").write_bytes(bytes(100))
        os.utime(tmp_path / f"{name}.code", (1e9 - age, 1e9 - age))
    make_room(tmp_path, 250)
    assert {path.stem for path in tmp_path.iterdir()} == {"new", "used"}


def test_code_that_is_read_counts_as_used(file):
    os.utime(file, (1e9, 1e9))
    value()
    assert file.stat().st_mtime > 1.5e9


def test_code_whose_arguments_are_written_later_is_told_by_what_they_are_written_from(folder, monkeypatch):
    """Nothing is written where it is there already; another source, option or number of the writer is other code."""
    x, written = hy.make_vars("x"), []

    def later(source, **options):
        def write():
            written.append(source)
            return [hy.diff(source * hy.sin(x), x)], [x]

        hy.llvm_state.clear_memcache()
        return compiled_later(hy.cfunc, write, source, **options)([0.5])[0]

    assert later(2.0) == later(2.0) == pytest.approx(2 * np.cos(0.5), rel=1e-15)
    assert written == [2.0]
    compiled_code._functions.clear()
    assert later(2.0) == pytest.approx(2 * np.cos(0.5), rel=1e-15)
    assert written == [2.0]
    assert later(3.0) == pytest.approx(3 * np.cos(0.5), rel=1e-15)
    later(2.0, compact_mode=True)
    monkeypatch.setitem(cache.FORMATS, "code", cache.FORMATS["code"] + 1)
    later(2.0)
    assert written == [2.0, 3.0, 2.0, 2.0]
    assert len(list(folder.iterdir())) == 4


def test_a_process_keeps_what_it_used_last_within_a_limit(folder, monkeypatch):
    """What is dropped is read from the disk again, as another function of the same values."""
    x = hy.make_vars("x")
    compiled_code._functions.clear()
    first = compiled(hy.cfunc, [hy.sin(x)], [x])
    ((_, taken),) = compiled_code._functions.values()
    monkeypatch.setattr(compiled_code, "SHARED", int(3.01 * taken))
    for number in range(2):
        assert compiled(hy.cfunc, [hy.sin(x)], [x]) is first
        compiled(hy.cfunc, [hy.cos(x) + float(number)], [x])
    for number in range(2, 5):
        compiled(hy.cfunc, [hy.cos(x) + float(number)], [x])
    again = compiled(hy.cfunc, [hy.sin(x)], [x])
    assert again is not first
    assert again([0.5])[0] == first([0.5])[0]
    assert len(compiled_code._functions) < 4


def test_many_small_functions_take_no_more_memory_than_a_process_may_keep(folder):
    """Those of a sweep have files of 10 kB, and 2.8 MB of memory each: counted by their files 1500 were kept."""
    x = hy.make_vars("x")
    compiled_code._functions.clear()
    for number in range(60):
        compiled(hy.cfunc, [hy.cos(x) + float(number)], [x])
    assert len(compiled_code._functions) * 2.8e6 < compiled_code.SHARED


def test_code_under_another_name_is_not_run(folder):
    """Its name says of what it is."""
    x = hy.make_vars("x")
    compiled(hy.cfunc, [x + 2.0], [x])
    (other,) = folder.iterdir()
    content = other.read_bytes()
    compiled(hy.cfunc, [x + 3.0], [x])
    (mine,) = set(folder.iterdir()) - {other}
    mine.write_bytes(content)
    compiled_code._functions.clear()
    assert compiled(hy.cfunc, [x + 3.0], [x])([1.0])[0] == 4.0


@pytest.mark.parametrize(("said", "left"), [("", 2), ("2", 2), ("1", 1)])
@pytest.mark.usefixtures("two_threads")
def test_a_block_of_one_thread_gives_the_others_back(monkeypatch, said, left):
    """Others wait busily for small work; parallel work is by processes. A process that has one thread keeps to it."""
    monkeypatch.setenv("OMP_NUM_THREADS", said)
    with one_thread():
        assert hy.get_nthreads() == 1
    assert hy.get_nthreads() == left
