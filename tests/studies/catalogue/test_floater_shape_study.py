"""Limits of stable frequency by the shape: a sphere's are its branch's, a cylinder's those of its own multipoles."""

from dataclasses import replace

import numpy as np
import pytest

from spinlev.dynamics.continuation.frequencies import stable_ranges
from spinlev.dynamics.motion.body_shape import response_error
from spinlev.geometry.scene.contents import Plate
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box, Cylinder
from spinlev.studies.catalogue import article
from spinlev.studies.catalogue.floater_shape import CUBE, SPHERE, STUDY, floater_of, limits
from spinlev.studies.levitation import Levitation
from spinlev.studies.plan import Models

ROTOR = {"configuration": "horizontal", "measure": 2.0}


@pytest.mark.parametrize(("shape", "aspect"), [(CUBE, 1.0), (SPHERE, 1.0), ("cylinder", 0.25), ("cylinder", 4.0)])
def test_all_have_the_volume_and_moment_of_the_sphere(shape, aspect):
    floater = floater_of(shape, aspect)
    ball = article.FLOATER
    assert floater.volume == pytest.approx(ball.volume)
    assert floater.mass == pytest.approx(ball.mass)
    assert floater.round
    size = floater.bodies[0].size
    assert shape == SPHERE or size[2] / size[0] == pytest.approx(aspect)


@pytest.mark.slow
def test_the_limits_of_a_sphere_are_those_of_its_branch():
    found = limits({**ROTOR, "shape": SPHERE, "aspect": 1.0})
    scene = article.rotor_scene("horizontal", 2.0, permeability=1.0, drag=False, floater=floater_of(SPHERE, 1.0))
    levitation = article.levitation_of(scene, "cuboid")
    stable = article.stable_frequencies(scene, levitation.rates)
    assert [found["low"].item(), found["high"].item()] == pytest.approx([stable.low.parameter, stable.high.parameter])


def cylinder_and_mean():
    """Levitations of a cylinder, whose motion has dipoles on its axis, and of its mean, which has them all over it."""
    mean = floater_of("cylinder", 1.0)
    body = mean.bodies[0]
    assert isinstance(body, Cylinder)
    floater = Floater(body.circumradius, mean.remanence, 1.0, mean.density, body=body)
    scenes = (
        article.rotor_scene("horizontal", 2.0, permeability=1.0, drag=False, floater=one) for one in (floater, mean)
    )
    return [article.levitation_of(replace(scene, frequency=143.5), "cuboid") for scene in scenes]


@pytest.mark.slow
def test_beside_the_rotor_a_cylinder_levitates_where_its_mean_does():
    """4 mm off it its first multipoles leave out more than a tenth of its weight: once it was found not to levitate."""
    cylinder, mean = cylinder_and_mean()
    assert cylinder.equations_key != mean.equations_key
    found = [[one.position for one in each.equilibria] for each in (cylinder, mean)]
    assert cylinder.equilibria[0].growth_per_s < 1e-3
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)


@pytest.mark.slow
def test_the_limits_of_a_cylinder_are_those_of_its_mean():
    """Its branch follows an equilibrium near the rotor, where seven dipoles on the axis would miss an end by 1 Hz."""
    found = limits({**ROTOR, "shape": "cylinder", "aspect": 1.0})
    levitation = cylinder_and_mean()[0]
    widest = max(((run.low.parameter, run.high.parameter) for run in stable_ranges(levitation.branch)), key=np.ptp)
    assert [found["low"].item(), found["high"].item()] == pytest.approx(widest, abs=1e-3)


@pytest.mark.slow
def test_a_branch_passes_through_the_equilibrium_it_is_of_whatever_the_spin():
    """A cylinder's spin counts by its moments of inertia, which are unlike."""
    levitation = Levitation(cylinder_and_mean()[0].scene, Models("cuboid", "none", interaction="rigid"), -0.1)
    near = min(levitation.branch, key=lambda point: abs(point.parameter - 143.5))
    assert near.spin == pytest.approx(levitation.equilibria[0].spin)
    np.testing.assert_allclose(near.position, levitation.equilibria[0].position, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plate", "tilt"), [(Plate(Box((0.3, 0.3, 0.03), (0.0, 0.0, -0.045)), 3.5e7), 0.0), (None, 0.02)]
)
def test_forced_a_cylinder_levitates_where_its_mean_does(plate, tilt):
    """Periodic motions are followed by the equations of which the equilibrium is, over a plate and where axes lean."""
    gravity = 9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    over = [
        Levitation(
            replace(one.scene, plate=plate, gravity=gravity), Models("cuboid", "slab", interaction="rigid")
        ).equilibria[0]
        for one in cylinder_and_mean()
    ]
    assert (over[0].currents is not None) == (plate is not None)
    np.testing.assert_allclose(over[0].position, over[1].position, atol=1e-9)
    assert over[0].growth_per_s == pytest.approx(over[1].growth_per_s, rel=1e-6)
    if plate:  # what the plate moves it is known as well as it responds to the shape
        moved = np.linalg.norm(over[0].position - over[0].without.position)
        assert over[0].position_error > response_error(cylinder_and_mean()[0].scene.floater) * moved


def test_every_rotor_has_every_shape():
    points = STUDY.points(False)
    assert {point["shape"] for point in points} == {"cylinder", CUBE, SPHERE}
    assert len({point["configuration"] for point in points}) == 3
