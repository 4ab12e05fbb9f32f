"""The user's cache of tables: keys of what decides a table, one kind of file for each solver, and their folder.

A key holds all inputs exactly, the number of the solver that turns them into a table, and the versions of the libraries
that compute. The numbers stand here, so that `make lint` can hold each against the code of its solver.

Tables are frozen dataclasses, kept as netCDF: a variable for each field of numbers of a class, for all its objects,
with the unit and the sentence beside it, and one text in JSON, the variable `content`, of which object holds which
numbers. Only classes that the fields' types name are made of it: no file can run anything.
"""

import hashlib
import inspect
import io
import json
import logging
import os
import platform
import re
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass
from errno import ENOLCK, ENOSYS, EOPNOTSUPP
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Generic, TypeVar, get_args, get_type_hints

import numpy as np
import platformdirs
import xarray as xr
from filelock import FileLock, Timeout
from xarray.backends import H5NetCDFStore

from ..geometry.common import ComputationError, InputError, Report
from ..geometry.files import MOST, closed, hdf5_fault, ours, regular_file, seal, sealed, user, write_whole

# Number of each solver whose answers are kept, or of what writes the formulas that are compiled: another answer, or
# another shape of its file, has the next number, and nothing of the old one is read any more.
FORMATS = {
    "rotor": 13,
    "mutual": 23,
    "map": 3,
    "plate": 3,
    "driven-plate": 7,
    "plate-currents": 3,
    "changed-share": 6,
    "slab": 7,
    "edges": 3,
    "rotor-losses": 2,
    "floater-currents": 3,
    "floating": 2,
    "floating-free": 1,
    "equilibria": 19,
    "flight": 5,
    "experiment": 3,
    "code": 1,
}
# That decide the digits of a table; the others read, write and show.
LIBRARIES = ("heyoka", "netgen-mesher", "ngsolve", "numpy", "scipy")
ROOT = Path(__file__).resolve().parents[1]
FLOORS = ("geometry", "fem", "dynamics", "studies")
TEXTS = (".py", ".csv")
OWNER = "in-use.lock"
LIMIT = 2.0  # Size of all tables that are kept, GB, if SPINLEV_CACHE_GB names no other
NO_LOCKS = (ENOLCK, ENOSYS, EOPNOTSUPP)
Table = TypeVar("Table")
CONTENT = "content"  # variable of a file that says which object holds which numbers


class TableFileError(InputError):
    """A table file that is damaged, or is not one."""


class NotKeptError(ComputationError):
    """A table that is not in the cache, where none may be made."""


_kept_only = ContextVar("kept_only", default=False)


@contextmanager
def kept_only() -> Iterator[None]:
    """Inside, a table that is not in the cache raises NotKeptError instead of being made: for who cannot wait."""
    token = _kept_only.set(True)
    try:
        yield
    finally:
        _kept_only.reset(token)


@cache
def libraries() -> str:
    """Names and versions of the libraries that decide digits."""
    return " ".join(f"{name} {version(name)}" for name in LIBRARIES)


@cache
def program_digest(*without: str, root: Path = ROOT) -> str:
    """SHA-256 of this program's text, but for rooms, and its libraries: of processes that compute together."""
    digest = hashlib.sha256(libraries().encode())
    for path in sorted(path for floor in FLOORS for path in (root / floor).rglob("*") if path.suffix in TEXTS):
        name = path.relative_to(root)
        if name.parent.as_posix() not in without:
            content = path.read_bytes()
            digest.update(f"{name.as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def key_of(name: str, *inputs: Any) -> str:
    """SHA-256 of the inputs of a solver, of its number in `FORMATS`, and of the libraries' versions.

    Of dataclasses all fields but those with `compare=False`; of a path the file's content. Raises TypeError: another
    input than these, arrays, numbers, texts, tuples and mappings.
    """
    digest = hashlib.sha256(f"{name} {FORMATS[name]} {libraries()}".encode())
    _count(inputs, digest.update)
    return digest.hexdigest()


def _count(value: Any, update: Callable[[bytes], None]) -> None:
    """Feed a digest; every piece begins with its kind and length, so that no two inputs are the same bytes."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        plain = value + 0.0 if value.dtype.kind in "fc" else value  # -0.0 is 0.0
        update(f"array {value.dtype.str} {value.shape} ".encode() + plain.tobytes())
    elif is_dataclass(value) and not isinstance(value, type):
        counted = [each.name for each in fields(value) if each.compare]
        update(f"class {type(value).__name__} {len(counted)} ".encode())
        for name in counted:
            _count((name, getattr(value, name)), update)
    elif isinstance(value, tuple | list):
        update(f"tuple {len(value)} ".encode())
        for item in value:
            _count(item, update)
    elif isinstance(value, Mapping):
        update(b"mapping ")
        _count(sorted(value.items()), update)
    elif isinstance(value, Path):
        with regular_file(value, MOST, "file", "a file") as stream:
            update(b"file " + hashlib.sha256(stream.read()).digest())
    elif value is None or isinstance(value, bool | int | str | bytes):
        said = value if isinstance(value, bytes) else str(value).encode()
        update(f"{type(value).__name__} {len(said)} ".encode() + said)
    elif isinstance(value, float):
        update(f"float {(float(value) + 0.0).hex()} ".encode())
    else:
        raise TypeError(f"Input of a key must be of what tables are made from; instead it is {type(value).__name__}.")


@dataclass(frozen=True)
class TableKind(Generic[Table]):
    """One kind of tables, and their files."""

    name: str  # its entry in `FORMATS`; names of files begin with it
    form: type[Table]  # type of a table: a dataclass, or `tuple[...]`
    title: str = ""  # of the files, for people
    # size of all of them, bytes, which are in a folder of their own then; None: with the others in the cache
    most: int | None = None

    @property
    def format(self) -> str:
        return f"spinlev {self.name} {FORMATS[self.name]}"

    def key(self, *inputs: Any) -> str:
        return key_of(self.name, *inputs)

    def save(self, table: Table, path: str | Path, key: str = "") -> None:
        """Write a table to `path`, with its `key`; the file is whole or absent. Raises OSError."""
        labels = {"format": self.format, "title": self.title, "key": key}
        write_checked(to_dataset(table).assign_attrs(labels), path)

    def load(self, path: str | Path, key: str = "") -> Table:
        """Read a table, with a key only the one of that key. Raises TableFileError: another, or damaged."""
        dataset = read_checked(path, self.format)
        if key and dataset.attrs.get("key") != key:
            raise TableFileError(f"Input {path} must be what its name says; instead it is the table of other inputs.")
        try:
            return from_dataset(dataset, self.form)
        except CodecError as error:
            raise TableFileError(f"Input {path} must be a '{self.format}'; instead: {error}") from error

    def cached(self, inputs: tuple[Any, ...], make: Callable[[], Table], report: Report) -> tuple[Table, bool]:
        """The table of some inputs, from the cache if it is there, and whether it was.

        A damaged entry, or one of another key, is reported, made anew and replaced; a cache that cannot be written is
        reported. While one process makes a table, others that need it wait. What was not used for the longest time
        makes room for `cache_limit` and `most`. Raises InputError: SPINLEV_CACHE_GB is no positive number;
        NotKeptError: inside `kept_only`.
        """
        key, limit = self.key(*inputs), min(self.most or 2**63, cache_limit())
        path = cache_folder() / (self.name if self.most else "") / f"{self.name}-{key}.nc"
        with alone(path.with_suffix(".lock"), report):
            if path.exists():
                try:
                    found = self.load(path, key)
                except (TableFileError, OSError) as error:
                    report(f"The cached table is damaged and is computed anew: {error}")
                else:
                    with suppress(OSError):  # of a cache that cannot be written
                        os.utime(path)
                    return found, True
            if _kept_only.get():
                raise NotKeptError(f"The table {path.name} is not in the cache.")
            table = make()
            try:
                self.save(table, path, key)
                make_room(path.parent, limit)
            except OSError as error:
                report(f"The table could not be cached: {error}")
            return table, False


def write_checked(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a dataset with the checksum of the file at its end; the file is whole or absent. Raises OSError."""
    memory = io.BytesIO()  # on a full disk HDF5 itself would crash
    # As `to_netcdf`, which would load a cluster's libraries and ask for a lock of memory that is its own.
    store = H5NetCDFStore.open(memory, mode="w", lock=False)
    dataset.dump_to_store(store)
    store.close()
    write_whole(path, seal(memory.getvalue()))


def read_checked(path: str | Path, file_format: str | None = None) -> xr.Dataset:
    """Read a dataset that is as it was written; `file_format` None is any, also of files that others have written.

    Raises TableFileError: the file is missing, no file, too large, damaged, no netCDF, or not of this format.
    """
    try:
        whole = sealed(Path(path))
    except InputError as error:
        raise TableFileError(str(error)) from None
    if whole is False:
        raise TableFileError(f"Input {path} must be as it was written; instead its checksum does not match.")
    if whole is None and file_format:
        raise TableFileError(f"Input {path} must be a whole '{file_format}'; instead it does not end in its checksum.")
    if whole is None and (reason := hdf5_fault(Path(path))):
        raise TableFileError(f"Input {path} must be a readable netCDF file; instead: {reason}.")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as opened:
            dataset = opened.load()
    except Exception as error:  # the HDF5 layer raises many kinds on a damaged file
        raise TableFileError(f"Input {path} must be a readable netCDF file; instead: {error}.") from error
    if file_format and dataset.attrs.get("format") != file_format:
        received = dataset.attrs.get("format")
        raise TableFileError(f"Input {path} must be a '{file_format}'; instead received '{received}'.")
    return dataset


def cache_folder() -> Path:
    """$SPINLEV_CACHE, else spinlev in the place of a user's caches, or in the temporary folder of who has no home."""
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
    home = Path(tempfile.gettempdir()) / f"spinlev-{user()}"
    home.mkdir(mode=0o700, exist_ok=True)
    if others_may_write(home):  # somebody else was there first
        return Path(tempfile.mkdtemp(prefix=f"{home.name}-"))
    return home


def others_may_write(folder: Path) -> str | None:
    """Who but this user and root can put files into a folder of the cache, or another in its place, and the way out.

    None if nobody can, or only the owner of a cache in which each may remove no more than what is his: the folder that
    he puts there is his own, and is known by that. Raises OSError.
    """
    above, found = folder.parent.stat(), folder.lstat()
    places = [(folder.parent, above, " (chmod +t where several users share it)"), (folder, found, "")]
    for path, one, hint in places[1:] if above.st_mode & stat.S_ISVTX else places:
        if not stat.S_ISDIR(one.st_mode):
            return f"{path} is a link or no folder; remove it"
        if not ours(one):
            return f"{path} belongs to another user; set SPINLEV_CACHE to a folder of your own"
        if not closed(one):
            return f"others may write in {path}; chmod go-w {path} mends it{hint}"
    return None


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


def make_room(folder: Path, limit: int) -> None:
    """Remove what was not used for the longest time and is not locked, until a folder keeps the limit, bytes."""
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
            lock = path.with_suffix(".lock")  # what needs none has none
            with FileLock(lock, timeout=0) if lock.exists() else nullcontext():
                path.unlink(missing_ok=True)
                lock.unlink(missing_ok=True)
        total -= size


@contextmanager
def alone(path: Path, report: Report) -> Iterator[None]:
    """Be the only process in this block with the same lock file; without locks a table is at worst made twice."""
    lock = FileLock(path)
    try:
        path.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
        try:
            lock.acquire(timeout=0)
        except Timeout:
            report("Another process is making this table: waiting for it ...")
            lock.acquire()
    except OSError as error:
        if error.errno in NO_LOCKS:
            report("The cache's file system has no locks.")
    try:
        yield
    finally:
        lock.release()  # does nothing if there is none


@contextmanager
def owned(folder: Path) -> Iterator[None]:
    """Be the only process that computes into a folder in the block. Raises InputError: another is; OSError."""
    is_new = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / OWNER
    lock = FileLock(path)
    try:
        lock.acquire(timeout=0)
        with suppress(OSError):  # a full disk: who owns the folder is said for people only
            path.write_text(f"process {os.getpid()} on {platform.node()}")
    except Timeout:
        owner = path.read_text(errors="replace")[:200] if path.exists() else ""
        raise InputError(
            f"Input --out must be a folder into which no other spinlev computes; instead {owner or 'another process'} "
            f"does so in {folder}. Wait until it has ended, or choose another --out."
        ) from None
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        lock.release()
        if is_new:
            with suppress(OSError):  # something was computed: it stays
                folder.rmdir()


class CodecError(InputError):
    """A data set does not hold such an object."""


def to_dataset(value: Any) -> xr.Dataset:
    """Dataclasses, tuples, mappings, arrays, texts and numbers in each other. Raises TypeError: another in them."""
    pools: dict[str, list[np.ndarray]] = {}
    labels: dict[str, dict[str, str]] = {}

    def packed(value: Any, name: str, label: Mapping[str, str]) -> Any:
        if isinstance(value, np.ndarray) or (isinstance(value, float) and "units" in label):
            if np.iscomplexobj(value):
                return {"complex": [packed(part, f"{name}_{end}", label)
                                    for part, end in ((value.real, "real"), (value.imag, "imag"))]}  # fmt: skip
            array = np.asarray(value, label.get("dtype"))
            pools.setdefault(name, []).append(array)
            labels.setdefault(name, {"units": "1"} | {k: text for k, text in label.items() if k != "dtype"})
            return {"number": name} if isinstance(value, float) else {"array": [name, *array.shape]}
        if is_dataclass(value) and not isinstance(value, type):
            said, inner = _documentation(type(value)), {}
            for each in fields(value):
                below = {"long_name": said.get(each.name, each.name), **each.metadata}
                inner[each.name] = packed(getattr(value, each.name), f"{type(value).__name__}.{each.name}", below)
            return {"class": [type(value).__name__, inner]}
        if isinstance(value, tuple | list):
            return {"tuple": [packed(item, name, label) for item in value]}
        if isinstance(value, Mapping):
            return {"mapping": {key: packed(item, name, label) for key, item in value.items()}}
        if isinstance(value, Path):
            return {"path": str(value)}
        if value is None or isinstance(value, str | int | float):
            return value
        raise TypeError(f"Input value must be of what tables are made of; instead {name} is {type(value).__name__}.")

    content = json.dumps(packed(value, "value", {}))
    variables = {}
    for name, arrays in pools.items():  # along a further axis where they have one shape, else one after the other
        alike = len({array.shape for array in arrays}) == 1
        whole = np.stack(arrays) if alike else np.concatenate([array.ravel() for array in arrays])
        axes = [f"{axis}_of_{size}" for axis, size in zip("abcdefg", whole.shape, strict=False)]
        variables[name] = xr.Variable(axes, whole, labels[name])
    about = {"units": "1", "long_name": "which object holds which numbers, JSON"}
    return xr.Dataset(variables | {CONTENT: xr.Variable((), content, about)})


def from_dataset(dataset: xr.Dataset, form: type[Table]) -> Table:
    """The object of a type, or of `tuple[...]`, that `to_dataset` made a data set of. Raises CodecError."""
    classes, left = _classes(form, {}), dict[str, np.ndarray]()

    def taken(name: str, shape: list[int]) -> np.ndarray:
        rest = left[name] if name in left else dataset[name].values.ravel()
        size = int(np.prod(shape))
        found, left[name] = rest[:size], rest[size:]
        return found.reshape(shape).astype(float if found.dtype.kind == "f" else found.dtype)

    def unpacked(tree: Any) -> Any:
        if not isinstance(tree, dict):
            return tree
        ((kind, inner),) = tree.items()
        if kind == "class":
            return classes[inner[0]](**{name: unpacked(part) for name, part in inner[1].items()})
        if kind == "tuple":
            return tuple(map(unpacked, inner))
        if kind == "mapping":
            return {key: unpacked(part) for key, part in inner.items()}
        if kind == "complex":
            real, imaginary = map(unpacked, inner)
            return real + 1j * imaginary
        if kind == "path":
            return Path(inner)
        return float(taken(inner, [1])[0]) if kind == "number" else taken(inner[0], inner[1:])

    try:
        return unpacked(json.loads(str(dataset[CONTENT].item())))  # type: ignore[no-any-return]
    except (KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
        name = getattr(form, "__name__", form)
        raise CodecError(f"Input dataset must hold a {name}; instead {type(error).__name__}: {error}.") from error


def _classes(form: Any, found: dict[str, type]) -> dict[str, type]:
    """Dataclasses that a type names, by their names, and all that their fields' types name."""
    if isinstance(form, type) and is_dataclass(form):
        if form.__name__ not in found:
            found[form.__name__] = form
            for hint in get_type_hints(form).values():
                _classes(hint, found)
    else:
        for argument in get_args(form):
            _classes(argument, found)
    return found


@cache
def _documentation(form: type) -> dict[str, str]:
    """What comments beside a class's fields, or else above them, or its list of parameters say of these, by name."""
    lines = re.findall(r"^(\w+(?:, \w+)*) : (.*(?:\n {4,}.*)*)", inspect.getdoc(form) or "", re.MULTILINE)
    said = {name: " ".join(text.split()) for names, text in lines for name in names.split(", ")}
    with suppress(OSError):  # no source
        written = re.findall(r"((?:^ +# .*\n)*)^ +(\w+): [^#\n]*(?:# (.*))?$", inspect.getsource(form), re.MULTILINE)
        said |= {name: " ".join((beside or above.replace("# ", "")).split()) for above, name, beside in written
                 if above or beside}  # fmt: skip
    return said
