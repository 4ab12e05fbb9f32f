"""Compiled code on disk."""

import heyoka as hy

from spinlev.fem.code_cache import LIMIT, keep_code


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
