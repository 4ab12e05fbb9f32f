"""One's own question, and what is made of a result: figure, pictures, report."""

import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, strategies as st
from places import HORIZONTAL

import spinlev as sl
from spinlev.geometry.common import InputError
from spinlev.geometry.scene.files import load_scene, parse_scene
from spinlev.geometry.scene.messages import SceneError
from spinlev.studies.catalogue.report import used_references
from spinlev.studies.cli.main import _status
from spinlev.studies.cli.options import combinations, parse_vary
from spinlev.studies.figures.run import question_lines

SCENE = str(HORIZONTAL)
FAST = ("--plate-model", "none", "--model", "dipole", "--workers", "1", "--json")


@pytest.fixture
def spinlev(tmp_path, monkeypatch, capsys):
    """Run the command line in this process; gives the exit status, the answer and the messages."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["spinlev", "test"])

    def run(*arguments):
        with (tmp_path / "stdout").open("w") as out:
            status = _status([str(a) for a in arguments], out)
        text = (tmp_path / "stdout").read_text()
        return status, json.loads(text) if text.startswith("{") else text, capsys.readouterr().err

    return run


@given(
    st.integers(-1000, 1000), st.integers(1, 200), st.sampled_from([0.001, 0.1, 0.25, 0.5, 1.0, 5.0, -0.1, -2.0, 1e-6])
)
def test_a_range_has_its_ends_and_no_more(first, count, step):
    last = first + (count - 1) * step
    (values,) = parse_vary([f"frequency_hz={first}:{last!r}:{step}"]).values()
    assert len(values) == count
    np.testing.assert_allclose(values, first + step * np.arange(count), rtol=1e-11, atol=1e-11)


def test_decimal_steps_give_decimal_values():
    assert parse_vary(["a.b=0.1:0.7:0.1"]) == {"a.b": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]}
    assert combinations(parse_vary(["a=1,2", "b=3,4"])) == [
        {"a": 1, "b": 3},
        {"a": 1, "b": 4},
        {"a": 2, "b": 3},
        {"a": 2, "b": 4},
    ]


@pytest.mark.parametrize(
    "wrong",
    [
        "x",
        "=1",
        "a=",
        "a=1:2",
        "a=2:1:1",
        "a=1:2:0",
        "a=1:2:nan",
        "a=1,x",
        "a=inf",
        "a=1,1",
        "a=0:1:1e-9",
        "a=1:2:3:4",
        "a=" + "9" * 5000,
        "a=" + "[" * 5000,
    ],
)
def test_wrong_values(wrong):
    with pytest.raises(InputError, match="Input --vary must"):
        parse_vary([wrong])


def test_a_change_takes_the_place_of_the_file_s_number():
    text = Path(SCENE).read_text()
    scene = parse_scene(text, changes={"rotor.displacement_mm": 3.0, "plate.center_mm.0": 40.0, "gravity_m_s2.0": 1.0})
    assert scene.rotor[0].box.center[0] == pytest.approx(3e-3)
    assert scene.plate.box.center[0] == pytest.approx(40e-3)
    assert scene.gravity[0] == 1.0


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("rotor.displacement", "unknown key `rotor.displacement` "),
        ("plate.center_mm.3", "must be a key inside the tables"),
        ("plates.center_mm.0", "must be a key inside the tables"),
        ("rotor.magnets.x.size_mm", "must be a key inside the tables"),
        ("frequency_hz.0", "must be a key inside the tables"),
        ("", "unknown key `''`"),
    ],
)
def test_a_change_that_no_key_takes(key, message):
    with pytest.raises(SceneError, match=message):
        parse_scene(Path(SCENE).read_text(), changes={key: 1.0})


def test_equilibria_over_a_grid_are_those_of_the_single_scenes(spinlev, tmp_path):
    """Also where a point fails: the frequency 0 Hz has no equilibrium, and is named with its reason."""
    asked = ("--vary", "frequency_hz=0,110", "--vary", "rotor.displacement_mm=1.5,2")
    status, answer, err = spinlev("study", SCENE, *asked, *FAST)
    assert status == 0, err
    assert [f["point"]["frequency_hz"] for f in answer["failed_points"]] == [0.0, 0.0]
    assert "Earnshaw" in answer["failed_points"][0]["reason"]
    with xr.open_dataset(answer["result"], engine="h5netcdf") as result:
        found = result["position"].sel({"frequency_hz": 110.0, "rotor_displacement_mm": 2.0})
        found = found.transpose("equilibrium", "axis").dropna("equilibrium").values
        assert np.isnan(result["position"].sel(frequency_hz=0.0)).all()
    status, single, err = spinlev("equilibria", SCENE, "--plate-model", "none", "--model", "dipole", "--json")
    # Round-off of a place that is millimetres away, also for its coordinate of a fraction of a nanometre.
    np.testing.assert_allclose(1e3 * found, [e["position_mm"] for e in single["equilibria"]], rtol=1e-14, atol=1e-15)
    assert all(Path(file).stat().st_size > 5000 for file in answer["figures"])


@pytest.mark.usefixtures("undrawn")
def test_field_over_one_parameter(spinlev):
    status, answer, err = spinlev(
        "study", SCENE, "--vary", "rotor.remanence_T=0.5:1:0.25", "--ask", "field", "--at", "0,0,-20", *FAST
    )
    assert status == 0, err
    with xr.open_dataset(answer["result"], engine="h5netcdf") as result:
        field = result["B"].transpose("rotor_remanence_T", "axis").values
    np.testing.assert_allclose(field[2], 2 * field[0], rtol=1e-14)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("study", SCENE), "--vary KEY=FIRST:LAST:STEP"),
        (("study", "--vary", "frequency_hz=1"), "must be a scene file"),
        (("study", "none.toml", "--vary", "frequency_hz=1"), "must be a TOML file; instead there is no none.toml."),
        (("study", SCENE, "--vary", "frequency_hz=-1"), "frequency_hz must be at least 0"),
        (("study", SCENE, "--vary", "frequency_hz=1", "--at", "1,2"), "--at must be three numbers"),
        (("study", SCENE, "--vary", "frequency_hz=1", "--workers", "0"), "--workers must be between"),
        (("study", SCENE, "--vary", "frequency_hz=1", "--duration-s", "0"), "--duration-s must be a positive"),
        (("figure", "none.nc"), "must be a regular file; instead there is no none.nc."),
        (("figure", SCENE), "instead it is a scene. Its result is made by: spinlev run"),
        (("show", "none.nc"), "must be a regular file; instead there is no none.nc."),
        (("cite", "none.nc"), "must be a regular file; instead there is no none.nc."),
        (("report", "nowhere"), "must be a folder with results"),
        (("report", "."), "must have results"),
    ],
)
def test_wrong_input(spinlev, arguments, message):
    status, out, err = spinlev(*arguments)
    assert status == 2
    assert message in err
    assert not out


class Sources(HTMLParser):
    """Where a page's pictures and links come from."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        self.found += [value for key, value in attrs if key in ("src", "href")]


@pytest.mark.usefixtures("needs_3d")
def test_a_flight_is_shown_and_reported(spinlev, tmp_path, monkeypatch):
    monkeypatch.setattr("spinlev.studies.figures.view.TURNS", 1)
    monkeypatch.setattr("spinlev.studies.figures.view.FRAMES", 2)
    status, _, err = spinlev("simulate", SCENE, "--duration-s", "0.1", *FAST[:4])
    assert status == 0, err
    trajectory = tmp_path / "out" / "trajectory.nc"
    text = load_scene(SCENE).text
    with xr.open_dataset(trajectory, engine="h5netcdf") as opened:
        flight = opened.load().assign_attrs(scene=text[: text.index("[plate]")])
    flight.to_netcdf(trajectory, engine="h5netcdf")
    status, answer, err = spinlev("show", trajectory, "--json")
    assert status == 0, err
    assert Path(answer["pictures"][0]).read_bytes().startswith(b"\x89PNG")
    assert Path(answer["pictures"][1]).read_bytes().startswith(b"GIF")
    status, answer, err = spinlev("report", "out", "--json")
    assert status == 0, err
    page = Path(answer["report"]).read_text()
    sources = Sources()
    sources.feed(page)
    assert len([s for s in sources.found if s.startswith("data:image/")]) == 3
    assert all(s.startswith(("data:image/", "#")) for s in sources.found)
    assert "<script src" not in page
    outside = re.sub("<script.*?</script>", "", page, flags=re.DOTALL)  # that it asks for nothing, test_browser holds
    assert not any(loading in outside for loading in ("<link", "<iframe src", "@import", "url("))
    narrow = re.findall('srcset="([^"]*)"', outside)
    assert len(narrow) == 1
    assert narrow[0].startswith("data:image/")
    assert "frequency_hz = 110.0" in page


@pytest.mark.parametrize(
    ("attributes", "there", "absent"),
    [
        ({"study": "question", "ask": "field", "model": "cuboid"}, ["effect", "program"], ["heyoka", "ngsolve"]),
        ({"study": "simulate", "model": "fem", "plate_model": "reduced"}, ["heyoka", "ngsolve", "eddy"], ["magpylib"]),
        ({"study": "levitation-time", "model": "cuboid"}, ["air", "heyoka"], ["ngsolve"]),
        ({"study": "team7"}, ["team7", "eddy", "ngsolve"], ["heyoka"]),
    ],
)
def test_what_is_cited(attributes, there, absent):
    keys = used_references(xr.Dataset(attrs=attributes))
    assert set(there) <= set(keys)
    assert not set(absent) & set(keys)


@pytest.mark.usefixtures("undrawn")
def test_a_study_has_no_scene_to_show(spinlev, tmp_path):
    spinlev("study", SCENE, "--vary", "frequency_hz=110", "--ask", "field", "--at", "0,0,-20", *FAST)
    status, _, err = spinlev("show", tmp_path / "out" / "question.nc")
    assert status == 2
    assert "must hold a trajectory" in err
    shutil.rmtree(tmp_path / "out")


@pytest.mark.slow
def test_a_sweep_is_beside_the_dipole_whatever_the_stability(tmp_path):
    """The dipoles of every point are those of `compare`'s table, which searches each for itself."""
    found = sl.sweep(SCENE, {"frequency_hz": [110.0, 118.0]}, model="surface", rtol=1e-3, out=tmp_path, workers=1)
    dipole = sl.equilibria(replace(load_scene(SCENE), frequency=110.0), model="dipole", plate_model="none")
    nearest = np.abs(dipole.distance.values - float(found.true_distance[0])).argmin()
    place = -dipole.position.sel(axis="z").values[nearest]
    assert found.dipole_distance.values[0] == pytest.approx(place, rel=1e-9)
    kinds = set(found.dipole_stability.values) | set(found.true_stability.values)
    assert kinds <= {"stable", "marginal", "unstable"}
    assert (found.true_moment_distance < found.dipole_distance).all()  # the true moment is 1.6 % weaker
    lines = "\n".join(question_lines(found))
    assert "same conditions" in lines
    assert "dipole of the magnets' true moments" in lines
    beside = sl.sweep(SCENE, {"frequency_hz": [110.0, 118.0]}, model="dipole", out=tmp_path, workers=1)
    assert question_lines(beside)[-1] == "Against finite elements: --vary model=dipole,fem."


@pytest.mark.slow
def test_error_bars_of_scenes_that_are_searched_together_have_what_mutual_magnetisation_misses():
    """Displaced rotors share their equations, where the effect moves with the magnet; its error is each scene's own."""
    scene, asked = replace(load_scene(SCENE), plate=None), {"ask": "equilibria", "model": "fem", "plate_model": "none"}
    together = sl.sweep(scene, {"rotor.displacement_mm": [2.0, 2.2]}, interaction="mutual", **asked)
    alone, rigid = (
        sl.sweep(scene, {"rotor.displacement_mm": [2.2]}, interaction=i, **asked) for i in ("mutual", "rigid")
    )
    found = together.position_error.values[1]
    assert found == pytest.approx(alone.position_error.values[0], rel=1e-4)
    assert found[0] > 2 * rigid.position_error.values[0, 0]
