"""A conductor of the rotor where the floater would levitate is a wrong scene."""

from types import SimpleNamespace

import numpy as np
import pytest
from article import BALL

import spinlev as sl
from spinlev.dynamics.equilibria.equilibrium import Mode
from spinlev.dynamics.flights.flight import most_like_levitation
from spinlev.geometry.common import InputError
from spinlev.studies.plan import check_way

BELOW = [0.0, 0.0, -0.02]
BLOCK = {"size_mm": [4.0, 4.0, 4.0], "center_mm": [0.0, 0.0, -8.0], "conductivity_S_m": 1.4e6}


def test_a_conductor_in_the_floaters_way_is_said_with_its_depth():
    """The block ends 10 mm below the axis of the cube; a floater at 17 mm begins at 10.65 mm, at 16 mm at 9.65 mm."""
    rotor = sl.horizontal(displacement_mm=0.0, edge_mm=10.0, remanence_T=1.305, conductors=[BLOCK])
    scene = sl.scene(frequency_hz=150.0, rotor=rotor, floater=BALL)
    check_way(scene, np.array([0.0, 0.0, -17e-3]))
    with pytest.raises(InputError, match=r"conductors\[0\] must leave the floater's way free.* by 0.35 mm"):
        check_way(scene, np.array([0.0, 0.0, -16e-3]))


def test_where_a_brake_undoes_every_equilibrium_the_least_growing_is_the_floaters_way():
    """As found for a block of steel 14 mm below the cube: 702 /s beside the rotor, 2.4 /s where it would float."""
    beside, below, far = (
        SimpleNamespace(growth_per_s=growth, stable=False, without=None, modes=(), position=BELOW)
        for growth in (702.0, 2.4, 36.0)
    )
    assert most_like_levitation([beside, below, far]) is below


def test_the_branch_of_levitation_is_the_one_that_is_stable_along_the_axis():
    """Above the range of stable frequencies a lateral mode grows faster there than the axial one farther away."""
    near, far, beside = (
        SimpleNamespace(
            growth_per_s=growth, stable=False, without=None, modes=(Mode("bounce", axial, 20.0),), position=place
        )
        for growth, axial, place in ((51.0, -1e-4, BELOW), (28.0, 28.0, BELOW), (16.0, -1e-4, [0.02, 0.0, -0.001]))
    )
    assert most_like_levitation([beside, near, far]) is near
