"""What a person and what a program sees: messages and progress on standard error, answers on standard output."""

import json
import logging
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Protocol, TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from ...geometry.basics import printable
from .heartbeat import Heartbeat
from .plain_text import READABLE

LOG = logging.getLogger("spinlev")
ERRORS = Console(stderr=True, highlight=False, soft_wrap=True)


class Progressed(Protocol):
    """Moves a progress bar."""

    def __call__(self, fraction: float, text: str = ...) -> None:
        """To the finished fraction, with another label if one is given."""


def note(text: str) -> None:
    """A message; on the command line, and where a caller asks for it, it goes to standard error."""
    LOG.info(text)


def detail(text: str) -> None:
    """A message that is heard only where the user wants to know everything (`--verbose`)."""
    LOG.debug(text)


class _Printed(logging.Handler):
    """Messages as they are, above a progress bar, and a sign of life where there are none."""

    def __init__(self) -> None:
        super().__init__()
        self.heartbeat = Heartbeat(lambda text: ERRORS.print(text, markup=False))

    def emit(self, record: logging.LogRecord) -> None:
        text = printable(record.getMessage())
        self.heartbeat.said(text)
        ERRORS.print(text, markup=False)

    def close(self) -> None:
        self.heartbeat.stop()
        super().close()


@contextmanager
def heard(wanted: bool = True, verbose: bool = False) -> Iterator[None]:
    """Messages and progress on standard error inside the block, if they are wanted; details too where `verbose`."""
    if not wanted or LOG.handlers:
        yield
        return
    handler, level = _Printed(), LOG.level
    LOG.addHandler(handler)
    LOG.setLevel(logging.DEBUG if verbose else logging.INFO)
    try:
        yield
    finally:
        LOG.removeHandler(handler)
        LOG.setLevel(level)
        handler.close()


@contextmanager
def silence() -> Iterator[None]:
    """No messages inside the block."""
    before, ERRORS.quiet = ERRORS.quiet, True
    try:
        yield
    finally:
        ERRORS.quiet = before


@contextmanager
def progress(label: str) -> Iterator[Progressed]:
    """A progress bar where messages are heard; gives a function that takes the finished fraction and a new label."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    shown = LOG.handlers and (ERRORS.is_interactive or ERRORS.is_jupyter)
    with Progress(*columns, console=ERRORS, transient=True, disable=not shown) as bar:
        task = bar.add_task(label, total=1.0)

        def advance(fraction: float, text: str = label) -> None:
            if text != bar.tasks[task].description:
                bar.reset(task, description=text)
            bar.update(task, completed=fraction)
            for handler in LOG.handlers:
                if isinstance(handler, _Printed) and shown:
                    handler.heartbeat.said()
                elif isinstance(handler, _Printed):
                    handler.heartbeat.advanced(fraction, text.partition(": ")[2])

        yield advance


@contextmanager
def stages(label: str) -> Iterator[Callable[[str, float], None]]:
    """A progress bar for work in stages; gives a function that takes a stage's name and its finished fraction."""
    with progress(label) as advance:
        yield lambda name, fraction: advance(fraction, f"{label}: {name}")


@contextmanager
def answers_only() -> Iterator[TextIO]:
    """Give the true standard output, while everything else that prints there goes to standard error.

    The numeric libraries print from C++; a program that reads our answer must not see that.
    """
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        stream = os.fdopen(os.dup(kept), "w", encoding=sys.stdout.encoding, errors=READABLE)
        yield stream
        with suppress(OSError):  # who prints flushes, and is told then
            stream.close()
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)


def plain(value: Any) -> Any:
    """The same value in types that JSON knows; what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # of NumPy
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def to_json(answer: Mapping[str, Any], encoding: str | None = "utf-8") -> str:
    """One JSON object; escapes stand for the characters that `encoding` may not have."""
    escaped = encoding is not None and not encoding.lower().startswith("utf")
    return json.dumps(plain(answer), allow_nan=False, ensure_ascii=escaped)
