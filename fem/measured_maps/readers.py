"""Maps of B from files: a probe's CSV, netCDF grids, and meshes with point data."""

import io
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import meshio
import numpy as np
import xarray as xr

from ...geometry.basics import Array
from ..storage import TableFileError, hdf5_fault, is_hdf5, read_checked
from .csv_files import csv_columns
from .field_map import FieldMap, FieldMapError
from .units import AXES, unit_scale

VALID = "Valid: the header x_mm,y_mm,z_mm,Bx_mT,By_mT,Bz_mT of a CSV file, or point data B (n, 3) of a mesh."


def read_field_map(path: str | Path, length_unit: str = "m", field_unit: str = "T") -> FieldMap:
    """Read a map of B, told apart by the name of the file.

    - `.csv`: a header with x_mm, y_mm, z_mm and some of Bx_T, By_T, Bz_T, Bx_err_T, By_err_T, Bz_err_T; other units of
      `METERS` and `TESLAS` by name; an empty cell or `nan` is a component not observed.
      COMSOL's export of mf.Bx, mf.By, mf.Bz, comma-separated, is read as it is: header lines that begin with %, units
      among them.
    - `.nc`: variables Bx, By, Bz (and Bx_err ...), or B (and B_err) with one more dimension of three components, over
      coordinates x, y, z, each with its `units`; grids and lists of points alike.
    - all that meshio reads (`.vtu`, `.vtk`, `.msh`, `.xdmf`): point data B (n, 3), or Bx, By, Bz. Such files carry no
      units: `length_unit` and `field_unit` are theirs, and only theirs.

    Raises
    ------
    FieldMapError : no such file, unreadable, coordinates or every component missing, an unknown unit, or what
        `FieldMap` refuses
    """
    path = Path(path)
    if not path.exists():
        raise FieldMapError(f"Input {path} must be a field map; instead there is no such file.")
    suffix = path.suffix.lower()
    try:
        if suffix == ".csv":
            columns = csv_columns(path)
        elif suffix in (".nc", ".nc4"):
            columns = _netcdf_columns(path)
        else:
            columns = _mesh_columns(path, unit_scale("length_unit", length_unit), unit_scale("field_unit", field_unit))
        return _assemble(columns)
    except FieldMapError as error:
        raise FieldMapError(f"{path}: {error}") from None


def _assemble(columns: Mapping[str, Array]) -> FieldMap:
    """A map from SI columns x, y, z, Bx, By, Bz, Bx_err, By_err, Bz_err, not all of which must be there."""
    missing = [axis for axis in AXES if axis not in columns]
    if missing or not any(f"B{axis}" in columns for axis in AXES):
        needed = "x, y, z and at least one of Bx, By, Bz"
        received = ", ".join(columns) or "none that is known"
        raise FieldMapError(f"Input columns must hold {needed}; instead received {received}. {VALID}")
    points = np.stack([columns[axis] for axis in AXES], axis=-1)
    nothing = np.full(len(points), np.nan)
    field = np.stack([columns.get(f"B{axis}", nothing) for axis in AXES], axis=-1)
    if not any(f"B{axis}_err" in columns for axis in AXES):
        return FieldMap(points, field)
    return FieldMap(points, field, np.stack([columns.get(f"B{axis}_err", nothing) for axis in AXES], axis=-1))


def _netcdf_columns(path: Path) -> dict[str, Array]:
    try:
        dataset = read_checked(path)
    except TableFileError as error:
        raise FieldMapError(str(error)) from error
    found = {name: dataset[name] for name in AXES if name in dataset}
    for name in ("B", "B_err"):
        if name in dataset:
            found.update(_components(dataset[name], name))
    for name in (f"B{axis}{suffix}" for axis in AXES for suffix in ("", "_err")):
        if name in dataset:
            found[name] = dataset[name]
    whole = xr.broadcast(*found.values())
    return {
        n: unit_scale(n, v.attrs.get("units")) * w.values.ravel()
        for (n, v), w in zip(found.items(), whole, strict=True)
    }


def _components(vector: xr.DataArray, name: str) -> dict[str, xr.DataArray]:
    """Bx, By, Bz of a variable that has a dimension of length 3 that is not one of space."""
    axes = [d for d in vector.dims if d not in AXES and vector.sizes[d] == 3]
    if len(axes) != 1:
        raise FieldMapError(f"Input {name} must have one dimension of three components; instead it has {vector.sizes}.")
    suffix = name.removeprefix("B")
    return {f"B{axis}{suffix}": vector.isel({axes[0]: k}, drop=True) for k, axis in enumerate(AXES)}


def _mesh_columns(path: Path, length: float, field: float) -> dict[str, Array]:
    for part in (path, path.with_suffix(".h5")):  # where XDMF has its numbers
        if is_hdf5(part) and (fault := hdf5_fault(part)):
            raise FieldMapError(f"Input map must be a readable HDF5 file; instead: {fault}.")
    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # where no reader takes the file meshio prints why, and leaves the program
        reason = " ".join(said.getvalue().split()) or error
        raise FieldMapError(f"Input map must be a mesh that meshio reads; instead: {reason}.") from None
    columns = {axis: length * mesh.points[:, k] for k, axis in enumerate(AXES[: mesh.points.shape[1]])}
    for name, values in mesh.point_data.items():
        values = np.asarray(values, float)
        if name == "B" and values.ndim == 2 and values.shape[1] == 3:
            columns |= {f"B{axis}": field * values[:, k] for k, axis in enumerate(AXES)}
        elif name in ("Bx", "By", "Bz"):
            columns[name] = field * values.ravel()
    return columns
