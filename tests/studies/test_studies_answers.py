"""The studies that answer the mission: each against something that does not share its way."""

from dataclasses import replace

import numpy as np
import pytest
from second_opinions.magnet_elements import element_ladder

from spinlev.dynamics.continuation.frequencies import at_frequency, levitating_ranges, reference_state, stable_range
from spinlev.dynamics.equilibria.balance import Balance
from spinlev.dynamics.equilibria.perturbed import shifted_equilibrium
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.events import rotor_gap
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.rotor_effects import Mutual
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.mutual.making import cached_mutual_table
from spinlev.fem.mutual.response import two_body
from spinlev.fem.rotor.choice import cached_rotor_table, rotor_table
from spinlev.geometry.scene.files import changed
from spinlev.studies.catalogue.article import FLOATER, rotor_scene
from spinlev.studies.catalogue.finite_magnets import CAUSES, TOTAL, change, dipole_vs_fem
from spinlev.studies.catalogue.margins import PARAMETERS, QUANTITIES, Slopes, scene_of
from spinlev.studies.catalogue.regions import stability_map


@pytest.fixture(scope="module")
def tilted():
    """Scene, rates and stable range of the cube tilted by 10° in the field of point dipoles."""
    scene = rotor_scene("tilt", 10.0, drag=False)
    rates = Rates(rotor_table(scene.rotor, "dipole"))
    return scene, rates, stable_range(scene, rates, *reference_state(scene))


@pytest.fixture(scope="module")
def horizontal():
    return Slopes.of("horizontal", 2.0)


def test_stability_ends_where_the_bodies_touch(tilted):
    """A dipole has no size, so that only the geometry ends its levitation at high frequency."""
    scene, _, found = tilted
    assert found.high.kind == "contact"
    assert abs(rotor_gap(scene, found.high.position)) < 1e-7


def test_a_range_ends_where_a_survey_says_so(tilted):
    """Beside the fold a search that knows nothing of the branch finds the pair of equilibria, or none."""
    scene, rates, found = tilted
    table = rotor_table(scene.rotor, "dipole")

    def near(frequency):
        there = find_equilibria(replace(scene, frequency=frequency), table, rates=rates)
        return [e.stable for e in there if abs(e.distance - found.low.distance) < 1e-3]

    assert found.low.kind == "fold"
    assert near(found.low.parameter + 0.01) == [True, False]
    assert near(found.low.parameter - 0.01) == []


def test_a_narrow_range_is_found_and_a_survey_confirms_it():
    """δx = 5 mm levitates over 4 Hz only, which a search at a few frequencies would miss."""
    scene = rotor_scene("horizontal", 5.0, drag=False)
    table = rotor_table(scene.rotor, "dipole")
    rates = Rates(table)
    (found,) = levitating_ranges(scene, table, rates)
    assert (found.low.kind, found.high.kind) == ("fold", "oscillatory")
    assert 0 < found.high.parameter - found.low.parameter < 5
    middle = (found.low.parameter + found.high.parameter) / 2
    stable = [e for e in find_equilibria(replace(scene, frequency=middle), table, rates=rates) if e.stable]
    assert min(abs(e.distance - at_frequency(scene, rates, found.near(middle), middle).distance) for e in stable) < 1e-9


def test_vertical_range_against_known_numbers():
    """PHYSICS.md, dipoles of μr = 1: with 14 mm none at 60 Hz, stable at 80 Hz, unstable from about 100 Hz."""
    point = {"configuration": "vertical", "measure": 14.0, "model": "dipole", "with_plate": 0}
    result = stability_map(point).isel(case=0, interval=0)
    assert 60 < float(result["lowest"]) < 80 < float(result["highest"]) < 100
    assert result["low_kind"].item() == "fold"
    assert result["high_kind"].item() == "oscillatory"


@pytest.mark.slow
def test_remanence_and_density_enter_only_as_a_ratio(horizontal):
    """Accelerations are those of gravity and Br Br'/density: their logarithmic derivatives are one number."""
    values = {"rotor_remanence": 1.305, "floater_remanence": 1.305, "density": 7500.0}
    slopes = dict(zip(PARAMETERS, horizontal.derivatives, strict=True))
    rows = [slopes[name] * value for name, value in values.items()]
    np.testing.assert_allclose(rows[1], rows[0], rtol=1e-6)
    np.testing.assert_allclose(rows[2], -rows[0], rtol=1e-6)


@pytest.mark.slow
def test_distance_of_a_sample_is_that_of_a_survey(horizontal):
    off = {"measure": 0.05, "edge": 0.03e-3, "density": -50.0}
    draw = np.array([off.get(name, 0.0) for name in PARAMETERS])
    found = dict(zip(QUANTITIES, horizontal.off(draw), strict=True))
    larger = {"rotor.edge_mm": 10.03, "floater.density_kg_m3": 7450.0}
    scene = changed(scene_of("horizontal", 2.05, float(horizontal.grid[1])), larger)
    expected = next(e for e in find_equilibria(scene, rotor_table(scene.rotor, "cuboid")) if e.stable)
    assert found["distance at 50%"] == pytest.approx(expected.distance, abs=1e-10)


@pytest.mark.slow
def test_mutual_magnetisation_moves_the_floater_as_the_perturbed_balance_says(tilted):
    """The table's energy in the equations, against Broyden's method with the magnetostatics of both bodies."""
    scene, _, found = tilted
    (rotor,) = element_ladder(scene.rotor, (2,))
    there = replace(scene, frequency=120.0)
    table = cached_rotor_table(scene.rotor, "fem", 3e-6, print, FLOATER.radius)[0]  # both bodies' field is the true one
    rates = Rates(table)
    effect = Mutual(cached_mutual_table(scene.rotor, FLOATER, print)[0], FLOATER.moment)
    together = at_frequency(there, Rates(Interaction(table, (effect,))), found.near(120.0), 120.0)
    scales = Scales.of(there)
    balance = Balance(rates, parameters(there, scales, frozen_spin=True), 0.0)
    rigid = at_frequency(there, rates, found.near(120.0), 120.0)

    def extra(position, moment):
        both = two_body(rotor, FLOATER, position, moment)
        added = both.total - both.rigid
        return added.force, added.torque

    _, shifted = shifted_equilibrium(there, balance, rigid.position, rigid.state[6:9], extra)
    assert np.linalg.norm(shifted - rigid.position) > 2e-5
    np.testing.assert_allclose(together.position, shifted, atol=1e-7)


@pytest.mark.slow
def test_causes_add_up_and_the_default_scene_is_met():
    """README: in the default rotor at 110 Hz the point dipole (floater's moment true) is 0.067 mm too far away."""
    point = {"configuration": "horizontal", "measure": 2.0, "steps": 3, "rtols": [1e-5, 1e-4]}
    result = dipole_vs_fem(point)
    parts = sum(change(result, "distance", models)[0] for models in CAUSES.values())
    np.testing.assert_allclose(parts, change(result, "distance", TOTAL)[0], atol=1e-15)
    apart = (result["distance"].sel(model="fem") - result["distance"].sel(model="dipole")).values[0]
    frequency = result["frequency"].values[0]
    assert frequency[0] < 110 < frequency[-1]
    assert 1e3 * np.interp(110.0, frequency, apart) == pytest.approx(-0.067, abs=0.03)
