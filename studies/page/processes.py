"""Processes that compute for a page; each ends with its page, and when the program that began it has ended."""

from __future__ import annotations

import multiprocessing
import os
import resource
import select
import signal
import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from typing import Any

from bokeh.document import Document
from tornado.ioloop import IOLoop

from ..processes import safe_path

Task = Callable[..., None]
"""Runs in the other process, with a `Connection` first."""
LIBRARIES = f"{__package__}.work"
"""What every process needs."""
MEMORY = 4 * 2**30
"""Bytes that a process may take."""
STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
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


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Signals that stop the program do so after this block.

    A process that is there, but was not told its task, would end with a traceback on the console.
    """
    if threading.current_thread() is not threading.main_thread():  # signals are none of its business
        yield
        return
    came: list[int] = []
    handlers = {number: signal.getsignal(number) for number in STOPS}
    try:
        for number in STOPS:
            if callable(handlers[number]):
                signal.signal(number, lambda which, _: came.append(which))
        yield
    finally:
        for number, handler in handlers.items():
            if callable(handler):
                signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


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
        with _undisturbed():
            self.process.start()
        other.close()
        self._loop = IOLoop.current()
        self._loop.add_handler(self._connection.fileno(), self._listen, IOLoop.READ)
        self._open = True

    def send(self, message: Any) -> None:
        """Ask for something; nothing comes of a process that has ended, or that has not heard the last hundreds."""
        try:
            if select.select([], [self._connection], [], 0)[1]:  # else the loop, and all pages, would wait for it
                self._connection.send(message)
        except (OSError, ValueError):  # it ends, which `_listen` will find out
            return

    def stop(self) -> None:
        """End the process, whatever it is doing."""
        if self._open:
            self._open = False
            self._loop.remove_handler(self._connection.fileno())
            self._connection.close()
            self.process.kill()
            self._loop.add_handler(self.process.sentinel, self._ended, IOLoop.READ)

    def _ended(self, sentinel: int, _: int) -> None:
        """Two files that tell of its end stay open until it is asked."""
        self._loop.remove_handler(sentinel)
        self.process.join()
        self.process.close()

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
    limits : seconds after which a task that was begun or asked, and is not at rest, is cut off, and words for it
    failed : is told why a process could not go on
    """

    def __init__(
        self,
        document: Document,
        hurried: Collection[Task],
        limits: Mapping[Task, tuple[float, str]],
        failed: Callable[[str], None],
    ) -> None:
        self._document, self._hurried, self._limits, self._failed = document, hurried, limits, failed
        self._workers: dict[Task, Worker] = {}
        self._waiting: dict[Task, list[Any]] = {}
        self._ends: dict[Task, Any] = {}

    def __contains__(self, task: Task) -> bool:
        """Whether a process is at a task."""
        return task in self._workers

    def start(self, task: Task, arguments: tuple[Any, ...], heard: Callable[[Any], None]) -> None:
        """Begin a task anew; answers of an earlier process are not heard any more."""
        self.stop(task)

        def later(answer: Any) -> None:
            self._document.add_next_tick_callback(lambda: self._hear(task, worker, heard, answer))

        self._workers[task] = worker = Worker(task, arguments, later, patient=task not in self._hurried)
        self._limit(task)

    def tell(self, task: Task, message: Any) -> None:
        """Send a message to who is at a task, if anybody is."""
        if task in self._workers:
            self._workers[task].send(message)

    def ask(self, task: Task, question: Any, instead: Callable[[Any], bool] = lambda _: False) -> None:
        """Send a question to a task that answers each, when it has answered the last.

        Of those that wait, the ones are left out `instead` of which this one is asked.
        """
        if task not in self._workers:
            return
        if task in self._waiting:
            self._waiting[task] = [*(other for other in self._waiting[task] if not instead(other)), question]
            return
        self._waiting[task] = []
        self.tell(task, question)
        self._limit(task)

    def waits_for(self, task: Task) -> bool:
        """Whether a question is not answered yet."""
        return task in self._waiting

    def rest(self, task: Task) -> None:
        """Nothing more is waited for: a task need not come to an end."""
        if task in self._ends:
            self._document.remove_timeout_callback(self._ends.pop(task))

    def stop(self, task: Task) -> None:
        """End a task."""
        self.rest(task)
        self._waiting.pop(task, None)
        if task in self._workers:
            self._workers.pop(task).stop()

    def close(self) -> None:
        """End all tasks."""
        for worker in self._workers.values():  # the document, and its callbacks, are gone
            worker.stop()
        self._workers.clear()

    def _limit(self, task: Task) -> None:
        self.rest(task)
        if task in self._limits:
            seconds, _ = self._limits[task]
            self._ends[task] = self._document.add_timeout_callback(partial(self._cut_off, task), int(1000 * seconds))

    def _cut_off(self, task: Task) -> None:
        del self._ends[task]
        seconds, words = self._limits[task]
        self.stop(task)
        self._failed(f"{words} took longer than {seconds:g} s and was cut off.")

    def _hear(self, task: Task, worker: Worker, heard: Callable[[Any], None], answer: Any) -> None:
        if self._workers.get(task) is not worker:
            return
        if isinstance(answer, Failure):
            self.stop(task)
            self._failed(answer.message)
            return
        waiting = self._waiting.pop(task, None)
        if waiting is not None:
            self.rest(task)
            for question in waiting:
                self.ask(task, question)
        heard(answer)


def _run(patient: bool, task: Task, connection: Connection, *arguments: Any) -> None:
    os.nice(PATIENCE if patient else 0)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        task(connection, *arguments)
    except (EOFError, BrokenPipeError, ConnectionResetError):  # the page has gone
        return
    except Exception as error:  # the last resort: the page says it
        with suppress(OSError):  # the page has gone
            connection.send(Failure(f"The computation failed: {type(error).__name__}: {error}."))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def warm_up() -> None:
    """Begin to load the numeric libraries for the processes to come."""
    process = _context().Process(target=_nothing, daemon=True)
    with _undisturbed():
        process.start()


def _nothing() -> None:
    """What the first process does: it makes sure that the others begin soon."""
