"""What the energy of a `MutualTable` leaves out near contact, found by taking the series of both bodies apart."""

import numpy as np
import pytest
from article import PERMEABLE, PERMEABLE_MAGNETS as MAGNETS
from second_opinions.magnet_elements import element_ladder

from spinlev.fem.harmonics.interior import dipole_sources, field_at_center, multipole_force, multipole_torque
from spinlev.fem.mutual.making import cached_mutual_table
from spinlev.fem.mutual.response import places_around, two_body
from spinlev.fem.mutual.table import induced_sources

DEGREE = 20


def parted(sources):
    """Sources of the sphere's degrees up to one, and of those above."""
    low = sources.copy()
    low[2:] = 0.0
    return low, sources - low


@pytest.mark.parametrize("gap", [1e-3, 3e-3])
def test_the_rotors_answer_to_the_spheres_higher_degrees_is_needed_and_enough(gap):
    """With it the force of both bodies is met to 2e-4 of the added one; without it, to 1e-2 at 1 mm. Torque alike.

    It is -M·V: the table's V is the field that the finite elements send back, to a part that leaves 1e-3 of the whole.
    """
    (rotor,) = element_ladder(MAGNETS, (2,))
    answers = cached_mutual_table(MAGNETS, PERMEABLE, print)[0]
    generator = np.random.default_rng(4)
    for place in places_around(MAGNETS, PERMEABLE.radius, (gap / PERMEABLE.radius,), 4, 3):
        direction = generator.normal(size=3)
        direction /= np.linalg.norm(direction)
        both = two_body(rotor, PERMEABLE, place, direction, DEGREE, 1e-7)
        ball, own = both.ball, both.own

        def wrench(incident, sources, ball=ball):
            torque = multipole_torque(incident, sources, ball) / PERMEABLE.radius
            return np.concatenate([multipole_force(incident, sources, ball), torque])

        low, high = parted(induced_sources(own, PERMEABLE.recoil_permeability))
        moment = dipole_sources(PERMEABLE.moment * direction, ball, DEGREE) + low
        back = rotor.answer(moment, ball, DEGREE)
        back_low, back_high = parted(induced_sources(back, PERMEABLE.recoil_permeability))
        table = wrench(own, low + high) + wrench(back, moment) + wrench(own, back_low)
        term = wrench(back, high) + wrench(rotor.answer(high, ball, DEGREE), moment) + wrench(own, back_high)
        added = both.total - both.rigid
        exact = np.concatenate([added.force, added.torque / PERMEABLE.radius])
        sizes = np.linalg.norm(exact[:3]), max(np.linalg.norm(exact[3:]), 0.1 * np.linalg.norm(exact[:3]))

        def missed(part, sizes=sizes):
            return [float(np.linalg.norm(p) / size) for p, size in zip(np.split(part, 2), sizes, strict=True)]

        without, whole = missed(exact - table), missed(exact - table - term)
        print(f"\n{1e3 * gap:g} mm: force, torque without the term {without}, with it {whole}")
        assert max(whole) < 2e-4
        assert max(without) > 10 * max(whole)
        returned = field_at_center(rotor.answer(high, ball, DEGREE))
        told = -answers.derivatives(place[None], np.zeros((1, 3)))[1][0, 3:]
        assert np.linalg.norm(told - returned) < 0.06 * np.linalg.norm(returned)
