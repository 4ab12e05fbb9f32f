"""The command line as a user sees it: keys, files, messages and exit statuses."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from places import SCENES

pytestmark = pytest.mark.usefixtures("undrawn")
NO_PLATE = ("--plate-model", "none")
GOOD = (SCENES / "horizontal.toml").read_text()


def test_a_process_answers_on_standard_output_and_complains_on_the_other(tmp_path, points):
    """As from a shell: one answer; and one message without a file."""
    call = "import sys; from spinlev.studies.cli.start import main; sys.argv[0] = 'spinlev'; main()"

    def process(*arguments):
        command = [sys.executable, "-c", call, *map(str, arguments)]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        return done.returncode, done.stdout, done.stderr

    status, out, err = process("field", SCENES / "horizontal.toml", "--points", points, "--model", "cuboid", "--json")
    assert status == 0, err
    assert np.shape(json.loads(out)["B_T"]) == (2, 3)
    status, out, err = process("run", "none.toml", "--out", "none")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert not (tmp_path / "none").exists()


def test_help_comes_without_what_computes():
    """It takes 0.6 s at most; xarray or pandas alone would double that."""
    code = "import sys; from spinlev.studies.cli.start import main; sys.argv[1:] = ['--help']\n"
    code += "try: main()\nfinally: print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "Commands" in found.stdout
    loaded = set(found.stdout.splitlines()[-1].split())
    assert "rich" in loaded
    assert not loaded & {"xarray", "matplotlib", "scipy", "pyngcore", "heyoka", "pandas", "pyvista"}


@pytest.mark.parametrize("model", ["dipole", "cuboid", "fem", "auto"])
def test_field(spinlev, tmp_path, points, model):
    status, out, err = spinlev("field", SCENES / "horizontal.toml", "--points", points, "--model", model, "--json")
    assert status == 0, err
    answer = json.loads(out)
    assert {"model", "error_estimate", "seconds", "B_T", "dB_T_per_m", "tables_from_cache"} <= set(answer)
    assert np.shape(answer["B_T"]) == (2, 3)
    gradient = np.array(answer["dB_T_per_m"])
    assert gradient.shape == (2, 3, 3)
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-12 * np.abs(gradient).max()
    # Below a magnet magnetised along +x the field points along -x, about μ0 m/(4π d³) = 12-13 mT at 20 mm.
    assert answer["B_T"][0][0] == pytest.approx(-0.0125, rel=0.05)
    assert 0 < answer["error_estimate"] < {"dipole": 0.2, "cuboid": 0.1}.get(model, 1e-5)
    assert (tmp_path / "out" / "field.csv").read_text().count("\n") == 3


def test_equilibria(spinlev):
    status, out, err = spinlev("equilibria", SCENES / "vertical-24h.toml", "--model", "cuboid", "--json")
    assert status == 0, err
    answer = json.loads(out)
    keys = {"position_mm", "polar_angle_deg", "lag_deg", "stable", "growth_per_s", "frequencies_hz"}
    assert all(keys <= set(e) for e in answer["equilibria"])
    assert any(e["stable"] and 25 < -e["position_mm"][2] < 29 for e in answer["equilibria"])
    assert answer["model"] == "cuboid"
    assert answer["interaction"] == "rigid"
    effects = {effect["name"]: effect for effect in answer["effects"]}
    assert set(next(iter(effects.values()))) == {
        *("name", "included", "shift_mm", "growth_per_s", "why", "motion_error")
    }
    assert effects["mutual magnetisation"]["shift_mm"] > 0.01  # what it would do
    assert "cuboid" in effects["mutual magnetisation"]["why"]


def test_an_unknown_interaction_is_refused(spinlev):
    status, _, err = spinlev("equilibria", SCENES / "horizontal.toml", "--interaction", "loud")
    assert status == 2
    assert "rigid" in err


def test_rotor_and_floater_magnetise_each_other_if_asked(spinlev):
    """Attraction lifts the floater by about a tenth of a millimetre, with any field; the flight has it too."""
    options = (SCENES / "horizontal.toml", "--model", "cuboid", *NO_PLATE, "--json", "--interaction")
    places = []
    for asked in ("rigid", "mutual"):
        status, out, err = spinlev("equilibria", *options, asked)
        assert status == 0, err
        answer = json.loads(out)
        assert answer["interaction"] == asked
        places.append(next(e["position_mm"][2] for e in answer["equilibria"] if e["stable"]))
    assert places[1] - places[0] == pytest.approx(0.09, abs=0.02)
    assert answer["effects"][0]["shift_mm"] == pytest.approx(places[1] - places[0], rel=0.1)
    status, out, err = spinlev("simulate", *options, "mutual", "--duration-s", "0.05")
    assert status == 0, err
    assert json.loads(out)["energy_error"] < 1e-10
    assert json.loads(out)["interaction"] == "mutual"


def test_simulate(spinlev, tmp_path):
    status, out, err = spinlev(
        "simulate", SCENES / "horizontal.toml", "--duration-s", "0.2", "--model", "dipole", *NO_PLATE, "--json"
    )
    assert status == 0, err
    answer = json.loads(out)
    assert answer["ended_by"] == "duration"
    assert answer["levitated_s"] == pytest.approx(0.2)
    assert answer["energy_error"] < 1e-10
    assert answer["realtime_factor"] > 0
    assert (tmp_path / "out" / "trajectory.nc").exists()
    assert answer["not_modelled"]  # the scene has a plate


def test_the_plate_is_in_the_equilibria_and_the_motion(spinlev):
    """A plate that lies under the floater damps it: the infinite slab, which needs no finite elements."""
    options = (SCENES / "tilt-over-plate.toml", "--model", "cuboid", "--plate-model", "slab", "--json")
    status, out, err = spinlev("equilibria", *options)
    assert status == 0, err
    first = json.loads(out)["equilibria"][0]
    assert first["with_plate"]
    assert first["stable"]
    assert -5 < first["growth_per_s"] < -1
    assert abs(first["without_plate"]["growth_per_s"]) < 1e-3
    status, out, err = spinlev("simulate", *options, "--duration-s", "0.05")
    assert status == 0, err
    answer = json.loads(out)
    assert answer["plate_model"] == "slab"
    assert answer["plate_error_estimate"] > 0.1  # the real plate is not infinite
    assert answer["energy_error"] < 1e-9
    assert answer["beyond_plate_table"] == 0


BAD_SCENES = {
    "not TOML": "not toml",
    "unknown key": GOOD + "\nfoo = 1\n",
    "negative size": GOOD.replace("edge_mm = 10.0", "edge_mm = -10.0"),
    "NaN": GOOD.replace("frequency_hz = 110.0", "frequency_hz = nan"),
    "wrong list length": GOOD.replace("[0.0, 0.0, -9.81]", "[0.0, -9.81]"),
    "overlapping bodies": GOOD.replace("[35.0, 0.0, -21.0]", "[10.0, 0.0, -21.0]"),
    "floater inside the rotor": GOOD + "\n[start]\nposition_mm = [2.0, 0.0, 0.0]\n",
    "plate lying with its centre 35 mm below, as the article's text might be read": GOOD.replace(
        "[35.0, 0.0, -21.0]", "[0.0, 0.0, -35.0]"
    ).replace("[0.0, 90.0, 0.0]", "[0.0, 0.0, 0.0]"),
}


@pytest.mark.parametrize("fault", BAD_SCENES)
def test_wrong_scenes_end_with_status_2_one_message_and_no_file(spinlev, tmp_path, fault):
    path = tmp_path / "s.toml"
    path.write_text(BAD_SCENES[fault])
    status, out, err = spinlev("run", path, "--model", "dipole")
    assert status == 2, err
    assert out == ""
    assert "Traceback" not in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "none.toml"), "none.toml: Input scene must be a TOML file; instead there is no none.toml."),
        (
            ("field", "S", "--points", "none.csv"),
            "points must be a CSV file with x_mm, y_mm, z_mm; instead there is no none.csv.",
        ),
        (("field", "S", "--points", "P", "--model", "magic"), "magic"),
        (("field", "S", "--points", "P", "--rtol", "-1"), "--rtol must be at least"),
        (("field", "S"), "--points"),
        (("simulate", "S", "--duration-s", "nan"), "--duration-s must be a positive number"),
        (("simulate", "S", "--duration-s", "long"), "long"),
        (("equilibria", "S", "--spin", "1e9"), "--spin must be between"),
        (("run", "S", "--spin", "nan"), "--spin must be between"),
        (("levitate",), "levitate"),
        (("run", "S", "--frequency", "3"), "--frequency"),
    ],
)
def test_wrong_command_lines_end_with_status_2(spinlev, tmp_path, points, arguments, said):
    names = {"S": SCENES / "horizontal.toml", "P": points}
    status, out, err = spinlev(*[names.get(a, a) for a in arguments])
    assert status == 2
    assert out == ""
    assert said in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "must have the columns"),
        ("x,y,z\n0,0,-20\n", "must have the columns"),
        ("x_mm,y_mm,z_mm,x_mm\n0,0,-20,1\n", "must have the columns x_mm, y_mm, z_mm, each once"),
        ("x_mm,y_mm,z_mm\n", "at least one line"),
        ("x_mm,y_mm,z_mm\n0,0,deep\n", "line 2 must have three finite numbers; instead received 'deep'"),
        ("x_mm,y_mm,z_mm\n0,0,-20\n0,0,nan\n", "line 3"),
        ("x_mm,y_mm,z_mm\n0,0\n", "line 2"),
        ("x_mm,y_mm,z_mm\n0,0,-20,5\n", "line 2 must have no more entries than the header, 3; instead it has 4"),
        ("x_mm,y_mm,z_mm\n7,5,0\n", "must not lie on an edge of a magnet"),
    ],
)
def test_wrong_points_end_with_status_2(spinlev, points, text, said):
    points.write_text(text)
    status, out, err = spinlev("field", SCENES / "horizontal.toml", "--points", points, "--model", "cuboid", "--json")
    assert status == 2
    assert out == ""
    assert said in err


def test_plate_takes_a_place_that_begins_with_a_minus(spinlev):
    scene = SCENES / "tilt-over-plate.toml"
    status, out, err = spinlev("plate", scene, "--at", "-5,0,-20", "--frequency-hz", "130", "--model", "slab", "--json")
    assert status == 0, err
    assert np.shape(json.loads(out)["G_T_per_A_m2"]["imag"]) == (3, 3)


@pytest.mark.parametrize(("own", "left"), [({}, "1 1"), ({"OMP_NUM_THREADS": "2"}, "2 1")])
def test_a_command_computes_in_one_thread_unless_the_user_says_otherwise(own, left):
    names = ("OMP_NUM_THREADS", "NGS_NUM_THREADS")
    code = (
        "import os, sys, atexit; from spinlev.studies.cli.start import main; sys.argv = ['spinlev', '--version']; "
        f"atexit.register(lambda: print(*(os.environ[name] for name in {names}))); main()"
    )
    environment = {name: value for name, value in os.environ.items() if name not in names}
    answer = subprocess.run([sys.executable, "-c", code], env=environment | own, capture_output=True, text=True)
    assert answer.stdout.splitlines()[-1] == left
