"""A folder of what was computed before: found again by its name, made by one process at a time."""

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import platformdirs
from filelock import FileLock, Timeout

from .checked_files import TableFileError

Table = TypeVar("Table")
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)


def cache_folder() -> Path:
    """$SPINLEV_CACHE, else spinlev in the place of a user's caches: $XDG_CACHE_HOME or ~/.cache on Linux."""
    return Path(os.environ.get("SPINLEV_CACHE") or platformdirs.user_cache_dir("spinlev", appauthor=False))


def from_cache(
    name: str,
    load: Callable[[Path], Table],
    make: Callable[[], Table],
    save: Callable[[Table, Path], None],
    report: Callable[[str], None],
) -> tuple[Table, bool]:
    """A table, from the cache if it is there under `name`, and whether it was.

    A damaged entry is reported, computed anew and replaced; a cache that cannot be written is reported and
    does no harm.  While one process makes a table, others that need the same one wait for it.
    """
    path = cache_folder() / name
    with alone(path.with_suffix(".lock"), report):
        if path.exists():
            try:
                return load(path), True
            except (TableFileError, OSError) as error:
                report(f"The cached table is damaged and is computed anew: {error}")
        table = make()
        try:
            save(table, path)
        except OSError as error:
            report(f"The table could not be cached: {error}")
        return table, False


@contextmanager
def alone(path: Path, report: Callable[[str], None]) -> Iterator[None]:
    """Be the only process in this block with the same lock file; the system frees it if the process dies.

    Where no lock can be had, the block runs without: at worst a table is made twice.
    """
    lock = FileLock(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _take(lock, report)
    except OSError as error:
        if error.errno in NO_LOCKS:
            report("The cache's file system has no locks.")
    try:
        yield
    finally:
        lock.release()  # does nothing if there is none


def _take(lock: FileLock, report: Callable[[str], None]) -> None:
    try:
        lock.acquire(timeout=0)
    except Timeout:
        report("Another process is making this table: waiting for it ...")
        lock.acquire()


def make_room(folder: Path, limit: int) -> None:
    """Remove what was not used for the longest time until all files of a folder together keep the limit, bytes."""
    kept = []
    for path in folder.iterdir():
        try:
            kept.append((path.stat().st_mtime_ns, path.stat().st_size, path))
        except FileNotFoundError:  # another process makes room too
            continue
    total = 0
    for _, size, path in sorted(kept, reverse=True):
        total += size
        if total > limit:
            path.unlink(missing_ok=True)
