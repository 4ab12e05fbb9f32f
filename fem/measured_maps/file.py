"""A gridded table as one self-describing netCDF file."""

from pathlib import Path

import xarray as xr

from ..rotor_tables import from_dataset, to_dataset
from ..storage import read_checked, write_checked
from .fitted_table import GriddedTable

FORMAT = "spinlev gridded table 1"


def save_gridded(table: GriddedTable, path: str | Path) -> None:
    """Write a table; the file is whole or absent."""
    dataset = to_dataset(table.expansions)
    dims = ("member", "fitted_expansion", "deviation_degree", "deviation_order")
    dataset["deviation_real"] = xr.Variable(dims, table.deviations.real, {"units": "T"})
    dataset["deviation_imag"] = xr.Variable(dims, table.deviations.imag, {"units": "T"})
    dataset["region"] = xr.Variable(("corner", "axis"), table.region, {"units": "m"})
    dataset.attrs |= {"format": FORMAT, "title": "Solid-harmonic expansions fitted to a map of a magnetic field"}
    write_checked(dataset, path)


def load_gridded(path: str | Path) -> GriddedTable:
    """Read a table.

    Raises
    ------
    TableFileError : the file is not a table of this format, or its content is not what was written
    """
    dataset = read_checked(path, FORMAT)
    deviations = dataset["deviation_real"].values + 1j * dataset["deviation_imag"].values
    return GriddedTable(from_dataset(dataset), deviations, dataset["region"].values)
