"""Pictures in three dimensions, drawn by a process of its own.

VTK ends the process that calls it, without a word, where it finds no graphics library: a computation must survive that.
"""

import io
import os
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import Protocol

from ...geometry.common import ComputationError
from ...geometry.files import write_whole
from ..processes import Death, results
from .view import Sample

Progress = Callable[[float], None]  # called with the finished part of all


class RenderError(ComputationError):
    """Pictures that could not be drawn, and why; those finished before are there."""


class Picture(Protocol):
    """What can be drawn: numbers that can be pickled."""

    def draw(self) -> Iterator[float | bytes]:
        """The finished part, now and then, and last the file's content; iterated in the other process."""


def render(pictures: Mapping[Path, Picture], progress: Progress = lambda fraction: None) -> None:
    """Draw `pictures`, by the file of each, in one process, and write each as it is finished; `progress` gets the part.

    Raises RenderError where they cannot be drawn, and leaves no older ones; OSError where a file cannot be written.
    """
    for path in pictures:
        path.unlink(missing_ok=True)
    left = list(pictures)
    try:
        with closing(drawn(list(pictures.values()), progress)) as contents:
            for content in contents:
                write_whole(left.pop(0), content)
    except RenderError as error:
        names = ", ".join(path.name for path in left)
        raise RenderError(f"The 3-D pictures are left out ({names}): {error}") from None


def rendered(picture: Picture) -> bytes:
    """One picture as the content of a file. Raises RenderError where it cannot be drawn."""
    try:
        (content,) = drawn([picture])
    except RenderError as error:
        raise RenderError(f"The view in three dimensions is left out: {error}") from None
    return content


def turnable_page(scene: bytes) -> bytes:
    """The page around a scene that was drawn as turnable."""
    from trame_vtk.tools.vtksz2html import write_html

    text = io.StringIO()
    write_html(scene, text)
    return text.getvalue().encode()


@cache
def unavailable() -> str | None:
    """Why nothing can be drawn in three dimensions on this machine; None where a small picture can."""
    try:
        list(drawn([Sample()]))
    except RenderError as error:
        return f"No 3-D pictures can be drawn: {error}"
    return None


def drawn(pictures: Sequence[Picture], progress: Progress = lambda fraction: None) -> Generator[bytes, None, None]:
    """The files' contents, one after the other. Raises RenderError, the end of a sentence: why there are no more."""
    try:
        with closing(results(1, _drawing, deque([pictures]), showing=True)) as answers:
            for _, answer in answers:
                if isinstance(answer, Death):
                    from ..cli.console import DRAWING, way_out

                    said = f"the process that draws them {answer.how}, as it does without graphics libraries. "
                    said += way_out(DRAWING)
                    raise RenderError(said)
                if isinstance(answer, str):
                    raise RenderError(answer)
                if isinstance(answer, float):
                    progress(answer)
                else:
                    yield answer
    except ComputationError as error:  # also where no process can begin, or it is of another version
        raise RenderError(str(error)) from None


def _drawing(pictures: Sequence[Picture]) -> Iterator[float | bytes | str]:
    """What the process that draws answers: finished parts, contents, and the reason where there is no more."""
    try:
        for number, picture in enumerate(pictures):
            for part in picture.draw():
                yield (number + part) / len(pictures) if isinstance(part, float) else part
    except Exception as error:  # whatever it is, the other process says it in a line
        from ..cli.console import DRAWING, is_missing_library, missing_extra, way_out

        reason = missing_extra(error) or " ".join(f"{type(error).__name__}: {error}.".split())
        yield f"{reason} {way_out(DRAWING)}" if is_missing_library(error) else reason
        if "SPINLEV_TRACEBACK" in os.environ:
            raise
