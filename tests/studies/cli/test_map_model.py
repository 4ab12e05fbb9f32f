"""A measured map as the field model of a scene: `rotor.field_map` and `--model map`."""

import json
import threading

import numpy as np
import pytest

from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.scene.files import changed, load_scene, scene_text
from spinlev.geometry.scene.messages import SceneError
from spinlev.studies.cli import main as cli
from spinlev.studies.cli.options import shipped_scene

GRID = np.arange(-0.03, 0.031, 0.01)
HEADER = "x_mm,y_mm,z_mm,Bx_mT,By_mT,Bz_mT"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A scene beside the map of its own rotor without permeability, with values inside the magnet too."""
    path, scene = tmp_path_factory.mktemp("map"), load_scene(shipped_scene("horizontal"))
    points = np.stack(np.meshgrid(GRID, GRID, GRID, indexing="ij"), -1).reshape(-1, 3)
    points = points[np.linalg.norm(points, axis=1) > 0.0075]
    values = RotorTable("cuboid", scene.rotor, scene.rotor).evaluate(points)[0]
    rows = 1e3 * np.hstack([points, values])
    np.savetxt(path / "map.csv", rows, delimiter=",", header=HEADER, comments="", fmt="%.10g")
    (path / "scene.toml").write_text(scene.text.replace("[rotor]\n", '[rotor]\nfield_map = "map.csv"\n'))
    (path / "points.csv").write_text("x_mm,y_mm,z_mm\n0,0,-20\n3,2,-25\n")
    return path


@pytest.fixture
def called():
    """Exit status of a command with the scene of a folder."""

    def call(folder, *arguments):
        line = [arguments[0], str(folder / "scene.toml"), *arguments[1:], "--out", str(folder / "out")]
        return cli.run(line, threading.Event())

    return call


def test_field_of_the_map_is_that_of_the_rotor(called, folder, capfd):
    found = {}
    for model in ("map", "cuboid"):
        assert called(folder, "field", "--points", str(folder / "points.csv"), "--model", model, "--json") == 0
        found[model] = json.loads(capfd.readouterr().out)
    assert found["map"]["model"] == "map"
    exact, stated = np.array(found["cuboid"]["B_T"]), np.array(found["map"]["B_relative_error"])
    error = np.linalg.norm(np.array(found["map"]["B_T"]) - exact, axis=1) / np.linalg.norm(exact, axis=1)
    assert (error < stated).all()
    assert (stated < 1e-2).all()


def test_a_place_among_the_sources_is_refused(called, folder, capfd):
    (folder / "near.csv").write_text("x_mm,y_mm,z_mm\n2,0,-7\n")
    assert called(folder, "field", "--points", str(folder / "near.csv"), "--model", "map") == 2
    assert "farther than 8.66 mm from (2, 0, 0) mm" in capfd.readouterr().err


def test_a_map_with_wrong_columns_is_refused(called, folder, capfd):
    wrong = folder / "wrong"
    wrong.mkdir()
    (wrong / "scene.toml").write_text((folder / "scene.toml").read_text())
    (wrong / "map.csv").write_text("x_mm,y_mm,z_mm,B_total\n0,0,-20,1\n")
    assert called(wrong, "field", "--points", str(folder / "points.csv"), "--model", "map") == 2
    assert "map.csv: Input columns must hold x, y, z and at least one of Bx, By, Bz" in capfd.readouterr().err


def test_the_scene_tells_what_the_map_does_not(called, folder, capfd):
    """Two solutions side by side, in units that no title has; and keys that are there without a map."""
    several, rows = folder / "several", np.loadtxt(folder / "map.csv", delimiter=",", skiprows=1)
    several.mkdir()
    titles = ",".join(["x", "y", "z", *(f"{name}.B{axis}" for name in ("one", "two") for axis in "xyz")])
    both = np.hstack([rows[:, :3], 0.5 * rows[:, 3:], rows[:, 3:]])
    np.savetxt(several / "map.csv", both, delimiter=";", header=titles.replace(",", ";"), comments="# ")
    told = '[rotor]\nmap_columns = "two"\nmap_length_unit = "mm"\nmap_field_unit = "mT"\n'
    text = (folder / "scene.toml").read_text()
    (several / "scene.toml").write_text(text.replace("[rotor]\n", told))
    found = []
    for scene in (several, folder):
        assert called(scene, "field", "--points", str(folder / "points.csv"), "--model", "map", "--json") == 0
        found.append(json.loads(capfd.readouterr().out)["B_T"])
    assert found[0] == found[1]
    written = scene_text(changed(load_scene(several / "scene.toml"), {}))
    assert all(line in written for line in told.splitlines())
    (several / "scene.toml").write_text(text.replace("[rotor]\n", told).replace('field_map = "map.csv"\n', ""))
    assert called(several, "field", "--points", str(folder / "points.csv")) == 2
    assert "Input rotor.map_columns must come with rotor.field_map" in " ".join(capfd.readouterr().err.split())


def test_no_map(called, folder, capfd):
    bare = folder / "bare"
    bare.mkdir()
    (bare / "scene.toml").write_text((folder / "scene.toml").read_text())
    with pytest.raises(SceneError, match=r"field_map must be a map of the field; instead there is no .*bare/map.csv"):
        load_scene(bare / "scene.toml")
    (bare / "scene.toml").write_text(load_scene(shipped_scene("horizontal")).text)
    assert called(bare, "field", "--points", str(folder / "points.csv"), "--model", "map") == 2
    assert "Input rotor.field_map must name a file" in capfd.readouterr().err


def test_a_map_does_not_tell_how_the_rotor_answers(folder, called, capsys):
    assert called(folder, "equilibria", "--model", "map", "--interaction", "mutual", "--plate-model", "none") == 2
    told = capsys.readouterr().err
    assert "--interaction must be rigid or auto with a measured map" in told
    assert "--model fem" in told
    assert "Traceback" not in told
