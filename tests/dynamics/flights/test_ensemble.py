"""Many flights at once: as flown one by one, and the same to the last bit in any company."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest
from article import MAGNETS, SCENE

from spinlev.dynamics.flights.batch import ensemble
from spinlev.dynamics.flights.flight import initial_state, simulate
from spinlev.dynamics.motion.state import State
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.common import InputError
from spinlev.geometry.scene.contents import AbsoluteStart

TABLE = RotorTable("moments", MAGNETS, (), tuple(uniform_moments(m, 13) for m in MAGNETS))
DURATION = 0.3
PLACES = np.array([[0, 0, 0], [1e-4, 0, 0], [0, 1e-4, 2e-4], [0, 0, 4e-4], [3e-4, 0, 0], [0, 0, 8e-3]])
"""Displacements: at rest, two that leave their small ball, two that swing, one wide, and one drawn to the magnet."""


@pytest.fixture(scope="module")
def starts():
    start = initial_state(SCENE, TABLE)[0]
    offset = np.concatenate([PLACES, 5e-5 * np.random.default_rng(0).normal(size=(14, 3))])
    turning = np.cross([0.0, 0.0, SCENE.angular_velocity], offset)
    same = (np.tile(v, (len(offset), 1)) for v in (start.moment, start.spin))
    return State(start.position + offset, start.velocity + turning, *same)


@pytest.fixture(scope="module")
def flown(starts):
    return ensemble(SCENE, TABLE, starts, DURATION)


@pytest.mark.slow
def test_each_ends_as_if_it_flew_alone(starts, flown):
    """The same field by the same expansions; steps differ where the lanes look for flights that have ended."""
    assert flown.changes.max() >= 1
    for k in range(len(PLACES)):
        scene = replace(SCENE, start=AbsoluteStart(*(v[k] for v in starts.vectors)))
        alone = simulate(scene, TABLE, DURATION, compact=True)
        assert flown.ended_by[k] == alone.ended_by
        assert flown.levitated_s[k] == pytest.approx(alone.levitated_s, rel=1e-9)
        assert np.abs(flown.last.position[k] - alone.rotor.position[-1]).max() < 1e-10
    assert set(flown.ended_by) == {"duration", "contact"}


def same(found, exact, order):
    np.testing.assert_array_equal(found.ended_by, exact.ended_by[order])
    np.testing.assert_array_equal(found.levitated_s, exact.levitated_s[order])
    for a, b in zip(found.last.vectors, exact.last.vectors, strict=True):
        np.testing.assert_array_equal(a, b[order])


@pytest.mark.slow
def test_the_company_does_not_matter(starts, flown):
    order = np.random.default_rng(1).permutation(len(starts.position))[:11]
    same(ensemble(SCENE, TABLE, State(*(v[order] for v in starts.vectors)), DURATION), flown, order)


@pytest.mark.slow
def test_the_number_of_workers_does_not_matter(starts, flown):
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        same(ensemble(SCENE, TABLE, starts, DURATION, pool.map, together=10), flown, np.arange(len(starts.position)))


def test_what_cannot_be_flown_is_said(starts):
    with pytest.raises(InputError, match="duration must be positive"):
        ensemble(SCENE, TABLE, starts, 0.0)
    with pytest.raises(InputError, match="one state at least"):
        ensemble(SCENE, TABLE, State(*(v[:0] for v in starts.vectors)), 1.0)


def test_a_start_in_contact_is_over_at_once(starts):
    here = State(np.array([[0.0, 0.0, -5e-3]]), *(v[:1] for v in starts.vectors[1:]))
    found = ensemble(SCENE, TABLE, here, 1.0)
    assert found.ended_by[0] == "contact"
    assert found.levitated_s[0] == 0.0
