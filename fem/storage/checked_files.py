"""Data on disk: one self-describing netCDF file with a checksum."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import xarray as xr
from xarray.backends import H5NetCDFStore

from ...geometry.basics import InputError
from .cache import TableFileError, key_of
from .foreign import hdf5_fault
from .netcdf import read_netcdf
from .whole_files import seal, sealed, write_whole

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
