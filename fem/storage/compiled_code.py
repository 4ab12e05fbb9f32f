"""Where heyoka keeps compiled code between processes: beside the tables, and not more than it can look through soon.

At the first compilation of a process heyoka adds up the sizes of all that it has kept, and reads its whole file for it:
with 9.5 GB that took 3 s of processor time, and 9 s where others read it too.  Its own limit is 20 GiB.
"""

from __future__ import annotations

import sqlite3
from pathlib import Path

import heyoka as hy

from .checked_files import alone, cache_folder
from .code_copy import add_copy, sound

LIMIT = 2**29
"""Size of what is kept, bytes; the oldest makes room.  Looked through in 0.2 s, after it is checked in as much."""


def keep_code() -> None:
    """Keep compiled code in the cache's folder; damaged code is thrown away, and none kept where that is impossible."""
    folder = cache_folder() / "code"
    try:
        with alone(folder / "lock", report=lambda _: None):  # two processes that make the file at once fail
            _open(folder)
    except (OSError, RuntimeError, sqlite3.Error):
        hy.llvm_state.set_diskcache_enabled(False)
    else:
        hy.llvm_state.set_diskcache_enabled(True)


def _open(folder: Path) -> None:
    """Let heyoka open its file, which is made anew unless it is sound.

    heyoka must not have the file open while this module looks into it: a process that closes a file loses all of its
    locks on it, also those of the other library.  Setting the path closes it.
    """
    file = folder / "cache.db"
    hy.llvm_state.set_diskcache_path(folder)
    if not (file.exists() and sound(file)):
        for path in (file, Path(f"{file}-wal"), Path(f"{file}-shm")):
            path.unlink(missing_ok=True)
        hy.llvm_state.set_diskcache_limit(LIMIT)  # makes the file
        hy.llvm_state.set_diskcache_path(folder)
        add_copy(file)
    hy.llvm_state.set_diskcache_limit(LIMIT)
