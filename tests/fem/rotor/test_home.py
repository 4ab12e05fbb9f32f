"""A lone magnet's table goes where the magnet goes, and is made once for all places."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER

from spinlev.fem.mutual.making import mutual_key
from spinlev.fem.rotor.choice import cached_rotor_table, rotor_table
from spinlev.fem.rotor.models import Accuracy, fem_table, shortened_table
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.shapes import Box, rotation_matrix

TURN = rotation_matrix((20, -35, 50))
PLACE = (0.002, -0.001, 0.0005)
MAGNET = Magnet(Box((0.01, 0.008, 0.012), PLACE, TURN), (1.0, 0.2, -0.5), 1.05)
WAYS = np.random.default_rng(4).normal(size=(30, 3))
POINTS = PLACE + 0.02 * WAYS / np.linalg.norm(WAYS, axis=1)[:, None]


@pytest.mark.slow  # 6 s
def test_a_table_that_was_moved_is_that_of_elements_in_place():
    """The mesh lies otherwise: they differ by less than both state."""
    accuracy = Accuracy(1e-5, 0.006)
    moved, there = rotor_table((MAGNET,), "fem", 1e-5, 0.006), fem_table((MAGNET,), accuracy)
    stated = moved.absolute_error(POINTS)[0] + there.absolute_error(POINTS)[0]
    assert (np.linalg.norm(moved.evaluate(POINTS)[0] - there.evaluate(POINTS)[0], axis=1) < stated).all()


def test_what_is_written_along_the_magnets_axes_is_the_same_field():
    """Its expressions against its coefficients, which are along the rotor's axes."""
    (expansion,) = rotor_table((MAGNET,), "moments", 1e-4, 0.01).expansions
    table = rotor_table((MAGNET,), "moments", 1e-4, 0.01)
    for compiled, direct in zip(table.evaluate(POINTS), expansion.evaluate(POINTS), strict=True):
        assert np.abs(compiled - direct).max() < 1e-14 * np.abs(direct).max()


def test_one_table_in_the_cache_serves_every_pose(tmp_path, monkeypatch):
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))
    other = Magnet(Box(MAGNET.box.size, (0.0, 0.003, 0.0)), MAGNET.polarization, 1.05)
    assert not cached_rotor_table((MAGNET,), "moments", 1e-4, print)[1]
    table, found = cached_rotor_table((other,), "moments", 1e-4, print)
    assert found
    turned = table.evaluate((POINTS - PLACE) @ TURN + other.box.center)[0] @ TURN.T
    field = rotor_table((MAGNET,), "moments", 1e-4).evaluate(POINTS)[0]
    assert np.abs(turned - field).max() < 1e-13 * np.abs(field).max()


def test_what_no_field_depends_on_needs_no_table_of_its_own(tmp_path, monkeypatch):
    """Conductivity and knee; and a permeability across the easy axis that is equal to that along it."""
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))
    two = MAGNET, replace(MAGNET, body=Box(MAGNET.box.size, (0.03, 0.0, 0.0)))
    for rotor in ((MAGNET,), two):
        same = tuple(replace(m, transverse_permeability=1.05, conductivity=6e5, coercivity=1e6) for m in rotor)
        assert mutual_key(same, FLOATER) == mutual_key(rotor, FLOATER)
        assert not cached_rotor_table(rotor, "moments", 1e-4, print)[1]
        table, found = cached_rotor_table(same, "moments", 1e-4, print)
        assert found
        assert table.magnets == same
        other = tuple(replace(m, transverse_permeability=1.1) for m in rotor)
        assert mutual_key(other, FLOATER) != mutual_key(rotor, FLOATER)
        assert not cached_rotor_table(other, "moments", 1e-4, print)[1]


def test_a_turned_table_is_shortened_along_its_own_axes():
    """Along the rotor's axes it would keep almost all of its terms."""
    upright = Magnet(Box((0.01, 0.01, 0.01)), (1.3, 0.0, 0.0), 1.05)
    turned = Magnet(Box((0.01, 0.01, 0.01), PLACE, TURN), (1.3, 0.0, 0.0), 1.05)
    accuracy = Accuracy(3e-6, 0.02)
    before, after = [], []
    for magnet in (upright, turned):
        table = rotor_table((magnet,), "moments", 3e-6, 0.0065)
        short = shortened_table(table, accuracy)
        for found, parts in ((before, table.expansions), (after, short.expansions)):
            found.append(sum(np.count_nonzero(part.own_coefficients) for part in parts))
        places = magnet.body.center + 0.04 * WAYS / np.linalg.norm(WAYS, axis=1)[:, None]
        whole = table.evaluate(places)[0]
        assert (
            np.linalg.norm(short.evaluate(places)[0] - whole, axis=1).max() < 1e-5 * np.linalg.norm(whole, axis=1).min()
        )
    assert before[0] == before[1]
    assert after[1] <= after[0] + 3 < before[1]
