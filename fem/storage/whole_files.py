"""Files that are whole or absent: written under a temporary name, then renamed."""

import os
import platform
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil


def write_whole(path: str | Path, content: bytes) -> None:
    """Write a file at once. Raises OSError, which names the file.

    Libraries that write files themselves may not survive a full disk: let them write to memory.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(content)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `path` that becomes `path` when the block ends without an error.

    The temporary name keeps the suffix, since writers choose the format by it. Missing folders are made, and what
    processes of this machine that were killed have left of the same file is removed.
    Raises OSError, which names the file.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _tidy(path)
        handle, name = tempfile.mkstemp(prefix=f"{_prefix(path)}{os.getpid()}-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            os.chmod(temporary, 0o644)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def _prefix(path: Path) -> str:
    return f".{path.stem}-{platform.node()}-"


def _tidy(path: Path) -> None:
    """Remove temporary files of processes that are no more."""
    prefix = _prefix(path)
    for left in path.parent.glob(f".*{path.suffix}"):
        owner = left.name.removeprefix(prefix).partition("-")[0] if left.name.startswith(prefix) else ""
        if owner.isdecimal() and not psutil.pid_exists(int(owner)):
            left.unlink(missing_ok=True)
