"""Processes that compute for a page; each ends with its page, and when the program that began it has ended."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cache
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from typing import Any

from bokeh.document import Document
from tornado.ioloop import IOLoop

from ..sweeps import safe_path

Task = Callable[..., None]
"""Runs in the other process, with a `Connection` first."""
LIBRARIES = f"{__package__.rpartition('.')[0]}.live"
"""What every process needs."""
PATIENCE = 10
"""By how much a process is nicer than others that does not hurry."""


@cache
def _context() -> ForkServerContext:
    """Processes are copies of one that has loaded the numeric libraries, and begin in hundredths of a second."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([LIBRARIES])
    with safe_path():
        resource_tracker.ensure_running()
        forkserver.ensure_running()
    return context


@dataclass(frozen=True)
class Failure:
    """What a process says that cannot go on."""

    message: str


class Worker:
    """A process with a task, to which a page sends messages and which answers with others.

    Parameters
    ----------
    task : a function of the module `work`
    arguments : of the task, behind the connection
    heard : is called with every answer, on the loop
    patient : whether others shall go before it
    """

    def __init__(
        self, task: Task, arguments: tuple[Any, ...], heard: Callable[[Any], None], patient: bool = False
    ) -> None:
        self._heard = heard
        self._connection, other = _context().Pipe()
        self.process = _context().Process(target=_run, args=(patient, task, other, *arguments), daemon=True)
        self.process.start()
        other.close()
        self._loop = IOLoop.current()
        self._loop.add_handler(self._connection.fileno(), self._listen, IOLoop.READ)
        self._open = True

    def send(self, message: Any) -> None:
        """Ask for something; of a process that has ended nothing comes."""
        try:
            self._connection.send(message)
        except OSError:  # it ends, which `_listen` will find out
            return

    def stop(self) -> None:
        """End the process, whatever it is doing."""
        if self._open:
            self._open = False
            self._loop.remove_handler(self._connection.fileno())
            self._connection.close()
        self.process.kill()

    def _listen(self, *_: object) -> None:
        try:
            while self._open and self._connection.poll():
                self._heard(self._connection.recv())
        except (EOFError, ConnectionError):
            self.process.join(1.0)
            status = self.process.exitcode
            self.stop()
            if status:
                self._heard(Failure(f"A computation was ended from outside (status {status}); memory may be short."))


class Crew:
    """The processes of a page, one for each task.

    Parameters
    ----------
    document : of the page, in whose turn answers are heard
    hurried : tasks for which the others have to wait
    failed : is told why a process could not go on
    """

    def __init__(self, document: Document, hurried: Collection[Task], failed: Callable[[str], None]) -> None:
        self._document, self._hurried, self._failed = document, hurried, failed
        self._workers: dict[Task, Worker] = {}

    def __contains__(self, task: Task) -> bool:
        """Whether a process is at a task."""
        return task in self._workers

    def start(self, task: Task, arguments: tuple[Any, ...], heard: Callable[[Any], None]) -> None:
        """Begin a task anew; answers of an earlier process are not heard any more."""
        self.stop(task)

        def later(answer: Any) -> None:
            self._document.add_next_tick_callback(lambda: self._hear(task, worker, heard, answer))

        self._workers[task] = worker = Worker(task, arguments, later, patient=task not in self._hurried)

    def tell(self, task: Task, message: Any) -> None:
        """Send a message to who is at a task, if anybody is."""
        if task in self._workers:
            self._workers[task].send(message)

    def stop(self, task: Task) -> None:
        """End a task."""
        if task in self._workers:
            self._workers.pop(task).stop()

    def close(self) -> None:
        """End all tasks."""
        for task in list(self._workers):
            self.stop(task)

    def _hear(self, task: Task, worker: Worker, heard: Callable[[Any], None], answer: Any) -> None:
        if self._workers.get(task) is not worker:
            return
        if isinstance(answer, Failure):
            self.stop(task)
            self._failed(answer.message)
        else:
            heard(answer)


def _run(patient: bool, task: Task, connection: Connection, *arguments: Any) -> None:
    os.nice(PATIENCE if patient else 0)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        task(connection, *arguments)
    except (EOFError, BrokenPipeError, ConnectionResetError):  # the page has gone
        return
    except Exception as error:  # the last resort: the page says it
        connection.send(Failure(f"The computation failed: {type(error).__name__}: {error}."))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def warm_up() -> None:
    """Begin to load the numeric libraries for the processes to come."""
    process = _context().Process(target=_nothing, daemon=True)
    process.start()


def _nothing() -> None:
    """What the first process does: it makes sure that the others begin soon."""
