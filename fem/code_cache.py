"""Where heyoka keeps compiled code between processes: beside the tables, and not more than it can look through soon.

At the first compilation of a process heyoka adds up the sizes of all that it has kept, and reads its whole file for it:
with 9.5 GB that took 3 s of processor time, and 9 s where others read it too.  Its own limit is 20 GiB.
"""

from __future__ import annotations

import heyoka as hy

from .table_store import alone, cache_folder

LIMIT = 2**29
"""Size of what is kept, bytes; the oldest makes room.  Looked through in 0.2 s."""


def keep_code() -> None:
    """Keep compiled code in the cache's folder; nothing is kept where that cannot be opened."""
    folder = cache_folder() / "code"
    try:
        with alone(folder / "lock", report=lambda _: None):  # two processes that make the file at once fail
            hy.llvm_state.set_diskcache_path(folder)
            hy.llvm_state.set_diskcache_limit(LIMIT)
    except (OSError, RuntimeError):
        hy.llvm_state.set_diskcache_enabled(False)
    else:
        hy.llvm_state.set_diskcache_enabled(True)
