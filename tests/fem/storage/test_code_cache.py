"""Compiled code on disk: kept beside the tables, bounded, and never run when damaged."""

import struct

import heyoka as hy
import numpy as np
import pytest

from spinlev.fem.storage.code_copy import sound
from spinlev.fem.storage.compiled_code import LIMIT, keep_code

CONSTANT = 3.1640625


@pytest.fixture
def file(tmp_path, monkeypatch):
    """The file of a cache of its own, in which the code of `value` is kept."""
    with monkeypatch.context() as patch:
        patch.setenv("SPINLEV_CACHE", str(tmp_path))
        keep_code()
        value()
        close(tmp_path)
        yield tmp_path / "code" / "cache.db"
    keep_code()


def value():
    """A compiled function's value, its code from the disk if it is there."""
    hy.llvm_state.clear_memcache()
    x = hy.make_vars("x")
    return hy.cfunc([hy.sin(x) * CONSTANT + hy.exp(x)], [x])([1.0])[0]


def close(folder):
    """Have heyoka close its file."""
    hy.llvm_state.set_diskcache_path(folder / "elsewhere")


def flip(content, place, bit):
    return content[:place] + bytes([content[place] ^ 1 << bit]) + content[place + 1 :]


def test_code_is_kept_beside_the_tables_and_bounded(tmp_path, monkeypatch):
    before = hy.llvm_state.get_diskcache_path(), hy.llvm_state.get_diskcache_enabled()
    assert hy.llvm_state.get_diskcache_limit() == LIMIT  # by the import of the package
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))
    keep_code()
    assert hy.llvm_state.get_diskcache_path() == tmp_path / "code"
    (tmp_path / "file").touch()
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path / "file"))
    keep_code()
    assert not hy.llvm_state.get_diskcache_enabled()
    x = hy.make_vars("x")
    assert hy.cfunc([x + 1.25], [x])([1.0])[0] == 2.25
    hy.llvm_state.set_diskcache_path(before[0])
    hy.llvm_state.set_diskcache_enabled(before[1])


def test_a_flipped_bit_of_a_constant_is_not_computed_with(file, tmp_path):
    """heyoka by itself does: wherever the constant is in the machine code, the value is another one."""
    expected, whole = value(), file.read_bytes()
    pattern = struct.pack("<d", CONSTANT)
    places = [k for k in range(len(whole)) if whole.startswith(pattern, k)]
    ran = []
    for place in places:
        file.write_bytes(flip(whole, place + 6, 1))
        hy.llvm_state.set_diskcache_path(file.parent)
        ran.append(value())
        close(tmp_path)
        file.write_bytes(flip(whole, place + 6, 1))
        keep_code()
        assert value() == expected
        close(tmp_path)
        assert sound(file)
    assert any(one != expected for one in ran)


def test_any_flipped_bit_leaves_the_value_as_it_was(file, tmp_path):
    expected, whole, chance, found = value(), file.read_bytes(), np.random.default_rng(0), 0
    for _ in range(50):
        file.write_bytes(flip(whole, chance.integers(len(whole)), chance.integers(8)))
        found += not sound(file)
        keep_code()
        assert value() == expected
        close(tmp_path)
        assert sound(file)
    assert found


@pytest.mark.parametrize("damage", ["cut off", "empty", "other bytes", "without a copy", "a folder"])
def test_a_damaged_file_is_made_anew(file, tmp_path, damage):
    content = file.read_bytes()
    file.unlink()
    if damage == "without a copy":  # as heyoka makes it
        hy.llvm_state.set_diskcache_path(file.parent)
        value()
        close(tmp_path)
    elif damage == "a folder":
        file.mkdir()
    else:
        file.write_bytes({"cut off": content[:50_000], "empty": b"", "other bytes": b"\x89HDF" * 999}[damage])
    keep_code()
    assert hy.llvm_state.get_diskcache_enabled() == (damage != "a folder")
    assert value() == 3.1640625 * np.sin(1.0) + np.exp(1.0)
    close(tmp_path)
    if damage != "a folder":
        assert sound(file)
