"""Maps of B from files: a probe's CSV, netCDF grids, and meshes with point data."""

import csv
import io
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import meshio
import numpy as np
import xarray as xr

from ...geometry.basics import Array
from ..storage import TableFileError, hdf5_fault, is_hdf5, read_checked
from .field_map import FieldMap, FieldMapError

AXES = ("x", "y", "z")
METERS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
TESLAS = {"T": 1.0, "mT": 1e-3, "uT": 1e-6, "µT": 1e-6, "G": 1e-4}
UNITS = {**METERS, **TESLAS}


def read_field_map(path: str | Path, length_unit: str = "m", field_unit: str = "T") -> FieldMap:
    """Read a map of B, told apart by the name of the file.

    - `.csv`: a header with x_mm, y_mm, z_mm and some of Bx_T, By_T, Bz_T, Bx_err_T, By_err_T, Bz_err_T; other units of
      `METERS` and `TESLAS` by name; an empty cell or `nan` is a component not observed.
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
            columns = _csv_columns(path)
        elif suffix in (".nc", ".nc4"):
            columns = _netcdf_columns(path)
        else:
            columns = _mesh_columns(path, _scale("length_unit", length_unit), _scale("field_unit", field_unit))
        return _assemble(columns)
    except FieldMapError as error:
        raise FieldMapError(f"{path}: {error}") from None


def _assemble(columns: Mapping[str, Array]) -> FieldMap:
    """A map from SI columns x, y, z, Bx, By, Bz, Bx_err, By_err, Bz_err, not all of which must be there."""
    missing = [axis for axis in AXES if axis not in columns]
    if missing or not any(f"B{axis}" in columns for axis in AXES):
        needed = "x, y, z and at least one of Bx, By, Bz"
        raise FieldMapError(f"Input columns must hold {needed}; instead received {', '.join(columns) or 'none'}.")
    points = np.stack([columns[axis] for axis in AXES], axis=-1)
    nothing = np.full(len(points), np.nan)
    field = np.stack([columns.get(f"B{axis}", nothing) for axis in AXES], axis=-1)
    if not any(f"B{axis}_err" in columns for axis in AXES):
        return FieldMap(points, field)
    return FieldMap(points, field, np.stack([columns.get(f"B{axis}_err", nothing) for axis in AXES], axis=-1))


def _scale(name: str, unit: object) -> float:
    """SI value of the unit of a column: of length for x, y, z and `length_unit`, of B for all others."""
    allowed = METERS if name in (*AXES, "length_unit") else TESLAS
    if unit not in allowed:
        raise FieldMapError(f"Input unit of {name} must be one of {', '.join(allowed)}; instead received {unit!r}.")
    return UNITS[str(unit)]


def _csv_columns(path: Path) -> dict[str, Array]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = [row for row in csv.reader(stream, skipinitialspace=True) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FieldMapError(f"Input map must be a readable CSV text; instead: {error}.") from None
    header = [name.strip() for name in rows[0]] if rows else []
    columns = {}
    for index, title in enumerate(header):
        name, _, unit = title.rpartition("_")
        if name in AXES or name.removesuffix("_err") in ("Bx", "By", "Bz"):
            scale = _scale(name, unit)
            columns[name] = scale * np.array([_number(title, k, row, index) for k, row in enumerate(rows[1:], 1)])
    return columns


def _number(title: str, line: int, row: list[str], column: int) -> float:
    text = row[column].strip() if column < len(row) else ""
    try:
        return float(text) if text else np.nan
    except ValueError:
        raise FieldMapError(
            f"Input {title} in row {line} below the header must be a number or empty; instead received {text!r}."
        ) from None


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
        n: _scale(n, v.attrs.get("units")) * w.values.ravel() for (n, v), w in zip(found.items(), whole, strict=True)
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
