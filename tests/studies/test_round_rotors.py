"""Rotors of round magnets through the whole program: balance of forces with magpylib's field, and a flight."""

from types import SimpleNamespace

import magpylib
import numpy as np
import pytest

import spinlev as sl
from spinlev.geometry.shapes import rotation_matrix
from spinlev.studies import effects

BALL = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0, recoil_permeability=1.0)
TILT = [0.0, -8.0, 0.0]
MATERIAL = {"center_mm": [0.0, 0.0, 0.0], "rotation_deg": TILT, "polarization_T": [1.3, 0.0, 0.0]}
CYLINDER = {"shape": "cylinder", "diameter_mm": 12.0, "height_mm": 10.0, "recoil_permeability": 1.0, **MATERIAL}
RING = {**CYLINDER, "shape": "ring", "diameter_mm": 14.0, "inner_diameter_mm": 6.0}


def theirs(body):
    """B (n, 3) T of magpylib's magnet at points (n, 3) m."""
    turn, half = rotation_matrix(TILT), body["height_mm"] / 2e3
    outer, inner = body["diameter_mm"] / 2e3, body.get("inner_diameter_mm", 0.0) / 2e3
    source = magpylib.magnet.CylinderSegment(dimension=(inner, outer, 2 * half, 0, 360), polarization=(1.3, 0, 0))
    return lambda points: source.getB(points @ turn).reshape(-1, 3) @ turn.T


@pytest.mark.parametrize("body", [CYLINDER, pytest.param(RING, marks=pytest.mark.slow)])
def test_in_balance_magpylibs_field_carries_the_weight_and_holds_the_floater_on_its_circle(body):
    """F = ∇(m·B) = M g z - M ω² (x, y), and no torque beside what turns the moment."""
    scene = sl.scene(frequency_hz=160.0, rotor=sl.magnets(body), floater=BALL)
    levitation = sl.Levitation(scene, sl.Models("cuboid", interaction="rigid"))
    found, field, step = levitation.equilibria[0], theirs(body), 1e-5
    moment = scene.floater.moment * found.state.moment
    around = found.position + step * np.concatenate([np.eye(3), -np.eye(3)])
    force = np.diff((field(around) @ moment).reshape(2, 3)[::-1], axis=0)[0] / (2 * step)
    mass, turning = scene.floater.mass, scene.angular_velocity
    wanted = mass * np.array([0, 0, 9.81]) - mass * turning**2 * found.position * [1, 1, 0]
    assert force == pytest.approx(wanted, abs=3e-6 * np.linalg.norm(wanted))  # the differences err as (step/distance)²
    torque = np.cross(moment, field(found.position[None])[0])
    spin = found.state.spin  # the change of I Ω, which turns with the rotor
    assert torque == pytest.approx(
        scene.floater.inertia * np.cross([0, 0, turning], spin), abs=1e-5 * abs(torque).max()
    )


def test_a_flight_under_a_cylinder_stays_up_and_its_ledger_closes():
    scene = sl.scene(frequency_hz=160.0, rotor=sl.magnets(CYLINDER), floater=BALL)
    flown = sl.simulate(scene, 0.05, model="cuboid", interaction="rigid")
    assert flown.attrs["ended_by"] == "duration"
    assert flown.attrs["energy_error"] < 1e-10


def of_spheres(**more):
    """A sphere with μr = 1 is exactly its dipole: whatever follows from its field is known from the dipole's."""
    rotor = sl.tilt(angle_deg=7.5, shape="sphere", diameter_mm=19.0, remanence_T=1.2, recoil_permeability=1.0)
    return sl.scene(frequency_hz=130.0, rotor=rotor, floater=BALL, **more)


@pytest.mark.slow
@pytest.mark.parametrize("plate_model", ["slab", "reduced"])
def test_over_a_plate_a_rotor_of_a_sphere_is_one_of_a_dipole(plate_model):
    plate = sl.plate(size_mm=[100.0, 240.0, 30.0], center_mm=[0.0, 0.0, -65.0], conductivity_S_m=3.5e7)
    pair = [sl.equilibria(of_spheres(plate=plate), model=m, plate_model=plate_model) for m in ("cuboid", "dipole")]
    sphere, dipole = (found.isel(equilibrium=0) for found in pair)
    assert sphere.position.values == pytest.approx(dipole.position.values, abs=1e-9)
    assert float(sphere.growth) == pytest.approx(float(dipole.growth), rel=1e-6)
    assert float(sphere.growth) < -1.0


@pytest.mark.slow
def test_a_map_of_sphere_rotors_is_that_of_dipoles():
    asked = {"rotor.angle_deg": [6.5, 7.5, 8.5], "frequency_hz": [130.0, 140.0]}
    pair = [sl.sweep(of_spheres(), {**asked, "model": [m]}, ask="equilibria", workers=1) for m in ("cuboid", "dipole")]
    sphere, dipole = (found.distance.values for found in pair)
    assert np.isfinite(sphere).any()
    assert sphere == pytest.approx(dipole, abs=1e-9, nan_ok=True)


def test_in_a_rings_hole_nobody_says_how_large_currents_in_it_would_be(monkeypatch):
    """A ball in the ring's place, whose losses are told elsewhere, would be around the floater: 1e13 /s were said."""
    scene = sl.scene(
        frequency_hz=100.0, rotor=sl.magnets({**RING, "diameter_mm": 20.0, "height_mm": 3.0}), floater=BALL
    )
    told = {}
    monkeypatch.setattr(
        effects, "growth_by_rotor", lambda _, there, *rest: float(told.setdefault(there.position[2], -2.0))
    )
    for height in (-1e-5, -20e-3):
        there = SimpleNamespace(position=np.array([0.0, 0.0, height]), without=None, kind="")
        listed = effects._rotor_currents(sl.Levitation(scene), there)
        assert (listed.growth_per_s is None) == ("so near" in listed.why) == (height > -10e-3)
    assert list(told) == [-20e-3]
