"""What is shown of results: currents in the plate, pictures, the report's page; and the command line's last resort."""

import io
import json
import threading
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from places import QUICK, SCENES

import spinlev as sl
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.common import InputError
from spinlev.geometry.scene.files import load_scene
from spinlev.studies.catalogue import field_quality
from spinlev.studies.catalogue.entries import CATALOGUE
from spinlev.studies.catalogue.field_quality import CASES
from spinlev.studies.catalogue.report import LONGEST, report_job
from spinlev.studies.catalogue.runner import read_result, show_job
from spinlev.studies.cli import main as cli
from spinlev.studies.cli.main import _status
from spinlev.studies.figures.pictures import plate_currents
from spinlev.studies.figures.run import question_figure
from spinlev.studies.figures.view import Currents, current_places
from spinlev.studies.result import write_dataset
from spinlev.studies.run import response


@pytest.fixture(scope="module")
def scene():
    return load_scene(SCENES / "horizontal.toml")


@pytest.mark.slow
def test_no_net_current_flows_through_a_section_of_the_plate(scene):
    """Currents are closed: as much flows one way through a plane as the other, and none out of a face."""
    table = rotor_table(scene.rotor, "dipole")
    floater = next(e for e in find_equilibria(scene, table) if e.stable).state
    box, counts = scene.plate.box, (60, 20)
    across = np.stack(np.meshgrid(*((np.arange(n) + 0.5) / n - 0.5 for n in counts), indexing="ij"), -1).reshape(-1, 2)
    sections = [np.insert(across, 0, place, axis=1) for place in (-0.2, 0.1)]
    face = np.insert(across, 2, 0.5 - 1e-6, axis=1)
    points = np.concatenate([*sections, face]) * box.size
    current = plate_currents(scene, scene.plate, table, floater, box.center + points @ box.rotation.T) @ box.rotation
    *through, out = current.reshape(3, -1, 3)
    for part in through:
        assert abs(part[:, 0].sum()) < 0.01 * np.abs(part[:, 0]).sum()
        assert np.abs(part).max() > 1e5  # A/m²
    assert np.abs(out[:, 2]).max() < 0.02 * np.abs(out).max()


@pytest.mark.usefixtures("needs_3d")
def test_arrows_show_the_currents_under_the_face_that_the_floater_is_before(scene):
    """All places lie in the plate, a hundredth of its thickness below that face; the longest arrow is 12 mm."""
    import pyvista as pv

    from spinlev.studies.figures.still import add_plate, new_plotter

    box, floater = scene.plate.box, np.array([0.0, 0.0, -0.02])
    points = current_places(box, floater)
    inside = box.to_body(points) / box.size
    normal = int(np.argmin(box.size))
    side = np.sign(box.to_body(floater[None])[0, normal])
    np.testing.assert_allclose(inside[:, normal], 0.49 * side)
    assert np.abs(inside).max() < 0.5
    plotter = new_plotter((300, 200))
    add_plate(plotter, scene, Currents(points, np.tile([0.0, 2e6, 0.0], (len(points), 1))))
    arrows = plotter.meshes[-1]
    assert isinstance(arrows, pv.PolyData)
    lower, upper = np.array(arrows.bounds).reshape(3, 2).T
    places = 1e3 * points
    assert upper[1] - places[:, 1].max() == pytest.approx(12.0, rel=1e-5)
    assert lower[1] == pytest.approx(places[:, 1].min(), abs=1e-3)
    plotter.close()


@pytest.mark.usefixtures("needs_3d")
def test_a_floater_without_a_direction_has_no_arrow(scene):
    from spinlev.studies.figures.still import add_floater, new_plotter

    plotter = new_plotter((300, 200))
    drawn = [add_floater(plotter, scene, np.zeros(3), moment) for moment in (np.zeros(3), np.array([0.0, 0.0, 1.0]))]
    assert [len(actors) for actors in drawn] == [1, 2]
    plotter.close()


@pytest.mark.slow
@pytest.mark.usefixtures("needs_3d")
def test_a_flight_is_shown_with_the_plate_where_it_has_been_lowered_to(tmp_path, monkeypatch):
    """After 4 s of a lowering that begins at 3 s with 10 mm/s the currents are those of a plate 10 mm further down."""
    scene = load_scene(SCENES / "tilt-over-plate.toml")
    flight = sl.simulate(scene, 0.05, "dipole", "none")
    path, asked = tmp_path / "trajectory.nc", []
    write_dataset(flight.assign_coords(time=flight["time"] + 3.95), path)

    def currents(scene, plate, table, floater, points):
        asked.append(plate)
        return np.zeros_like(points)

    monkeypatch.setattr("spinlev.studies.figures.view.FRAMES", 1)
    monkeypatch.setattr("spinlev.studies.catalogue.runner.plate_currents", currents)
    files = [Path(name) for name in show_job(path, tmp_path)]
    assert [file.suffix for file in files] == [".png", ".gif"]
    assert all(file.stat().st_size for file in files)
    (plate,) = asked
    np.testing.assert_allclose(scene.plate.box.center - plate.box.center, [0.0, 0.0, 0.01], atol=1e-12)
    assert plate.lowering is None


@pytest.mark.usefixtures("undrawn")
def test_the_report_of_a_run_has_its_numbers_cut_where_they_are_long(scene, tmp_path):
    result = sl.simulate(replace(scene, plate=None), 0.02, "dipole", "none").assign_attrs(study="run")
    write_dataset(result, tmp_path / "result.nc")
    numbers = {"levitated_s": 0.0215, "long": "x" * LONGEST + " last of all"}
    (tmp_path / "summary.json").write_text(json.dumps(numbers))
    page = report_job(tmp_path, tmp_path)[0].read_text()
    assert "0.0215" in page
    assert "xx …" in page
    assert "last of all" not in page
    (tmp_path / "summary.json").write_text("{")
    with pytest.raises(InputError, match=r"summary.json must be a JSON object; instead: Expecting"):
        report_job(tmp_path, tmp_path)


def question(place, stable, **varied):
    """A result of a sweep of equilibria at places (m) by the values varied."""
    dims = (*varied, "equilibrium")
    columns = {"position": ((*dims, "axis"), place, {"units": "m"}), "stable": (dims, stable)}
    attrs = {"study": "question", "ask": "equilibria", "varied": [*varied]}
    return xr.Dataset(columns, {**varied, "axis": ["x", "y", "z"]}, attrs)


def test_a_sweep_draws_the_branch_on_which_the_floater_levitates():
    """From the stable one on, hollow where it is unstable; neither its end nor other branches."""
    height = np.array([[-0.021, -0.03], [-0.02, -0.03], [-0.019, -0.03], [-0.0305, -np.nan]])
    place = np.stack([0 * height, 0 * height, height], axis=-1)
    result = question(place, [[0, 0], [1, 0], [0, 0], [0, np.nan]], frequency_hz=[110.0, 115.0, 120.0, 125.0])
    (axes,) = question_figure(result).axes
    filled, hollow = (
        np.concatenate([line.get_ydata() for line in axes.lines if line.get_marker() == "o" and face(line) == fill])
        for fill in (False, True)
    )
    np.testing.assert_allclose(filled[np.isfinite(filled)], [20.0])
    np.testing.assert_allclose(hollow[np.isfinite(hollow)], [21.0, 19.0])


def face(line):
    """Whether a line's markers are hollow."""
    return line.get_markerfacecolor() == "white"


@pytest.mark.parametrize(("members", "panels"), [(3, 1), (7, 2)])
def test_a_second_number_is_a_family_of_curves_and_of_many_values_a_map(members, panels):
    place = np.zeros((8, members, 1, 3)) - 0.02
    result = question(place, np.ones((8, members, 1)), frequency_hz=np.arange(8.0), angle=np.arange(members) + 1.0)
    figure = question_figure(result)
    assert len(figure.axes) == panels  # a map has a bar
    names = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert names == ["angle = 1", "angle = 2", "angle = 3", "unstable"][: 4 * (panels == 1)]


def test_every_point_of_every_study_is_known_to_json():
    """Points name files and go to other processes; a quick study asks for no more of them."""
    for study in CATALOGUE.values():
        quick, full = study.points(True), study.points(False)
        assert 0 < len(quick) <= len(full)
        for points in (quick, full):
            told = json.loads(json.dumps(points))
            assert told == [dict(point) for point in points]
            assert len({json.dumps(point) for point in points}) == len(points)


@pytest.mark.slow
def test_a_study_on_the_command_line_and_in_python_is_what_was_stored(tmp_path, monkeypatch):
    """To 1e-3, since the elements' accuracy moves with their versions; points are computed once for both."""
    name, said = "force-curve", io.StringIO()
    study = CATALOGUE[name]
    once = cache(lambda text: study.compute(json.loads(text)))
    monkeypatch.setitem(CATALOGUE, name, replace(study, compute=lambda point: once(json.dumps(point))))
    asked = ["study", name, "--quick", "--workers", "1", "--json", "--out", str(tmp_path)]
    assert _status(asked, said) == 0
    answer = json.loads(said.getvalue())
    assert (answer["study"], answer["failed_points"]) == (name, [])
    assert {Path(file).suffix for file in answer["figures"]} == {".png", ".pdf"}
    stored = read_result(QUICK / f"{name}.nc")
    for found in (read_result(Path(answer["result"])), sl.run_study(name, out=tmp_path / "again")):
        for part in ("attracting", "repelling", "polar_angle"):
            np.testing.assert_allclose(found[part], stored[part], atol=1e-3 * float(np.abs(stored[part]).max()))
        assert list(found["model"].values) == list(stored["model"].values)
    listed = io.StringIO()
    assert _status(["study", "--list"], listed) == 0
    assert [line.split()[0] for line in listed.getvalue().splitlines()] == list(CATALOGUE)


def test_what_nobody_foresaw_ends_in_one_message(monkeypatch, capsys):
    """The error's kind, words and place; the traceback for who asks for it; who has been stopped is told that."""

    def fails(*arguments, **options):
        raise ZeroDivisionError("a mistake of ours")

    monkeypatch.setattr(cli, "app", SimpleNamespace(parse_args=fails))
    assert _status([], io.StringIO()) == 1
    said = capsys.readouterr().err
    assert f"failed at {Path(__file__).parent.name}/{Path(__file__).name}:" in said
    assert said.strip().endswith("ZeroDivisionError: a mistake of ours")
    stopped = threading.Event()
    stopped.set()
    assert _status([], io.StringIO(), stopped) == 1
    assert capsys.readouterr().err.strip() == cli.STOPPED
    monkeypatch.setenv("SPINLEV_TRACEBACK", "1")
    with pytest.raises(ZeroDivisionError):
        _status([], io.StringIO())


def small_plate():
    """A plate of 100 × 120 mm, and a place 35 mm over it."""
    plate = replace(load_scene(SCENES / "tilt-over-plate.toml").plate, lowering=None)
    small = replace(plate, body=replace(plate.box, size=np.array([0.1, 0.12, 0.01]), center=np.zeros(3)))
    return small, small.box.rotation @ np.array([0.0, 0.01, 0.04])


def test_a_small_plate_is_answered_by_finite_elements():
    """35 mm over 100 × 120 mm too much lies beyond the edges for the infinite slab, which is wrong by half there."""
    small, place = small_plate()
    answer, slab = (response(small, place, 50.0, name, 0.1) for name in ("auto", "slab"))
    (model, tensor, _, _), (_, flat, error, _) = answer, slab
    assert model == "fem"
    assert error > 0.1
    assert np.linalg.norm(tensor - flat) > 0.1 * np.linalg.norm(tensor)
    assert abs(tensor - tensor.T).max() < 1e-9 * abs(tensor).max()


@pytest.mark.slow
def test_the_reduced_plate_is_that_of_the_finite_elements():
    small, place = small_plate()
    reduced, fem = (response(small, place, 50.0, name, 0.1) for name in ("reduced", "fem"))
    apart = np.linalg.norm(reduced[1] - fem[1]) / np.linalg.norm(fem[1])
    assert apart < reduced[2] + fem[2]
    assert reduced[2] <= 0.1


def test_the_study_of_hard_cases_is_its_cases():
    """Quick: those that are marked so, each as alone."""
    names = "extensions, μr = 1", "no polarisation", "long"
    result = field_quality.field_hard_cases(quick=True, cases={name: CASES[name] for name in names}, places=4)
    assert list(result["case"].values) == list(names[:2])
    alone = field_quality.case_errors(CASES[names[0]], 2)
    np.testing.assert_array_equal(result["true_error"].sel(case=names[0]), alone["true_error"])
