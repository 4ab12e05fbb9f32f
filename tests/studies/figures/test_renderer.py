"""Pictures in three dimensions come from a process of its own: its death costs the pictures and nothing else.

Nothing here needs a graphics library, but for the last test.
"""

import os
import signal
from pathlib import Path

import numpy as np
import pytest
from pictures_that_fail import Dies, Endless, Fails, Group
from places import SCENES, TESTS

from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.flights.flight import simulate
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.scene.files import load_scene
from spinlev.studies.cli.console import DRAWING, way_out
from spinlev.studies.figures.pictures import flight_frames, last_view
from spinlev.studies.figures.renderer import RenderError, render, unavailable
from spinlev.studies.figures.view import FieldPlane, frame_times


@pytest.fixture(autouse=True)
def tests_are_found(monkeypatch):
    """The pictures of this file, by the other process."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).parent), str(TESTS)]))


def test_pictures_are_drawn_by_one_process_in_a_group_of_its_own(tmp_path):
    """Ctrl-C at the terminal is sent to this group; what is printed there is no picture."""
    done = []
    render({tmp_path / name: Group() for name in "ab"}, done.append)
    groups = {(tmp_path / name).read_text() for name in "ab"}
    assert len(groups) == 1
    assert groups != {str(os.getpgrp())}
    assert done == [0.5, 1.0]


@pytest.mark.parametrize(
    ("end", "said"),
    [
        (Dies(signal.SIGSEGV), "died (Segmentation fault), as it does without graphics libraries. "),
        pytest.param(Dies(signal.SIGABRT), "died (Aborted)", marks=pytest.mark.slow),
        pytest.param(Dies(signal.SIGKILL), "was killed (out of memory?)", marks=pytest.mark.slow),
        (Fails(ImportError("libGL.so.1: cannot open shared object")), f"cannot open shared object. {way_out(DRAWING)}"),
        (Fails(ImportError("cannot import name 'Cube'")), "ImportError: cannot import name 'Cube'."),
        pytest.param(Fails(ValueError("ω\nis not")), "ValueError: ω is not.", marks=pytest.mark.slow),
    ],
)
def test_what_was_finished_stays_and_the_rest_is_named(tmp_path, end, said):
    older = tmp_path / "b.png"
    older.write_text("of an older result")
    with pytest.raises(RenderError, match=r"The 3-D pictures are left out \(b.png, c.png\): ") as caught:
        render({tmp_path / "a.png": Group(), older: end, tmp_path / "c.png": Group()})
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.parametrize("begin", ["import os; os._exit(3)", "import sys; sys.exit('no such module')"])
def test_a_process_that_cannot_begin(tmp_path, monkeypatch, begin):
    monkeypatch.setattr("spinlev.studies.processes.BEGIN", begin)
    unavailable.cache_clear()
    with pytest.raises(RenderError, match=r"left out \(a.png\): No process can begin: it died"):
        render({tmp_path / "a.png": Fails(ValueError("x" * 1_000_000))})
    assert "it died" in unavailable()
    unavailable.cache_clear()


def test_who_stops_the_program_stops_the_drawing(tmp_path):
    drawing = []

    def stop(process):
        drawing.append(int(process))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render({tmp_path / "a.png": Endless()}, stop)
    with pytest.raises(ProcessLookupError):
        os.kill(drawing[0], 0)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_no_fault_of_the_drawing(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=r"a\.png"):
        render({tmp_path / "file" / "a.png": Group()})


@pytest.fixture(scope="module")
def flight():
    scene = load_scene(SCENES / "vertical-24h.toml")
    table = rotor_table(scene.rotor, "dipole")
    found = find_equilibria(scene, table)
    return scene, table, simulate(scene, table, 0.5, found)


@pytest.mark.slow
def test_the_frames_of_a_flight_are_places_on_its_path(flight):
    """Between two samples a straight line along the rotor's axes is within 1 % of a millimetre."""
    scene, _, flown = flight
    frames = flight_frames(scene, flown.time, flown.rotor)
    np.testing.assert_array_equal(frames.time, frame_times(scene, float(flown.time[-1])))
    assert np.ptp(frames.time) > 0.9 * flown.time[-1]
    for axis in range(3):
        expected = np.interp(frames.time, flown.time, flown.lab.position[:, axis])
        np.testing.assert_allclose(frames.position[:, axis], expected, atol=1e-5)


def test_the_field_that_is_drawn_is_the_tables(flight):
    scene, table, flown = flight
    view = last_view(scene, table, flown.time, flown.rotor)
    points = 1e-3 * FieldPlane.points(view.plane.width, view.plane.depth)
    known = np.isfinite(view.plane.field).all(axis=1)
    np.testing.assert_array_equal(known, table.in_range(points))
    np.testing.assert_array_equal(view.plane.field[known], table.evaluate(points[known])[0])
