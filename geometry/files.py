"""Files that a user names: opened only where they are files, and of a size that can be read.

Files of ours are whole or absent: written under a temporary name, then renamed; and have a checksum at their end. With
it damage is known before any library tries to make sense of the content: HDF5 ignores what comes after its own end;
given a damaged file it may print, raise anything, or not return at all.
"""

import contextlib
import errno
import hashlib
import os
import pickle
import platform
import resource
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import psutil

from .common import ComputationError, InputError, printable, shown

MEGA = 1_000_000
# What is no file of a disk.
KINDS = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
KINDS |= dict.fromkeys((stat.S_IFCHR, stat.S_IFBLK), "a device")
LONGEST = 300  # Characters of a file's name in a message
MEMORY = 2_000_000_000  # Bytes of address space of another process; the libraries alone take a third of it
SLOWER = 4.0  # How much longer by the clock than by the processor a call may take: the machine has others to serve
MARK = b"\nspinlev sha256 "
LENGTH = len(MARK) + 64
MOST = 1_000_000_000  # Bytes of a file of ours that is read
LAUNCH = "from spinlev.geometry.files import _serve; _serve()"

Answer = TypeVar("Answer")


def regular_file(path: str | Path, most_bytes: int, name: str, kind: str) -> BinaryIO:
    """A file that a user named, opened for reading once it is known to be one: others may block, or never end.

    Raises InputError: there is none, it cannot be opened, is a folder, pipe, device or socket, or is larger. Returns
    the file, to be closed; a library that opens the path by itself needs no more than that it was given. `path`: the
    file; `most_bytes`: its size may be so large; `name`: what messages call the input, such as `points`; `kind`: what
    it must be, with its article, such as `a CSV file`.
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
    """All of a file; `path`, `most_bytes`, `name`, `kind`: as of `regular_file`. Raises InputError, also by reading."""
    with regular_file(path, most_bytes, name, kind) as stream:
        try:
            return stream.read(most_bytes)
        except OSError as error:
            raise InputError(f"Input {name} must be {kind}; instead {_fault(path, error)}.") from None


def _opened(path: str | Path) -> BinaryIO | str:
    """A regular file of a disk, opened, looked at before and after; or why it is none, as the end of a sentence."""
    if not isinstance(path, str | Path):  # a number would be taken for a file that is open already
        return f"received {shown(path)}"
    try:
        if kind := KINDS.get(stat.S_IFMT(os.stat(path).st_mode)):
            return f"{_named(path)} is {kind}"
        handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
        found = os.fstat(handle)
    except (OSError, ValueError) as error:
        return _fault(path, error)
    kind = KINDS.get(stat.S_IFMT(found.st_mode))
    try:  # files of /proc that say that they are empty may have no end, or wait for something
        endless = not kind and found.st_size == 0 and os.pread(handle, 1, 0) != b""
    except OSError:
        endless = True
    if not kind and not endless:
        return os.fdopen(handle, "rb")
    os.close(handle)
    return f"{_named(path)} is {kind or 'no file of a disk, but of the system'}"


def _fault(path: str | Path, error: OSError | ValueError) -> str:
    name, number = _named(path), getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENOTDIR):
        return f"{name} is a link to a file that is not there" if os.path.islink(path) else f"there is no {name}"
    if number == errno.ELOOP:
        return f"{name} is a link that leads back to itself"
    if isinstance(error, OSError):
        return f"{name} cannot be read: {error.strerror}"
    return f"{name} holds a character that no file's name has"


def _named(path: str | Path) -> str:
    text = printable(str(path)).replace("\n", "\\n")
    return text if len(text) <= LONGEST else f"…{text[-LONGEST:]}"


class LostError(ComputationError):
    """The process ended without an answer; the message is the end of a sentence: "does not come to an end with it"."""


class CrashError(LostError):
    """The process crashed: asked slightly differently, the library may well answer."""


def call_apart(seconds: float, function: Callable[..., Answer], *given: Any) -> Answer:
    """Call a function of this package in another process.

    Raises LostError: the process took too long, or needed more than `MEMORY`; CrashError: it crashed; Exception:
    whatever the function raises. `seconds`: of processor time; `function`: at the top of its module; `*given`: its
    arguments, which like the answer must be such that pickle takes them.
    """
    # -P: no module of the current folder. Processes of multiprocessing would run the user's script once more.
    command = [sys.executable, "-P", "-c", LAUNCH, f"{function.__module__}.{function.__qualname__}"]
    task, quiet = pickle.dumps((seconds, function, given)), subprocess.DEVNULL
    alone = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # each thread takes address space
    try:
        done = subprocess.run(
            command, input=task, stdout=subprocess.PIPE, stderr=quiet, timeout=SLOWER * seconds, check=False, env=alone
        )
    except subprocess.TimeoutExpired:
        raise LostError("does not come to an end with it") from None
    return outcome(done.returncode, done.stdout)  # type: ignore[no-any-return]


def outcome(status: int, sent: bytes) -> Any:
    """The answer that a process sent which ended with a status. Raises as `call_apart`."""
    if status in (-signal.SIGXCPU, -signal.SIGKILL):
        raise LostError("does not come to an end with it")
    try:
        answer, error = pickle.loads(sent)
    except (EOFError, pickle.UnpicklingError):
        raise CrashError("crashes on it") from None
    if isinstance(error, MemoryError):
        raise LostError(f"needs more than {MEMORY / 1e9:g} GB of memory for it")
    if error is not None:
        raise error
    return answer


def _serve() -> None:
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # libraries may print what they like, where nobody listens
    answers.write(sent_answer(sys.stdin.buffer.read()))
    answers.flush()
    os._exit(0)  # what a damaged shape left behind may crash as it is cleared away


def sent_answer(task: bytes) -> bytes:
    """Answer of a process that has the limits of its task from here on."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(ValueError):  # the limit of this process may be lower already
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    seconds, function, given = pickle.loads(task)
    limit = int(time.process_time() + seconds) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
    answer: tuple[Any, BaseException | None]
    try:
        answer = function(*given), None
    except Exception as error:
        answer = None, error
    try:
        return pickle.dumps(answer)
    except Exception:  # an error of a library that pickle does not take: its text does
        return pickle.dumps((None, RuntimeError(str(answer[1]))))


def write_whole(path: str | Path, content: bytes) -> None:
    """Write a file at once: libraries may not survive a full disk. Raises OSError, which names the file."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


@contextlib.contextmanager
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
    """What was sealed, if the file `path` is as then, else None. Raises InputError, see `regular_file`, and OSError.

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
SLOWEST = 20.0  # Seconds to look through a small file, which takes a fraction of one
LARGEST = 1_000_000_000  # Bytes of numbers that a file may unfold to: a few of it can stand for any number of zeros
PACE = 10e6  # Bytes for each second more; disks and HDF5's filters are ten times as fast


def is_hdf5(path: Path) -> bool:
    """Whether a file is there and begins as HDF5 does."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return stream.read(len(SIGNATURE)) == SIGNATURE


def hdf5_fault(path: Path, longest: float = SLOWEST) -> str | None:
    """What is wrong with an HDF5 file, as a sentence's end; None if all can be read, a small one in `longest` s."""
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
