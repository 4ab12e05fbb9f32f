"""Maps of the field on a plane, and the field at points in magnets, as the command line writes them."""

import json
import threading

import meshio
import numpy as np
import pytest
import xarray as xr
from article import BALL

import spinlev as sl
from spinlev.geometry.common import MU_0, InputError
from spinlev.geometry.scene.files import scene_text
from spinlev.studies.cli.main import run
from spinlev.studies.cli.options import map_extent
from spinlev.studies.fields import field_map

SPHERE = sl.tilt(angle_deg=5.0, shape="sphere", diameter_mm=10.0, remanence_T=1.3)


def scene_of(rotor):
    return sl.scene(frequency_hz=100.0, rotor=rotor, floater=BALL)


def test_a_map_of_a_sphere_has_its_exact_field_inside_and_outside():
    rotor = sl.tilt(angle_deg=0.0, shape="sphere", diameter_mm=10.0, remanence_T=1.3)
    found = field_map(scene_of(rotor), "xz", map_extent("9"), 0.0, 31)
    fem, inside = found.sel(model="fem"), found["magnet"].values == 1
    assert np.abs(fem["B"].values[inside] - [2 * 1.3 / 3.05, 0, 0]).max() < 1e-9
    assert np.abs(fem["H"].values[inside] * MU_0 + [1.3 / 3.05, 0, 0]).max() < 1e-9
    assert np.abs((fem["B"] / MU_0 - fem["H"] - fem["M"]).values).max() < 1e-6
    # outside, a sphere is a dipole; that of the remanence is (μr + 2)/3 times too strong
    outside = found["difference"].sel(model="dipole").values[found["magnet"].values == 0]
    assert outside == pytest.approx(0.05 / 3, rel=1e-6)


def test_python_has_the_map_over_the_coordinates_of_its_plane():
    found = sl.field_map(scene_of(SPHERE), "yz", (-8.0, 8.0, -9.0, -6.0), 1.0, 9)
    assert found["B"].dims == ("model", "z", "y", "component")
    assert {name: found[name].attrs["units"] for name in ("y", "z", "B", "H", "error")} == {
        "y": "m", "z": "m", "B": "T", "H": "A/m", "error": "T"
    }  # fmt: skip
    table = sl.rotor_table(scene_of(SPHERE), "fem")
    alone = table.evaluate([[1e-3, float(found["y"][2]), float(found["z"][0])]])[0][0]
    assert found["B"].sel(model="fem")[0, 2].values == pytest.approx(alone, rel=1e-5)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"plane": "xq"}, "plane must be one of xy, xz, yz"),
        ({"extent_mm": (1.0, -1.0, 0.0, 1.0)}, "extent_mm must be left, right, lower and upper end"),
        ({"extent_mm": (0.0, 1.0)}, "extent_mm must be left"),
        ({"extent_mm": (0.0, float("nan"), 0.0, 1.0)}, "extent_mm must be a finite number"),
        ({"steps": 3}, "steps must be a whole number between 5 and 1001"),
        ({"steps": 7.5}, "steps must be a whole number between 5 and 1001"),
        ({"offset_mm": "a"}, "offset_mm must be a finite number"),
    ],
)
def test_python_refuses_what_no_map_can_be_of(wrong, said):
    with pytest.raises(InputError, match=said):
        sl.field_map(scene_of(SPHERE), **wrong)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("map")
    (folder / "scene.toml").write_text(scene_text(scene_of(SPHERE)))
    call = ["field", str(folder / "scene.toml"), "--plane", "xz", "--steps", "25", "--out", str(folder), "--json"]
    assert run(call, threading.Event()) == 0
    return folder


def test_the_files_of_a_map_are_labelled_and_open_elsewhere(written):
    with xr.open_dataset(written / "field-map.nc", engine="h5netcdf") as found:
        assert found["B"].dims == ("model", "z", "x", "component")
        assert found["B"].attrs["units"] == "T"
        assert set(np.unique(found["magnet"])) == {0, 1}
        b = found["B"].sel(model="fem").values
    grid = meshio.read(written / "field-map.vtu")
    assert grid.point_data["B_fem"].reshape(b.shape) == pytest.approx(b, nan_ok=True)
    assert (written / "field-map.png").stat().st_size > 10_000


@pytest.mark.parametrize("text", ["", "a", "-5", "1,2,3", "3,1,0,5", "nan"])
def test_an_extent_that_is_none_is_refused(text):
    with pytest.raises(InputError, match="--extent-mm must be one positive number"):
        map_extent(text)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ([], "Input --points must be given, or --plane, or --working-point; instead received none of them"),
        (["--plane", "xz", "--points", "p.csv"], "instead received 2 of them"),
        (["--plane", "xq"], "xq"),
        (["--plane", "xz", "--steps", "1"], "--steps must be a whole number between 5 and 1001; instead received 1"),
        (["--plane", "xz", "--extent-mm", "0"], "--extent-mm must be one positive number"),
        (["--plane", "xz", "--offset-mm", "nan"], "--offset-mm must be a finite number; instead received nan"),
    ],
)
def test_what_is_wrong_is_told_and_ends_with_2(written, more, said, capsys):
    assert run(["field", str(written / "scene.toml"), *more], threading.Event()) == 2
    assert said in capsys.readouterr().err


def test_points_in_magnets_have_b_h_and_m(written, capfd):
    (written / "points.csv").write_text("x_mm,y_mm,z_mm\n0,0,1\n0,0,-20\n")
    call = [
        "field",
        str(written / "scene.toml"),
        "--points",
        str(written / "points.csv"),
        "--out",
        str(written),
        "--json",
    ]
    assert run(call, threading.Event()) == 0
    values = json.loads(capfd.readouterr().out)
    assert values["inside_magnet"] == [1, 0]
    b, h, m = (np.array(values[key]) for key in ("B_T", "H_A_per_m", "M_A_per_m"))
    assert b == pytest.approx(MU_0 * (h + m), abs=1e-9)
    assert not m[1].any()
