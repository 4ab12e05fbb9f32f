"""Files that a scene names are part of what it is: their content decides its digest, and must stay what it was."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spinlev.geometry.meshes.solids import occ_solid
from spinlev.geometry.scene.files import changed, check_files, load_scene, parse_scene, scene_digest
from spinlev.geometry.scene.messages import SceneError
from spinlev.geometry.shapes import Box

FLOATER = "[floater]\ndiameter_mm = 12.7\nremanence_T = 1.3\ndensity_kg_m3 = 7500.0\n"
OF_STEP = (
    f"frequency_hz = 100.0\n{FLOATER}[[rotor.magnets]]\nfile = 'part.step'\ncenter_mm = [0.0, 0.0, 0.0]\n"
    "polarization_T = [1.0, 0.0, 0.5]\n"
)
OF_MAP = (
    f"frequency_hz = 100.0\n{FLOATER}[rotor]\nconfiguration = 'tilt'\nangle_deg = 5.0\nedge_mm = 10.0\n"
    "remanence_T = 1.3\nfield_map = 'part.step'\n"
)


def cube(edge, bored):
    """A cube of an edge (mm), or what is left of it, which is no shape with a closed form."""
    import netgen.occ as occ

    solid = occ_solid(Box((edge * 1e-3,) * 3), np.zeros(3), 1e-3)
    return solid - occ.Cylinder(occ.Pnt(1, 0, -9), occ.Z, r=1, h=18) if bored else solid


def at_once(content, path):
    """Another content of the same length in the same second, with the old times: what a copy with its times does."""
    before = path.stat()
    path.write_bytes(content)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


@pytest.fixture(params=["known shape", "part", "map"])
def kept(request, tmp_path):
    """A scene with a file, and another content for that."""
    contents = []
    for edge in (10, 9):
        if request.param == "map":
            contents.append(f"x_mm,y_mm,z_mm,Bx_mT,By_mT,Bz_mT\n0,0,{edge},1,2,3\n".encode())
            continue
        cube(edge, request.param == "part").WriteStep(str(tmp_path / "part.step"))
        contents.append((tmp_path / "part.step").read_bytes())
    (tmp_path / "part.step").write_bytes(contents[0])
    (tmp_path / "scene.toml").write_text(OF_MAP if request.param == "map" else OF_STEP)
    return tmp_path / "scene.toml", contents


def test_a_file_that_was_replaced_makes_another_scene(kept):
    path, contents = kept
    before = load_scene(path)
    at_once(contents[1], path.with_name("part.step"))
    after = load_scene(path)
    assert scene_digest(before) != scene_digest(after)
    stays = r"part\.step must stay as it was when the scene was read"
    with pytest.raises(SceneError, match=stays):
        check_files(before)
    with pytest.raises(SceneError, match=stays):
        changed(before, {"frequency_hz": 90.0}, str(path))
    check_files(after)
    at_once(contents[0], path.with_name("part.step"))
    assert scene_digest(load_scene(path)) == scene_digest(before)
    assert changed(before, {"frequency_hz": 90.0}, str(path)).frequency == 90.0


def test_names_and_comments_do_not_count(kept, tmp_path):
    path, _ = kept
    other = tmp_path / "elsewhere"
    other.mkdir()
    shutil.copy(path.with_name("part.step"), other / "other.step")
    text = path.read_text().replace("part.step", "other.step")
    (other / "my.toml").write_text(f"# of mine\n{text}")
    assert scene_digest(load_scene(other / "my.toml")) == scene_digest(load_scene(path))


def test_a_scene_finds_its_files_from_any_folder(kept, monkeypatch):
    """Those beside the scene's file, not those of the same name in the folder at hand."""
    path, contents = kept
    there = load_scene(path)
    (path.parent / "at hand").mkdir()
    monkeypatch.chdir(path.parent / "at hand")
    Path("part.step").write_bytes(contents[1])
    assert scene_digest(changed(there, {"frequency_hz": 100.0})) == scene_digest(there)
    assert scene_digest(changed(changed(there, {"frequency_hz": 90.0}), {"frequency_hz": 100.0})) == scene_digest(there)


@pytest.mark.parametrize(
    "change",
    [
        {"frequency_hz": 101.0},
        {"floater.diameter_mm": 12.8},
        {"floater.density_kg_m3": 7501.0},
        {"rotor.magnets.0.polarization_T.1": 0.1},
        {"rotor.magnets.0.center_mm": [0.0, 0.0, 1.0]},
        {"gravity_m_s2": [0.0, 0.1, -9.81]},
        {"start": {"offset_mm": [0.0, 0.0, 0.2]}},
    ],
)
def test_any_other_key_makes_another_scene(change):
    scene = parse_scene(OF_STEP.replace("file = 'part.step'", "size_mm = [10.0, 10.0, 10.0]"))
    assert scene_digest(changed(scene, change)) != scene_digest(scene)
    assert scene_digest(replace(scene, text="")) == scene_digest(scene)
