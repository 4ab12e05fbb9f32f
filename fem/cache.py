"""Which program a file is of: the text of the rooms that make it, and the versions of the libraries that compute it."""

import errno
import fcntl
import hashlib
import io
import logging
import os
import platform
import re
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import platformdirs
import xarray as xr
from filelock import FileLock, Timeout
from xarray.backends import H5NetCDFStore

from ..geometry.common import InputError
from .files import closed, hdf5_fault, ours, read_netcdf, seal, sealed, write_whole

ROOT = Path(__file__).resolve().parents[1]
"""Where the floors lie."""
LIBRARIES = ("heyoka", "netgen-mesher", "ngsolve", "numpy", "scipy")
"""That decide the digits of a table; the others read, write and show."""
TEXTS = (".py", ".csv")
IMPORT = re.compile(r"^\s*from (\.+)([\w.]+) import", re.MULTILINE)


def program_of(*packages: str) -> str:
    """The versions of what computes in packages: digest of their text, and libraries."""
    return " ".join([digest_of(*packages), _libraries()])


@cache
def _libraries() -> str:
    return " ".join(f"{name} {version(name)}" for name in LIBRARIES)


@cache
def digest_of(*names: str, root: Path = ROOT) -> str:
    """SHA-256 of the text of modules and of all modules that they import, directly or not.

    Parameters
    ----------
    names : of modules, or of packages for all of their modules
    root : folder of the floors

    Raises
    ------
    FileNotFoundError : a name is of no module of this program
    """
    digest = hashlib.sha256()
    for path in sorted(modules_of(*names, root=root)):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(root).as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def modules_of(*names: str, root: Path = ROOT) -> set[Path]:
    """Files of modules or packages and of all modules that they import, directly or not."""
    found: set[Path] = set()
    new = {path for name in names for path in _files_of(name, root)}
    if not all(_files_of(name, root) for name in names):
        raise FileNotFoundError(f"Input names must be modules of this program; instead received {', '.join(names)}.")
    while new:
        found |= new
        new = {path for module in new for path in _imported(module, root)} - found
    return found


def _files_of(name: str, root: Path) -> set[Path]:
    place = root.joinpath(*name.split(".")[1:])
    if place.is_dir():
        return {path for path in place.rglob("*") if path.suffix in TEXTS}
    return {path for path in [place.with_suffix(".py")] if path.exists()}


def _imported(module: Path, root: Path) -> set[Path]:
    """Files that a module imports; inside the program all imports are relative."""
    found: set[Path] = set()
    above = ("spinlev", *module.relative_to(root).parts[:-1])
    for dots, name in IMPORT.findall(module.read_text(encoding="utf-8")):
        found |= _files_of(".".join([*above[: len(above) - len(dots) + 1], *name.split(".")]), root)
    return found


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


Variables = Mapping[str, tuple[tuple[str, ...], Any, str]]
"""Dimensions, values and unit by name."""


def described(variables: Variables, attributes: Mapping[str, Any]) -> xr.Dataset:
    """A dataset in which every variable carries its unit."""
    return xr.Dataset({n: xr.Variable(d, v, {"units": u}) for n, (d, v, u) in variables.items()}, attrs=attributes)


def write_checked(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a dataset with the checksum of the file at its end; the file is whole or absent. Raises OSError.

    In the cache the name of a file says what its content is of, and the checksum counts it.
    """
    memory = io.BytesIO()  # on a full disk HDF5 itself would crash
    # As `to_netcdf`, which would load a cluster's libraries and ask for a lock of memory that is its own.
    store = H5NetCDFStore.open(memory, mode="w", lock=False)
    dataset.dump_to_store(store)
    store.close()
    write_whole(path, seal(memory.getvalue(), key_of(path)))


def read_checked(path: str | Path, file_format: str | None = None) -> xr.Dataset:
    """Read a dataset that is as it was written.

    Parameters
    ----------
    file_format : that it must have; None for any, and for files that others have written or changed

    Raises
    ------
    TableFileError : the file is missing, no file, too large, damaged, no netCDF, or not of this format
    """
    try:
        whole = sealed(Path(path), key_of(path))
    except InputError as error:
        raise TableFileError(str(error)) from None
    if whole is False:
        raise TableFileError(f"Input {path} must be as it was written; instead its checksum does not match.")
    if whole is None and file_format:
        raise TableFileError(f"Input {path} must be a whole '{file_format}'; instead it does not end in its checksum.")
    if whole is None and (reason := hdf5_fault(Path(path))):
        raise TableFileError(f"Input {path} must be a readable netCDF file; instead: {reason}.")
    try:
        dataset = read_netcdf(path) if whole else _foreign(path)
    except Exception as error:  # the HDF5 layer raises many kinds on a damaged file
        raise TableFileError(f"Input {path} must be a readable netCDF file; instead: {error}.") from error
    if file_format and dataset.attrs.get("format") != file_format:
        received = dataset.attrs.get("format")
        raise TableFileError(f"Input {path} must be a '{file_format}'; instead received '{received}'.")
    return dataset


def _foreign(path: str | Path) -> xr.Dataset:
    with xr.open_dataset(path, engine="h5netcdf") as opened:
        return opened.load()
