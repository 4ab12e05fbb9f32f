"""Processes that compute for a page: each does one kind of work, can be stopped, and ends with the page.

They are reached over a pair of sockets that nobody else can open.
"""

import asyncio
import multiprocessing
import os
import resource
import signal
import threading
from collections.abc import Callable, Hashable
from functools import cache
from multiprocessing import forkserver, resource_tracker, spawn
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext, ForkServerProcess
from typing import Any

from ...geometry.common import SpinlevError
from ..processes import end_with, safe_path

MEMORY = 4 * 2**30  # Bytes that a process may take
NAME = "spinlev page"  # Of each process
PATIENCE = 10  # By how much a process is nicer than others that does not hurry
Call = Callable[[], tuple[Any, ...]]


@cache
def context() -> ForkServerContext:
    """Processes are copies of one that loads the numeric libraries from now on, and begin in hundredths of a second."""
    found, known = multiprocessing.get_context("forkserver"), spawn.get_preparation_data

    def prepared(name: str) -> dict[str, Any]:  # ours do not run the user's script, which may have no guard
        return {key: value for key, value in known(name).items() if name != NAME or not key.startswith("init_main")}

    spawn.get_preparation_data = prepared
    found.set_forkserver_preload([f"{__package__}.work"])
    with safe_path():
        resource_tracker.ensure_running()
        forkserver.ensure_running()
    return found


class Worker:
    """A process that answers one question after the other, in the asyncio loop of who asks.

    `words` say what the work is, which is cut off after so many `seconds`; `failed` is called with a sentence that says
    why there is no answer. By `patience` others go first; such a process ends, with its memory, when no question waits.
    """

    def __init__(self, words: str, seconds: float, failed: Callable[[str], None], patience: int = 0) -> None:
        self.words, self.seconds, self.failed, self.patience = words, seconds, failed, patience
        self.process: ForkServerProcess | None = None
        self._connection: Connection | None = None
        self._waiting: dict[Hashable, tuple[Call, Callable[[Any], None]]] = {}
        self._task: asyncio.Task[None] | None = None

    @property
    def busy(self) -> bool:
        return self._task is not None and not self._task.done()

    def ask(self, key: Hashable, call: Call, receive: Callable[[Any], None]) -> None:
        """Compute `call`'s function of arguments in turn, for `receive`; a waiting question of this `key` goes."""
        self._waiting.pop(key, None)
        self._waiting[key] = call, receive
        if not self.busy:
            self._task = asyncio.get_running_loop().create_task(self._work())
            self._task.add_done_callback(_stopped)

    def stop(self) -> None:
        """End the process, whatever it is doing, and forget all questions."""
        self._waiting.clear()
        task, process, connection = self._task, self.process, self._connection
        # First of all: a signal may come in between, and who stops everything then must not find half of it.
        self._task = self.process = self._connection = None
        if task is not None:
            task.cancel()
        if connection is not None:
            if task is not None:  # before the file is closed, whose number may be another's at once
                task.get_loop().remove_reader(connection.fileno())
            connection.close()
        if process is not None:
            _end(process)

    async def _work(self) -> None:
        me = asyncio.current_task()
        while self._waiting and self._task is me:  # who receives an answer may have stopped this
            call, receive = self._waiting.pop(next(iter(self._waiting)))
            answer, problem = None, ""
            try:
                async with asyncio.timeout(self.seconds):
                    answer, problem = await self._answer(call())
            except TimeoutError:
                self.stop()
                problem = f"{self.words} took longer than {self.seconds:g} s and was cut off."
            except (EOFError, OSError):
                self.stop()
                problem = "A computation was ended from outside; memory may be short."
            if problem:
                self.failed(problem)
            else:
                receive(answer)
        if self.patience and self._task is me:
            self.stop()

    async def _answer(self, question: tuple[Any, ...]) -> tuple[Any, str]:
        if self.process is None:
            self._connection, other = context().Pipe()
            process = context().Process(target=_serve, name=NAME, args=(other, self.patience), daemon=True)
            # Not here: a signal stops this thread anywhere, and a process that gets no task says so at length.
            begun = asyncio.get_running_loop().run_in_executor(None, process.start)
            try:
                await asyncio.shield(begun)
            except asyncio.CancelledError:  # stopped meanwhile
                begun.add_done_callback(lambda _: _end(process))
                raise
            finally:
                begun.add_done_callback(lambda _: other.close())
            self.process = process
        connection, loop = self._connection, asyncio.get_running_loop()
        assert connection is not None
        connection.send(question)
        said = asyncio.Event()
        loop.add_reader(connection.fileno(), said.set)
        try:
            await said.wait()
        finally:
            if not connection.closed:
                loop.remove_reader(connection.fileno())
        found: tuple[Any, str] = connection.recv()
        return found


def _stopped(task: asyncio.Task[None]) -> None:
    error = None if task.cancelled() else task.exception()
    if error is not None and not isinstance(error, KeyboardInterrupt):
        raise error


def _end(process: ForkServerProcess) -> None:
    process.kill()
    process.join()
    process.close()


def _serve(connection: Connection, patience: int) -> None:
    os.nice(patience)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server
    threading.Thread(target=end_with, args=(connection.fileno(),), daemon=True).start()
    while True:
        try:
            function, *arguments = connection.recv()
            answer, problem = None, ""
            try:
                answer = function(*arguments)
            except SpinlevError as error:
                problem = str(error)
            except Exception as error:  # the last resort: the page says it
                problem = f"The computation failed: {type(error).__name__}: {error}."
            connection.send((answer, problem))
        except (EOFError, BrokenPipeError, ConnectionResetError):  # the page has gone
            return
