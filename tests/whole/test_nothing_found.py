"""Where a search has nothing to find, a problem is degenerate or the system refuses: what is said or done instead."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from article import FLOATER, SCENE
from second_opinions.solids import Conductor, occ_mesh

from spinlev.dynamics.continuation import frequencies
from spinlev.dynamics.continuation.frequencies import way_out
from spinlev.dynamics.continuation.slow_drift import drift
from spinlev.dynamics.equilibria.balance import EVERY, Balance, solve
from spinlev.dynamics.equilibria.equilibrium import EquilibriumError
from spinlev.dynamics.equilibria.perturbed import TILTS, balanced_directions, shifted_equilibrium
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.closed_forms.potentials import Racetrack
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.common import MU_0
from spinlev.geometry.cutting import CONVERGENCE, cut_magnets
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.meshes.plate import Block, ConductorMesh, graded_partition, hex_mesh
from spinlev.geometry.scene.contents import Plate
from spinlev.geometry.shapes import Box, rotation_matrix

TABLE = rotor_table(SCENE.rotor, "dipole")
WEAK = replace(SCENE, floater=replace(FLOATER, remanence=1e-3))
"""A floater that no distance up to 0.1 m lets levitate."""


@pytest.fixture(scope="module")
def rates():
    return Rates(TABLE)


@pytest.fixture(scope="module")
def stable(rates):
    return next(e for e in find_equilibria(SCENE, TABLE, rates=rates) if e.stable)


class Spring:
    """A balance that does not know of the moment, so that its matrix is singular to the last bit."""

    def at(self, active):
        return self

    def about(self, position, moment):
        return self

    def __call__(self, position, moment):
        slope = np.zeros((len(position), 5, 5))
        slope[:, :3, :3] = np.eye(3)
        return np.pad(position - [0.1, 0.2, -3.0], ((0, 0), (0, 2))), slope


def test_newton_takes_the_shortest_way_where_a_matrix_is_singular():
    moments = np.array([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])
    places, turned, step = solve(Spring(), np.array([[0.0, 0.0, -2.0], [1.0, 1.0, -3.0]]), moments, EVERY)
    np.testing.assert_allclose(places, np.tile([0.1, 0.2, -3.0], (2, 1)), atol=1e-14)
    np.testing.assert_allclose(turned, moments, atol=1e-14)
    assert np.all(step < 1e-11)


def test_gravity_across_the_axis_beyond_what_holds_the_floater(rates, stable):
    """With a tenth of gravity to the side it stays, with six times gravity no periodic motion is left to be found."""
    found = [replace(SCENE, gravity=np.array([side, 0.0, -9.81])) for side in (1.0, 60.0)]
    mild, strong = (find_equilibria(scene, TABLE, rates=rates) for scene in found)
    assert np.linalg.norm(mild[0].position - stable.position) < 1e-3
    assert all(np.linalg.norm(each.position - stable.position) > 5e-3 for each in strong)


def test_no_frequency_helps_a_floater_without_strength(monkeypatch):
    """The way out names no frequency, and a drift has nowhere to begin."""
    monkeypatch.setattr(frequencies, "WIDEST", 1.2)
    assert "from 91.67 to 132 Hz either. To simulate anyway, set start.position_mm" in way_out(WEAK, TABLE, ())
    with pytest.raises(EquilibriumError, match=r"At 110 Hz the floater has no equilibrium with body spin 0\.25"):
        drift(WEAK, TABLE, spin=0.25)


def test_a_frequency_that_the_plates_table_does_not_reach_is_still_named():
    """At 60 Hz nothing levitates; from some 90 Hz it does, where this plate's table, up to 70 Hz, has no currents."""
    low = replace(SCENE, frequency=60.0, plate=Plate(Box((0.1, 0.1, 0.01), (0.0, 0.0, -0.05)), 3.5e7))
    memory = SimpleNamespace(table=SimpleNamespace(frequencies=(50.0, 70.0)))
    said = way_out(low, TABLE, (), memory=memory)
    assert "Hz without eddy currents in the plate, which are not computed there" in said
    named = float(re.search(r"possible at about ([\d.]+) Hz", said)[1])
    assert any(e.stable for e in find_equilibria(replace(SCENE, frequency=named), TABLE))
    assert "currents" not in way_out(replace(low, plate=None), TABLE, ())


@pytest.fixture(scope="module")
def balance(rates):
    return Balance(rates, parameters(SCENE, Scales.of(SCENE), frozen_spin=True), 0.0)


def test_the_balanced_direction_feels_no_torque(balance):
    """At any place near the axis."""
    place = np.array([[1e-3, 2e-3, -0.025]])
    found = balanced_directions(SCENE, balance, place, 0.0, np.array([0.2, 0.0, np.sqrt(0.96)]))
    assert np.abs(balance(place / FLOATER.radius, found)[0][0, TILTS]).max() < 1e-9
    assert np.linalg.norm(found) == pytest.approx(1.0)


def test_an_additional_force_that_throws_the_floater_out_leaves_no_place(stable, balance):
    """Ten times the weight upwards; a linear estimate there is, but no equilibrium."""
    lift = -10 * FLOATER.mass * SCENE.gravity
    linear, found = shifted_equilibrium(
        SCENE, balance, stable.position, stable.state.moment, lambda place, moment: (lift, np.zeros(3))
    )
    assert np.isnan(found).all()
    assert np.isfinite(linear).all()


def test_a_flat_magnet_is_cut_into_pieces_that_converge():
    """Volume and moment are kept, each piece is inside, and a point at the nearest distance is beyond its series."""
    turned = rotation_matrix((10.0, 20.0, 30.0))
    whole = Magnet(Box((20e-3, 20e-3, 2e-3), (1e-3, 2e-3, 3e-3), turned), (0.3, 0.4, 1.0), 1.05)
    nearest = 4e-3
    (pieces,) = cut_magnets([whole], nearest)
    assert len(pieces) > 4
    np.testing.assert_allclose(sum(piece.moment for piece in pieces), whole.moment, rtol=1e-12)
    for piece in pieces:
        assert np.all(
            np.abs(whole.box.to_body(piece.box.center)) + piece.box.half_edges <= whole.box.half_edges + 1e-12
        )
        assert nearest + piece.box.half_edges.min() >= CONVERGENCE * piece.box.circumradius * (1 - 1e-12)
    assert cut_magnets([whole], 0.1) == ((whole,),)


def test_a_round_coil_has_the_field_of_a_thick_solenoid():
    """A racetrack without straight parts: B on the axis in closed form, j μ0 h/2 · asinh terms."""
    inner, outer, height, turns = 0.02, 0.03, 0.04, 500.0
    coil = Racetrack(np.zeros(3), (2 * outer, 2 * outer), height, inner, outer, turns)
    z = np.array([0.0, 0.01, 0.05])

    def part(end):
        return end * (np.arcsinh(outer / np.abs(end)) - np.arcsinh(inner / np.abs(end)))

    expected = MU_0 * turns / (2 * height * (outer - inner)) * (part(height / 2 - z) + part(height / 2 + z))
    field = coil.flux_density(np.column_stack([0 * z, 0 * z, z]))
    np.testing.assert_allclose(field[:, 2], expected, rtol=1e-7)
    np.testing.assert_allclose(field[:, :2], 0.0, atol=1e-12)


def air_cube():
    lines = [np.array([-10.0, 0.0, 10.0])] * 3
    return hex_mesh(lines, [Block("plate", np.zeros(3), np.full(3, 10.0))])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ConductorMesh(air_cube(), {"iron": 1e7}), r"must name one of \['air', 'plate'\]; .* received iron"),
        (lambda: ConductorMesh(air_cube(), {"plate": 0.0}), "conductivity of plate must be positive, S/m; .* 0.0"),
        (lambda: graded_partition([0.0, 2.0, 1.0], np.ones_like), r"must increase; .* \[0.0, 2.0, 1.0\]"),
        (lambda: occ_mesh({}), "at least one conductor; .* none"),
        (lambda: occ_mesh({"rod": Conductor(None, 1e7, 0.0)}), "cell_mm of rod must be positive; .* 0.0"),
    ],
    ids=["name", "conductivity", "breakpoints", "no conductor", "cell"],
)
def test_meshes_that_make_no_sense_are_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()


@pytest.mark.parametrize(("change", "what"), [("rotor", "rotor"), ("floater", "floater")])
def test_what_is_not_magnetised_has_no_equilibria_and_is_said(change: str, what: str):
    bare = replace(SCENE.rotor[0], polarization=np.zeros(3))
    scenes = {
        "rotor": replace(SCENE, rotor=(bare,)),
        "floater": replace(SCENE, floater=replace(FLOATER, remanence=0.0)),
    }
    scene = scenes[change]
    with pytest.raises(EquilibriumError, match=f"Nothing levitates: the {what} is not magnetised"):
        find_equilibria(scene, rotor_table(scene.rotor, "dipole"))
