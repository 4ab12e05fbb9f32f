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


def test_a_step_that_knows_says_its_share_and_the_time_left():
    said: queue.Queue[str] = queue.Queue()
    heartbeat = Heartbeat(said.put, 0.01)
    heartbeat.said("Motion ...")
    heartbeat.advanced(0.5)
    heartbeat._stage_began -= 60.0
    alone = _first(said, "left")
    heartbeat.advanced(0.25, "places")
    heartbeat._stage_began -= 60.0
    staged = _first(said, "places, 25%, ")
    heartbeat.said("Equilibria ...")
    _first(said, "so far")
    heartbeat.stop()
    assert alone == "  50%, 60 s left"
    assert staged == "  places, 25%, 180 s left"


def test_the_time_left_is_told_once_it_can_be_and_in_units_that_suit_it():
    heartbeat = Heartbeat(print, 0.01)
    heartbeat.advanced(0.001)
    now = heartbeat._stage_began + 6000.0
    assert heartbeat._progress(now, now - 6000.0) == "100 min so far"
    heartbeat.advanced(0.1)
    heartbeat._advanced = now
    assert heartbeat._progress(now, now - 6000.0) == "10%, 15.0 h left"
    assert heartbeat._progress(now + 3600.0, now - 6000.0) == "10%, 14.0 h left"
    heartbeat.advanced(0.999)
    assert heartbeat._progress(now, now - 6000.0) == "100 min so far"
    heartbeat.advanced(0.0, "compiling the equations of motion")
    assert heartbeat._progress(now, now - 6000.0) == "compiling the equations of motion, 100 min so far"


def test_a_part_that_takes_longer_than_its_share_tells_no_time_that_grows():
    heartbeat = Heartbeat(print, 0.01)
    heartbeat.advanced(0.5, "errors")
    heartbeat._advanced = heartbeat._stage_began + 60.0
    told = [heartbeat._progress(heartbeat._advanced + late, 0.0) for late in (0.0, 30.0, 61.0)]
    assert told == ["errors, 50%, 60 s left", "errors, 50%, 30 s left", "errors, 50%"]


def _first(said, word):
    while word not in (line := said.get(timeout=WAIT)):
        pass
    return line
