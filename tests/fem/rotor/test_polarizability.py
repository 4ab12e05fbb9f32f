"""What a uniform field induces in a floater: spheres, depolarisation of cylinders and cubes, two halves, and motion."""

from dataclasses import replace

import magpylib as magpy
import numpy as np
import pytest
from article import MAGNETS, NO_DRAG

from spinlev.dynamics.flights.flight import Flight, initial_state, integrate
from spinlev.dynamics.motion.body_shape import InducedShape
from spinlev.dynamics.motion.effect import Interaction
from spinlev.fem.elements.surface_charges import SurfaceCharges
from spinlev.fem.harmonics.expansion import polynomial_rule
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.floater import polarizability_tensor
from spinlev.geometry.common import MU_0
from spinlev.geometry.magnets import Magnet, polarizability
from spinlev.geometry.scene.contents import AbsoluteStart, Scene
from spinlev.geometry.scene.floater import Floater, FloaterPart
from spinlev.geometry.shapes import Box, Cylinder, Sphere

CUBE = Floater(0.005 * 3**0.5, 1.3, 1.05, 7500.0, None, Box((0.01,) * 3))
DISC = Floater(float(np.hypot(5e-3, 2.5e-3)), 1.3, 1.05, 7500.0, None, Cylinder(5e-3, 5e-3))


def factors(floater):
    """Depolarisation factors N of χV/(1 + χN) along the axes."""
    contrast = floater.recoil_permeability - 1
    return (contrast * floater.volume / MU_0 / np.diag(polarizability_tensor(floater)) - 1) / contrast


@pytest.mark.parametrize("permeability", [1.05, 2.0, 100.0])
def test_a_sphere_has_its_closed_form(permeability):
    charges = SurfaceCharges([Magnet(Sphere(5e-3), (0.0, 0.0, 1.0), permeability)], 6)
    known = polarizability(4 / 3 * np.pi * 5e-3**3, permeability)
    np.testing.assert_allclose(charges.polarizability(), known * np.eye(3), rtol=1e-12, atol=1e-12 * known)


@pytest.mark.parametrize("height", [2.5e-3, 5e-3, 10e-3, 20e-3])
def test_cylinders_are_depolarised_as_their_mean_field_says(height):
    """For χ → 0 N is the mean of -H/M of a uniform one (magpylib); at χ = 0.05 it differs by a few 1e-3.

    Of equal height and diameter it is 0.3116 (D.-X. Chen, J. A. Brug, R. B. Goldfarb, IEEE Trans. Magn. 27, 3601).
    """
    body = Cylinder(5e-3, height)
    found = factors(replace(DISC, body=body, radius=body.circumradius))
    places, weights = polynomial_rule(body, 30)
    uniform = magpy.magnet.Cylinder(dimension=(10e-3, height), polarization=(0, 0, 1))
    mean = -(weights @ uniform.getH(places)[:, 2]) * MU_0 / weights.sum()
    assert found[2] == pytest.approx(mean, abs=4e-3)
    assert found[0] == pytest.approx((1 - mean) / 2, abs=4e-3)
    if height == 10e-3:
        assert found[2] == pytest.approx(0.3116, abs=2e-3)


def test_a_cube_is_as_polarizable_in_all_directions():
    """N = 1/3 by symmetry for χ → 0. More nodes change it by 1e-4, and two halves together are the cube."""
    found = polarizability_tensor(CUBE)
    assert factors(CUBE) == pytest.approx(np.full(3, 1 / 3), abs=2e-3)
    finer = SurfaceCharges(CUBE.magnets, 16).polarizability()
    np.testing.assert_allclose(found, finer, rtol=1e-4, atol=1e-9 * finer[0, 0])
    halves = [
        FloaterPart(Magnet(Box((0.01, 0.01, 0.005), (0.0, 0.0, z)), (0.0, 0.0, 1.3), 1.05), 7500.0)
        for z in (-2.5e-3, 2.5e-3)
    ]
    np.testing.assert_allclose(
        polarizability_tensor(Floater.composed(halves)), finer, rtol=1e-3, atol=1e-6 * found[0, 0]
    )


def test_what_no_charges_are_computed_for_is_a_sphere():
    strong = replace(CUBE, recoil_permeability=5.0)
    np.testing.assert_array_equal(polarizability_tensor(strong), strong.polarizability * np.eye(3))
    assert not InducedShape.of(strong).tensor.any()


@pytest.mark.parametrize("floater", [CUBE, DISC], ids=["cube", "disc"])
def test_force_and_torque_are_slopes_of_the_energy(floater):
    """With a tensor a hundred times as large as a body's: the Jacobi integral of a trajectory stays."""
    table = rotor_table(MAGNETS, "dipole")
    tensor = (
        np.diag([2e-5, 2e-5, -3e-5]) if floater.round else np.array([[2e-5, 1e-5, 0], [1e-5, -1e-5, 0], [0, 0, 3e-5]])
    )
    tensor = 0.02 * tensor * floater.polarizability / 1e-5 * 5
    start = AbsoluteStart(
        np.array([1e-3, 0.0, -24e-3]), np.zeros(3), np.array([-0.2, 0.1, 1.0]), np.array([5.0, 3.0, 40.0])
    )
    scene = Scene(130.0, MAGNETS, floater, NO_DRAG, start=start)
    ends = []
    for effects in ((), (InducedShape(tensor),)):
        flight = Flight(scene, Interaction(table, effects), 0.03, in_balls=False)
        flown = integrate(flight, initial_state(scene, table)[0], 0.03)
        assert flown.energy_error < 1e-12
        ends.append(flown.lab.position[-1])
    assert np.linalg.norm(ends[1] - ends[0]) > 1e-6  # it does something
