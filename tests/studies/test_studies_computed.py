"""The computing of studies, in coarse fields at few points, against scaling laws, searches and balances."""

from dataclasses import replace

import numpy as np
import pytest

from spinlev.dynamics.continuation import frequencies as stable_range
from spinlev.dynamics.continuation.frequencies import reference_state
from spinlev.dynamics.equilibria.balance import Balance
from spinlev.dynamics.equilibria.equilibrium import FOLD
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.rotor_effects import Mutual
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.mutual.making import cached_mutual_table
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.scene.files import changed
from spinlev.studies.catalogue import regions
from spinlev.studies.catalogue.article import rotor_scene
from spinlev.studies.catalogue.finite_magnets import dipole_vs_fem
from spinlev.studies.catalogue.margins import design, scene_of, sensitivity
from spinlev.studies.catalogue.regions import stability_map


def nearest(scene, model, distance):
    """The equilibrium whose distance is nearest to the given one, by a search that knows of no branch; or None."""
    found = find_equilibria(scene, rotor_table(scene.rotor, model))
    return min(found, key=lambda each: abs(each.distance - distance), default=None)


@pytest.fixture(scope="module")
def derived():
    """Derivatives and a sample of a rotor of point dipoles."""
    point = {"configuration": "horizontal", "measure": 2.0, "field": "dipole", "samples": 1}
    return sensitivity(point).isel(case=0)


NOMINAL = {
    "measure": 2.0,
    "rotor_remanence": 1.305,
    "floater_remanence": 1.305,
    "density": 7500.0,
    "edge": 10e-3,
    "diameter": 12.7e-3,
    "gravity": 9.81,
}


def changed_by_scale(derived, exponents):
    """First-order change of all quantities, per unit of ln λ, when each parameter goes with a power of λ."""
    by = derived["derivative"]
    parts = [power * NOMINAL[name] * by.sel(parameter=name) for name, power in exponents.items() if name in NOMINAL]
    at = np.concatenate([[0.0, 0.0], derived["frequency"]])
    return sum(parts).values + exponents["frequency"] * at * by.sel(parameter="frequency").values


@pytest.mark.slow
def test_all_derivatives_obey_a_change_of_the_unit_of_time(derived):
    """Rates × λ where accelerations are × λ²: by λ² for gravity and for the product of the remanences."""
    change = changed_by_scale(derived, {"gravity": 2, "rotor_remanence": 1, "floater_remanence": 1, "frequency": 1})
    nominal = derived["nominal"].values
    np.testing.assert_allclose(change[:2], nominal[:2], rtol=1e-6)
    np.testing.assert_allclose(change[2:], 0.0, atol=1e-6 * nominal[2:].max())


@pytest.mark.slow
def test_all_derivatives_obey_a_change_of_the_unit_of_length(derived):
    """All lengths × λ at the same Br and density: the force per mass is × 1/λ, so that all rates are, and gravity."""
    lengths = {"measure": 1, "edge": 1, "diameter": 1, "gravity": -1, "frequency": -1}
    change, nominal = changed_by_scale(derived, lengths), derived["nominal"].values
    np.testing.assert_allclose(change[:2], -nominal[:2], rtol=1e-6)
    np.testing.assert_allclose(change[2:], nominal[2:], rtol=1e-6)


@pytest.mark.slow
def test_a_sample_is_what_the_derivatives_foretell(derived):
    """Tolerances are small: the tangent plane gives the distances of whole equilibria but for second-order terms."""
    draws, by = derived["drawn"].values, derived["derivative"].values[:, 2:]
    moved = derived["sample"].values[:, 2:] - derived["nominal"].values[2:]
    assert np.all(np.abs(moved) > 3e-6)  # m
    assert np.all(np.abs(draws @ by - moved) < 0.1 * np.abs(draws) @ np.abs(by))


@pytest.mark.slow
def test_a_small_tilt_of_the_axis_moves_the_floater_in_second_order(derived):
    """By symmetry the mean distance is even in the tilt: 2° changes it four times as much as 1°."""
    upright, one, two = derived["leaning_distance"].values
    assert 0 < abs(one - upright) < 1e-6
    assert (two - upright) / (one - upright) == pytest.approx(4.0, rel=0.01)
    assert np.all(derived["leaning_growth"].values < 1e-6)


@pytest.mark.slow
def test_a_design_is_stable_up_to_its_margin():
    """A search finds it where it was wanted, and half a hertz beyond its ends nothing that is stable."""
    found = design({"configuration": "tilt", "distances_mm": [25.0], "frequency": 120.0}, rtol=1e-2).isel(case=0)
    measure, edge = float(found["measure"]), float(found["edge"])

    def stable(frequency):
        scene = changed(scene_of("tilt", measure, frequency), {"rotor.edge_mm": 1e3 * edge})
        return [e for e in find_equilibria(scene, rotor_table(scene.rotor, "cuboid")) if e.stable]

    assert stable(120.0)[0].distance == pytest.approx(25e-3, abs=1e-6)
    for end, beyond in (("lowest", -0.5), ("highest", 0.5)):
        assert not stable(float(found[end]) + beyond)
    ends = 120 - float(found["lowest"]), float(found["highest"]) - 120
    assert float(found["margin"]) == pytest.approx(min(ends) / 120)
    assert ends[0] == pytest.approx(ends[1], rel=1e-4)  # at the largest margin both ends are as far
    assert abs(float(found["true_distance"]) - 25e-3) < 1e-6
    # Its own field takes (μr - 1)/3 of a permeable cube's moment: the weaker one has to be tilted a little less.
    assert 0.95 < float(found["true_measure"] / found["measure"]) < 1.0


@pytest.fixture(scope="module")
def compared():
    """Levitation by every model, with finite elements of 1e-3 and answers of the lowest degrees."""
    point = {"configuration": "horizontal", "measure": 2.0, "steps": 1, "rtols": [1e-3, 1e-2]}
    return dipole_vs_fem(point).isel(case=0, step=0)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["dipole", "cuboid"])
def test_each_model_s_levitation_is_that_of_a_search(compared, model):
    frequency = float(compared["frequency"])
    there = nearest(
        rotor_scene("horizontal", 2.0, frequency, drag=False), model, float(compared["distance"].sel(model=model))
    )
    here = compared.sel(model=model)
    assert float(here["distance"]) == pytest.approx(there.distance, abs=1e-10)
    np.testing.assert_allclose(
        np.sort(here["mode_frequency"]), np.sort([m.frequency_hz for m in there.modes]), rtol=1e-6
    )


@pytest.mark.slow
def test_causes_go_the_way_that_physics_says(compared):
    """A floater of full remanence is the stronger one, and attraction by magnetised iron moves it nearer the rotor."""
    distance = compared["distance"]
    assert distance.sel(model="article") > distance.sel(model="dipole")
    assert distance.sel(model="mutual") < distance.sel(model="fem")
    assert list(compared["high_kind"].values) == ["oscillatory"] * 5
    assert np.all(compared["lowest"] < compared["frequency"])
    assert np.all(compared["frequency"] < compared["highest"])
    assert np.all(compared["distance_error"].sel(model=["fem", "mutual"]) < 1e-4)


@pytest.mark.slow
def test_with_mutual_magnetisation_a_fold_is_where_the_balance_has_a_double_root():
    """Force and torque vanish, and so does their change along one direction; it lies below the rigid dipole's."""
    scene = rotor_scene("tilt", 10.0, drag=False)
    table, start = rotor_table(scene.rotor, "dipole"), reference_state(scene)
    answers = cached_mutual_table(scene.rotor, scene.floater, print)[0]
    rates = Rates(Interaction(table, (Mutual(answers, scene.floater.moment),)))
    low, rigid = (stable_range.stable_range(scene, r, *start).low for r in (rates, Rates(table)))
    there = replace(scene, frequency=low.parameter)
    balance = Balance(rates, parameters(there, Scales.of(there), frozen_spin=True), 0.0)
    value, slope = balance(low.state[None, :3], low.state[None, 6:9])
    sizes = np.linalg.svd(slope[0])[1]
    assert low.kind == FOLD
    assert np.abs(value).max() < 1e-6
    assert sizes[-1] < 1e-3 * sizes[-2]
    assert 0 < rigid.parameter - low.parameter < 1


@pytest.mark.slow
def test_a_plate_below_damps_what_is_neutral_without_it():
    """Without drag nothing decays. Beside the fold the bounce is soft: the place moves by a millimetre or two."""
    asked = {"configuration": "vertical", "measure": 14.0, "model": "fem", "with_plate": 1}
    found = stability_map(asked, rtol=1e-2).isel(case=0)
    assert 60 < float(found["lowest"][0]) < 65
    assert found["high_kind"].values[0] == "oscillatory"
    tried = found.isel(tried=0)
    alone = rotor_scene("vertical", 14.0, float(tried["plate_frequency"]), drag=False)
    there = min(find_equilibria(alone, rotor_table(alone.rotor, "fem", 1e-2)), key=lambda each: each.growth_per_s)
    assert there.stable
    assert abs(there.growth_per_s) < 1e-6
    assert float(tried["plate_distance"]) == pytest.approx(there.distance, abs=2e-3)
    assert float(tried["plate_growth"]) < -0.1
    assert float(tried["plate_error"]) <= regions.PLATE_RTOL
    assert np.isnan(found["plate_frequency"].values[1:]).all()


def test_a_rotor_without_levitation_has_an_empty_row(monkeypatch):
    """Where attraction nowhere carries the weight there is no branch, and a search finds nothing."""
    scene = rotor_scene("horizontal", 2.0, drag=False)
    weak = replace(scene, floater=replace(scene.floater, remanence=1e-3))
    monkeypatch.setattr(regions.article, "rotor_scene", lambda *rotor, **changes: weak)
    asked = {"configuration": "horizontal", "measure": 2.0, "model": "dipole", "with_plate": 2}
    found = stability_map(asked)
    assert np.isnan(found["lowest"]).all()
    assert np.isnan(found["plate_frequency"]).all()
    assert find_equilibria(weak, rotor_table(weak.rotor, "dipole")) == []
