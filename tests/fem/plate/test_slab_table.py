"""The infinite slab as a table: closed forms, independent quadrature, and the symmetry of a cylinder."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jv

from spinlev.fem.closed_forms.potentials import Dipole, HomogeneousField, PolarizedCuboid
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.plate.rotor_share import DOWN, ExpansionSource, posed_rotor, rotor_parts
from spinlev.fem.plate.slab import Slab, modes_needed, mutual_tensor, reaction_tensor, slab_modes
from spinlev.fem.plate.table import Region, refuse
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.plate.waves import cylinder_moments
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.models import AccuracyError
from spinlev.geometry.common import MU_0, InputError
from spinlev.geometry.magnets import tilt
from spinlev.geometry.scene.contents import Lowering, Plate
from spinlev.geometry.shapes import Box, rotation_matrix

SLAB = Slab(3.5e7, 0.03)
SIZE = np.array([0.1, 0.24, 0.03])
RTOL = 1e-3
CUBE = tilt(0.2, 0.01, 1.305, 1.0)[0]
ROTOR = rotor_table((replace(CUBE, body=replace(CUBE.box, center=(2e-3, 0.0, 0.0))),), "cuboid")
"""Tilted and beside the axis: its field has all harmonics of the turn."""
FLAT = Plate(Box(SIZE, (0.004, 0.0, -0.05)), SLAB.conductivity, Lowering(0.0, 0.01, 0.02))
UPRIGHT = Plate(Box(SIZE, (-0.04, 0.0, -0.02), rotation_matrix((0.0, 90.0, 0.0))), SLAB.conductivity)
ABOVE = Plate(Box(SIZE, (0.0, 0.0, 0.05)), SLAB.conductivity)
OTHER_EDGES = Plate(Box(SIZE[[2, 0, 1]], (-0.04, 0.0, -0.02), rotation_matrix((4.0, 6.0, 10.0))), SLAB.conductivity)
"""Thin along its own x axis, and square to no axis of the laboratory."""
PLATES = {"flat": FLAT, "upright": UPRIGHT, "above": ABOVE, "other edges": OTHER_EDGES}


def region_of(plate):
    """14 to 20 mm from the face that looks at the rotor, ±3 mm along it."""
    normal = int(np.argmin(plate.box.size))
    side = np.sign(plate.box.to_body(np.zeros(3))[normal])
    along = np.eye(3)[normal]
    middle = side * (0.015 + 0.017) * along + plate.box.to_body([0.0, 0.0, -0.02]) * (1 - along)
    return Region(middle - 3e-3, middle + 3e-3)


@pytest.fixture(scope="module", params=PLATES)
def made(request):
    plate = PLATES[request.param]
    return plate, region_of(plate), *PlateAround(plate, ROTOR, region_of(plate), rtol=RTOL, slab=True).tables()


@pytest.fixture(scope="module")
def flat():
    return PlateAround(FLAT, ROTOR, region_of(FLAT), rtol=RTOL, slab=True).tables()


def places(region, count, seed):
    return region.lower + (region.upper - region.lower) * np.random.default_rng(seed).random((count, 3))


def normal_of(plate, region):
    normal = int(np.argmin(plate.box.size))
    return normal, np.sign(region.center[normal])


def local_axes(plate, region):
    """Right-handed axes in the plate's frame, the last one away from the slab."""
    normal, side = normal_of(plate, region)
    third = side * np.eye(3)[normal]
    first = np.eye(3)[(normal + 1) % 3]
    return np.stack([first, np.cross(third, first), third], axis=1)


def test_modes_add_up_to_the_reflection():
    """Slab's closed form; what N modes leave falls as 1/N³, and `modes_needed` says how many will do."""
    k = np.geomspace(0.5, 130.0, 9)
    counts = np.array([40, 80])
    for frequency in (0.5, 250.0):
        exact = SLAB.reflection(k, frequency)
        errors = np.array([abs(reflection(slab_modes(SLAB, k, n), frequency) / exact - 1) for n in counts])
        assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.15)  # the next order is some kt/N of it
        needed = modes_needed(SLAB, k.max(), 250.0, 1e-4)
        assert abs(reflection(slab_modes(SLAB, k, needed), frequency) / exact - 1).max() < 1e-4


def reflection(modes, frequency):
    """Γ (n,) of the modes: 2iωk/μ0 Σ γ²/(λ + iω)."""
    rate = 2j * np.pi * frequency
    return 2 * rate * modes.wave_numbers / MU_0 * np.sum(modes.strengths**2 / (modes.rates + rate), axis=1)


def test_modes_of_a_thin_slab_are_those_of_a_sheet():
    """λ = 2k/(μ0σt) of a thin sheet, off by the order of kt = 3e-6."""
    thin = slab_modes(Slab(3.5e10, 3e-8), np.array([100.0]), 1)
    assert thin.rates[0, 0] == pytest.approx(200 / (4e-7 * np.pi * 1050), rel=1e-5)


def test_cylinder_waves_hear_a_dipole_by_the_gradient_of_a_bessel_function():
    """Differences of order 4 of J_m(kρ) e^{imφ} e^{-kz} in a turned frame: (k step)⁴ = 1e-10."""
    axes, origin = rotation_matrix((20.0, 30.0, 50.0)), np.array([0.01, -0.02, -0.03])
    place, moment, k, step = np.array([0.02, 0.01, 0.005]), np.array([0.3, 0.5, -0.2]), 30.0, 1e-4

    def wave(m, s):
        x, y, z = (place + s * step * moment - origin) @ axes
        return jv(m, k * np.hypot(x, y)) * np.exp(1j * m * np.arctan2(y, x) - k * z)

    found = cylinder_moments([Dipole(place, moment)], origin, axes, np.array([k]), 4, 32)[0, 0]
    for m in range(4):
        slope = (wave(m, -2) - 8 * wave(m, -1) + 8 * wave(m, 1) - wave(m, 2)) / (12 * step)
        assert abs(found[m] - slope) < 1e-8 * abs(found[:2]).max()


def test_waves_hear_a_cuboid_and_its_moments_alike():
    """Closed form against the multipole expansion to degree 17, at k times radius up to 2.6: round-off."""
    magnet = ROTOR.magnets[0]
    sources = [PolarizedCuboid(magnet.box, magnet.polarization_in_rotor), ExpansionSource(uniform_moments(magnet, 17))]
    cuboid, moments = cylinder_moments(
        sources, np.array([0.0, 0.0, -0.03]), rotation_matrix((5.0, 0.0, 0.0)), np.array([3.0, 50.0, 300.0]), 5, 32
    )
    assert abs(cuboid - moments).max() < 1e-13 * abs(cuboid).max()
    with pytest.raises(TypeError, match="Input source must be a magnetisation"):
        cylinder_moments([HomogeneousField(np.eye(3)[0])], np.zeros(3), np.eye(3), np.array([1.0]), 1, 4)


def test_reaction_tensor_is_the_closed_form_within_the_stated_error(made):
    """Unseen places and frequencies, some far below the lowest, for a face along any axis and looking either way."""
    plate, region, table, _ = made
    assert table.errors.total <= RTOL
    normal, _ = normal_of(plate, region)
    points = places(region, 40, 1)
    height = abs(points[:, normal]) - SLAB.thickness / 2
    turn = local_axes(plate, region)
    for frequency in 10 ** np.random.default_rng(2).uniform(-2, np.log10(250), 20):
        exact = turn @ reaction_tensor(SLAB, height, frequency) @ turn.T
        found = table.reaction_tensor(points, frequency)
        error = np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))
        assert error.max() < table.errors.total


def test_slab_looks_the_same_from_beside_the_axis(flat):
    """Translation invariance: each tensor is off by no more than the stated error, so that they differ by twice it."""
    table, _ = flat
    center = region_of(FLAT).center
    for frequency in (1.0, 80.0):
        here = table.reaction_tensor(center, frequency)[0]
        for offset in ([3e-3, 0, 0], [0, -3e-3, 0], [-2e-3, 3e-3, 0]):
            there = table.reaction_tensor(center + offset, frequency)[0]
            assert np.linalg.norm(there - here) < 2 * table.errors.total * np.linalg.norm(here)


def test_rotors_currents_have_the_field_of_the_slabs_answer_to_its_magnetisation(made):
    """Unseen angle, depth, frequency and places, against Gauss quadrature of the mutual tensor over the magnets."""
    plate, region, table, share = made
    angle, depth, frequency = 1.0, 0.6 * share.distance, 120.0
    nodes, weights = np.polynomial.legendre.leggauss(8)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), -1).reshape(-1, 3)
    volume = (weights[:, None, None] * weights[:, None] * weights).ravel() / 8
    turn = rotation_matrix((0.0, 0.0, np.degrees(angle)))
    axes = local_axes(plate, region)
    foot = SLAB.thickness / 2 * axes[:, 2]
    points = places(region, 4, 4)
    exact = np.zeros((4, 3), complex)
    for magnet in ROTOR.magnets:
        inside = (magnet.box.center + grid * magnet.box.half_edges @ magnet.box.rotation.T) @ turn.T
        there = (plate.box.to_body(inside - depth * DOWN) - foot) @ axes
        moment = axes.T @ plate.box.rotation.T @ turn @ magnet.moment
        tensors = mutual_tensor(SLAB, ((points - foot) @ axes)[:, None], there, frequency)
        exact += np.einsum("n,pnij,j->pi", volume, tensors, moment) @ axes.T
    omega = 2 * np.pi * frequency
    current = -1j * omega * share.signals(angle, depth) / (table.rates + 1j * omega)
    found = np.einsum("i,nia->na", current, table.field_functions(points)[0])
    assert np.linalg.norm(found - exact) < RTOL * np.linalg.norm(exact)


def test_network_is_passive(made):
    """Positive rates; dissipation and repulsion of any moment, reciprocity to round-off."""
    _, region, table, _ = made
    assert table.rates.min() > 0
    for frequency in (0.01, 3.0, 250.0):
        tensors = table.reaction_tensor(places(region, 50, 5), frequency)
        assert abs(tensors - tensors.swapaxes(1, 2)).max() <= 1e-14 * abs(tensors).max()
        assert np.linalg.eigvalsh(-tensors.imag).min() >= 0
        assert np.linalg.eigvalsh(-tensors.real).min() >= 0


def test_table_of_a_flat_slab_turns_with_the_rotor(flat):
    """Exactly: G(Rx) = R G(x) Rᵀ about the rotor's axis, rates in equal pairs, harmonic m only in states of order m.

    So the steady motion of floater and currents is at rest in the rotor's frame.
    """
    table, share = flat
    axis = FLAT.box.to_body(np.zeros(3)) * [1, 1, 0]
    region = region_of(FLAT)
    turn = rotation_matrix((0.0, 0.0, 33.0))
    points = axis + 2e-3 * np.random.default_rng(6).uniform(-1, 1, (20, 3)) + region.center * [0, 0, 1]
    here, there = (table.reaction_tensor(p, 90.0) for p in (points, axis + (points - axis) @ turn.T))
    assert abs(there - turn @ here @ turn.T).max() < 1e-12 * abs(here).max()
    heard = np.abs(share.series).max(axis=2)
    orders = [set(((np.flatnonzero(column) + 1) // 2).tolist()) for column in heard.T]
    assert all(len(order) <= 1 for order in orders)
    assert {m for order in orders for m in order} >= {0, 1, 2}
    rates, counts = np.unique(table.rates, return_counts=True)
    single = [rate for rate, order in zip(table.rates, orders, strict=True) if order == {0}]
    assert np.array_equal(counts == 1, np.isin(rates, single))
    assert counts.max() == 2


def test_rotors_permeability_is_heard():
    """A cube of μr = 1.05 has 0.98367 of the moment (PHYSICS.md), and nearly so much of the signal."""
    magnets = tilt(0.2, 0.01, 1.305, 1.05)
    tables = [rotor_table(magnets, "fem", 1e-3), rotor_table(magnets, "cuboid")]
    sources = [posed_rotor(rotor_parts(table, FLAT), FLAT, 0.4, 0.0) for table in tables]
    k = np.array([10.0, 30.0])
    permeable, rigid = cylinder_moments(sources, np.array([0.0, 0.0, 0.015]), np.eye(3), k, 2, 16)
    assert abs(permeable / rigid) == pytest.approx(np.full((2, 2), 0.98367), abs=2e-3)


@pytest.mark.parametrize(
    ("plate", "region", "message"),
    [
        (FLAT, Region(np.array([0.06, 0.0, 0.0]), np.array([0.07, 0.01, 0.01])), "must be over one of the plate's two"),
        (
            FLAT,
            Region(np.array([0.06, 0.0, 0.02]), np.array([0.07, 0.01, 0.03])),
            "must be over one of the plate's two",
        ),
        (FLAT, Region(np.full(3, -0.01), np.full(3, 0.02)), r"Move the plate, or model it by finite elements"),
        (FLAT, Region(np.array([0.0, 0.0, -0.03]), np.array([0.01, 0.01, -0.02])), "the floater's side"),
        (replace(UPRIGHT, body=replace(UPRIGHT.box, center=(-0.018, 0.0, -0.02))), None, "comes .* mm below its face"),
    ],
)
def test_a_plate_that_no_slab_can_stand_for_is_refused(plate, region, message):
    with pytest.raises(InputError, match=message):
        PlateAround(plate, ROTOR, region or region_of(plate), slab=True).tables()


@pytest.mark.slow
def test_a_tolerance_that_is_refused_names_one_that_is_met():
    """0.5 to 6 mm over copper, where currents of many orders are near, at 3 kHz: named once, it does not move."""
    plate = Plate(Box(np.array([0.06, 0.06, 0.005]), (0.0, 0.0, -0.024)), 5.8e7)
    near = Region(np.array([-0.004, -0.004, 0.003]), np.array([0.004, 0.004, 0.009]))
    asked = plate, ROTOR, near, (0.5, 6000.0)
    with pytest.raises(AccuracyError, match=r"Input --plate-rtol .*must be at least [\d.]+ for this plate") as refused:
        PlateAround(*asked, rtol=2e-3, slab=True).tables()
    assert "PlateErrors" not in str(refused.value)
    named = float(re.findall(r"at least ([\d.]+) for", str(refused.value))[0])
    table, _ = PlateAround(*asked, rtol=named, slab=True).tables()
    assert table.errors.total <= named < 0.1


def test_a_tolerance_that_cannot_be_met_is_told_in_words():
    with pytest.raises(AccuracyError, match=r"must be at least 0\.04 for it; instead received 0\.016"):
        refuse(0.016, 0.034, "it")
    with pytest.raises(AccuracyError, match=r"at least 0\.2 .*0\.1 that is allowed.*Move the plate away"):
        refuse(0.016, 0.17, "it")


def test_bad_ranges_are_named():
    with pytest.raises(ValueError, match="Input frequencies_hz must be positive and increasing"):
        PlateAround(FLAT, ROTOR, region_of(FLAT), (0.0, 250.0), slab=True).tables()
    with pytest.raises(ValueError, match="Input rtol must be between 0 and 1"):
        PlateAround(FLAT, ROTOR, region_of(FLAT), rtol=0.0, slab=True).tables()
