"""Files of measured fields: a table from a map that was measured, and a fitted table kept as netCDF."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from ...geometry.bodies import Magnet
from ...geometry.scenes import MapReading
from ..rotor_tables import from_dataset, to_dataset
from ..storage import read_checked, write_checked
from .field_map import FieldMapError
from .fit import fit_field_map
from .fitted_table import GriddedTable
from .plausible import require_plausible
from .readers import read_field_map

FORMAT = "spinlev gridded table 1"


def map_table(path: Path | None, magnets: Sequence[Magnet], reading: MapReading | None = None) -> GriddedTable:
    """Table of a map of B in the rotor's frame; the sources lie in the smallest spheres about the magnets.

    What the map holds inside those spheres is left out. The magnets' shapes and places say where sources can be; their
    strength, whether the map is theirs.

    Raises
    ------
    FieldMapError : no map, a file that is none, one that contradicts the magnets, or too few values outside the spheres
    """
    if path is None:
        raise FieldMapError("Input rotor.field_map must name a file for the model map; instead it is missing.")
    field_map = read_field_map(path, reading)
    radius = max(magnet.body.circumradius for magnet in magnets)
    centers = np.array([magnet.box.center for magnet in magnets])
    try:
        require_plausible(field_map, magnets, radius)
        for center in centers:
            field_map = field_map.outside(center, radius)
        return fit_field_map(field_map, centers, radius)
    except FieldMapError as error:
        raise FieldMapError(f"{path}: {error}") from None


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
