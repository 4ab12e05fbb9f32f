"""Files that are whole or absent: written under a temporary name, then renamed; and a checksum at their end.

With it damage is known before any library tries to make sense of the content: HDF5 ignores what comes after its own
end; given a damaged file it may print, raise anything, or not return at all.
"""

import hashlib
import os
import platform
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import psutil
import xarray as xr

from ..geometry.files import LostError, call_apart, file_content, regular_file

MARK = b"\nspinlev sha256 "
LENGTH = len(MARK) + 64
MOST = 1_000_000_000
"""Bytes of a file that is read."""


def write_whole(path: str | Path, content: bytes) -> None:
    """Write a file at once. Raises OSError, which names the file.

    Libraries that write files themselves may not survive a full disk: let them write to memory.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(content)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `path` that becomes `path` when the block ends without an error.

    The temporary name keeps the suffix, since writers choose the format by it. Missing folders are made, and what
    processes of this machine that were killed have left of the same file is removed.
    Raises OSError, which names the file.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _tidy(path)
        handle, name = tempfile.mkstemp(prefix=f"{_prefix(path)}{os.getpid()}-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            os.chmod(temporary, 0o644)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def _prefix(path: Path) -> str:
    return f".{path.stem}-{platform.node()}-"


def _tidy(path: Path) -> None:
    """Remove temporary files of processes that are no more."""
    prefix = _prefix(path)
    for left in path.parent.glob(f".*{path.suffix}"):
        owner = left.name.removeprefix(prefix).partition("-")[0] if left.name.startswith(prefix) else ""
        if owner.isdecimal() and not psutil.pid_exists(int(owner)):
            left.unlink(missing_ok=True)


def seal(content: bytes, name: str = "") -> bytes:
    """The content with its checksum, which counts the name under which alone it may be read, if there is one."""
    return content + MARK + _digest(content, name)


def sealed(path: Path, name: str = "") -> bool | None:
    """Whether the file is as it was when it was sealed; None if it never was. Raises InputError, see `file_content`."""
    content = file_content(path, MOST, "file", "a regular file")
    return _as_sealed(content, name) if content[-LENGTH:-64] == MARK else None


def unsealed(path: Path, name: str = "", mine: bool = False) -> bytes | None:
    """What was sealed, if the file is as it was then, else None. Raises InputError, see `regular_file`, and OSError.

    Parameters
    ----------
    name : under which alone it may be read, if it was sealed for one
    mine : None too where another user than this one and root may have written it
    """
    with regular_file(path, MOST, "file", "a regular file") as stream:
        if mine and not (ours(found := os.fstat(stream.fileno())) and closed(found)):
            return None
        content = stream.read(MOST)
    return content[:-LENGTH] if _as_sealed(content, name) else None


def ours(found: os.stat_result) -> bool:
    """Whether a file is this user's or root's."""
    return found.st_uid in (0, os.getuid())


def closed(found: os.stat_result) -> bool:
    """Whether no other than a file's owner may write there."""
    return not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _as_sealed(content: bytes, name: str) -> bool:
    """Whether a content ends in its checksum; it is large, and not copied for that."""
    return content[-LENGTH:] == MARK + _digest(memoryview(content)[:-LENGTH], name)


def _digest(content: bytes | memoryview, name: str) -> bytes:
    found = hashlib.sha256(content)
    found.update(name.encode())
    return found.hexdigest().encode()


DIMENSION = "_Netcdf4Dimid"
OWN_TO_NETCDF = {
    *(DIMENSION, "_Netcdf4Coordinates", "_NCProperties", "_FillValue"),
    *("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"),
}
"""Attributes by which netCDF keeps dimensions and the like in HDF5."""


def read_netcdf(path: str | Path) -> xr.Dataset:
    """The dataset of a whole file that xarray wrote by h5netcdf; of another HDF5 makes many kinds of errors."""
    with h5py.File(path) as file:
        stored = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset)}
        dimensions = {item.attrs[DIMENSION]: name for name, item in stored.items() if "CLASS" in item.attrs}
        variables = {
            name: _variable(item, dimensions)
            for name, item in stored.items()
            if not str(item.attrs.get("NAME", b""), "ascii").startswith("This is a netCDF dimension but not")
        }
        attributes = _attributes(file)
    told = [held.pop("coordinates", "") for held in (attributes, *(v.attrs for v in variables.values()))]
    return xr.Dataset(variables, attrs=attributes).set_coords(" ".join(told).split())


def _variable(item: h5py.Dataset, dimensions: Mapping[int, str]) -> xr.Variable:
    attributes = _attributes(item)
    values = np.array(item.asstr()[()], str) if h5py.check_string_dtype(item.dtype) else item[()]
    if attributes.pop("dtype", None) == "bool":
        values = values.astype(bool)
    along = item.attrs.get("_Netcdf4Coordinates")
    if along is None:
        along = [item.attrs[DIMENSION]] if values.shape else []
    return xr.Variable([dimensions[number] for number in along], values, attributes)


def _attributes(item: h5py.Dataset | h5py.File) -> dict[str, Any]:
    """Those that are not HDF5's and netCDF's own."""
    return {n: _plain(v) for n, v in item.attrs.items() if n not in OWN_TO_NETCDF}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype == object:
        value = [str(entry) for entry in value]
        return value[0] if len(value) == 1 else value
    return value[0] if isinstance(value, np.ndarray) and len(value) == 1 else value


SIGNATURE = b"\x89HDF\r\n\x1a\n"
LONGEST = 20.0
"""Seconds to look through a small file, which takes a fraction of one."""
LARGEST = 1_000_000_000
"""Bytes of numbers that a file may unfold to: a few of it can stand for any number of zeros."""
PACE = 10e6
"""Bytes for each second more; disks and HDF5's filters are ten times as fast."""


def is_hdf5(path: Path) -> bool:
    """Whether a file is there and begins as HDF5 does."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return stream.read(len(SIGNATURE)) == SIGNATURE


def hdf5_fault(path: Path, longest: float = LONGEST) -> str | None:
    """What is wrong with an HDF5 file, as the end of a sentence; None if all of it can be read.

    A small file is given up after `longest` seconds.
    """
    try:
        call_apart(longest + path.stat().st_size / PACE, look_through, path)
    except LostError as error:
        return f"HDF5 {error}"
    except Exception as error:
        return str(error).strip().rpartition("\n")[2] or "HDF5 cannot read it"
    return None


def look_through(path: str | Path) -> None:
    """Read every attribute and every dataset of an HDF5 file. Raises whatever HDF5 makes of a damaged one."""
    import h5py

    left = LARGEST

    def read(_: str, item: h5py.Group | h5py.Dataset) -> None:
        nonlocal left
        dict(item.attrs)
        if isinstance(item, h5py.Dataset):
            left -= item.nbytes
            if left < 0:
                raise ValueError(
                    f"Input file must hold at most {LARGEST / 1e6:g} MB of numbers; instead it holds more."
                )
            item[()]

    with h5py.File(path, "r") as file:
        dict(file.attrs)
        file.visititems(read)
