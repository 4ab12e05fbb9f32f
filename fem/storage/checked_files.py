"""Tables on disk: one self-describing netCDF file with a checksum, and a folder of those computed before."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import dask
import xarray as xr

from . import foreign
from .checksum import seal, sealed
from .whole_files import write_whole

Variables = Mapping[str, tuple[tuple[str, ...], Any, str]]
"""Dimensions, values and unit by name."""
Table = TypeVar("Table")


class TableFileError(ValueError):
    """A table file that is damaged, or is not one."""


def described(variables: Variables, attributes: Mapping[str, Any]) -> xr.Dataset:
    """A dataset in which every variable carries its unit."""
    return xr.Dataset({n: xr.Variable(d, v, {"units": u}) for n, (d, v, u) in variables.items()}, attrs=attributes)


def write_checked(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a dataset with the checksum of the file at its end; the file is whole or absent. Raises OSError."""
    with dask.config.set(scheduler="synchronous"):  # or xarray would ask a cluster for a lock of memory that is its own
        content = bytes(dataset.to_netcdf(engine="h5netcdf"))  # on a full disk HDF5 itself would crash
    write_whole(path, seal(content))


def read_checked(path: str | Path, file_format: str | None = None) -> xr.Dataset:
    """Read a dataset that is as it was written.

    Parameters
    ----------
    file_format : that it must have; None for any, and for files that others have written or changed

    Raises
    ------
    TableFileError : the file is damaged, is no netCDF, or is not of this format
    FileNotFoundError : it is missing
    """
    whole = sealed(Path(path))
    if whole is False:
        raise TableFileError(f"Input {path} must be as it was written; instead its checksum does not match.")
    if whole is None and file_format:
        raise TableFileError(f"Input {path} must be a whole '{file_format}'; instead it does not end in its checksum.")
    if whole is None and (reason := foreign.fault(Path(path))):
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
    """Where tables are kept: $SPINLEV_CACHE, else $XDG_CACHE_HOME/spinlev, else ~/.cache/spinlev."""
    if folder := os.environ.get("SPINLEV_CACHE"):
        return Path(folder)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "spinlev"


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
def alone(lock: Path, report: Callable[[str], None]) -> Iterator[None]:
    """Be the only process in this block with the same lock file; the system frees it if the process dies."""
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
        stream = lock.open("w")
    except OSError:  # a cache that cannot be written cannot be shared either
        yield
        return
    with stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            report("Another process is making this table: waiting for it ...")
            fcntl.flock(stream, fcntl.LOCK_EX)
        except OSError:  # a file system without locks: at worst a table is made twice
            report("The cache's file system has no locks.")
        yield
