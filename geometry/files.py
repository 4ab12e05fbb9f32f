"""Files that a user names: opened only where they are files, and of a size that can be read."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

from .errors import InputError, printable, shown

MEGA = 1_000_000
KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
LONGEST = 300
"""Characters of a file's name in a message."""


def regular_file(path: str | Path, most_bytes: int, name: str, kind: str) -> BinaryIO:
    """A file that a user named, opened for reading once it is known to be one: what is none can hang, or never end.

    Parameters
    ----------
    path : str or Path
        The file.
    most_bytes : int
        Its size may be so large.
    name : str
        What messages call the input, such as `points`.
    kind : str
        What it must be, with its article, such as `a CSV file`.

    Returns
    -------
    BinaryIO
        To be closed; a library that opens the path by itself needs no more than that it was given.

    Raises
    ------
    InputError
        There is none, it cannot be opened, is a folder, pipe, device or socket, or is larger.
    """
    found = _opened(path)
    if isinstance(found, str):
        raise InputError(f"Input {name} must be {kind}; instead {found}.")
    size = os.fstat(found.fileno()).st_size
    if size > most_bytes:
        found.close()
        raise InputError(
            f"Input {name} must be {kind} of at most {most_bytes / MEGA:g} MB; instead {_named(path)} holds "
            f"{size / MEGA:.1f} MB."
        )
    return found


def file_content(path: str | Path, most_bytes: int, name: str, kind: str) -> bytes:
    """All of a file that a user named, as `regular_file` opens it. Raises InputError, also where reading fails."""
    with regular_file(path, most_bytes, name, kind) as stream:
        try:
            return stream.read(most_bytes)
        except OSError as error:
            raise InputError(f"Input {name} must be {kind}; instead {_fault(path, error)}.") from None


def _opened(path: str | Path) -> BinaryIO | str:
    """A regular file of a disk, opened; or why it is none.

    Looked at before, as opening a device may do something, and after, when no other can have taken its place.
    """
    if not isinstance(path, str | Path):  # a number would be taken for a file that is open already
        return f"received {shown(path)}"
    try:
        if kind := _other(os.stat(path)):
            return f"{_named(path)} is {kind}"
        handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
        found = os.fstat(handle)
        kind = _other(found) or ("no file of a disk, but of the system" if _endless(handle, found) else None)
    except (OSError, ValueError) as error:
        return _fault(path, error)
    if not kind:
        return os.fdopen(handle, "rb")
    os.close(handle)
    return f"{_named(path)} is {kind}"


def _endless(handle: int, found: os.stat_result) -> bool:
    """Whether a file that says that it is empty is not: those of /proc may have no end, or wait for something."""
    try:
        return found.st_size == 0 and stat.S_ISREG(found.st_mode) and os.pread(handle, 1, 0) != b""
    except OSError:
        return True


def _other(found: os.stat_result) -> str | None:
    """What it is, if it is no regular file."""
    return next((words for test, words in KINDS if test(found.st_mode)), None)


def _fault(path: str | Path, error: OSError | ValueError) -> str:
    """Why there is no such file, as the end of a sentence."""
    name, number = _named(path), getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENOTDIR):
        return f"{name} is a link to a file that is not there" if os.path.islink(path) else f"there is no {name}"
    if number == errno.ELOOP:
        return f"{name} is a link that leads back to itself"
    if isinstance(error, OSError):
        return f"{name} cannot be read: {error.strerror}"
    return f"{name} holds a character that no file's name has"


def _named(path: str | Path) -> str:
    """The file's name on one line of a message: the end of a long one."""
    text = printable(str(path)).replace("\n", "\\n")
    return text if len(text) <= LONGEST else f"…{text[-LONGEST:]}"
