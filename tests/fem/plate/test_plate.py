"""Plate in any pose: frame, tolerance, refinement."""

from __future__ import annotations

import numpy as np
import pytest
from second_opinions.phasor import mean_loss

from spinlev.fem.plate.eddy import plate_reaction
from spinlev.fem.plate.slab import Slab, reaction_tensor
from spinlev.fem.rotor.models import AccuracyError
from spinlev.geometry.meshes.plate import MeshRule
from spinlev.geometry.scene.contents import Plate
from spinlev.geometry.shapes import Box, rotation_matrix

LYING = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.015)), 3.5e7)
HEIGHTS = (0.012, 0.02, 0.03)


def test_pose_turns_the_tensor():
    """An upright plate with the dipole beside it is the lying plate, turned."""
    turn = rotation_matrix((10.0, 90.0, 30.0))
    place, shift = np.array([0.005, -0.01, 0.03]), np.array([0.1, -0.2, 0.3])
    upright = Plate(Box(LYING.box.size, turn @ LYING.box.center + shift, turn), LYING.conductivity)
    lying, turned = plate_reaction(LYING, place, 50.0, 1e-2), plate_reaction(upright, turn @ place + shift, 50.0, 1e-2)
    expected = turn @ lying.tensors[0] @ turn.T
    assert turned.tensors[0] == pytest.approx(expected, rel=1e-7, abs=1e-8 * abs(expected).max())


@pytest.mark.slow
def test_error_estimate_covers_the_error():
    coarse, fine = (plate_reaction(LYING, [(0.0, 0.0, 0.03)], 100.0, rtol) for rtol in (3e-2, 1e-3))
    error = np.linalg.norm(coarse.tensors - fine.tensors) / np.linalg.norm(fine.tensors)
    assert error < coarse.error_estimate[0] + fine.error_estimate[0]
    assert fine.order > coarse.order


@pytest.mark.slow
def test_a_mesh_too_coarse_for_the_skin_depth_is_refined():
    """A start with one cell for 30 skin depths must end within the tolerance of a mesh made for it."""
    place, frequency = [(0.0, 0.0, 0.03)], 2e4
    made = plate_reaction(LYING, place, frequency, 2e-2)
    rough = plate_reaction(LYING, place, frequency, 2e-2, MeshRule(2.0, 60.0, 3.0))
    difference = np.linalg.norm(made.tensors - rough.tensors) / np.linalg.norm(made.tensors)
    print(f"\ncells {made.cells} and, after refinement, {rough.cells}: {difference:.1e} apart")
    assert difference < 4e-2  # both within 2e-2


def test_static_field_sees_no_plate():
    assert not plate_reaction(LYING, [(0, 0, 0.02)], 0.0).tensors.any()


def test_bad_input_is_named(monkeypatch):
    monkeypatch.setattr("spinlev.fem.plate.eddy.REFINEMENTS", 0)
    with pytest.raises(ValueError, match="Input positions_m must lie outside the plate"):
        plate_reaction(LYING, [(0, 0, -0.001)], 50.0)
    with pytest.raises(ValueError, match="Input frequency_hz must be finite and not negative"):
        plate_reaction(LYING, [(0, 0, 0.02)], -50.0)
    with pytest.raises(AccuracyError, match="Input rtol of the plate must be at least"):
        plate_reaction(LYING, [(0, 0, 0.1)], 1.0, 1e-12, MeshRule(4.0, 4.0, 4.0))


def test_a_frequency_beyond_the_finite_elements_is_refused_before_it_is_tried():
    """5 MHz, skin depth 0.04 mm: the mesh alone has too many cells; at once, and the remedy is named."""
    with pytest.raises(AccuracyError, match=r"frequency_hz must be lower for finite elements.*model slab"):
        plate_reaction(LYING, [(0, 0, 0.02)], 5e6, 0.1)


@pytest.mark.slow
def test_a_hopeless_frequency_ends_at_a_low_order():
    """1 MHz: the mesh is made, but no order that is within the limit can do."""
    with pytest.raises(AccuracyError, match=r"must be lower for finite elements.*0\.085 mm"):
        plate_reaction(LYING, [(0, 0, 0.017)], 1e6, 0.1)


@pytest.mark.slow
def test_a_hundred_kilohertz_is_answered():
    """The skin depth is 1/110 of the thickness; near the infinite slab, to which the edges make a difference."""
    found = plate_reaction(LYING, [(0, 0, 0.017)], 1e5, 0.1)
    slab = reaction_tensor(Slab(LYING.conductivity, 0.03), 0.017, 1e5)
    difference = np.linalg.norm(found.tensors[0] - slab) / np.linalg.norm(slab)
    stated = found.error_estimate[0]
    print(f"\norder {found.order}, cells {found.cells}, stated {stated:.1e}; the slab is {difference:.1e} off")
    assert difference < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [1.0, 50.0, 100.0, 200.0, 1000.0])
def test_self_convergence_of_every_entry(frequency):
    """Another mesh and order: every entry of G within 1e-4 of its norm; symmetric; passive.

    Three heights on the axis, 20 mm from an edge, and beside the narrow face: beside an upright plate.
    """
    places = [(0.0, 0.0, h) for h in HEIGHTS] + [(0.03, 0.0, 0.02), (0.07, 0.01, -0.005)]
    found = plate_reaction(LYING, places, frequency, 1e-4)
    other = plate_reaction(LYING, places, frequency, 1e-4, MeshRule(1.0, 1.6, 1.4))
    size = np.linalg.norm(found.tensors, axis=(1, 2))
    difference = abs(found.tensors - other.tensors).max(axis=(1, 2)) / size
    print(f"\n{frequency:g} Hz, orders {found.order}, {other.order}, cells {found.cells}, {other.cells}: {difference}")
    assert difference.max() < 1e-4
    assert (abs(found.tensors - found.tensors.swapaxes(1, 2)).max(axis=(1, 2)) < 1e-9 * size).all()  # of the solver
    assert (mean_loss(found.tensors, [1, -1j, 0.2], frequency) > 0).all()
