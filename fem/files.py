"""Files that are whole or absent: written under a temporary name, then renamed; and a checksum at their end.

With it damage is known before any library tries to make sense of the content: HDF5 ignores what comes after its own
end; given a damaged file it may print, raise anything, or not return at all.
"""

import hashlib
import os
import platform
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

from ..geometry.files import LostError, call_apart, file_content, regular_file

MARK = b"\nspinlev sha256 "
LENGTH = len(MARK) + 64
MOST = 1_000_000_000  # Bytes of a file that is read


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


def seal(content: bytes) -> bytes:
    """The content with its checksum."""
    return content + MARK + hashlib.sha256(content).hexdigest().encode()


def sealed(path: Path) -> bool | None:
    """Whether the file is as it was when it was sealed; None if it never was. Raises InputError, see `file_content`."""
    content = file_content(path, MOST, "file", "a regular file")
    return _as_sealed(content) if content[-LENGTH:-64] == MARK else None


def unsealed(path: Path, mine: bool = False, name: str = "file") -> bytes | None:
    """What was sealed, if the file is as it was then, else None. Raises InputError, see `regular_file`, and OSError.

    With `mine` it is None too where another user than this one and root may have written it; messages call it `name`.
    """
    with regular_file(path, MOST, name, "a regular file") as stream:
        if mine and not (ours(found := os.fstat(stream.fileno())) and closed(found)):
            return None
        content = stream.read(MOST)
    return content[:-LENGTH] if _as_sealed(content) else None


def _as_sealed(content: bytes) -> bool:
    """Whether a content ends in its checksum; it is large, and not copied for that."""
    return content[-LENGTH:] == MARK + hashlib.sha256(memoryview(content)[:-LENGTH]).hexdigest().encode()


def user() -> int:
    """Number of this user; 0 on systems without numbers, where files are trusted by folders that are the user's own."""
    return os.getuid() if hasattr(os, "getuid") else 0


def ours(found: os.stat_result) -> bool:
    """Whether a file is this user's or root's."""
    return found.st_uid in (0, user())


def closed(found: os.stat_result) -> bool:
    """Whether no other than a file's owner may write there."""
    return not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


SIGNATURE = b"\x89HDF\r\n\x1a\n"
LONGEST = 20.0  # Seconds to look through a small file, which takes a fraction of one
LARGEST = 1_000_000_000  # Bytes of numbers that a file may unfold to: a few of it can stand for any number of zeros
PACE = 10e6  # Bytes for each second more; disks and HDF5's filters are ten times as fast


def is_hdf5(path: Path) -> bool:
    """Whether a file is there and begins as HDF5 does."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return stream.read(len(SIGNATURE)) == SIGNATURE


def hdf5_fault(path: Path, longest: float = LONGEST) -> str | None:
    """What is wrong with an HDF5 file, as the end of a sentence; None if all of it can be read.

    A small file is given up after `longest` seconds.
    """
    try:
        call_apart(longest + path.stat().st_size / PACE, look_through, path)
    except LostError as error:
        return f"HDF5 {error}"
    except Exception as error:
        return str(error).strip().rpartition("\n")[2] or "HDF5 cannot read it"
    return None


def look_through(path: str | Path) -> None:
    """Read every attribute and every dataset of an HDF5 file. Raises whatever HDF5 makes of a damaged one."""
    import h5py

    left = LARGEST

    def read(_: str, item: h5py.Group | h5py.Dataset) -> None:
        nonlocal left
        dict(item.attrs)
        if isinstance(item, h5py.Dataset):
            left -= item.nbytes
            if left < 0:
                raise ValueError(
                    f"Input file must hold at most {LARGEST / 1e6:g} MB of numbers; instead it holds more."
                )
            item[()]

    with h5py.File(path, "r") as file:
        dict(file.attrs)
        file.visititems(read)
