"""Pictures in three dimensions, drawn by a process of its own: `python -m` this module.

VTK ends the process that calls it, without a word, where it finds no graphics library: a computation must survive that.
Pictures go to the process pickled, through its standard input; its answers come back the same way: a finished picture
(bytes), the part of all that is done (float), or the reason why there is no more (str).
"""

import io
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from ...geometry.common import ComputationError
from .view import Sample

COMMAND = (sys.executable, "-P", "-m", f"{__package__}.renderer")


class RenderError(ComputationError):
    """Pictures that could not be drawn, and why; those finished before are there."""


class Picture(Protocol):
    """What can be drawn: numbers that can be pickled."""

    def draw(self, progress: Callable[[float], None]) -> bytes:
        """The file's content; called in the other process."""


def render(
    pictures: Mapping[Path, Picture],
    progress: Callable[[float], None] = lambda fraction: None,
    command: Sequence[str] = COMMAND,
) -> None:
    """Draw pictures, all in one process, and write each as soon as it is finished.

    Parameters
    ----------
    pictures : by the file that each becomes
    progress : is told the part of all that is done
    command : begins the process

    Raises
    ------
    RenderError : the process died or found no way to draw; no older picture is left where one could not be drawn
    OSError : a file cannot be written
    """
    from ...fem.files import write_whole

    for path in pictures:
        path.unlink(missing_ok=True)
    left = list(pictures)
    for answer in _rendered(list(pictures.values()), progress, command):
        if isinstance(answer, str):
            names = ", ".join(path.name for path in left)
            raise RenderError(f"The 3-D pictures are left out ({names}): {answer}")
        write_whole(left.pop(0), answer)


def rendered(picture: Picture) -> bytes:
    """One picture as the content of a file. Raises RenderError where it cannot be drawn."""
    (answer,) = _rendered([picture], lambda fraction: None, COMMAND)
    if isinstance(answer, str):
        raise RenderError(f"The view in three dimensions is left out: {answer}")
    return answer


def turnable_page(scene: bytes) -> bytes:
    """The page around a scene that was drawn as turnable."""
    from trame_vtk.tools.vtksz2html import write_html

    text = io.StringIO()
    write_html(scene, text)
    return text.getvalue().encode()


@cache
def unavailable(command: Sequence[str] = COMMAND) -> str | None:
    """Why nothing can be drawn in three dimensions on this machine; None where a small picture can."""
    (answer,) = _rendered([Sample()], lambda fraction: None, command)
    return f"No 3-D pictures can be drawn: {answer}" if isinstance(answer, str) else None


def _rendered(
    pictures: Sequence[Picture], progress: Callable[[float], None], command: Sequence[str]
) -> Iterator[bytes | str]:
    """The files' contents, one after the other; where that fails, last the reason."""
    messages = None if "SPINLEV_TRACEBACK" in os.environ else subprocess.DEVNULL
    pipe = subprocess.PIPE
    # Ctrl-C at the terminal is for this process, which then ends the other: hence a group of its own.
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=messages, process_group=0) as process:
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


def _answers(process: subprocess.Popen[bytes], question: bytes) -> Iterator[bytes | float | str]:
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


def _main() -> None:
    """The life of the process that draws."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer

    def send(answer: Any) -> None:
        pickle.dump(answer, answers)
        answers.flush()

    try:
        pictures = pickle.load(sys.stdin.buffer)
        for number, picture in enumerate(pictures):
            send(picture.draw(lambda fraction, number=number: send((number + fraction) / len(pictures))))
    except Exception as error:  # whatever it is, the other process says it in a line
        from ..cli.console import DRAWING, is_missing_library, missing_extra, way_out

        reason = missing_extra(error) or " ".join(f"{type(error).__name__}: {error}.".split())
        send(f"{reason} {way_out(DRAWING)}" if is_missing_library(error) else reason)
        if "SPINLEV_TRACEBACK" in os.environ:
            raise


if __name__ == "__main__":
    _main()
