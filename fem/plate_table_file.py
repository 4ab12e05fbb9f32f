"""A plate table as one self-describing netCDF file, and its place in the cache."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ..geometry.scene import Plate
from .field_functions import Multipoles
from .plate_model import plate_table
from .plate_region import Region
from .plate_table import PlateErrors, PlateTable
from .table_store import described, from_cache, read_checked, write_checked

FORMAT = "spinlev plate table 1"


def save_plate_table(table: PlateTable, path: str | Path) -> None:
    """Write a table; the file is whole or absent."""
    errors = (table.errors.mesh, table.errors.states, table.errors.functions)
    variables = {
        "size": (("axis",), table.size, "m"),
        "conductivity": ((), table.conductivity, "S/m"),
        "region": (("bound", "axis"), np.array([table.region.lower, table.region.upper]), "m"),
        "frequencies": (("bound",), np.array(table.frequencies), "Hz"),
        "rate": (("state",), table.rates, "1/s"),
        "multipole_center": (("multipole", "axis"), table.multipoles.centers, "m"),
        "multipole_kind": (("multipole", "degree_order_imaginary"), table.multipoles.kinds, "1"),
        "multipole_scale": ((), table.multipoles.scale, "m"),
        "weight": (("state", "multipole"), table.weights, "J^-1/2"),
        "error": (("mesh_states_functions",), np.array(errors), "1"),
    }
    attributes = {
        "format": FORMAT,
        "title": "Eddy currents of a plate: passive network with harmonic field functions, in the plate's frame",
        "provenance": json.dumps(dict(table.provenance), sort_keys=True),
    }
    write_checked(described(variables, attributes), path)


def load_plate_table(path: str | Path) -> PlateTable:
    """Read a table.

    Raises
    ------
    TableFileError : the file is not a table of this format, or its content is not what was written
    """
    dataset = read_checked(path, FORMAT)
    data = {str(name): variable.values for name, variable in dataset.data_vars.items()}
    low, high = data["frequencies"]
    return PlateTable(
        size=data["size"],
        conductivity=float(data["conductivity"]),
        region=Region(*data["region"]),
        frequencies=(float(low), float(high)),
        rates=data["rate"],
        multipoles=Multipoles(data["multipole_center"], data["multipole_kind"], float(data["multipole_scale"])),
        weights=data["weight"],
        errors=PlateErrors(*(float(e) for e in data["error"])),
        provenance=json.loads(dataset.attrs["provenance"]),
    )


def plate_key(plate: Plate, region: Region, frequencies: tuple[float, float], rtol: float) -> str:
    """SHA-256 of the plate's size and conductivity, the ranges, the tolerance, and the programs; not of its pose."""
    digest = hashlib.sha256(f"{FORMAT} {version('spinlev')} {version('ngsolve')}".encode())
    for part in (plate.box.size, [plate.conductivity, rtol], region.lower, region.upper, frequencies):
        digest.update(np.ascontiguousarray(np.asarray(part) + 0.0, dtype="<f8").tobytes())
    return digest.hexdigest()


def cached_plate_table(
    plate: Plate, region: Region, frequencies: tuple[float, float], rtol: float, report: Callable[[str], None]
) -> tuple[PlateTable, bool]:
    """A plate table, from the cache if it is there, and whether it was."""
    return from_cache(
        f"plate-{plate_key(plate, region, frequencies, rtol)}.nc",
        load_plate_table,
        lambda: plate_table(plate, region, frequencies, rtol),
        save_plate_table,
        report,
    )
