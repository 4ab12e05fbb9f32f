"""Processes of this machine that work for this one, each over a pair of sockets that nobody else can open.

No port and no shared memory is needed, and no guard in the user's script: a process begins as `python -P`, so that it
loads nothing from the folder it happens to be in, and then gets where this one looks for modules.
"""

import os
import pickle
import select
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from typing import Any

import cloudpickle

from ..fem.cache import program_digest
from ..geometry.common import ComputationError

PATIENCE = 5.0  # seconds for a process to tidy up its unfinished files before it is killed
THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NGS_NUM_THREADS")
BEGIN = "import gc, sys, pickle; from multiprocessing.connection import Connection; gc.set_threshold(100_000); \
c = Connection(int(sys.argv[1])); sys.path[:] = pickle.loads(c.recv_bytes()); from {module} import serve; serve(c)"
Function = Callable[[Any], Iterable[Any]]
Answers = Generator[tuple[Any, Any], None, None]  # with their items


@dataclass(frozen=True)
class Death:
    """How a process ended before its work was done, as the end of a sentence, and how often."""

    how: str
    times: int = 1


class NoProcessError(ComputationError):
    """The system lets no process begin; the message says why."""


def program() -> str:
    """The digest of the program as a process reads it, see `program_digest`."""
    return program_digest()


def results(number: int, function: Function, items: deque[Any], showing: bool = False) -> Answers:
    """Results of a `function`, which gives an iterable, for `items` as they come; a `Death` for what is missing.

    Each comes with its item; who iterates may append others. At most `number` processes work; those that only draw
    (`showing`) may be of any version of the program, and say nothing. Raises NoProcessError where none can begin;
    ComputationError where the function raised, or the program was changed since this process began.
    """
    busy: dict[Connection, tuple[_Process, Any]] = {}
    free: list[_Process] = []
    try:
        while items or busy:
            while items and (free or len(busy) < number):
                try:
                    process = free.pop() if free else _Process(function, showing)
                except OSError as error:  # too many open files or processes, too little memory
                    number = _fewer(len(busy), str(error))
                    break
                process.send(item := items.popleft())
                busy[process.connection] = process, item
            for connection in wait(list(busy)):
                process, item = busy[connection]  # type: ignore[index]
                kind, content = process.receive()
                if kind in ("death", "done"):
                    del busy[process.connection]
                if kind == "ready":
                    process.ready = True
                    if not showing and content != program():
                        raise ComputationError(
                            "The program was changed while it computed: what is finished is kept; begin again."
                        )
                elif kind == "raised":
                    raise ComputationError(f"A process of this sweep failed: {content}.")
                elif kind == "done":
                    free.append(process)
                elif kind == "result":
                    yield item, content
                else:
                    process.stop()
                    if process.ready:
                        yield item, content
                    else:  # no death of its item, which it had not begun
                        items.appendleft(item)
                        number = _fewer(len(busy), f"it {content.how}")
    finally:
        left = [*free, *(process for process, _ in busy.values())]
        for process in left:  # all are asked before the first is waited for
            process.terminate()
        for process in left:
            process.stop()


def _fewer(left: int, why: str) -> int:
    if not left:
        raise NoProcessError(f"No process can begin: {why}.")
    return left


def mapped(number: int) -> Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[Any]]:
    """A function like `map` in so many processes; ComputationError where one dies, none can begin, or a call raised."""

    def map_in_processes(function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
        found: dict[int, Any] = {}
        for (k, _), answer in results(number, lambda item: [function(item[1])], deque(enumerate(items))):
            if isinstance(answer, Death):
                raise ComputationError(f"A process {answer.how}: choose fewer workers, or a machine with more memory.")
            found[k] = answer
        return (found[k] for k in sorted(found))

    return map_in_processes


@contextmanager
def safe_path() -> Iterator[None]:
    """Python processes that libraries begin in this block load nothing from the folder they happen to be in."""
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = before


class _Process:
    def __init__(self, function: Function, showing: bool) -> None:
        self.ready = False
        self.connection, other = Pipe()
        silent = subprocess.DEVNULL if showing and "SPINLEV_TRACEBACK" not in os.environ else None
        one_thread = dict.fromkeys(THREADS, "1") | {"MALLOC_TRIM_THRESHOLD_": "65536"}
        try:
            with other:
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-c", BEGIN.format(module=__name__), str(other.fileno())],
                    pass_fds=(other.fileno(),),
                    stdin=subprocess.DEVNULL,
                    stdout=silent,
                    stderr=silent,
                    env=one_thread | dict(os.environ),
                    process_group=0,  # Ctrl-C at the terminal is for this process, which then ends the other
                )
        except BaseException:
            self.connection.close()
            raise
        here = [os.getcwd()] if "" in sys.path else []
        self.send([place for place in sys.path if place] + here)
        self.send(function)

    def send(self, what: Any) -> None:
        with suppress(OSError):  # it has ended, which `receive` finds out
            self.connection.send_bytes(cloudpickle.dumps(what))  # functions of a notebook as well

    def receive(self) -> tuple[str, Any]:
        try:
            kind, content = pickle.loads(self.connection.recv_bytes())
        except (EOFError, OSError):
            status = self._process.wait()
            if status == -signal.SIGKILL:
                return "death", Death("was killed (out of memory?)")
            return "death", Death(f"died ({signal.strsignal(-status) if status < 0 else f'exit status {status}'})")
        return kind, content

    def terminate(self) -> None:
        self._process.terminate()

    def stop(self) -> None:
        self.connection.close()
        self._process.terminate()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:  # deep in a library
            self._process.kill()
            self._process.wait()


def serve(connection: Connection) -> None:
    """The life of such a process: items come, results go, until the other end is closed."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # unfinished files are removed on the way out
    threading.Thread(target=end_with, args=(connection.fileno(),), daemon=True).start()

    def say(kind: str, content: Any = None) -> None:
        connection.send_bytes(cloudpickle.dumps((kind, content)))

    try:
        say("ready", program())
        content, function = connection.recv_bytes(), None
        while True:
            item = pickle.loads(connection.recv_bytes())
            try:
                function = function or pickle.loads(content)
                for result in function(item):
                    say("result", result)
                say("done")
            except Exception as error:
                say("raised", f"{type(error).__name__}: {error}")
    except (EOFError, ConnectionError):  # it is over
        return


def end_with(descriptor: int) -> None:
    """End when the other process has: it closes its end of the sockets, or is killed."""
    poll = select.poll()
    poll.register(descriptor, select.POLLHUP)
    poll.poll()
    os._exit(1)
