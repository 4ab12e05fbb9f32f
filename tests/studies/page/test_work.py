"""What a page's processes answer: field lines, the map, the flight, and files to take home."""

import json
import multiprocessing
import threading
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from places import OVER_PLATE

from spinlev.geometry.scene.files import load_scene, parse_scene
from spinlev.studies.levitation import Levitation
from spinlev.studies.page.state import Screen, content, field_lines, first_state
from spinlev.studies.page.work import complete, fly, follow, has_map, map_key, regions
from spinlev.studies.run import equilibria_job

STATE = replace(first_state(load_scene(OVER_PLATE)), plate_model="none")


@pytest.fixture
def line():
    """A connection to a task, which runs in a thread and ends with the test."""
    ends = []

    def begin(task, *arguments):
        mine, its = multiprocessing.Pipe()

        def work():
            with its:
                try:
                    task(its, *arguments)
                except (EOFError, OSError):  # the test is over
                    return

        thread = threading.Thread(target=work)
        thread.start()
        ends.append((mine, thread))
        return mine

    yield begin
    for mine, thread in ends:
        mine.close()
        thread.join()


def heard(connection):
    """The next answer."""
    assert connection.poll(120)
    return connection.recv()


def test_lines_of_a_dipoles_field_are_its_field_lines():
    """r = a sin² of the angle from the moment, along every line; the moment is along x here."""
    scene = replace(STATE.changed("rotor.angle_deg", 0.0).scene, plate=None)

    def field(points):
        r = np.linalg.norm(points, axis=1, keepdims=True)
        return 3 * points * points[:, :1] / r**5 - np.array([1.0, 0.0, 0.0]) / r**3

    lines = field_lines(scene, field)
    assert len(lines) > 10
    for one in lines:
        r = np.linalg.norm(one, axis=1)
        sine = 1 - (one[:, 0] / r) ** 2
        assert r / sine == pytest.approx((r / sine)[len(r) // 2], rel=2e-3)  # steps of a tenth of the cube's edge
        assert np.abs(one[:, 1]).max() < 1e-12


def test_where_there_is_no_field_there_are_no_lines():
    assert field_lines(STATE.scene, lambda points: np.zeros((len(points), 3))) == []


def test_every_question_is_answered_and_equilibria_are_carried(line):
    """Each question is answered from what was searched for elsewhere, which is taken in first."""
    connection = line(complete, 7, STATE)
    whole = heard(connection)
    assert (whole.number, whole.shown.complete) == (7, True)
    assert len(whole.lines) > 5
    quick = line(follow)
    quick.send((8, STATE, whole.survey))
    assert heard(quick) is None
    for number, frequency in ((9, 131.0), (10, 132.0), (11, 133.0)):
        quick.send((number, STATE.changed("frequency_hz", frequency), None))
    found = [heard(quick) for _ in range(3)][-1]
    assert found.number == 11
    assert not found.shown.complete
    assert found.shown.sign == "point dipole, without the plate's currents"
    assert len(found.shown.places) == len(whole.shown.places)


def test_a_question_without_an_answer_says_why(line):
    quick = line(follow)
    quick.send((1, STATE.changed("frequency_hz", 0.0), None))
    found = heard(quick)
    assert found.shown is None
    assert "Beside a rotor at rest" in found.message
    quick.send((2, STATE, None))
    assert heard(quick).shown.complete


def test_the_map_says_where_it_levitates(line):
    """At four of its points as a search for that scene does."""
    connection = line(regions, STATE, ((100.0, 160.0), (6.0, 18.0)))
    first, fine = heard(connection), heard(connection)
    assert first.kind.shape == (13, 13)
    assert fine.kind.shape == (41, 41)
    assert set(np.unique(fine.kind)) == {1, 2}
    for row, column in ((0, 0), (0, 40), (20, 15), (40, 40)):
        there = STATE.changed("frequency_hz", float(fine.frequencies[row]))
        there = there.changed("rotor.angle_deg", float(fine.measures[column]))
        found = Levitation(there.scene, there.models).equilibria
        assert fine.kind[row, column] == (2 if any(e.stable for e in found) else 1 if found else 0)


def test_a_map_stays_while_only_its_point_or_the_plate_moves():
    moved = STATE.changed("frequency_hz", 144.0).changed("rotor.angle_deg", 12.0).changed("plate.center_mm.2", -60.0)
    assert map_key(moved) == map_key(STATE)
    for key, value in (("rotor.edge_mm", 9.0), ("floater.diameter_mm", 10.0), ("spin", 0.1)):
        assert map_key(STATE.changed(key, value)) != map_key(STATE)


def test_what_has_no_map():
    assert has_map(STATE)
    assert not has_map(STATE.changed("gravity_m_s2", [0.1, 0.0, -9.8]))


def test_a_flight_does_what_it_is_told(line):
    connection = line(fly, STATE)
    start = heard(connection)
    assert start.time.tolist() == [0.0]
    connection.send(("push", [0.0, 0.0, 0.01]))
    assert heard(connection).position == start.position
    connection.send(("put", [0.0, 0.0, 0.0]))
    assert "free of the magnets" in heard(connection).message
    connection.send(("play", 1e-3))
    connection.send(("drawn",))
    slow = heard(connection)
    assert 0 < slow.time[-1] < 1e-3
    connection.send(("put", [0.0, 0.0, -0.09]))
    heard(connection)
    connection.send(("play", 1.0))
    frame = slow
    while not frame.ended:
        connection.send(("drawn",))
        frame = heard(connection)
    assert frame.ended.endswith("touched the rotor or the plate.") or "lost" in frame.ended
    assert frame.height[-1] < -60.0


def test_a_flight_that_cannot_begin_says_why(line):
    assert "no stable equilibrium" in heard(line(fly, STATE.changed("rotor.angle_deg", 40.0)))


def test_files_to_take_home_are_those_of_the_command_line(tmp_path):
    values, _ = equilibria_job(STATE.scene, STATE.models, STATE.spin, tmp_path)
    assert json.loads(content("json", STATE)) == json.loads((tmp_path / "equilibria.json").read_text())
    (tmp_path / "result.nc").write_bytes(content("nc", STATE))
    with xr.open_dataset(tmp_path / "result.nc") as dataset:
        assert (1e3 * dataset.position[0]).values == pytest.approx(values["equilibria"][0]["position_mm"], rel=1e-12)
        assert dataset.attrs["model"] == "dipole"
    moved = STATE.changed("frequency_hz", 133.0)
    assert parse_scene(content("toml", moved).decode()).frequency == 133.0
    screen = Screen(None, "", ("Frequency (Hz)", "Tilt (°)"), *[np.zeros(0)] * 3, (130.0, 10.0), *[np.zeros(0)] * 3)
    assert content("png", STATE, screen).startswith(b"\x89PNG")
