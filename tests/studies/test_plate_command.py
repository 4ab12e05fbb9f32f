"""`spinlev plate`: what it answers, for which pose, and how it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spinlev.fem.plate.slab import EDGES
from spinlev.geometry.common import InputError
from spinlev.geometry.scene.contents import Plate
from spinlev.geometry.scene.files import load_scene
from spinlev.geometry.shapes import Box, rotation_matrix
from spinlev.studies.cli.main import app
from spinlev.studies.plan import check_room
from spinlev.studies.run import response

SCENE = "scenes/tilt-over-plate.toml"


def ask(tmp_path, *arguments):
    call = ["plate", SCENE, *arguments, "--out", str(tmp_path)]
    values, _ = app(call, exit_on_error=False, print_error=False, result_action="return_value")
    return values


def tensor(values):
    parts = values["G_T_per_A_m2"]
    return np.array(parts["real"]) + 1j * np.array(parts["imag"])


@pytest.fixture(autouse=True)
def _at_the_root(monkeypatch, request):
    monkeypatch.chdir(request.config.rootpath)


def test_slab_and_finite_elements_agree_as_far_as_the_slab_claims(tmp_path):
    """A real plate against an infinite one, 17 mm over the face: within the slab's own estimate."""
    slab = ask(tmp_path, "--at", "0,0,-20", "--frequency-hz", "100", "--model", "slab")
    fem = ask(tmp_path, "--at", "0,0,-20", "--frequency-hz", "100", "--model", "fem", "--rtol", "1e-2")
    none = ask(tmp_path, "--at", "0,0,-20", "--frequency-hz", "100", "--model", "none")
    assert not np.any([none["G_T_per_A_m2"][part] for part in ("real", "imag")])
    assert set(slab) == set(none) == {"model", "error_estimate", "G_T_per_A_m2", "tables_from_cache"}
    difference = np.linalg.norm(tensor(slab) - tensor(fem)) / np.linalg.norm(tensor(fem))
    assert difference < slab["error_estimate"]
    assert 0 < fem["error_estimate"] <= 1e-2
    assert (tmp_path / "plate.json").exists()


@pytest.mark.parametrize(
    ("size", "place", "frequency"),
    [
        ((0.1, 0.24, 0.03), (0.02, 0.01, 0.02), 100.0),
        ((0.1, 0.12, 0.01), (0.02, 0.01, 0.02), 5.0),
        pytest.param((0.2, 0.4, 0.001), (0.0, 0.0, 0.01), 0.5, marks=pytest.mark.slow),
        ((0.2, 0.2, 0.002), (0.07, 0.07, 0.04), 0.5),
    ],
)
def test_edges_change_the_slab_by_no_more_than_it_says(size, place, frequency):
    """They matter the most where resistance alone rules: at low frequencies in thin plates."""
    plate = Plate(Box(size, (0.0, 0.0, -size[2] / 2)), 3.5e7)
    slab, fem = (response(plate, np.array(place), frequency, model, 1e-2) for model in ("slab", "fem"))
    (_, tensor, error, _), (_, exact, _, _) = slab, fem
    assert 0.05 * error < np.linalg.norm(tensor - exact) / np.linalg.norm(tensor) < error


def test_slab_follows_the_pose():
    """The tensor of a turned plate is the turned tensor, under the face that is nearest."""
    lying = Plate(Box((0.5, 0.6, 0.03)), 3.5e7)
    turn = rotation_matrix((20.0, 70.0, 10.0))
    turned = Plate(Box(lying.box.size, (0.1, 0.2, 0.3), turn), 3.5e7)
    place = np.array([0.01, 0.02, -0.04])
    _, first, error, _ = response(lying, place, 50.0, "slab", 1e-3)
    _, second, same, _ = response(turned, turn @ place + turned.box.center, 50.0, "slab", 1e-3)
    assert abs(second - turn @ first @ turn.T).max() < 1e-12 * abs(first).max()
    assert error == pytest.approx(same, rel=1e-9)


def test_slab_estimate_vanishes_for_a_wide_plate():
    """Beyond a disc of radius ρ lies depth²/(depth² + ρ²) of it, beyond its square less."""
    wide = Plate(Box((20.0, 20.0, 0.03)), 3.5e7)
    _, _, error, _ = response(wide, np.array([0, 0, 0.035]), 50.0, "slab", 1e-3)
    assert 0 < error < EDGES * 0.05**2 / 10.0**2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--at", "0,0,-40", "--frequency-hz", "50"), "--at must lie outside the plate"),
        (("--at", "0,0,-20", "--frequency-hz=-1"), "--frequency-hz must be finite and not negative"),
        (("--at", "0,0,-37", "--frequency-hz", "50"), "--at must lie outside the plate"),
        (("--at", "0,0,1e9", "--frequency-hz", "50"), "--at must lie outside the plate, 1 mm to 24 m from it"),
        (("--at", "0,0,-20", "--frequency-hz", "50", "--rtol", "1e-9"), "--rtol must be at least 1e-05 and less than"),
        (("--at", "0,0,-20", "--frequency-hz", "50", "--rtol", "2"), "--rtol must be at least 1e-05 and less than 1"),
        (("--at", "0,0,-20", "--frequency-hz", "nan"), "--frequency-hz must be finite and not negative"),
        (("--at", "0,0,-20", "--frequency-hz", "5e6", "--model", "fem", "--rtol", "0.1"), "model slab"),
        (("--at", "0,0", "--frequency-hz", "50"), "--at must be three numbers"),
        (("--at", "60,0,-50", "--frequency-hz", "50", "--model", "slab"), "--at must be over one of the plate"),
    ],
)
def test_bad_input_is_named(tmp_path, arguments, message):
    with pytest.raises(InputError, match=message):
        ask(tmp_path, *arguments)


def test_a_scene_without_plate_is_refused(tmp_path):
    text = Path(SCENE).read_text()
    (tmp_path / "bare.toml").write_text(text[: text.index("[plate]")])
    with pytest.raises(InputError, match=r"must have a \[plate\]"):
        app(
            ["plate", str(tmp_path / "bare.toml"), "--at", "0,0,-20", "--frequency-hz", "1", "--out", str(tmp_path)],
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )


def test_a_plate_where_the_floater_levitates_is_refused():
    """Nothing in the scene file says where that is: found with the equilibrium."""
    scene = load_scene(SCENE)
    check_room(scene, np.array([0.0, 0.0, -0.019]))
    with pytest.raises(InputError, match=r"plate\.center_mm must leave room .* by 3\.35 mm .*; move the plate"):
        check_room(scene, np.array([0.0, 0.0, -0.034]))
