"""A step that says nothing for a while is heard of all the same."""

import queue
import time

import pytest

from spinlev.studies.cli.console import Heartbeat

WAIT = 30.0
"""Until a test fails, s."""


def test_a_silent_step_says_how_long_it_has_gone_on_until_it_ends():
    said: queue.Queue[str] = queue.Queue()
    heartbeat = Heartbeat(said.put, 0.01)
    heartbeat.said("Equilibria ...")
    lines = [said.get(timeout=WAIT) for _ in range(3)]
    heartbeat.said("  done in 0.1 s.")
    heartbeat.stop()
    assert set(lines) == {"  0 s so far"}
    assert not heartbeat.is_alive()


def test_nothing_is_said_outside_of_a_step():
    said: queue.Queue[str] = queue.Queue()
    heartbeat = Heartbeat(said.put, 0.01)
    heartbeat.said("Equilibria ...")
    said.get(timeout=WAIT)
    heartbeat.said("Plate: finite")
    time.sleep(0.1)
    while not said.empty():  # what was being said just then
        said.get()
    with pytest.raises(queue.Empty):
        said.get(timeout=0.2)
    heartbeat.stop()


def test_a_step_that_knows_says_its_share_and_its_stage():
    said: queue.Queue[str] = queue.Queue()
    heartbeat = Heartbeat(said.put, 0.01)
    heartbeat.said("Motion ...")
    for advanced, line in (
        ((0.5,), "  50%"),
        ((0.25, "places"), "  places, 25%"),
        ((0.999, "places"), "  places, 0 s so far"),
    ):
        heartbeat.advanced(*advanced)
        _first(said, line)
    heartbeat.said("Equilibria ...")
    _first(said, "  0 s so far")
    heartbeat.stop()


def _first(said, line):
    while said.get(timeout=WAIT) != line:
        pass


def test_a_step_goes_on_when_a_part_of_it_has_ended():
    said: queue.Queue[str] = queue.Queue()
    heartbeat = Heartbeat(said.put, 0.01)
    heartbeat.said("study, 3 points ...")
    with heartbeat.around():
        heartbeat.said("Equilibria ...")
        heartbeat.said("  done in 0.1 s.")
        while not said.empty():  # of the part
            said.get()
        assert [said.get(timeout=WAIT) for _ in range(2)] == ["  0 s so far"] * 2
    heartbeat.stop()
