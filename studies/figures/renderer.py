"""Pictures in three dimensions, drawn by a process of its own.

VTK ends the process that calls it, without a word, where it finds no graphics library: a computation must survive that.
"""

import gc
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from types import TracebackType
from typing import Protocol, TypeAlias

from ...geometry.common import ComputationError
from .draw_process import answer_all
from .view import Sample

COMMAND = (sys.executable, "-P", "-m", f"{__package__}.draw_process")
Drawer: TypeAlias = "Sequence[str] | Copy"
"""What draws: a command that begins a process, or a process that waits."""


class RenderError(ComputationError):
    """Pictures that could not be drawn, and why; those finished before are there."""


class Picture(Protocol):
    """What can be drawn: numbers that can be pickled."""

    def draw(self, progress: Callable[[float], None]) -> bytes:
        """The file's content; called in the other process."""


def render(
    pictures: Mapping[Path, Picture],
    progress: Callable[[float], None] = lambda fraction: None,
    command: Drawer = COMMAND,
) -> None:
    """Draw pictures, all in one process, which a command begins or which waits; write each as soon as it is finished.

    Raises
    ------
    RenderError : the process died or found no way to draw; no older picture is left where one could not be drawn
    OSError : a file cannot be written
    """
    from ...fem.files import write_whole

    for path in pictures:
        path.unlink(missing_ok=True)
    left = list(pictures)
    for answer in _drawn(list(pictures.values()), progress, command):
        if isinstance(answer, str):
            names = ", ".join(path.name for path in left)
            raise RenderError(f"The 3-D pictures are left out ({names}): {answer}")
        write_whole(left.pop(0), answer)


def drawn(picture: Picture, command: Sequence[str] = COMMAND) -> bytes:
    """One picture as the content of a file. Raises RenderError where it cannot be drawn."""
    (answer,) = _drawn([picture], lambda fraction: None, command)
    if isinstance(answer, str):
        raise RenderError(f"The view in three dimensions is left out: {answer}")
    return answer


@cache
def unavailable(command: Sequence[str] = COMMAND) -> str | None:
    """Why nothing can be drawn in three dimensions on this machine; None where a small picture can."""
    (answer,) = _drawn([Sample()], lambda fraction: None, command)
    return f"No 3-D pictures can be drawn: {answer}" if isinstance(answer, str) else None


def _drawn(pictures: Sequence[Picture], progress: Callable[[float], None], command: Drawer) -> Iterator[bytes | str]:
    """The files' contents, one after the other; where that fails, last the reason."""
    with _begun(command) if isinstance(command, Sequence) else command as process:
        try:
            unfinished = len(pictures)
            for answer in _answers(process, pickle.dumps(pictures)):
                if isinstance(answer, float):
                    progress(answer)
                else:
                    yield answer
                    unfinished = 0 if isinstance(answer, str) else unfinished - 1
            if unfinished:
                yield _death(process.wait())
        except BaseException:
            process.kill()
            process.wait()  # leaving the block would not, after Ctrl-C
            raise


def _begun(command: Sequence[str]) -> subprocess.Popen[bytes]:
    messages = None if "SPINLEV_TRACEBACK" in os.environ else subprocess.DEVNULL
    pipe = subprocess.PIPE
    # Ctrl-C at the terminal is for this process, which then ends the other: hence a group of its own.
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=messages, process_group=0)


def _answers(process: "subprocess.Popen[bytes] | Copy", question: bytes) -> Iterator[bytes | float | str]:
    """What the process says until it ends."""
    assert process.stdin
    assert process.stdout
    try:
        with process.stdin as stream:
            stream.write(question)
        while True:
            yield pickle.load(process.stdout)
    except (BrokenPipeError, EOFError, pickle.UnpicklingError):  # it has ended, perhaps in the middle of a word
        return


def _death(status: int) -> str:
    """How the process ended too early, and what would help."""
    from ..cli.console import DRAWING, way_out

    if status == -signal.SIGKILL:
        return "the process that draws them was killed; too little memory may be the reason."
    how = signal.strsignal(-status) if status < 0 else f"exit status {status}"
    return f"the process that draws them died ({how}), as it does without graphics libraries. {way_out(DRAWING)}"


class Copy:
    """What `subprocess.Popen` offers, of a copy of this process that waits for pictures to draw."""

    def __init__(self) -> None:
        (asked, ask), (told, tell) = os.pipe(), os.pipe()
        self._process = get_context("fork").Process(target=_draw, args=(asked, tell, (ask, told)), daemon=True)
        self._process.start()
        os.close(asked)
        os.close(tell)
        self.stdin, self.stdout = os.fdopen(ask, "wb"), os.fdopen(told, "rb")

    def wait(self) -> int:
        """The exit status, negative for the signal that ended it."""
        self._process.join()
        return self._process.exitcode or 0

    def kill(self) -> None:
        """End it."""
        self._process.kill()

    def __enter__(self) -> "Copy":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: TracebackType | None) -> None:
        self.stdin.close()
        self.stdout.close()
        self.wait()


@contextmanager
def copied() -> Iterator[Drawer]:
    """A copy of this process, made before the work begins; where copies are not safe, the command of a new one.

    A copy has what other threads held locked, for ever: hence this one must have no others yet. It ends with the block.
    """
    if sys.platform != "linux" or threading.active_count() > 1:
        yield COMMAND
        return
    import matplotlib.pyplot  # noqa: F401  # for the figures here and for VTK there

    gc.freeze()  # what is loaded lives to the end, here and there
    with Copy() as copy:
        yield copy


def _draw(asked: int, tell: int, others: tuple[int, int]) -> None:
    """The copy's life: pictures from one pipe, answers to the other."""
    os.setpgid(0, 0)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, signal.SIG_DFL)
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    for descriptor in others:
        os.close(descriptor)
    if "SPINLEV_TRACEBACK" not in os.environ:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    os.dup2(2, 1)  # what libraries print is no answer
    with os.fdopen(asked, "rb") as questions, os.fdopen(tell, "wb") as answers:
        answer_all(questions, answers)
