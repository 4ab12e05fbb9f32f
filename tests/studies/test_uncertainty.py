"""Error bars from tolerances: the first order against draws, and draws against equilibria searched for anew."""

import json
import re
import threading
from dataclasses import replace

import numpy as np
import pytest
from places import HORIZONTAL, OVER_PLATE

import spinlev as sl
from spinlev.geometry.scene.files import changed, scene_text
from spinlev.studies.cli.main import run
from spinlev.studies.gradient import Gradient
from spinlev.studies.levitation import Levitation
from spinlev.studies.uncertainty import uncertainty_job

FEW = {"model": "dipole", "plate_model": "none"}
TOLERANCES = {"rotor.edge_mm": 0.05, "frequency_hz": 0.5, "floater.diameter_mm": 0.05}
TEXT = re.sub(r"edge_mm = [\d.]+", "edge_mm = {value = 10.0, tolerance = 0.05}", HORIZONTAL.read_text())


@pytest.mark.slow
def test_draws_scatter_as_the_first_order_says():
    """200 draws of a Latin hypercube tell a standard deviation to about 4 %, and the second order adds 1 % here."""
    found = sl.uncertainty(HORIZONTAL, TOLERANCES, **FEW).isel(equilibrium=0)
    for name in ("distance", "polar_angle"):
        assert float(found[f"{name}_drawn_error"]) == pytest.approx(float(found[f"{name}_error"]), rel=0.08)
    assert found.mode_frequency_drawn_error.values == pytest.approx(found.mode_frequency_error.values, rel=0.1)
    assert float(found.lost) == 0
    assert float(found.distance_error) == pytest.approx(np.linalg.norm(found.distance_share), rel=1e-12)
    low, high = found.distance_drawn.values
    assert low < float(found.distance) < high


def test_an_equilibrium_of_a_draw_is_that_of_its_scene():
    """Newton's method from the tangent ends where a search of the changed scene does, modes included."""
    levitation = Levitation(HORIZONTAL, sl.Models(**FEW))
    gradient, known = Gradient(levitation), levitation.equilibria[0]
    offsets = {"rotor.edge_mm": 0.1, "rotor.displacement_mm": -0.05, "frequency_hz": 2.0}
    ways, implicit, nearby = gradient.ways(known, list(offsets))
    there = changed(gradient.scene, {key: gradient.numbers[key] + step for key, step in offsets.items()})
    moved = implicit.moved(nearby.at(there, offsets), [(step, ways[key]) for key, step in offsets.items()])
    searched = Levitation(there, sl.Models(**FEW)).equilibria[0]
    assert moved.position == pytest.approx(searched.position, abs=1e-12)
    assert [mode.frequency_hz for mode in moved.modes] == pytest.approx(
        [m.frequency_hz for m in searched.modes], rel=1e-9
    )
    assert moved.growth_per_s == pytest.approx(searched.growth_per_s, abs=1e-8)


@pytest.mark.slow
def test_draws_past_a_fold_are_counted_as_lost():
    """With 15 Hz either way about a frequency 5 Hz above the fold of this rotor a third has no equilibrium."""
    scene = sl.load_scene(HORIZONTAL)
    levitation = Levitation(scene, sl.Models(**FEW))
    fold = levitation.branch[0].parameter
    near = changed(scene, {"frequency_hz": fold + 5.0})
    found = sl.uncertainty(near, {"frequency_hz": 15.0}, **FEW)
    assert float(found.lost[0]) == pytest.approx(1 / 3, abs=0.05)


def test_scene_files_may_have_tolerances():
    scene = sl.parse_scene(TEXT)
    assert scene.tolerances == (("rotor.edge_mm", 0.05),)
    again = scene_text(changed(scene, {"frequency_hz": 111.0}))
    assert "edge_mm = {value = 10.0, tolerance = 0.05}" in again
    assert sl.parse_scene(again).tolerances == scene.tolerances
    found = sl.uncertainty(scene, draws=0, **FEW)
    assert found.key.values.tolist() == ["rotor.edge_mm"]
    assert "distance_drawn" not in found


@pytest.mark.parametrize(
    ("number", "said"),
    [
        ("{value = 10.0}", r"Input rotor.edge_mm.tolerance must be given"),
        ("{tolerance = 0.1}", r"Input rotor.edge_mm.value must be given"),
        ("{value = 10.0, tolerance = 0.0}", r"rotor.edge_mm.tolerance must be a positive number; instead received 0.0"),
        ('{value = 10.0, tolerance = "x"}', r"must be a positive number"),
        ("{value = 10.0, tol = 0.1}", r"unknown key `rotor.edge_mm.tol`"),
        ("{value = [10.0], tolerance = 0.1}", r"rotor.edge_mm.value must be a number"),
    ],
)
def test_a_tolerance_that_cannot_be_is_one_clear_message(number, said):
    with pytest.raises(sl.SceneError, match=said) as error:
        sl.parse_scene(re.sub(r"edge_mm = [\d.]+", f"edge_mm = {number}", HORIZONTAL.read_text()))
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("tolerances", "more", "said"),
    [
        (None, {}, "must be numbers by key"),
        ({}, {}, "must be numbers by key"),
        ({"rotor.edge": 0.1}, {}, "did you mean `rotor.edge_mm`"),
        ({"rotor.edge_mm": -0.1}, {}, "must be a positive number"),
        ({"rotor.edge_mm": "a"}, {}, "must be a positive number"),
        ({"rotor.configuration": 0.1}, {}, "must name keys of numbers in this scene"),
        (TOLERANCES, {"draws": -1}, "draws must be a number"),
        (TOLERANCES, {"draws": 2.5}, "draws must be a number"),
    ],
)
def test_bad_requests_are_refused(tolerances, more, said):
    with pytest.raises(sl.InputError, match=said):
        sl.uncertainty(HORIZONTAL, tolerances, **FEW, **more)


def test_what_is_not_known_over_a_plate_is_said(tmp_path):
    """Of a plate's sizes no derivatives are known, hence no error bars; draws of its place are whole motions."""
    scene = sl.load_scene(OVER_PLATE)
    for key, known in (("plate.size_mm.2", False), ("plate.center_mm.2", True)):
        said = replace(scene, tolerances=((key, 0.2),))
        levitation = Levitation(said, sl.Models("dipole", "slab", plate_rtol=5e-2))
        values, (line, *more) = uncertainty_job(levitation, tmp_path)
        assert ("not known, as derivatives by sizes" in line) == (not known)
        bar = values["uncertainty"][0]["distance_mm"]
        assert not more
        assert np.isfinite(bar["error"]) == known
        if known:
            assert bar["drawn_error"] == pytest.approx(bar["error"], rel=0.2)  # of 20 draws


def test_the_command_line_prints_error_bars(tmp_path, monkeypatch):
    monkeypatch.setattr("spinlev.studies.uncertainty.DRAWS", 40)
    scene = tmp_path / "scene.toml"
    scene.write_text(TEXT)
    command = ["equilibria", str(scene), "--model", "dipole", "--plate-model", "none", "--out", str(tmp_path)]
    assert run(command, threading.Event()) == 0
    said = json.loads((tmp_path / "equilibria.json").read_text())
    bars = said["uncertainty"][0]["distance_mm"]
    assert bars["error"] == pytest.approx(2.42476 * 0.05 / 3**0.5, rel=1e-4)  # by the derivative, see docs/gradient.md
    assert bars["drawn_error"] == pytest.approx(bars["error"], rel=0.02)
    assert (tmp_path / "uncertainty.nc").exists()
