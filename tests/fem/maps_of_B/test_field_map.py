"""Maps of B from files: what is written in any format is read back, and what is wrong is named."""

import os
import re

import dialects
import meshio
import numpy as np
import pytest
import xarray as xr

from spinlev.fem.maps_of_B.columns import FieldMap, FieldMapError
from spinlev.fem.maps_of_B.read import read_field_map
from spinlev.geometry.scene.contents import MapReading

AXES = {"x": [-1.0, 1.0], "y": [0.0, 2.0], "z": [-20.0, -18.0, -16.0]}  # mm
POINTS = np.stack(np.meshgrid(*AXES.values(), indexing="ij"), -1).reshape(-1, 3)
FIELD = np.random.default_rng(2).normal(size=POINTS.shape)  # mT


def assert_same(read, columns=(0, 1, 2)):
    assert read.points == pytest.approx(POINTS * 1e-3, rel=1e-15)
    assert read.field[:, columns] == pytest.approx(FIELD[:, columns] * 1e-3, rel=1e-15)


def grid(variables):
    coordinates = {name: (name, values, {"units": "mm"}) for name, values in AXES.items()}
    return xr.Dataset({n: (d, v, {"units": "mT"}) for n, (d, v) in variables.items()}, coordinates)


def test_netcdf_with_a_dimension_of_components(tmp_path):
    values = FIELD.reshape(2, 2, 3, 3)
    grid({"B": (("component", "z", "y", "x"), values.transpose(3, 2, 1, 0))}).to_netcdf(tmp_path / "m.nc")
    assert_same(read_field_map(tmp_path / "m.nc"))


def test_netcdf_with_a_list_of_points_and_errors(tmp_path):
    columns = {f"B{axis}": ("point", FIELD[:, k], {"units": "mT"}) for k, axis in enumerate("xyz")}
    columns |= {axis: ("point", POINTS[:, k], {"units": "mm"}) for k, axis in enumerate("xyz")}
    columns["Bz_err"] = ("point", np.full(len(POINTS), 2.0), {"units": "uT"})
    del columns["Bx"], columns["By"]
    xr.Dataset(columns).to_netcdf(tmp_path / "m.nc")
    read = read_field_map(tmp_path / "m.nc")
    assert_same(read, [2])
    assert np.isnan(read.field[:, :2]).all()
    assert read.errors[:, 2] == pytest.approx(2e-6)


@pytest.mark.parametrize(("suffix", "format_name"), [("vtu", "vtu"), ("vtk", "vtk"), ("msh", "gmsh")])
def test_meshes(tmp_path, suffix, format_name):
    cells = [("vertex", np.arange(len(POINTS))[:, None])]
    meshio.Mesh(POINTS, cells, point_data={"B": FIELD}).write(tmp_path / f"m.{suffix}", format_name)
    assert_same(read_field_map(tmp_path / f"m.{suffix}", MapReading("mm", "mT")))


def test_csv_of_a_probe_of_one_component(tmp_path):
    rows = [
        f"{x!r}, {y!r}, {z!r}, {b!r}, 0.01" for (x, y, z), b in zip(POINTS.tolist(), FIELD[:, 2].tolist(), strict=True)
    ]
    rows[3] = rows[3].rsplit(",", 2)[0] + ", , "
    (tmp_path / "m.csv").write_text("x_mm, y_mm, z_mm, Bz_mT, Bz_err_mT\n\n" + "\n".join(rows))
    read = read_field_map(tmp_path / "m.csv")
    assert np.isnan(read.field[3]).all()
    assert read.observations == len(POINTS) - 1
    seen = np.arange(len(POINTS)) != 3
    assert read.field[seen, 2] == pytest.approx(FIELD[seen, 2] * 1e-3, rel=1e-15)
    assert read.errors[seen, 2] == pytest.approx(1e-5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x_mm,y_mm,Bz_T\n1,2,3", "x, y, z and at least one of Bx, By, Bz; instead received x, y, Bz"),
        ("x_mm,y_mm,z_mm\n1,2,3", "at least one of Bx"),
        ("", "instead received none"),
        ("x_ft,y_mm,z_mm,Bz_T\n1,2,3,4", "unit of x must be one of m, cm, mm, µm, in; instead received 'ft'"),
        ("x_mm,y_mm,z_mm,Bz_Oe\n1,2,3,4", "unit of Bz must be one of T, mT"),
        ("x_mm,y_mm,z_mm,Bz_T\n1,2,3,4\n1,2,,4", "points must be finite; instead received .* at point 1"),
        ("x_mm,y_mm,z_mm,Bz_T\n1,2,3,much", "Bz_T in row 1 below the titles must be a number or empty; .* 'much'"),
        ("x_mm,y_mm,z_mm,Bz_T\n1,2,3,inf", "field must be finite, or NaN"),
        ("x_mm,y_mm,z_mm,Bz_T,Bz_err_T\n1,2,3,4,0", "errors must be positive where the field is observed"),
    ],
)
def test_faults_of_a_csv_are_named(tmp_path, text, message):
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(FieldMapError, match=rf"m\.csv: Input .*{message}"):
        read_field_map(tmp_path / "m.csv")


def test_faults_of_other_files_are_named(tmp_path):
    with pytest.raises(FieldMapError, match="must be a file; instead there is no"):
        read_field_map(tmp_path / "m.nc")
    for name, message in (("m.nc", "readable netCDF"), ("m.vtu", "mesh that meshio reads"), ("m.abc", "of the titles")):
        (tmp_path / name).write_text("nothing")
        with pytest.raises(FieldMapError, match=message):
            read_field_map(tmp_path / name)
    no_units = grid({"Bz": (("x", "y", "z"), FIELD[:, 2].reshape(2, 2, 3))})
    del no_units["Bz"].attrs["units"]
    no_units.to_netcdf(tmp_path / "u.nc")
    with pytest.raises(
        FieldMapError, match=r"column Bz must have a unit, as in the title Bz_mT or netCDF.*; instead it has none"
    ):
        read_field_map(tmp_path / "u.nc")
    grid({"B": (("x", "y", "z"), FIELD[:, 2].reshape(2, 2, 3))}).to_netcdf(tmp_path / "b.nc")
    with pytest.raises(FieldMapError, match="one dimension of three components"):
        read_field_map(tmp_path / "b.nc")
    meshio.Mesh(POINTS, [("vertex", np.arange(len(POINTS))[:, None])], {"B": FIELD}).write(tmp_path / "m.vtk")
    with pytest.raises(FieldMapError, match=r"unit of x must be one of m, cm, mm, µm, in; instead received 'ft'"):
        read_field_map(tmp_path / "m.vtk", MapReading("ft"))


def test_shapes_are_checked():
    with pytest.raises(FieldMapError, match=r"field must have shape \(2, 3\); instead received \(2, 2\)"):
        FieldMap(np.zeros((2, 3)), np.zeros((2, 2)))


def test_comsols_export_is_read_as_it_is(tmp_path):
    """Header lines that begin with %, the unit of length among them, the units of B in the titles."""
    head = (
        "% Model,rotor.mph\n% Version,COMSOL 6.2.0.290\n% Dimension,3\n% Nodes,2\n% Expressions,3\n"
        '% Description,"Magnetic flux density, x-component"\n% Length unit,mm\n'
        "% x,y,z,mf.Bx (mT),mf.By (mT),mf.Bz (mT)\n"
    )
    (tmp_path / "m.csv").write_text(head + "0,0,-20,-12.5,0,2.5\n1,2,-30,NaN,1,2\n")
    read = read_field_map(tmp_path / "m.csv")
    np.testing.assert_allclose(read.points, [[0.0, 0.0, -0.02], [1e-3, 2e-3, -0.03]])
    np.testing.assert_allclose(read.field, [[-0.0125, 0.0, 0.0025], [np.nan, 1e-3, 2e-3]])


def test_a_wrong_header_is_answered_with_a_right_one(tmp_path):
    (tmp_path / "m.csv").write_text("X,Y,Z,B\n0,0,-20,1\n")
    with pytest.raises(
        FieldMapError, match=r"x, y, z of the titles 'X, Y, Z, B'\. Valid: x_mm,y_mm,z_mm,Bx_mT,By_mT,Bz_mT\."
    ):
        read_field_map(tmp_path / "m.csv")


@pytest.mark.parametrize("suffix", ["csv", "txt", "nc", "vtu"])
def test_only_a_file_of_a_sane_size_is_opened(tmp_path, suffix):
    path = tmp_path / f"m.{suffix}"
    os.mkfifo(path)
    with pytest.raises(FieldMapError, match=r"map must be a file; instead .* is a pipe"):
        read_field_map(path)
    path.unlink()
    path.mkdir()
    with pytest.raises(FieldMapError, match="is a folder"):
        read_field_map(path)
    path.rmdir()
    path.symlink_to("/dev/zero")
    with pytest.raises(FieldMapError, match="is a device"):
        read_field_map(path)
    path.unlink()
    path.touch()
    os.truncate(path, 3_000_000_000)  # without blocks on the disk
    with pytest.raises(FieldMapError, match=r"of at most .* MB; instead .* holds 3000"):
        read_field_map(path)


def written(folder, content):
    """A file of a dialect and what the scene says of it."""
    content, reading = content if isinstance(content, tuple) else (content, None)
    path = folder / "map.txt"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path, reading


@pytest.mark.parametrize("name", dialects.READ)
def test_a_map_is_the_same_in_every_dialect(tmp_path, name):
    """To some units in the last place: the same numbers in other units."""
    read = read_field_map(*written(tmp_path, dialects.READ[name]))
    found = np.hstack([read.points, read.field])[-len(dialects.SI) :]
    np.testing.assert_allclose(found, dialects.SI, rtol=1e-14)


@pytest.mark.parametrize("name", dialects.REFUSED)
def test_what_could_be_another_map_is_refused(tmp_path, name):
    content, message = dialects.REFUSED[name]
    with pytest.raises(FieldMapError, match=r"map\.txt: Input ") as refused:
        read_field_map(*written(tmp_path, content))
    assert re.search(message if ".*" in message else re.escape(message), str(refused.value)), refused.value


def test_meshes_tell_units_and_solutions_by_names(tmp_path):
    """`B_fem` of several fields, components by COMSOL's words, and B that is only in cells."""
    cells, place = [("vertex", np.arange(len(POINTS))[:, None])], tmp_path / "m.vtu"
    meshio.Mesh(POINTS, cells, {"B_dipole": 2 * FIELD, "B_fem": FIELD, "H": FIELD}).write(place)
    assert_same(read_field_map(place, MapReading("mm", "mT", "fem")))
    with pytest.raises(FieldMapError, match=r"instead received 'B_dipole' and 'B_fem'"):
        read_field_map(place)
    names = {f"Magnetic_flux_density,_{axis}-component_(mT)": FIELD[:, k] for k, axis in enumerate("xyz")}
    meshio.Mesh(POINTS, cells, names).write(tmp_path / "c.vtk")
    assert_same(read_field_map(tmp_path / "c.vtk", MapReading("mm")))
    meshio.Mesh(POINTS, cells, cell_data={"B": [FIELD]}).write(place)
    with pytest.raises(FieldMapError, match="B as point data; instead 'B' is cell data"):
        read_field_map(place)
    (tmp_path / "m.vti").write_text("<VTKFile/>")
    with pytest.raises(FieldMapError, match=r"instead received \.vti\. Save it as \.vtu"):
        read_field_map(tmp_path / "m.vti")
