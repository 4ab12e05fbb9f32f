"""A folder of what was computed before: found again by its name, made by one process at a time."""

import errno
import fcntl
import logging
import os
import platform
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TypeVar

import platformdirs
from filelock import FileLock, Timeout

from ...geometry.basics import InputError
from .whole_files import closed, ours

Table = TypeVar("Table")
OWNER = "in-use.lock"
LIMIT = 2.0
"""Size of all tables that are kept, GB, if SPINLEV_CACHE_GB names no other."""
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)


class TableFileError(InputError):
    """A table file that is damaged, or is not one."""


def cache_folder() -> Path:
    """$SPINLEV_CACHE, else spinlev in the place of a user's caches: $XDG_CACHE_HOME or ~/.cache on Linux.

    Who has no home, or none to write in, has a folder in the system's temporary one.
    """
    if named := os.environ.get("SPINLEV_CACHE"):
        return Path(named)
    try:
        return _usable(Path(platformdirs.user_cache_dir("spinlev", appauthor=False)))
    except RuntimeError:  # neither $HOME nor an entry in the list of users
        return _usable(Path())


@cache
def _usable(folder: Path) -> Path:
    with suppress(OSError):
        if folder.is_absolute():  # older platformdirs leave a ~ that nobody knows, which would be a folder's name
            folder.mkdir(mode=0o755, parents=True, exist_ok=True)
            return folder
    try:
        instead = temporary_home()
    except OSError:
        return Path(os.devnull) / "spinlev"  # where nothing can be kept, which each table says
    text = "There is no home folder: tables are kept in %s, as long as the system does; SPINLEV_CACHE names another."
    logging.getLogger("spinlev").info(text, instead)
    return instead


def temporary_home() -> Path:
    """A folder among the temporary files that is this user's alone, the same each time if it can be. Raises OSError."""
    home = Path(tempfile.gettempdir()) / f"spinlev-{os.getuid()}"
    home.mkdir(mode=0o700, exist_ok=True)
    if others_may_write(home):  # somebody else was there first
        return Path(tempfile.mkdtemp(prefix=f"{home.name}-"))
    return home


def own_folder(name: str) -> Path:
    """A folder of the cache for this user alone, made if it is missing. Raises OSError.

    In a cache that several users share each has one: what is in it can be trusted as far as `others_may_write` says.
    """
    # Not as the user's mask would have it, which often lets a group write.
    (root := cache_folder()).mkdir(mode=0o755, parents=True, exist_ok=True)
    (folder := root / f"{name}-{os.getuid()}").mkdir(mode=0o700, exist_ok=True)
    return folder


def others_may_write(folder: Path) -> str | None:
    """Who but this user and root can put files into a folder of the cache, or another in its place, and the way out.

    None if nobody can, or only the owner of a cache in which each may remove no more than what is his: the folder that
    he puts there is his own, and is known by that. Raises OSError.
    """
    above, found = folder.parent.stat(), folder.lstat()
    if not above.st_mode & stat.S_ISVTX:
        if not ours(above):
            return f"{folder.parent} belongs to another user; set SPINLEV_CACHE to a folder of your own"
        if not closed(above):
            mends = f"chmod go-w {folder.parent} mends it (chmod +t where several users share it)"
            return f"others may write in {folder.parent}; {mends}"
    if not stat.S_ISDIR(found.st_mode):
        return f"{folder} is a link or no folder; remove it"
    if not ours(found):
        return f"{folder} belongs to another user; set SPINLEV_CACHE to a folder of your own"
    return None if closed(found) else f"others may write in {folder}; chmod go-w {folder} mends it"


def cache_limit() -> int:
    """Size of all tables that are kept, bytes. Raises InputError where SPINLEV_CACHE_GB is no positive number."""
    text = os.environ.get("SPINLEV_CACHE_GB") or str(LIMIT)
    try:
        limit = float(text)
    except ValueError:
        limit = 0.0
    if not 0 < limit < 1e9:
        raise InputError(f"Input SPINLEV_CACHE_GB must be a positive number; instead received {text!r}.")
    return int(1e9 * limit)


def key_of(path: str | Path) -> str:
    """Name by which a file in the cache is found again; empty for a file anywhere else."""
    path, folder = Path(path), cache_folder().resolve()
    place = path.parent.resolve() / path.name  # however the path is written: from the current folder, by a link
    return place.relative_to(folder).as_posix() if place.is_relative_to(folder) else ""


def from_cache(
    name: str,
    load: Callable[[Path], Table],
    make: Callable[[], Table],
    save: Callable[[Table, Path], None],
    report: Callable[[str], None],
    most: int = 2**63,
) -> tuple[Table, bool]:
    """A table, from the cache if it is there under `name`, and whether it was.

    A damaged entry, or one that was kept under another name, is reported, computed anew and replaced; a cache that
    cannot be written is reported and does no harm.  While one process makes a table, others that need the same one wait
    for it.  All tables in its folder together keep `cache_limit` and `most`, bytes; what was not used for the longest
    time makes room.

    Raises
    ------
    InputError : SPINLEV_CACHE_GB is no positive number
    """
    path, limit = cache_folder() / name, min(most, cache_limit())
    with alone(path.with_suffix(".lock"), report):
        if path.exists():
            try:
                found = load(path)
            except (TableFileError, OSError) as error:
                report(f"The cached table is damaged and is computed anew: {error}")
            else:
                with suppress(OSError):  # of a cache that cannot be written
                    os.utime(path)
                return found, True
        table = make()
        try:
            save(table, path)
            make_room(path.parent, limit)
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
        path.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
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


@contextmanager
def owned(folder: Path) -> Iterator[None]:
    """Be the only process that computes into a folder while the block lasts.

    The system frees the lock of a process that has ended, however it did. Where there are no locks the block runs
    without.

    Raises
    ------
    InputError : another process is at work there
    OSError : the folder cannot be made or written
    """
    is_new = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / OWNER
    descriptor = _lock(path)
    try:
        with suppress(OSError):  # a full disk: who owns the folder is said for people only
            os.ftruncate(descriptor, 0)
            os.write(descriptor, f"process {os.getpid()} on {platform.node()}".encode())
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)
        if is_new:
            with suppress(OSError):  # something was computed: it stays
                folder.rmdir()


def _lock(path: Path) -> int:
    """Descriptor of the file at a path, locked; it is a new one if another process has just removed its own."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(descriptor, 200).decode(errors="replace") or "another process"
            os.close(descriptor)
            raise InputError(
                f"Input --out must be a folder into which no other spinlev computes; instead {owner} does so in "
                f"{path.parent}. Wait until it has ended, or choose another --out."
            ) from None
        except OSError as error:
            if error.errno not in NO_LOCKS:
                os.close(descriptor)
                raise
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        os.close(descriptor)


def make_room(folder: Path, limit: int) -> None:
    """Remove what was not used for the longest time until the files of a folder together keep the limit, bytes.

    The newest stays, and what a process has locked.
    """
    kept = []
    for path in folder.iterdir():
        with suppress(FileNotFoundError):  # another process makes room too
            found = path.stat()
            if stat.S_ISREG(found.st_mode) and path.suffix != ".lock":
                kept.append((found.st_mtime_ns, found.st_size, path))
    kept.sort(reverse=True)
    total = sum(size for _, size, _ in kept)
    while total > limit and len(kept) > 1:
        _, size, path = kept.pop()
        with suppress(OSError, Timeout):  # of another user, or it is being read
            lock = path.with_suffix(".lock")
            if not lock.exists():  # of what needs none
                path.unlink(missing_ok=True)
            else:
                with FileLock(lock, timeout=0):
                    path.unlink(missing_ok=True)
                    lock.unlink()
        total -= size
