"""Flights of a sweep go side by side in lanes, and each is the one that it is alone."""

import numpy as np
import pytest

import spinlev as sl
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor.table import RotorTable
from spinlev.studies.cli.options import Models, combinations
from spinlev.studies.question import Question

ROTOR = sl.horizontal(displacement_mm=2.0, edge_mm=10.0, remanence_T=1.305, recoil_permeability=1.0)
SCENE = sl.scene(
    frequency_hz=110.0,
    rotor=ROTOR,
    floater=sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0, recoil_permeability=1.0),
    start={"offset_mm": [0.0, 0.0, 0.2]},
)
TABLE = RotorTable("moments", SCENE.rotor, (), tuple(uniform_moments(m, 13) for m in SCENE.rotor))
"""As long as one of finite elements."""


@pytest.fixture
def long_table(monkeypatch):
    monkeypatch.setattr("spinlev.fem.rotor.choice.rotor_table", lambda *given: TABLE)


def asked(**values):
    models = Models("cuboid", "none", interaction="rigid")
    return Question(SCENE, "scene", "flight", models, 0.0, 0.4, (0.0, 0.0, -0.02)), combinations(values)


@pytest.mark.parametrize(
    "values",
    [
        pytest.param({"start.offset_mm.2": [0.05, 0.4, 2.5], "start.offset_mm.0": [0.0, 0.1]}, marks=pytest.mark.slow),
        {"frequency_hz": [105.0, 110.0, 115.0]},
    ],
)
def test_flights_together_are_those_alone(long_table, values):
    """Samples, ledger and end; by both ways through the same balls, so that only round-off is between them."""
    question, points = asked(**values)
    made = [question.levitation(point) for point in points]
    jobs = question.prepared(points)
    together = [job.args[1] for job in jobs]
    assert all(0.4 in levitation.simulated for levitation in together)
    for alone, shared, job in zip(made, together, jobs, strict=True):
        expected, found = alone.flight(0.4), shared.flight(0.4)
        assert found.ended_by == expected.ended_by
        assert len(found.time) == len(expected.time)
        np.testing.assert_allclose(found.time, expected.time, rtol=1e-10, atol=0)
        assert np.abs(found.lab.position - expected.lab.position).max() < 1e-10 * 0.02
        assert np.abs(found.lab.moment - expected.lab.moment).max() < 1e-10
        assert found.field_changes.count == expected.field_changes.count
        assert found.field_changes.energy == pytest.approx(expected.field_changes.energy, rel=1e-5, abs=1e-13)
        assert found.energy_error < 1e-12
        assert job()["levitated"].values[0] == found.levitated_s


def test_a_flight_that_cannot_begin_leaves_the_others(long_table, tmp_path):
    """One start in contact: it is named, the other two fly."""
    found = sl.sweep(
        SCENE,
        {"start.offset_mm.2": [0.05, 9.0, 0.1]},
        ask="flight",
        model="cuboid",
        plate_model="none",
        interaction="rigid",
        duration_s=0.2,
        out=tmp_path,
    )
    np.testing.assert_array_equal(np.isfinite(found["levitated"]), [True, False, True])
    assert "inside one of them" in found.attrs["failed_points"]


@pytest.mark.slow
def test_cubes_of_a_sweep_are_simulated_together():
    """At two frequencies and from two places each: code with runtime parameters in it, where each alone has numbers."""
    cube = {"shape": "cuboid", "size_mm": [10.0, 10.0, 10.0], "remanence_T": 1.305, "density_kg_m3": 7500.0}
    begin = {"position_mm": [0.6, 0.0, -19.0], "velocity_mm_s": [0.0, 400.0, 0.0], "moment": [0.24, 0.0, 0.97]}
    scene = sl.scene(frequency_hz=110.0, rotor=ROTOR, floater=cube, start=begin)
    question = Question(
        scene, "scene", "flight", Models("dipole", "none", interaction="rigid"), 0.0, 0.03, (0, 0, -0.02)
    )
    points = combinations({"frequency_hz": [105.0, 110.0], "start.position_mm.2": [-19.0, -19.5]})
    jobs = question.prepared(points)
    for point, job in zip(points, jobs, strict=True):
        alone, found = question.levitation(point).flight(0.03), job.args[1].simulated[0.03]
        assert found.ended_by == alone.ended_by == "duration"
        np.testing.assert_array_equal(found.time, alone.time)
        assert np.abs(found.lab.position - alone.lab.position).max() < 1e-12
        assert np.abs(found.lab.axes - alone.lab.axes).max() < 1e-10
        assert found.energy_error < 1e-12
