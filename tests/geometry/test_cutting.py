"""Magnets that are one in several pieces: touching, alike magnetised and of one material."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from spinlev.fem.mutual.making import mutual_key
from spinlev.fem.rotor.choice import cached_rotor_table, rotor_table
from spinlev.geometry.cutting import cut_magnets, united
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box, Cylinder, rotation_matrix

TURN = rotation_matrix([20.0, -35.0, 50.0])
WHOLE = Magnet(Box([0.01, 0.012, 0.014], [1e-3, 2e-3, -3e-3], TURN), [0.3, 0.5, 1.1], 1.05)


def blocks(magnet, counts):
    """A cuboid cut into equal blocks."""
    size = magnet.body.size / counts
    shifts = [(np.array(place) + 0.5) * size - magnet.body.half_edges for place in np.ndindex(*counts)]
    return tuple(replace(magnet, body=Box(size, magnet.body.center + TURN @ shift, TURN)) for shift in shifts)


@pytest.mark.parametrize("counts", [(2, 1, 1), (1, 3, 1), (2, 2, 2)])
def test_blocks_of_a_cuboid_are_the_cuboid_in_any_order(counts):
    pieces = blocks(WHOLE, counts)
    for order in (pieces, pieces[::-1]):
        (one,) = united(order)
        assert one.body.size == pytest.approx(WHOLE.body.size, rel=1e-12)
        assert one.body.center == pytest.approx(WHOLE.body.center, abs=1e-15)
        assert one.polarization == pytest.approx(WHOLE.polarization)


def test_what_is_cut_is_united_again():
    bar = replace(WHOLE, body=Box([0.004, 0.004, 0.06], WHOLE.body.center, TURN))
    (pieces,) = cut_magnets((bar,), 2e-3)
    assert len(pieces) > 3
    assert united(pieces)[0].body.size == pytest.approx(bar.body.size, rel=1e-12)


def test_stacked_rings_are_one_whatever_way_each_is_turned_about_their_axis():
    turned = TURN @ rotation_matrix([0.0, 0.0, 77.0])
    lower = Magnet(Cylinder(5e-3, 4e-3, [0.0, 0.0, 0.0], TURN, 2e-3), [0.0, 0.2, 1.0], 1.05)
    place, along = 5e-3 * TURN[:, 2], turned.T @ lower.polarization_in_rotor
    (one,) = united((lower, Magnet(Cylinder(5e-3, 6e-3, place, turned, 2e-3), along, 1.05)))
    assert one.body.height == pytest.approx(0.01)
    assert one.body.center == pytest.approx(3e-3 * TURN[:, 2])


def test_magnets_that_differ_or_only_meet_in_part_stay_two():
    first, second = blocks(WHOLE, (2, 1, 1))
    along, aside = TURN[:, 0], TURN[:, 1]
    for other in (
        replace(second, polarization=-second.polarization),
        replace(second, recoil_permeability=1.06),
        replace(second, body=replace(second.body, center=second.body.center + 1e-8 * along)),
        replace(second, body=replace(second.body, center=second.body.center + 1e-4 * aside)),
        replace(second, body=Box(second.body.size * [1.0, 1.0, 0.9], second.body.center, TURN)),
        replace(second, body=Cylinder(5e-3, 0.01, second.body.center, TURN)),
    ):
        assert united((first, other)) == (first, other)


@pytest.mark.slow
def test_a_magnet_in_blocks_has_the_tables_of_the_whole_and_dipoles_of_its_own():
    pieces, floater = blocks(WHOLE, (2, 2, 1)), Floater(6e-3, 1.3, 1.05, 7500.0)
    places = np.array(list(product([-0.02, 0.02], repeat=3)))
    for model in ("cuboid", "fem", "surface"):
        found, true = (rotor_table(rotor, model).evaluate(places)[0] for rotor in (pieces, (WHOLE,)))
        assert found == pytest.approx(true, abs=1e-12 * np.abs(true).max())
    for table in (rotor_table(pieces, "dipole"), cached_rotor_table(pieces, "dipole", 1e-5, print)[0]):
        assert len(table.expansions) == len(pieces)
    assert mutual_key(pieces, floater) == mutual_key(united(pieces), floater)
