"""The process that draws as a copy of this one: what is loaded already need not be loaded again."""

import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import get_context
from types import TracebackType

from .draw_process import answer_all
from .renderer import COMMAND, Drawer


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
