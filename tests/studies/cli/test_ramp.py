"""Turned down until it is lost: the equilibria foretell where, and what stands in the floater's way is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from article import SCENE

from spinlev.geometry.common import InputError
from spinlev.geometry.scene.contents import DriveStep, OffsetStart, Plate
from spinlev.geometry.scene.files import scene_text
from spinlev.geometry.shapes import Box
from spinlev.studies.cli.options import Models
from spinlev.studies.interface import simulate, sweep
from spinlev.studies.levitation import Levitation
from spinlev.studies.result import Result

DIPOLE = Models("dipole", "none")


def test_lost_at_the_fold():
    """At 0.1 Hz/s: along the branch within 0.05 mm until 0.3 Hz before the fold, lost within 0.1 Hz beyond."""
    drive = (DriveStep(90.0, 20.0),)
    levitation = Levitation(replace(SCENE, frequency=92.0, start=OffsetStart(np.zeros(3)), drive=drive), DIPOLE)
    flight = levitation.flight(20.0)
    fold = levitation.branch[0]
    assert fold.kind == "fold"
    assert flight.ended_by in ("lost", "contact")
    assert fold.parameter - 0.1 < flight.lost_at_hz < fold.parameter
    before = flight.rate / (2 * np.pi) > fold.parameter + 0.3
    points = sorted((point.parameter, point.position[2]) for point in levitation.branch[1:])
    expected = np.interp(flight.rate[before] / (2 * np.pi), *np.array(points).T)
    assert np.abs(flight.lab.position[before, 2] - expected).max() < 5e-5
    summary = Result(levitation, flight=flight).summary
    assert summary["quasi_static_range_hz"][0] == fold.parameter
    assert summary["lost_at_hz"] == summary["ended_at_hz"] == flight.lost_at_hz
    momentum = (levitation.scene.floater.mass * np.cross(flight.lab.position, flight.lab.velocity))[:, 2]
    momentum += levitation.scene.floater.inertia * flight.lab.spin[:, 2]
    assert summary["motor_momentum_N_m_s"] == pytest.approx(momentum[-1] - momentum[0], rel=1e-10)


def test_ramp_from_the_command_line(spinlev, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(scene_text(SCENE))
    options = ("--model", "dipole", "--plate-model", "none", "--ramp", "95:80:20", "--out", tmp_path / "out")
    status, out, err = spinlev("simulate", path, *options, "--json")
    assert status == 0, err
    answer = json.loads(out)
    assert 80.0 < answer["lost_at_hz"] < 91.0
    assert answer["levitated_s"] == pytest.approx((95 - answer["lost_at_hz"]) / 20)
    with xr.open_dataset(tmp_path / "out" / "trajectory.nc") as kept:
        assert float(kept["rotor_frequency"][-1]) == pytest.approx(answer["lost_at_hz"])
        assert float(kept["motor_work"][-1]) == pytest.approx(answer["motor_work_J"])
        assert kept["motor_torque"].attrs["units"] == "N m"
        assert kept["quasi_static_distance"].sizes["branch_point"] > 10
        growth = kept["quasi_static_growth"].values
        assert growth.max() > 10.0  # beyond the fold as well
        assert np.min(np.abs(growth)) < 1e-6
    assert (tmp_path / "out" / "drive.png").stat().st_size > 10_000


@pytest.mark.parametrize("ramp", ["160:-80:1", "160:80:0", "160:160:1", "160:80", "a:b:c", "160:80:nan"])
def test_ramps_that_are_none(spinlev, tmp_path, ramp):
    path = tmp_path / "scene.toml"
    path.write_text(scene_text(SCENE))
    status, _, err = spinlev("simulate", path, "--ramp", ramp)
    assert status == 2
    assert err.count("Input --ramp must be FROM:TO:RATE") == 1


def test_a_duration_must_be_known(spinlev, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(scene_text(SCENE))
    status, _, err = spinlev("simulate", path)
    assert status == 2
    assert "--duration-s must be given" in err


def test_a_drive_that_is_longer_than_the_simulation():
    scene = replace(SCENE, drive=(DriveStep(100.0, 10.0),))
    with pytest.raises(InputError, match=r"Input drive must end within the 3 s .* its steps take 10 s"):
        Levitation(scene, DIPOLE).flight(3.0)


def test_a_plate_in_the_way_after_the_ramp():
    """At 110 Hz the floater is 19.9 mm below the rotor, at 95 Hz 23 mm: the plate leaves room for the first alone."""
    plate = Plate(Box((0.1, 0.1, 0.01), (0.0, 0.0, -0.033)), 3.5e7)
    scene = replace(SCENE, plate=plate, drive=(DriveStep(95.0, 1.0),))
    with pytest.raises(InputError, match=r"Input plate.center_mm must leave room .* where it levitates at 95 Hz"):
        Levitation(scene, DIPOLE).flight(1.0)
    Levitation(replace(scene, drive=(DriveStep(109.0, 0.01),)), DIPOLE).flight(0.02)


def test_sweeps_vary_a_drive():
    """Faster past the fold, later lost; three trajectories side by side."""
    scene = replace(SCENE, frequency=92.0, drive=(DriveStep(82.0, 0.5),))
    found = sweep(scene, {"drive.0.in_s": [0.5, 1.0, 2.0]}, "flight", "dipole", "none", duration_s=2.0)
    assert found["ended_by"].values.tolist() == ["lost"] * 3
    assert (np.diff(found["lost_at"].values) > 0.1).all()
    assert found["lost_at"].attrs["units"] == "Hz"


def test_python_takes_steps():
    found = simulate(SCENE, 0.05, "dipole", "none", drive=[{"to_hz": 120.0, "in_s": 0.04}])
    assert float(found["rotor_frequency"][-1]) == pytest.approx(120.0)
    assert "[[drive]]" in found.attrs["scene"]
    assert "motor_torque" not in simulate(SCENE, 0.05, "dipole", "none")


@pytest.mark.slow
def test_beside_the_ramp_of_a_cube_are_the_equilibria_of_its_mean(tmp_path):
    """Averaged over its own turn, through the fold to the other branch."""
    text = """frequency_hz = 100.0
    rotor = {configuration = "tilt", edge_mm = 10.0, angle_deg = 10.0, remanence_T = 1.3}
    floater = {shape = "cuboid", size_mm = [10.0, 10.0, 10.0], remanence_T = 1.3, density_kg_m3 = 7500.0}
    drive = [{to_hz = 99.0, in_s = 0.5}]"""
    (tmp_path / "cube.toml").write_text(text)
    levitation = Levitation(tmp_path / "cube.toml", Models("dipole", "none"))
    fold, other = levitation.branch[0], levitation.beyond_fold
    assert fold.parameter < 100.0
    assert other[-1].parameter == pytest.approx(100.0)
    here = min(levitation.branch, key=lambda point: abs(point.parameter - 100.0))
    assert abs(other[-1].state[2] - here.state[2]) > 1.0  # radii
