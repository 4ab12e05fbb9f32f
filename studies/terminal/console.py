"""What a person and what a program sees: messages and progress on standard error, answers on standard output."""

import json
import logging
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, TextIO

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from .plain_text import READABLE

LOG = logging.getLogger("spinlev")
ERRORS = Console(stderr=True, highlight=False, soft_wrap=True)


def note(text: str) -> None:
    """A message; on the command line, and where a caller asks for it, it goes to standard error."""
    LOG.info(text)


class _Printed(logging.Handler):
    """Messages as they are, above a progress bar."""

    def emit(self, record: logging.LogRecord) -> None:
        ERRORS.print(record.getMessage(), markup=False)


@contextmanager
def heard(wanted: bool = True) -> Iterator[None]:
    """Messages and progress on standard error inside the block, if they are wanted."""
    if not wanted or LOG.handlers:
        yield
        return
    handler, level = _Printed(), LOG.level
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    try:
        yield
    finally:
        LOG.removeHandler(handler)
        LOG.setLevel(level)


@contextmanager
def silence() -> Iterator[None]:
    """No messages inside the block."""
    before, ERRORS.quiet = ERRORS.quiet, True
    try:
        yield
    finally:
        ERRORS.quiet = before


@contextmanager
def progress(label: str) -> Iterator[Callable[[float], None]]:
    """A progress bar where messages are heard; gives a function that takes the finished fraction."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=ERRORS, transient=True, disable=not LOG.handlers) as bar:
        task = bar.add_task(label, total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)


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
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value


def to_json(answer: Mapping[str, Any], encoding: str | None = "utf-8") -> str:
    """One JSON object; escapes stand for the characters that `encoding` may not have."""
    escaped = encoding is not None and not encoding.lower().startswith("utf")
    return json.dumps(plain(answer), allow_nan=False, ensure_ascii=escaped)
