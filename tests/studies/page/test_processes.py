"""Processes of a page: they answer, say when they cannot, and end when they are told."""

import asyncio
import math
import os
import subprocess
import sys
import time

import pytest

from spinlev.studies.page.worker import Worker


async def begun(worker):
    """The process of a worker, when it is there."""
    while worker.process is None:
        await asyncio.sleep(0.01)
    return worker.process


def said_by(ask, seconds=60.0):
    """The first answer or complaint of a worker, and the worker."""

    async def listen():
        said = []
        worker = Worker("The work", seconds, said.append)
        ask(worker, said.append)
        while not said:
            await asyncio.sleep(0.01)
        return said[0], worker

    return asyncio.run(asyncio.wait_for(listen(), 60))


def test_questions_are_answered_in_turn_and_newer_ones_take_the_place_of_those_that_wait():
    async def listen():
        said = []
        worker = Worker("The work", 60.0, said.append)
        for number in range(5):
            worker.ask("root", lambda number=number: (math.sqrt, number), said.append)
            await asyncio.sleep(0)  # the first begins, the others wait
        worker.ask("other", lambda: (math.sqrt, 100), said.append)
        while worker.busy:
            await asyncio.sleep(0.01)
        worker.stop()
        return said

    assert asyncio.run(asyncio.wait_for(listen(), 60)) == [0.0, 2.0, 10.0]


def test_a_task_that_fails_is_said_and_the_process_goes_on():
    said, worker = said_by(lambda worker, heard: worker.ask("", lambda: (math.sqrt, "two"), heard))
    assert said.startswith("The computation failed: TypeError: must be real number")
    assert worker.process.is_alive()
    worker.process.kill()


def test_a_stop_that_is_interrupted_may_be_repeated():
    """As by SIGTERM while an idle process is ended: the server then ends all of them, this one too."""

    async def listen():
        worker = Worker("The work", 60.0, print)
        worker.ask("", lambda: (math.sqrt, 4), print)
        process = await begun(worker)
        close = worker._connection.close  # where the signal comes

        def struck():
            close()
            raise KeyboardInterrupt

        worker._connection.close = struck
        with pytest.raises(KeyboardInterrupt):
            worker.stop()
        worker.stop()
        return process

    process = asyncio.run(listen())
    process.kill()
    process.join()


def test_idle_processes_of_work_that_is_not_in_a_hurry_end():
    async def listen():
        said = []
        workers = [Worker("The work", 60.0, said.append, patience) for patience in (0, 10)]
        for worker in workers:
            worker.ask("", lambda: (math.sqrt, 4), said.append)
        while len(said) < 2 or any(worker.busy for worker in workers):
            await asyncio.sleep(0.01)
        kept = [worker.process is not None for worker in workers]
        workers[0].stop()
        return kept

    assert asyncio.run(asyncio.wait_for(listen(), 60)) == [True, False]


def test_a_process_that_is_ended_from_outside_is_said():
    said, worker = said_by(lambda worker, heard: worker.ask("", lambda: (os.abort,), heard))
    assert "ended from outside" in said
    assert worker.process is None


def test_work_that_takes_too_long_is_cut_off():
    said, worker = said_by(lambda worker, heard: worker.ask("", lambda: (time.sleep, 100), heard), 0.3)
    assert said == "The work took longer than 0.3 s and was cut off."
    assert worker.process is None


def test_a_process_at_work_ends_when_it_is_told():
    async def begin():
        heard = []
        worker = Worker("The work", 60.0, heard.append)
        worker.ask("", lambda: (time.sleep, 100), heard.append)
        number = (await begun(worker)).pid
        worker.stop()
        return number, heard

    number, heard = asyncio.run(begin())
    assert heard == []
    assert not os.path.exists(f"/proc/{number}")


BEGUN = """
import asyncio, time
from spinlev.studies.page.worker import Worker

async def begin():
    worker = Worker("", 60.0, print)
    worker.ask("", lambda: (time.sleep, 100), print)
    while worker.process is None:
        await asyncio.sleep(0.01)
    print(worker.process.pid, flush=True)
    await asyncio.sleep(100)

asyncio.run(begin())
"""


def test_a_process_at_work_ends_with_a_program_that_is_killed():
    with subprocess.Popen([sys.executable, "-c", BEGUN], stdout=subprocess.PIPE, text=True) as program:
        number = int(program.stdout.readline())
        program.kill()
    end = time.monotonic() + 30
    while os.path.exists(f"/proc/{number}"):
        assert time.monotonic() < end, "the process lives on"
        time.sleep(0.05)


UNGUARDED = """
import asyncio, math
from spinlev.studies.page.worker import Worker

print("begun")
async def ask():
    said = []
    worker = Worker("", 60.0, said.append)
    worker.ask("", lambda: (math.sqrt, 4), said.append)
    while not said:
        await asyncio.sleep(0.01)
    print(said[0])
    worker.stop()

asyncio.run(ask())
"""


def test_a_script_needs_no_guard(tmp_path):
    """It is run once, where multiprocessing would run it in each process again."""
    (tmp_path / "script.py").write_text(UNGUARDED)
    done = subprocess.run([sys.executable, tmp_path / "script.py"], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["begun", "2.0"]


STRUCK = """
import asyncio, os, signal, time
from multiprocessing import forkserver
from spinlev.studies.page.worker import Worker

def stopped(*_):
    raise KeyboardInterrupt

def struck(descriptors, connect=forkserver.connect_to_new_process):
    found = connect(descriptors)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(0.2)
    return found

async def begin():
    Worker("", 60.0, print).ask("", lambda: (time.sleep, 100), print)
    await asyncio.sleep(100)

signal.signal(signal.SIGTERM, stopped)
forkserver.connect_to_new_process = struck
try:
    asyncio.run(begin())
except KeyboardInterrupt:
    print("stopped", signal.getsignal(signal.SIGTERM) is stopped)
"""


@pytest.mark.slow
def test_a_stop_while_a_process_begins_is_no_traceback():
    """SIGTERM comes when the process is there and does not know its task yet; all of them have ended afterwards."""
    ended = subprocess.run([sys.executable, "-c", STRUCK], capture_output=True, text=True, timeout=60, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "stopped True\n", "")
