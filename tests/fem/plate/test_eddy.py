"""Eddy-current solver: exact sphere and slab, limits, gauge, symmetry, energy."""

from __future__ import annotations

import numpy as np
import pytest
from second_opinions.dipole_derivative import DipoleDerivative
from second_opinions.phasor import mean_loss

from spinlev.fem.closed_forms.potentials import Dipole, PolarizedCuboid, unit_dipoles
from spinlev.fem.elements.spaces import Parity, tree_edges
from spinlev.fem.plate.eddy import solve_eddy
from spinlev.fem.plate.slab import Slab, mutual_tensor, reaction_tensor
from spinlev.geometry.common import MU_0
from spinlev.geometry.meshes.plate import Block, ConductorMesh, MeshRule, hex_mesh, plate_mesh
from spinlev.geometry.shapes import Box, Cylinder

SIZE, SIGMA = (0.1, 0.24, 0.03), 3.5e7
PLACES = np.array([[0.01, -0.02, 0.035], [0.0, 0.0, 0.04]])


@pytest.fixture(scope="module")
def coarse():
    """A mesh on which order 2 is good to some 1e-2: enough for identities that hold on any mesh."""
    return plate_mesh(Box(SIZE), SIGMA, PLACES, 100.0, MeshRule(2.0, 4.0, 3.0))


@pytest.fixture(scope="module")
def response(coarse):
    return solve_eddy(coarse, 2, 100.0, unit_dipoles(PLACES))


def test_couplings_are_reciprocal(response):
    found = response.couplings
    assert found == pytest.approx(found.T, rel=1e-9, abs=1e-10 * abs(found).max())  # of the direct solver


def test_receivers_are_sources(response):
    receivers = response.couplings_to(unit_dipoles(PLACES[:1]))
    assert receivers == pytest.approx(response.couplings[:3], rel=1e-12)


def test_derivative_receiver_is_the_derivative_of_the_coupling(response):
    place, moment, direction, step = PLACES[0], np.array([0.2, 0.5, -1.0]), np.array([0.6, 0.0, 0.8]), 1e-4
    ends = [Dipole(place + s * step * direction, moment) for s in (2, 1, -1, -2)]
    difference = np.array([-1, 8, -8, 1]) @ response.couplings_to(ends) / (12 * step)
    found = response.couplings_to([DipoleDerivative(place, moment, direction)])[0]
    assert found == pytest.approx(difference, rel=1e-6, abs=1e-7 * abs(found).max())  # (step/h)⁴ ~ 6e-10


def test_small_cube_magnet_induces_as_a_dipole(response):
    """A cube has no l = 3 moment: a 2 mm cube at 20 mm differs from the dipole by (1 mm / 20 mm)⁴ ~ 1e-5."""
    moment = np.array([1.0, -2.0, 0.5])
    cube = PolarizedCuboid(Box((2e-3,) * 3, PLACES[0]), moment * MU_0 / 8e-9)
    found = response.couplings_to([cube])[0]
    assert found == pytest.approx(moment @ response.couplings[:3], rel=1e-4, abs=1e-5 * abs(found).max())


def test_dissipation_is_positive_for_any_moments(response):
    rng = np.random.default_rng(3)
    moments = rng.normal(size=(200, 6)) + 1j * rng.normal(size=(200, 6))
    work = np.einsum("ni,ij,nj->n", moments.conj(), response.couplings, moments)
    assert (work.imag < 0).all()
    assert (mean_loss(response.couplings[:3, :3], moments[:, :3], 100.0) > 0).all()


def test_parity_classes_add_up_to_the_full_problem(coarse):
    """The same discrete problem without using the mirrors: mirrored grid lines, no boundary at the planes."""
    full = solve_eddy(unfolded(coarse), 1, 100.0, unit_dipoles(PLACES)).couplings
    eighth = solve_eddy(coarse, 1, 100.0, unit_dipoles(PLACES)).couplings
    assert eighth == pytest.approx(full, rel=1e-8, abs=1e-9 * abs(full).max())  # identical but for round-off


def unfolded(conductors):
    """The whole of a mirrored structured mesh."""
    points = np.array([v.point for v in conductors.mesh.vertices])
    lines = [np.unique(np.round(points[:, a], 9)) for a in range(3)]
    lines = [np.concatenate([-line[:0:-1], line]) for line in lines]
    half = np.array(SIZE) * 500
    return ConductorMesh(hex_mesh(lines, [Block("plate", -half, half)]), {"plate": SIGMA})


def test_low_frequency_is_linear_down_to_zero(coarse):
    """Im G ∝ f and Re G ∝ f² from above the switch to the resistive limit (0.6 mHz) to far below it."""
    low, lowest, zero = (solve_eddy(coarse, 2, f, unit_dipoles(PLACES)).couplings for f in (1e-2, 1e-9, 0.0))
    diagonal = np.diag(low)
    # (ωτ)² with τ ~ 10 ms is 4e-7 at 1e-2 Hz; Re G is 1e-5 of G there, and keeps five digits less
    assert np.diag(lowest).imag * 1e7 == pytest.approx(diagonal.imag, rel=1e-6)
    assert np.diag(lowest).real * 1e14 == pytest.approx(diagonal.real, rel=1e-3)
    assert not zero.any()


@pytest.mark.slow
def test_high_frequency_shields_perfectly():
    """At 1 MHz (δ = 85 µm) the normal reaction of a plate much larger than the height is the image's."""
    height = 0.008
    place = [(0.0, 0.0, 0.015 + height)]
    mesh = plate_mesh(Box((0.2, 0.2, 0.03)), SIGMA, place, 1e6, MeshRule(1.5, 3.0, 3.0))
    found = solve_eddy(mesh, 3, 1e6, [Dipole(place[0], (0, 0, 1.0))]).couplings[0, 0]
    exact = reaction_tensor(Slab(SIGMA, 0.03), height, 1e6)[2, 2]
    print(f"\n1 MHz: {found.real / exact.real - 1:.1e}")
    assert found.real == pytest.approx(exact.real, rel=5e-3)  # order 2 leaves 7e-3, order 3 2.6e-3
    assert found.imag < 0


@pytest.mark.slow
@pytest.mark.parametrize(("axis", "tolerance"), [(2, 1e-4), (0, 1e-3)])
def test_wide_plate_is_the_slab(axis, tolerance):
    """1.2 m wide, h = 12 mm: the missing rest answers with (12/600)³ ~ 1e-5, the boundary at 3.6 m with less."""
    place = np.array([0.0, 0.0, 0.027])
    mesh = plate_mesh(Box((1.2, 1.2, 0.03)), SIGMA, [place], 200.0, MeshRule(1.2, 2.0, 2.0, reach=3.0))
    found = solve_eddy(mesh, 4, 200.0, [Dipole(place, np.eye(3)[axis])]).couplings[0, 0]
    exact = reaction_tensor(Slab(SIGMA, 0.03), 0.012, 200.0)[axis, axis]
    print(f"\nmoment along axis {axis}: {abs(found / exact - 1):.1e}")
    assert abs(found - exact) < tolerance * abs(exact)


def test_mutual_coupling_over_a_wide_plate():
    """Two places: the off-diagonal tensors against the slab's."""
    places = np.array([[0.0, 0.0, 0.035], [0.015, 0.01, 0.045]])
    mesh = plate_mesh(Box((0.8, 0.8, 0.03)), SIGMA, places, 100.0, MeshRule(1.5, 3.0, 2.0, reach=3.0))
    found = solve_eddy(mesh, 2, 100.0, unit_dipoles(places)).couplings[:3, 3:]
    exact = mutual_tensor(Slab(SIGMA, 0.03), places[0] - [0, 0, 0.015], places[1] - [0, 0, 0.015], 100.0)
    assert abs(found - exact).max() < 1e-2 * abs(exact).max()  # order 2 on a coarse mesh and the plate's finite width


def test_spanning_tree_counts():
    """A square with one diagonal: a tree of 4 vertices has 3 edges; with one edge shrunk, 2."""
    edges = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]])
    assert len(tree_edges(edges, np.zeros(5, bool))) == 3
    shrunk = np.array([True, False, False, False, False])
    tree = tree_edges(edges, shrunk)
    assert len(tree) == 2
    assert 0 not in tree


def test_parity_parts_add_up():
    parity = Parity((0, 2))
    images = np.random.default_rng(0).normal(size=(4, 5, 3))
    assert parity.project(images).sum(0) == pytest.approx(images[0])  # the first mirror is the identity


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: solve_eddy(m, 2, -1.0, unit_dipoles(PLACES)), "Input frequency_hz must be finite and not negative"),
        (lambda m: solve_eddy(m, 0, 1.0, unit_dipoles(PLACES)), "Input order must be at least 1"),
        (lambda m: solve_eddy(m, 2, 1.0, []), "Input sources must hold at least one source"),
        (lambda m: ConductorMesh(m.mesh, {"plate": -1.0}), "Input conductivity of plate must be positive"),
        (lambda m: ConductorMesh(m.mesh, {"copper": 1.0}), "Input conductivity must name one of"),
        (lambda m: plate_mesh(Box(SIZE), SIGMA, [(0, 0, 0.01)], 50.0), "Input positions_m must lie outside the plate"),
        (lambda m: plate_mesh(Box((0.1, 0.0, 1)), SIGMA, PLACES, 50.0), "Input size_m must be positive"),
        (lambda m: plate_mesh(Cylinder(0.1, 0.08), SIGMA, PLACES, 50.0), "must lie outside the plate"),
    ],
)
def test_bad_input_is_named(coarse, call, message):
    with pytest.raises(ValueError, match=message):
        call(coarse)
