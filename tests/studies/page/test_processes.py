"""Processes of a page: they answer, say when they cannot, and end when they are told."""

import asyncio
import math
import subprocess
import sys
import time

from spinlev.studies.page.processes import Failure, Worker


def heard_from(task, *arguments):
    """The first answer of a process, and the process itself."""

    async def listen():
        answers = []
        worker = Worker(task, arguments, answers.append)
        while not answers:
            await asyncio.sleep(0.01)
        worker.stop()
        return answers[0], worker.process

    return asyncio.run(asyncio.wait_for(listen(), 60))


def test_a_task_that_fails_is_an_answer():
    """The square root of a connection."""
    answer, process = heard_from(math.sqrt)
    assert isinstance(answer, Failure)
    assert answer.message.startswith("The computation failed: TypeError: must be real number")
    process.join(10)
    assert not process.is_alive()


def test_a_process_that_is_ended_from_outside_is_an_answer():
    async def listen():
        answers = []
        worker = Worker(_sleep, (), answers.append, patient=True)
        await asyncio.sleep(0.2)
        worker.process.kill()
        while not answers:
            await asyncio.sleep(0.01)
        return answers[0]

    answer = asyncio.run(asyncio.wait_for(listen(), 60))
    assert isinstance(answer, Failure)
    assert "ended from outside" in answer.message


def test_a_process_at_work_ends_when_it_is_told():
    async def begin():
        worker = Worker(_sleep, (), print)
        worker.stop()
        worker.send("to nobody")
        return worker.process

    process = asyncio.run(begin())
    process.join(10)
    assert process.exitcode == -9


STRUCK = """
import asyncio, os, signal
from multiprocessing import forkserver
from spinlev.studies.page.processes import Worker
from spinlev.studies.page.work import follow

def stopped(*_):
    raise KeyboardInterrupt

def struck(descriptors, connect=forkserver.connect_to_new_process):
    found = connect(descriptors)
    os.kill(os.getpid(), signal.SIGTERM)
    return found

async def begin():
    Worker(follow, (), print)

signal.signal(signal.SIGTERM, stopped)
forkserver.connect_to_new_process = struck
try:
    asyncio.run(begin())
except KeyboardInterrupt:
    print("stopped", signal.getsignal(signal.SIGTERM) is stopped)
"""


def test_a_stop_while_a_process_begins_is_no_traceback():
    """SIGTERM comes when the process is there and does not know its task yet; all of them have ended afterwards."""
    ended = subprocess.run([sys.executable, "-c", STRUCK], capture_output=True, text=True, timeout=60, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "stopped True\n", "")


def _sleep(connection):
    time.sleep(100)
