"""Maps of B from files: a probe's CSV, netCDF grids, and meshes with point data."""

import io
import re
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...geometry.basics import Array, InputError, regular_file
from ...geometry.scenes import MapReading
from ..storage import TableFileError, hdf5_fault, is_hdf5, read_checked
from .columns import (
    AXES,
    COMPONENTS,
    ERRORS,
    GHOSTS,
    HIDDEN,
    HIDDEN_CELL,
    MASK,
    NEEDED,
    UNITS,
    Column,
    chosen,
    column_of,
    known_columns,
)
from .field_map import FieldMap, FieldMapError
from .text_tables import text_columns

MESHES = {*meshio.extension_to_filetypes} - {".dat"}
"""Endings of the names of meshes; a `.dat` is one if it is Tecplot's."""
TECPLOT = re.compile(rb"\s*(?:TITLE|VARIABLES|ZONE)\b", re.IGNORECASE)
OTHER_VTK = {".vti", ".vtr", ".vts", ".vtp", ".vtm", ".pvtu", ".pvti", ".pvts", ".pvtr", ".pvd"}
MOST_BYTES = 1_000_000_000
Read = tuple[dict[str, Array], dict[str, str]]
"""Columns in SI units by name, and the units in which the file has them."""


def read_field_map(path: str | Path, reading: MapReading | None = None) -> FieldMap:
    """Read a map of B, told apart by the name of the file and by what it begins with.

    - netCDF: variables Bx, By, Bz (and Bx_err ...), or B (and B_err) with one more dimension of three components, over
      coordinates x, y, z, each with its `units`; grids and lists of points alike.
    - all that meshio reads (`.vtu`, `.vtk`, `.msh`, `.xdmf`): point data B (n, 3), or Bx, By, Bz, in m and T where
      neither their names nor `reading` tell others. Points that VTK marks as hidden or without a value are left out.
    - any other file: a table as text, `text_columns`.

    Raises
    ------
    FieldMapError : no such file, unreadable, coordinates or every component missing or twice, an unknown unit, or what
        `FieldMap` refuses
    """
    path, reading = Path(path), reading or MapReading()
    try:
        with regular_file(path, MOST_BYTES, "map", "a file") as stream:
            beginning, suffix = stream.read(100), path.suffix.lower()
    except InputError as error:
        raise FieldMapError(str(error)) from None
    try:
        if suffix in OTHER_VTK:
            raise FieldMapError(
                f"Input map must be a mesh that meshio reads; instead received {suffix}. Save it as .vtu."
            )
        if suffix in (".nc", ".nc4"):
            columns, units = _netcdf_columns(path, reading)
        elif suffix in MESHES or (suffix == ".dat" and TECPLOT.match(beginning)):
            columns, units = _mesh_columns(path, reading)
        else:
            columns, units = text_columns(path, reading)
        return _assemble(columns, units)
    except InputError as error:
        raise FieldMapError(f"{path}: {error}") from None


def _assemble(columns: Mapping[str, Array], units: Mapping[str, str]) -> FieldMap:
    """A map from SI columns x, y, z, Bx, By, Bz, Bx_err, By_err, Bz_err, not all of which must be there, and masks."""
    missing = [axis for axis in AXES if axis not in columns]
    if missing or not any(component in columns for component in COMPONENTS):
        received = ", ".join(columns) or "none that is known"
        raise FieldMapError(f"Input columns must hold {NEEDED}; instead received {received}.")
    points = np.stack([columns[axis] for axis in AXES], axis=-1)
    nothing = np.full(len(points), np.nan)
    field, errors = (
        np.stack([columns.get(name, nothing) for name in names], axis=-1) for names in (COMPONENTS, ERRORS)
    )
    is_known = np.ones(len(points), bool)
    if MASK in columns:
        is_known &= columns[MASK] != 0
    if GHOSTS in columns:
        is_known &= columns[GHOSTS].astype(int) & HIDDEN == 0
    if not is_known.any():
        raise FieldMapError(f"Input map must have points with a value; instead all {len(points)} are masked.")
    given = not columns.keys().isdisjoint(ERRORS)
    read_as = units["x"], next(units[name] for name in COMPONENTS if name in columns)
    return FieldMap(points[is_known], field[is_known], errors[is_known] if given else None, read_as)


def _netcdf_columns(path: Path, reading: MapReading) -> Read:
    try:
        dataset = read_checked(path)
    except TableFileError as error:
        raise FieldMapError(str(error)) from error
    names = [str(name) for name in dataset.variables]
    found, units = dict[str, xr.DataArray](), dict[str, str]()
    for k, column in chosen(names, reading, vectors=True).items():
        variable = dataset[names[k]]
        is_vector = column.name in ("B", "B_err")
        parts = _components(variable, column.name) if is_vector else {column.name: variable}
        unit = replace(column, unit=variable.attrs.get("units", column.unit)).known_unit(reading)
        found |= parts
        units |= dict.fromkeys(parts, unit)
    found = {axis: found[axis] for axis in AXES if axis in found} | found
    whole = xr.broadcast(*found.values())
    return {n: UNITS[units[n]] * w.values.ravel() for n, w in zip(found, whole, strict=True)}, units


def _components(vector: xr.DataArray, name: str) -> dict[str, xr.DataArray]:
    """Bx, By, Bz of a variable that has a dimension of length 3 that is not one of space."""
    axes = [d for d in vector.dims if d not in AXES and vector.sizes[d] == 3]
    if len(axes) != 1:
        raise FieldMapError(f"Input {name} must have one dimension of three components; instead it has {vector.sizes}.")
    suffix = name.removeprefix("B")
    return {f"B{axis}{suffix}": vector.isel({axes[0]: k}, drop=True) for k, axis in enumerate(AXES)}


def _mesh_columns(path: Path, reading: MapReading) -> Read:
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
    places = enumerate(AXES[: mesh.points.shape[1]])
    units = dict.fromkeys(AXES, Column("x", "x", "m").known_unit(reading))
    columns = {axis: UNITS[units["x"]] * mesh.points[:, k] for k, axis in places}
    columns[GHOSTS] = np.where(_hidden_by_cells(mesh), HIDDEN, 0)
    data = {name: np.squeeze(np.asarray(values, float)) for name, values in mesh.point_data.items()}
    known = known_columns(list(data), reading, vectors=True)
    names = [title for k, title in enumerate(data) if k in known and _fits(known[k], data[title])]
    for k, column in chosen(names, reading, vectors=True).items():
        values = data[names[k]]
        if column.name in (MASK, GHOSTS):
            columns[column.name] = np.maximum(columns.get(column.name, values), values)
            continue
        is_vector = column.name in ("B", "B_err")
        parts = (
            dict(zip(COMPONENTS if column.name == "B" else ERRORS, values.T, strict=True))
            if is_vector
            else {column.name: values}
        )
        units |= dict.fromkeys(parts, column.known_unit(reading, "T"))
        columns |= {name: UNITS[units[name]] * part for name, part in parts.items()}
    in_cells = [name for name in mesh.cell_data if (c := column_of(name)) and c.is_field]
    if in_cells and columns.keys().isdisjoint(COMPONENTS):
        raise FieldMapError(
            f"Input map must have B as point data; instead {in_cells[0]!r} is cell data. Write its values at the "
            "points, as ParaView's filter Cell Data to Point Data does."
        )
    return columns, units


def _fits(column: Column, values: Array) -> bool:
    """Whether point data have the shape that goes with their name."""
    return column.name not in AXES and values.shape[1:] == ((3,) if column.name in ("B", "B_err") else ())


def _hidden_by_cells(mesh: meshio.Mesh) -> NDArray[np.bool_]:
    """Which points (n,) belong to cells that VTK marks as hidden, and to no other."""
    seen, hidden = (np.zeros(len(mesh.points), bool) for _ in range(2))
    flags: list[Array] = next((v for name, v in mesh.cell_data.items() if name.casefold() == GHOSTS), [])
    for block, marks in zip(mesh.cells, flags, strict=False):
        is_hidden = np.ravel(marks).astype(int) & HIDDEN_CELL != 0
        hidden[np.ravel(block.data[is_hidden])] = True
        seen[np.ravel(block.data[~is_hidden])] = True
    return np.asarray(hidden & ~seen)
