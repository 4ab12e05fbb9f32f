"""What a page's processes answer: field lines, the map, the flight, and files to take home."""

import json
import os
import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from places import OVER_PLATE

from spinlev.dynamics.equilibria.equilibrium import EquilibriumError
from spinlev.geometry.scene.files import load_scene, parse_scene
from spinlev.studies.figures.view import field_lines, unit
from spinlev.studies.levitation import Levitation
from spinlev.studies.page.state import first_state
from spinlev.studies.page.work import (
    SIGHT,
    begin_flight,
    complete,
    content,
    fly,
    has_map,
    map_key,
    preview,
    regions,
    wish,
)
from spinlev.studies.run import equilibria_job
from spinlev.studies.words import left_out_words

"""On a page's screen."""
STATE = replace(first_state(load_scene(OVER_PLATE)), model="dipole", plate_model="none")


def dipole_along_x(points):
    """Its field (n, 3), of no unit."""
    r = np.linalg.norm(points, axis=1, keepdims=True)
    return 3 * points * points[:, :1] / r**5 - np.array([1.0, 0.0, 0.0]) / r**3


def test_lines_of_a_dipoles_field_are_its_field_lines():
    """r = a sin² of the angle from the moment, along every line; the moment is along x here."""
    scene = replace(STATE.changed("rotor.angle_deg", 0.0).scene, plate=None)
    lines = field_lines(scene, dipole_along_x, *SIGHT)
    assert len(lines) > 10
    for one in lines:
        r = np.linalg.norm(one, axis=1)
        sine = 1 - (one[:, 0] / r) ** 2
        assert r / sine == pytest.approx((r / sine)[len(r) // 2], rel=2e-3)  # steps of 1 mm beside a cube of 10 mm
        assert np.abs(one[:, 1]).max() < 1e-12


@pytest.mark.parametrize("times", [0.1, 10.0])
def test_lines_and_names_of_a_scene_ten_times_the_size_are_ten_times_the_size(times):
    """Their steps are parts of the bodies; the same picture, whose scale says another length."""
    text = "frequency_hz = {f}\n[rotor]\nconfiguration = 'tilt'\nangle_deg = 10.0\nedge_mm = {e}\nremanence_T = 1.3\n"
    text += "[floater]\ndiameter_mm = {d}\nremanence_T = 1.3\ndensity_kg_m3 = 7500.0\n"
    plain, scaled = (parse_scene(text.format(f=130 / k, e=10 * k, d=12.7 * k)) for k in (1.0, times))
    assert (unit(plain), unit(scaled)) == (1.0, pytest.approx(times))
    lines = field_lines(plain, dipole_along_x, *SIGHT)
    other = field_lines(scaled, dipole_along_x, *(times * np.array(SIGHT)))
    assert len(lines) == len(other) > 10
    for one, two in zip(lines, other, strict=True):
        np.testing.assert_allclose(two, times * one, rtol=0, atol=1e-9 * times)  # m; the lines are some 50 mm long


def test_where_there_is_no_field_there_are_no_lines():
    assert field_lines(STATE.scene, lambda points: np.zeros((len(points), 3)), *SIGHT) == []


def test_the_page_says_what_the_command_line_says(tmp_path):
    """Row by row, the same characters; eigenvalues to the six digits that are shown; the preview of a dipole is whole.

    Two solutions lie inside the metal of the article's plate.
    """
    state = STATE.changed("frequency_hz", 141.0)
    found, quick = complete(state), preview(state)
    assert (quick.rows, quick.modes, quick.headline) == (found.rows, found.modes, found.headline)
    assert "without the plate's eddy currents" in found.conditions
    assert len(found.lines) > 5
    values, lines = equilibria_job(state.scene, state.models, state.spin, tmp_path)
    assert lines[0] == found.headline
    said = [line.split() for line in lines[1 : 1 + len(found.rows)]]
    assert said == [" ".join(row).split() for row in found.rows]
    modes = values["equilibria"][0]["modes"]
    assert [row[1:] for row in found.modes[1:]] == [
        (f"{mode['frequency_hz']:.6g}", f"{mode['growth_per_s']:.6g}") for mode in modes
    ]
    assert found.places[0][0] == pytest.approx(values["equilibria"][0]["position_mm"], rel=1e-11, abs=1e-12)
    levitation = Levitation(state.scene, state.models)
    assert found.left_out == left_out_words(levitation, levitation.survey.left_out)
    assert found.left_out[0].startswith("Left out: 2 solutions at ")


def test_a_question_without_an_answer_says_why():
    with pytest.raises(EquilibriumError, match="Beside a rotor at rest"):
        preview(STATE.changed("frequency_hz", 0.0))


def test_models_are_compared_under_the_same_conditions(tmp_path):
    """Each is what the command line finds by it with the same plate; the selected one is the first."""
    state = replace(STATE, model="fem", plate_model="slab")
    found = complete(state)
    assert [one.name for one in found.models] == ["finite elements", "point dipole"]
    assert "over the plate as an infinite slab" in found.conditions
    for one, model in zip(found.models, ("fem", "dipole"), strict=True):
        alone = Levitation(state.scene, replace(state.models, model=model)).equilibria[0]
        assert one.pose[0] == pytest.approx(1e3 * alone.start.position, abs=2e-3)  # the plate has one network for both
        assert (one.stability, one.polar_angle) == (alone.stability, pytest.approx(alone.polar_angle_deg, abs=0.02))
    assert "same conditions: levitation distance" in found.comparison[0]
    assert "without the plate" not in found.comparison[0]


@pytest.mark.slow
def test_a_preview_from_a_scene_nearby_is_that_of_a_search():
    """By finite elements too, whose tables are in the cache by now; where equilibria were lost it searches again."""
    state = replace(STATE, model="fem")
    complete(state)
    begin = preview(state)
    moved = state.changed("frequency_hz", 131.0)
    for near in (begin.places, [([0.0, 0.0, -400.0], [0.0, 0.0, 1.0])]):
        found = preview(moved, near)
        for one, model in zip(found.models, ("fem", "dipole"), strict=True):
            alone = Levitation(moved.scene, replace(moved.models, model=model)).equilibria[0]
            assert one.known
            assert one.pose[0] == pytest.approx(1e3 * alone.position, rel=1e-9, abs=1e-9)
            assert one.stability == alone.stability


def test_a_preview_waits_for_no_table():
    """Of a rotor that was never computed finite elements are left open; the point dipole is told."""
    found = preview(replace(STATE, model="fem").changed("rotor.edge_mm", 8.123))
    assert [(one.known, one.pose is None) for one in found.models] == [(False, True), (True, False)]


def inside(cells, place):
    """Whether one of convex polygons holds a place."""
    for cell in cells:
        ahead = np.roll(cell, -1, axis=0) - cell
        apart = np.array(place) - cell
        if np.all(ahead[:, 0] * apart[:, 1] - ahead[:, 1] * apart[:, 0] >= -1e-9):
            return True
    return False


def test_the_map_says_where_it_levitates():
    """At some places as a search for that scene does, beside the border too, which is finer than the grid."""
    fine = regions(STATE, ((100.0, 160.0), (6.0, 18.0)), "dipole", 9)
    ends = [place for piece in fine.border for place in piece]
    beside = [(x, y + step) for x, y in ends[:: len(ends) // 2] for step in (-0.1, 0.1)]  # a fifteenth of the grid
    for frequency, angle in [(101.0, 6.1), (159.0, 17.5), *beside]:
        there = STATE.changed("frequency_hz", frequency).changed("rotor.angle_deg", angle)
        found = Levitation(there.scene, there.models).without_plate.equilibria
        assert inside([np.array(cell) for cell in fine.cells], (frequency, angle)) == any(
            e.stability != "unstable" for e in found
        )


def test_a_map_stays_while_only_its_point_or_the_plate_moves():
    moved = STATE.changed("frequency_hz", 144.0).changed("rotor.angle_deg", 12.0).changed("plate.center_mm.2", -60.0)
    assert map_key(moved) == map_key(STATE)
    for key, value in (("rotor.edge_mm", 9.0), ("floater.diameter_mm", 10.0), ("spin", 0.1)):
        assert map_key(STATE.changed(key, value)) != map_key(STATE)


def test_what_has_no_map():
    assert has_map(STATE)
    assert not has_map(STATE.changed("gravity_m_s2", [0.1, 0.0, -9.8]))


def test_a_flight_does_what_it_is_told():
    start = begin_flight(STATE)
    assert start["samples"][0].tolist() == [0.0]
    assert np.array_equal(wish("push", [0.0, 0.0, 0.01])["pose"]["position"], start["pose"]["position"])
    assert "free of the magnets" in wish("put", [0.0, 0.0, 0.0])["message"]
    assert 0 < fly(1e-4)["samples"][0, -1] < 1e-3
    wish("put", [0.0, 0.0, -0.09])
    frame = start
    while not frame["ended"]:
        frame = fly(0.1)
    assert frame["ended"].endswith("touched the rotor or the plate.") or "lost" in frame["ended"]
    assert frame["samples"][1, -1] < -60.0


def test_a_flight_tells_how_far_the_plate_is_lowered():
    """From 3 s on at 10 mm/s."""
    begin_flight(STATE)
    for seconds, time in ((2.0, 2.0), (2.0, 4.0), (1.5, 5.5)):
        frame = fly(seconds)
        assert frame["pose"]["plate"] == pytest.approx(max(0.0, 10 * (time - 3)), abs=1e-6)


def test_a_flight_that_cannot_begin_says_why():
    with pytest.raises(EquilibriumError, match="no stable equilibrium"):
        begin_flight(STATE.changed("rotor.angle_deg", 40.0))


def test_files_to_take_home_are_those_of_the_command_line(tmp_path):
    values, _ = equilibria_job(STATE.scene, STATE.models, STATE.spin, tmp_path)
    assert json.loads(content("json", STATE)) == json.loads((tmp_path / "equilibria.json").read_text())
    (tmp_path / "result.nc").write_bytes(content("nc", STATE))
    with xr.open_dataset(tmp_path / "result.nc") as dataset:
        assert (1e3 * dataset.position[0]).values == pytest.approx(values["equilibria"][0]["position_mm"], rel=1e-12)
        assert dataset.attrs["model"] == "dipole"
    moved = STATE.changed("frequency_hz", 133.0)
    assert parse_scene(content("toml", moved).decode()).frequency == 133.0


def test_what_is_copied_asks_for_the_same(tmp_path, monkeypatch, capsys):
    """The command in a shell, with another program of the name of ours; the program as it stands."""
    copies = STATE.changed("frequency_hz", 133.0).copies()
    (tmp_path / "spinlev").write_text("#!/bin/sh\necho $*\n")
    (tmp_path / "spinlev").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    said = subprocess.run(["sh", "-c", copies["command"]], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert f"spinlev {said.stdout.strip()}" == copies["line"]
    assert load_scene(tmp_path / "scene.toml").frequency == 133.0
    found = {}
    exec(copies["python"], found)
    assert found["scene"].frequency == 133.0
    assert re.search(r"distance +polar_angle +growth +stable\n.*\n0 +0\.0\d+", capsys.readouterr().out)
