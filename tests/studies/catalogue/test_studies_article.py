"""The studies after the article's figures, at coarse points, against independent expectations."""

import numpy as np
import pytest

from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.fem.elements.magnetostatics import coulomb_field
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.scene.contents import Scene
from spinlev.studies.catalogue import article as formulas
from spinlev.studies.catalogue.article import CONFIGURATIONS, FLOATER, WEIGHT, rotor_scene, stable_in_flight
from spinlev.studies.catalogue.article_figures import (
    FIELD_MODELS,
    FORCE_MODELS,
    field_components,
    force_curve,
    side_mode,
)
from spinlev.studies.catalogue.article_flights import NONE, levitation_distance, trajectories
from spinlev.studies.catalogue.entries import CATALOGUE
from spinlev.studies.figures.style import figure_bytes
from spinlev.studies.study import by_case

ROTORS = [("horizontal", 2.0), ("vertical", 14.0), ("tilt", 10.0)]
ONE = {"configuration": "horizontal", "value": 1.0}


@pytest.mark.parametrize(("configuration", "value"), ROTORS)
def test_semi_analytic_force_is_the_dipoles_to_second_order(configuration, value):
    """At 60 mm (a, δx)/d is 3e-2, and r ≈ d leaves its square, times at most 8 (from 5 and 3 of the expansion)."""
    distance, frequency = 0.06, 30.0
    found = formulas.force(configuration, value, distance, frequency)
    scene = rotor_scene(configuration, value, frequency)
    field, gradient = rotor_table(scene.rotor, "dipole").evaluate([[float(found.side), 0.0, -distance]])
    angle = float(found.polar_angle)
    moment = FLOATER.moment * np.array([np.sin(angle), 0.0, np.cos(angle)])
    force = moment @ gradient[0, :, 2]
    tolerance = 8 * (2e-3 / distance) ** 2
    np.testing.assert_allclose(found.total, force, atol=tolerance * float(found.attracting - found.repelling))
    stiffness = FLOATER.inertia * (2 * np.pi * frequency) ** 2
    expected = -FLOATER.moment * field[0, 0] / (stiffness - FLOATER.moment * field[0, 2])
    np.testing.assert_allclose(angle, expected, rtol=tolerance)


@pytest.mark.parametrize("configuration", ["horizontal", "tilt"])
def test_the_analytic_distance_is_where_the_simple_force_vanishes(configuration):
    for value in CONFIGURATIONS[configuration].tested:
        for frequency in (50.0, 150.0, 250.0):
            distance = formulas.analytic_distance(configuration, value, frequency)
            force = formulas.force(configuration, value, distance, frequency, simple=True)
            assert abs(force.total) < 1e-12 * abs(force.attracting)


def test_the_semi_analytic_balance_carries_the_load_and_is_stable_near():
    near, far = formulas.balanced("vertical", 14.0, 80.0, WEIGHT)
    for distance, slope in ((near, 1), (far, -1)):
        step = 1e-6
        force = formulas.force("vertical", 14.0, distance + step * np.array([-1, 0, 1]), 80.0).total
        assert force[1] == pytest.approx(WEIGHT, rel=1e-9)
        assert (force[2] - force[0]) * slope > 0
    assert all(np.isnan(formulas.balanced("vertical", 14.0, 45.0, WEIGHT)))


@pytest.mark.parametrize(("configuration", "value"), ROTORS)
def test_field_components(configuration, value):
    asked = {"configuration": configuration, "value": value}
    closed = field_components({**asked, "model": "cuboid"}).isel(case=0)
    places = np.array([[0.0, 0.0, -d] for d in closed["distance"].values])
    expected = sum(coulomb_field(magnet, places) for magnet in rotor_scene(configuration, value, 100.0).rotor)
    np.testing.assert_allclose(closed["off_axis"], np.hypot(*expected.T[:2]), rtol=1e-11)
    np.testing.assert_allclose(closed["on_axis"], expected[:, 2], rtol=1e-11)
    dipole = field_components({**asked, "model": "dipole"}).isel(case=0)
    article = field_components({**asked, "model": "article"}).isel(case=0)
    for name in ("off_axis", "on_axis"):  # r ≈ d again, at 15 mm and farther
        np.testing.assert_allclose(article[name], dipole[name], rtol=8 * (2 / 15) ** 2)


@pytest.fixture(scope="module")
def distances():
    asked = {**ONE, "step_hz": 35.0, "flights": 3}
    return by_case([levitation_distance({**asked, "model": m}) for m in ("semi-analytic", "analytic", "dipole", "fem")])


@pytest.mark.slow
def test_levitation_distance_is_that_of_the_survey(distances):
    found = distances.isel(case=list(distances["model"].values).index("dipole"))
    frequency = 180.0
    scene = rotor_scene("horizontal", 1.0, frequency)
    known = find_equilibria(scene, rotor_table(scene.rotor, "dipole"))
    for side, equilibrium in zip(("near", "far"), known[:2], strict=True):
        here = found.sel(side=side, frequency=frequency)
        assert float(here["distance"]) == pytest.approx(-equilibrium.position[2], rel=1e-10)
        assert float(here["growth"]) == pytest.approx(equilibrium.growth_per_s, abs=1e-5)
        assert bool(stable_in_flight(here["growth"].values)) == (side == "near") == equilibrium.stable
    assert 145.0 < float(found["fold_frequency"]) < 180.0
    assert np.isnan(found["distance"].sel(frequency=145.0)).all()


@pytest.mark.slow
def test_flights_and_the_semi_analytic_formula_agree_with_the_equilibrium(distances):
    dipole, formula = (distances.isel(case=k) for k in (2, 0))
    near = dipole["distance"].sel(side="near")
    at = near.sel(frequency=dipole["flight_frequency"].values)
    # The bounce of 0.1 mm moves the mean by its square over the distance.
    np.testing.assert_allclose(dipole["flight_distance"], at, atol=1e-5)
    good = np.isfinite(near)
    np.testing.assert_allclose(formula["distance"].sel(side="near")[good], near[good], rtol=2e-3)


@pytest.mark.slow
def test_distance_error_bounds_what_the_permeability_changes(distances):
    dipole, fem = (distances.isel(case=k)["distance"].sel(side="near").values for k in (2, 3))
    bound = distances["distance_error"].isel(case=2).sel(side="near").values
    good = np.isfinite(dipole)
    assert good.sum() == 3
    assert (np.abs(dipole - fem)[good] < bound[good]).all()


def test_the_side_mode_balances_the_lateral_force():
    found = side_mode({**ONE, "model": "dipole", "step_hz": 105.0}).isel(case=0).sel(frequency=250.0)
    scene: Scene = rotor_scene("horizontal", 1.0, 250.0)
    table = rotor_table(scene.rotor, "dipole")
    (state,) = [e.state for e in find_equilibria(scene, table) if e.stable]
    _, gradient = table.evaluate(state.position)
    force = FLOATER.moment * state.moment @ gradient[:, 0]
    expected = -force / (FLOATER.mass * scene.angular_velocity**2)
    assert float(found["radius"]) == pytest.approx(expected, rel=1e-3)  # drag turns the circle a little
    radius = np.hypot(found["flight_x"], found["flight_y"])
    formula = formulas.side_radius(-found["flight_z"].mean(), 170.0)
    np.testing.assert_allclose(radius, formula, rtol=0.02)  # the article: "agrees very well"


@pytest.fixture(scope="module")
def forces():
    asked = {**ONE, "frequencies_hz": [170.0], "spacing": 5e-4}
    return by_case([force_curve({**asked, "model": model}) for model in FORCE_MODELS])


def test_tipping_points(forces):
    for model, simple in (("semi-analytic", False), ("small angles", True)):
        found = forces.isel(case=FORCE_MODELS.index(model), frequency=0)
        fine = np.linspace(float(found["near_tipping"]), float(found["far_tipping"]), 2001)
        force = formulas.force("horizontal", 1.0, fine, 170.0, simple).total - WEIGHT
        assert abs(np.trapezoid(force, fine)) < 3e-3 * np.trapezoid(np.abs(force), fine)  # the study's grid is coarse
        assert abs(force[-1]) < 1e-3 * WEIGHT
    for name in ("near_tipping", "far_tipping"):
        np.testing.assert_allclose(forces[name], forces[name].mean(), rtol=0.02)
    assert (forces["near_tipping"] < forces["equilibrium"]).all()


def test_force_curve_passes_the_equilibrium(forces, distances):
    scene = rotor_scene("horizontal", 1.0, 170.0)
    (known,) = [e for e in find_equilibria(scene, rotor_table(scene.rotor, "dipole")) if e.stable]
    found = forces.isel(case=FORCE_MODELS.index("dipole"), frequency=0)
    assert float(found["equilibrium"]) == pytest.approx(-known.position[2], rel=1e-4)
    assert np.degrees(float(found["angle_equilibrium"])) == pytest.approx(known.polar_angle_deg, rel=1e-3)


@pytest.mark.slow
def test_kinds_of_flight():
    found = trajectories({**ONE, "model": "dipole", "duration_s": 1.0}).isel(case=0)
    assert found["kind"].values.tolist()[:3] == [NONE] * 3
    assert set(found["kind"].values.tolist()[3:]) <= {"stable", "drifting"}  # the spin moves from the first second on
    flown = found.sel(frequency=200.0)
    assert float(flown["energy_error"]) < 1e-12
    np.testing.assert_allclose(flown["mean"], 16.13e-3, atol=0.1e-3)  # it sinks by 0.05 mm in this second
    assert found["levitated"].values.tolist()[3:] == [1.0] * 3


@pytest.mark.slow
def test_figures_and_reports_come_from_the_result_alone(distances, forces, tmp_path):
    field = by_case(
        [
            field_components(
                {"configuration": name, "value": value, "model": "cuboid" if model == "fem" else model}
            ).assign(model=("case", [model]))
            for name, kind in CONFIGURATIONS.items()
            for value in kind.tested[:1]
            for model in FIELD_MODELS
        ]
    )
    for name, result in {"levitation-distance": distances, "force-curve": forces, "field-components": field}.items():
        for figure, draw in CATALOGUE[name].figures.items():
            (tmp_path / f"{figure}.png").write_bytes(figure_bytes(draw(result), "png"))
        lines = CATALOGUE[name].report(result)
        assert lines
        assert not any("unknown" in line for line in lines)


def test_every_parameter_of_the_article_is_asked():
    points = CATALOGUE["levitation-distance"].points(False)
    rotors = {(p["configuration"], p["value"]) for p in points if p["model"] == "fem"}
    assert rotors == {(n, v) for n, kind in CONFIGURATIONS.items() for v in kind.tested}
    assert len(rotors) == 8 + 6 + 9
