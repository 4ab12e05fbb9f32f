"""The working point of a scene's magnets, on the command line and in Python."""

import json
import threading

import numpy as np
import pytest

import spinlev as sl
from spinlev.geometry.scene.files import scene_text
from spinlev.studies.cli.main import run

BALL = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0, recoil_permeability=1.0)


def scene_of(**more):
    rotor = sl.tilt(angle_deg=10.0, shape="sphere", diameter_mm=12.0, remanence_T=1.3, recoil_permeability=1.0, **more)
    return sl.scene(frequency_hz=130.0, rotor=rotor, floater=BALL)


def test_the_command_writes_numbers_and_a_picture(tmp_path, capfd):
    """A uniform sphere with a floater below it: H = -J/3 and the floater's dipole field, at its strongest."""
    (tmp_path / "scene.toml").write_text(scene_text(scene_of(coercivity_kA_m=355.0)))
    call = ["field", str(tmp_path / "scene.toml"), "--working-point", "--out", str(tmp_path), "--json"]
    assert run(call, threading.Event()) == 0
    values = json.loads(capfd.readouterr().out)
    (one,) = values["working_points"]
    place, floater = np.array(one["place_mm"]), np.array(values["floater_position_mm"])
    assert np.linalg.norm(place) == pytest.approx(6.0, abs=0.01)
    assert place @ floater > 0  # on the floater's side
    dipole = 1.305 * (2 / 3) * (6.35 / np.linalg.norm(floater - place)) ** 3  # on its axis
    assert -1.3 / 3 - dipole < one["lowest_mu0H_T"] < -1.3 / 3 - 0.2 * dipole
    assert one["lowest_while_slipping_mu0H_T"] <= one["lowest_mu0H_T"]
    assert one["knee_mu0H_T"] == pytest.approx(-4e-7 * np.pi * 355e3, rel=1e-6)
    assert 0 < one["share_below_knee"] < 0.5
    assert (tmp_path / "working-point.png").stat().st_size > 10_000
    saved = json.loads((tmp_path / "working-point.json").read_text())
    assert saved["working_points"] == values["working_points"]


def test_where_nothing_levitates_the_magnets_are_alone_and_it_is_said(tmp_path, capfd):
    scene = scene_of()
    (tmp_path / "scene.toml").write_text(scene_text(scene).replace("frequency_hz = 130.0", "frequency_hz = 0.0"))
    assert (
        run(["field", str(tmp_path / "scene.toml"), "--working-point", "--out", str(tmp_path)], threading.Event()) == 0
    )
    said = capfd.readouterr().out
    assert "no equilibrium: it is left out" in said
    assert "-0.4333" in said
    assert "Give coercivity_kA_m" in said


def test_in_python_it_is_labelled_data():
    found = sl.working_point(scene_of(coercivity_kA_m=955.0), model="dipole")
    assert found.sizes["magnet"] == 1
    assert found["lowest"].attrs["units"] == "T"
    assert float(found["lowest"][0]) > float(found["knee"][0])
    assert float(found["share_below"][0]) == 0
    section = found["section"].values[0]
    assert np.nanmin(section) == pytest.approx(float(found["lowest"][0]), abs=2e-3)
    assert np.isnan(section[0, 0])


def test_a_rotor_without_polarisation_is_refused():
    body = {"size_mm": [10.0] * 3, "center_mm": [0.0] * 3, "polarization_T": [0.0] * 3}
    scene = sl.scene(frequency_hz=10.0, rotor=sl.magnets(body), floater=BALL)
    with pytest.raises(sl.InputError, match="must have a magnet with a polarisation"):
        sl.working_point(scene, model="dipole")
