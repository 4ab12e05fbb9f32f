"""Calls in a process of their own: what others wrote may crash a library, or never let it return.

The call ends with its process's limits on processor time and memory; whatever happens there, this process goes on.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from .errors import ComputationError

MEMORY = 2_000_000_000
"""Bytes of address space; the libraries alone take a third of it."""
SLOWER = 4.0
"""How much longer by the clock than by the processor a call may take: the machine has others to serve."""
LAUNCH = "from spinlev.geometry.basics.apart import _serve; _serve()"

Given = ParamSpec("Given")
Answer = TypeVar("Answer")


class LostError(ComputationError):
    """The process ended without an answer; the message is the end of a sentence: "does not come to an end with it"."""


class CrashError(LostError):
    """The process crashed: asked slightly differently, the library may well answer."""


def call_apart(seconds: float, function: Callable[Given, Answer], *given: Given.args, **named: Given.kwargs) -> Answer:
    """What a function of this package returns, called in another process.

    Parameters
    ----------
    seconds : of processor time
    function : at the top of its module
    *given, **named : its arguments, which like the answer must be such that pickle takes them

    Raises
    ------
    LostError : the process took too long, or needed more than `MEMORY`
    CrashError : it crashed
    Exception : whatever the function raises
    """
    task = pickle.dumps((seconds, function, given, named))
    name = f"{function.__module__}.{function.__qualname__}"
    command = [sys.executable, "-P", "-c", LAUNCH, name]  # -P: no module of the current folder
    alone = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # each thread takes address space
    try:
        done = subprocess.run(
            command, input=task, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            timeout=SLOWER * seconds, check=False, env=alone,
        )  # fmt: skip
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
    """Answer one call from standard input; libraries may print what they like."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())
    answers.write(sent_answer(sys.stdin.buffer.read()))
    answers.flush()
    os._exit(0)  # what a damaged shape left behind may crash as it is cleared away


def sent_answer(task: bytes) -> bytes:
    """What a process sends that has the limits of its task from here on."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(ValueError):  # the limit of this process may be lower already
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    seconds, function, given, named = pickle.loads(task)
    used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    limit = int(used + seconds) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
    answer: tuple[Any, BaseException | None]
    try:
        answer = function(*given, **named), None
    except Exception as error:
        answer = None, error
    try:
        return pickle.dumps(answer)
    except Exception:  # an error of a library that pickle does not take: its text does
        return pickle.dumps((None, RuntimeError(str(answer[1]))))
