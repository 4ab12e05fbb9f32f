"""Limits of stable frequency by the shape: a sphere's are its branch's, a cylinder's those of its own multipoles."""

import numpy as np
import pytest

from spinlev.dynamics.continuation.frequencies import levitating_ranges
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Cylinder
from spinlev.studies.catalogue import article
from spinlev.studies.catalogue.floater_shape import CUBE, SPHERE, STUDY, floater_of, limits

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


@pytest.mark.slow
def test_the_limits_of_a_cylinder_are_those_of_its_first_multipoles():
    """Dipoles all over it, and seven on its axis with its multipoles up to degree 7: 0.3 Hz."""
    found = limits({**ROTOR, "shape": "cylinder", "aspect": 1.0})
    mean = floater_of("cylinder", 1.0)
    body = mean.bodies[0]
    assert isinstance(body, Cylinder)
    floater = Floater(body.circumradius, mean.remanence, 1.0, mean.density, body=body)
    scene = article.rotor_scene("horizontal", 2.0, permeability=1.0, drag=False, floater=floater)
    levitation = article.levitation_of(scene, "cuboid")
    runs = levitating_ranges(scene, levitation.table, levitation.rates)
    ends = [(run.low.parameter, run.high.parameter) for run in runs]
    widest = max(ends, key=np.ptp)
    assert [found["low"].item(), found["high"].item()] == pytest.approx(widest, abs=0.3)


def test_every_rotor_has_every_shape():
    points = STUDY.points(False)
    assert {point["shape"] for point in points} == {"cylinder", CUBE, SPHERE}
    assert len({point["configuration"] for point in points}) == 3
