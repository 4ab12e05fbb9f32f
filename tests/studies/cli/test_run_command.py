"""`spinlev run` as a user sees it: what it answers, and the files that it leaves."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from places import OVER_PLATE, SCENES

import spinlev as sl
from spinlev.fem.rotor.choice import MODELS
from spinlev.fem.rotor.models import dipole_table
from spinlev.studies.cli.options import NAMES, Models
from spinlev.studies.figures.renderer import unavailable
from spinlev.studies.run import main_job

NO_PLATE = ("--plate-model", "none")
GOOD = (SCENES / "horizontal.toml").read_text()


def test_run_writes_everything_and_finds_its_tables_and_flight_again(spinlev, tmp_path, points, monkeypatch, request):
    status, written, err = spinlev("run", SCENES / "horizontal.toml", "--duration-s", "0.1", *NO_PLATE)
    assert status == 0, err
    assert re.search(
        r"Point-dipole model, same conditions without the plate: levitation distance [\d.]+ mm, "
        r"0\.16\(1\) mm more than",
        written,
    )
    made = {path.name for path in (tmp_path / "out").iterdir()}
    drawn = set() if unavailable() else {"scene.png"}
    figures = {f"{name}.{kind}" for name in ("field", "force", "trajectory") for kind in ("png", "pdf")}
    assert made == {"result.nc", "summary.json", *figures, *drawn}
    assert all((tmp_path / "out" / name).read_bytes().startswith(b"\x89PNG") for name in drawn)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["comparison"]["difference_error_mm"] < 0.01 * abs(summary["comparison"]["difference_mm"])
    status, out, err = spinlev("field", SCENES / "horizontal.toml", "--points", points, "--json")
    assert json.loads(out)["tables_from_cache"] == ["fem"]
    monkeypatch.setattr("spinlev.studies.levitation.simulate", pytest.fail)
    request.getfixturevalue("undrawn")
    again = spinlev("run", SCENES / "horizontal.toml", "--duration-s", "0.1", *NO_PLATE, "--out", "again")
    assert again[:2] == (0, written.replace("out/", "again/"))


@pytest.mark.usefixtures("undrawn")
def test_a_field_model_of_one_s_own_is_run_and_drawn(tmp_path, monkeypatch):
    """The recipe of docs/own-field-model.md: a function in `MODELS`, and its name in `FieldModel`."""
    monkeypatch.setitem(MODELS, "own", lambda magnets, accuracy: replace(dipole_table(magnets, accuracy), model="own"))
    monkeypatch.setitem(NAMES, "model", ("dipole", "own"))
    scene = sl.parse_scene(GOOD.replace("recoil_permeability = 1.05", "recoil_permeability = 1.0"))
    values, lines = main_job(scene, Models("own", "none"), 0.0, 0.01, tmp_path)
    assert values["model"] == "own"
    assert lines[0].startswith("Stable levitation ")
    assert (tmp_path / "force.png").exists()


@pytest.mark.usefixtures("undrawn")
def test_solutions_inside_the_metal_are_equilibria_in_no_file(tmp_path):
    """Of the article's scene: there are two, at 33.8 mm, which the plate's face cuts, and at 45.2 mm."""
    values, lines = main_job(sl.load_scene(OVER_PLATE), Models("dipole", "none"), 0.0, 0.01, tmp_path)
    with xr.open_dataset(tmp_path / "result.nc") as result:
        here = result.isel(equilibrium=np.flatnonzero(result["equilibrium_model"] == "dipole"))
        depths = -1e3 * result["equilibrium_position"].values[:, 2]
        assert len(here["equilibrium"]) == len(values["equilibria"])
        assert (depths + 12.7 / 2 < 37.0).all()  # the sphere's lowest point is above the face
        assert result.attrs["left_out"].count("plate") == len(values["left_out"]) == 2
    assert any(line.startswith("Left out: 2 solutions at ") for line in lines)


@pytest.mark.usefixtures("undrawn")
def test_a_run_is_of_the_body_spin_asked_for(spinlev, tmp_path):
    """Its first equilibrium is that of `equilibria`, its flight begins with that spin, its files say so."""
    path, spin = tmp_path / "s.toml", 0.3
    path.write_text(GOOD.replace("recoil_permeability = 1.05", "recoil_permeability = 1.0"))
    options = ("--model", "dipole", *NO_PLATE, "--spin", spin, "--duration-s", "0.01", "--json")
    status, out, err = spinlev("run", path, *options)
    assert status == 0, err
    answer = json.loads(out)
    known = sl.equilibria(path, model="dipole", plate_model="none", spin=spin).isel(equilibrium=0)
    np.testing.assert_allclose(answer["equilibria"][0]["position_mm"], 1e3 * known.position, atol=1e-9)
    with xr.open_dataset(tmp_path / "out" / "result.nc") as result:
        assert result.attrs["body_spin"] == answer["body_spin"] == spin
        begun = result.isel(time=0)
        assert float(begun.spin @ begun.moment) == pytest.approx(spin * 2 * np.pi * 110, rel=1e-6)


@pytest.mark.usefixtures("undrawn")
def test_no_equilibrium_is_a_failed_computation_that_keeps_what_was_finished(spinlev, tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(GOOD.replace("frequency_hz = 110.0", "frequency_hz = 30.0"))
    status, _, err = spinlev("run", path, "--model", "dipole", *NO_PLATE)
    assert status == 1
    assert "Traceback" not in err
    assert (tmp_path / "out" / "force.png").exists()
    assert "failed" in json.loads((tmp_path / "out" / "summary.json").read_text())


@pytest.mark.usefixtures("undrawn")
def test_a_rotor_at_rest_has_no_equilibrium_but_its_floater_still_falls(spinlev, tmp_path):
    path = tmp_path / "s.toml"
    at_rest = GOOD.replace("frequency_hz = 110.0", "frequency_hz = 0.0")
    path.write_text(at_rest)
    status, _, err = spinlev("equilibria", path, "--model", "dipole", *NO_PLATE)
    assert status == 1
    assert "Earnshaw" in err
    path.write_text(at_rest + "\n[start]\nposition_mm = [0.0, 0.0, -60.0]\n")
    status, out, err = spinlev("run", path, "--model", "dipole", "--duration-s", "1", *NO_PLATE, "--json")
    assert status == 0, err
    answer = json.loads(out)
    assert answer["ended_by"] == "lost"
    assert "Earnshaw" in answer["failed"]


def test_a_quick_run_is_coarser_and_says_so(spinlev, monkeypatch, tmp_path):
    """What is asked for coarser still, or by name, stays as it is asked for."""
    seen = []

    def job(scene, asked, spin, duration, out, gradient):
        seen.append(asked)
        return {}, ["the answer"]

    monkeypatch.setattr("spinlev.studies.run.main_job", job)
    status, out, err = spinlev("run", SCENES / "horizontal.toml", "--quick", "--plate-rtol", "0.1")
    assert status == 0, err
    assert seen == [Models(rtol=1e-3, plate_rtol=0.1, interaction="rigid")]
    assert out.splitlines()[1].startswith("Quick: field to 0.1%, plate's response to 10%")
    spinlev("run", SCENES / "horizontal.toml", "--quick", "--interaction", "mutual")
    assert seen[1].interaction == "mutual"
