"""Designs: against grids that know of no derivatives, curves of two goals, and what cannot be asked for."""

import json
import threading

import numpy as np
import pytest
import xarray as xr
from article import BALL

import spinlev as sl
from spinlev.geometry.scene.files import changed, scene_text
from spinlev.studies.candidates import Candidate, Search
from spinlev.studies.cli.main import run
from spinlev.studies.levitation import Levitation

SCENE = sl.scene(
    frequency_hz=120.0, rotor=sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305), floater=BALL
)  # fmt: skip
FEW = {"model": "dipole", "plate_model": "none"}
FREE = {"rotor.angle_deg": (4.0, 30.0), "rotor.edge_mm": (8.0, 13.0)}


def test_slopes_of_all_measures_are_differences():
    """Of central differences with steps of 1e-3; ends of stability by whole branches."""
    search = Search(Levitation(SCENE, sl.Models(**FEW)), FREE)
    for name in ("margin", "decay_per_s", "distance_mm", "polar_angle_deg", "gap_mm", "rotor_mass_g"):
        got = search.start.slopes(name)
        for k, step in enumerate((1e-2, 1e-2)):
            ends = [search.at(search.first + sign * step * np.eye(2)[k]) for sign in (1, -1)]
            whole = [Candidate(end.levitation, end.known, end.keys).values(name) for end in ends]
            wanted = (whole[0] - whole[1]) / (2 * step)
            assert got[:, k] == pytest.approx(wanted, rel=1e-4, abs=1e-7), name


@pytest.mark.slow
def test_the_largest_margin_is_that_of_a_grid():
    """At 20 mm: no smaller rotor with that distance has a larger one, and the neighbours come near."""
    found = sl.design(SCENE, "largest margin", FREE, {"distance_mm": 20.0}, **FEW)
    value = found.value.isel(point=0)
    assert float(value.sel(measure="distance_mm")) == pytest.approx(20.0, abs=5e-5)
    best, margins = float(value.sel(measure="margin")), []
    for edge in float(found.number.sel(key="rotor.edge_mm")[0]) * np.array([0.96, 0.98, 1.0]):
        there = sl.design(
            changed(SCENE, {"rotor.edge_mm": edge}), "lowest frequency", {"rotor.angle_deg": (4.0, 30.0)},
            {"distance_mm": 20.0}, **FEW,
        )  # fmt: skip
        margins.append(float(there.value.sel(measure="margin")[0]))
    assert best == pytest.approx(margins[2], abs=1e-4)
    assert margins == sorted(margins)
    below, above = np.diff(margins)  # a smooth function of the edge: by equal steps it changes nearly as much
    assert below == pytest.approx(above, rel=0.1)
    assert float(found.first_value.sel(measure="margin")) < best
    again = sl.parse_scene(str(found.scene[0].item()))
    assert sl.equilibria(again, **FEW).distance[0] == pytest.approx(20e-3, abs=5e-8)


@pytest.mark.slow
def test_two_goals_have_a_curve():
    """At 20 mm a lighter rotor has less margin: along the curve neither goal gains without loss of the other."""
    found = sl.design(SCENE, ["largest margin", "lightest rotor"], FREE, {"distance_mm": 20.0}, points=4, **FEW)
    margin, mass = (found.value.sel(measure=name).values for name in ("margin", "rotor_mass_g"))
    assert np.all(np.diff(margin) < 0)
    assert np.all(np.diff(mass) < 0)
    assert found.value.sel(measure="distance_mm").values == pytest.approx(np.full(4, 20.0), abs=1e-4)


@pytest.mark.parametrize(
    ("goals", "free", "limits", "said"),
    [
        ("largest margins", FREE, None, "did you mean `largest margin`"),
        ([], FREE, None, "must be one or two of"),
        ("largest margin", {}, None, "free must be least and most by key"),
        ("largest margin", {"rotor.edge": (8, 12)}, None, "did you mean `rotor.edge_mm`"),
        ("largest margin", {"rotor.edge_mm": (12, 8)}, None, "two in order"),
        ("largest margin", {"rotor.edge_mm": 10}, None, "two finite numbers in order"),
        ("largest margin", {"rotor.edge_mm": (11, 12)}, None, "holds the scene's own number, 10"),
        ("largest margin", FREE, {"distance": 20}, "did you mean `distance_mm`"),
        ("largest margin", FREE, {"distance_mm": "near"}, "a number, or two in order"),
        ("largest margin", FREE, {"distance_mm": (21, 20)}, "a number, or two in order"),
        ("largest margin", FREE, 20.0, "limits must be ranges"),
    ],
)
def test_bad_requests_are_refused(goals, free, limits, said):
    with pytest.raises(sl.InputError, match=said):
        sl.design(SCENE, goals, free, limits, **FEW)


def test_limits_that_nothing_meets_are_a_failure_that_says_which():
    with pytest.raises(sl.ComputationError, match="meets all limits: distance_mm is"):
        sl.design(SCENE, "largest margin", {"rotor.angle_deg": (9.0, 11.0)}, {"distance_mm": 25.0}, **FEW)


@pytest.mark.slow
@pytest.mark.parametrize("models", [FEW, {"model": "fem"}], ids=["dipole", "finite elements"])
def test_what_nothing_meets_is_said_after_few_scenes(models, monkeypatch):
    """Below this cube the farthest equilibrium ends in a fold at 29 mm, along which a search would creep for long."""
    looked_at, followed = [], Search._followed
    monkeypatch.setattr(Search, "_followed", lambda *given: looked_at.append(given) or followed(*given))
    with pytest.raises(sl.ComputationError, match=r"distance_mm is 2[89]"):
        sl.design(SCENE, "lightest rotor", FREE, {"distance_mm": 40.0}, **models)
    assert len(looked_at) < 200  # each takes some 0.1 s


def test_the_command_line_writes_a_scene(tmp_path):
    (tmp_path / "scene.toml").write_text(scene_text(SCENE))
    goals = tmp_path / "goals.toml"
    goals.write_text(
        'scene = "scene.toml"\ngoals = ["lightest rotor"]\n[free]\n"rotor.edge_mm" = [7.0, 12.0]\n'
        "[limits]\ngap_mm = [6.0, inf]\n"
    )
    out = tmp_path / "out"
    command = ["design", str(goals), "--model", "dipole", "--plate-model", "none", "--out", str(out)]
    assert run(command, threading.Event()) == 0
    said = json.loads((out / "design.json").read_text())
    assert said["gap_mm"] == pytest.approx(6.0, abs=1e-4)
    assert said["rotor_mass_g"] < 7.5
    assert sl.load_scene(said["scene"]).rotor[0].box.size[0] == pytest.approx(
        1e-3 * said["numbers"][0]["rotor.edge_mm"]
    )
    assert (out / "design.png").exists()
    with xr.open_dataset(out / "design.nc") as kept:
        assert kept.attrs["goals"] == "lightest rotor"
    assert run(["figure", str(out / "design.nc"), "--out", str(tmp_path)], threading.Event()) == 0


@pytest.mark.parametrize(
    ("text", "said", "status"),
    [
        ('scene = "scene.toml"\ngoal = ["lightest rotor"]', "did you mean `goals`", 2),
        ('goals = ["lightest rotor"]', "scene must be the path", 2),
        ('scene = "other.toml"\ngoals = ["lightest rotor"]\nfree."rotor.edge_mm" = [7, 12]', "other.toml", 2),
        ('scene = "scene.toml"\ngoals = ["lightest rotor"]', "free must be", 2),
        ('scene = "scene.toml"\ngoals = "lightest"\nfree."rotor.edge_mm" = [7, 12]', "goals must name goals", 2),
        ("scene = [", "must be TOML", 2),
        (
            'scene = "scene.toml"\ngoals = "largest margin"\nfree."rotor.angle_deg" = [9, 11]\nlimits.distance_mm = 25',
            "meets all limits",
            1,
        ),
    ],
)
def test_a_bad_file_of_goals_is_one_sentence(text, said, status, tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(scene_text(SCENE))
    goals = tmp_path / "goals.toml"
    goals.write_text(text)
    command = ["design", str(goals), "--model", "dipole", "--plate-model", "none", "--out", str(tmp_path)]
    assert run(command, threading.Event()) == status
    message = capsys.readouterr().err.strip().splitlines()[-1]
    assert said in message
    assert "Traceback" not in message
