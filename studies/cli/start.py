"""Start of the command line: streams, signals and a home folder, before anything large is loaded."""

import errno
import gc
import os
import signal
import sys
import threading
from contextlib import suppress

STOPPED = "spinlev: stopped; what was finished is kept."
TOO_MANY_FILES = (
    "the computation failed to open a file: this shell allows too few at a time; `ulimit -n 256` allows more."
)
AGAIN = 0.01  # seconds until an interrupt is raised again that fell where Python drops exceptions


def main() -> None:
    """Load the command line, run it, and leave with its exit status."""
    stop = threading.Event()
    _open_streams()
    _listen(stop)
    # Parallel work is by processes, and idle threads wait busily; the user's own setting wins.
    for threads in ("OMP_NUM_THREADS", "NGS_NUM_THREADS"):
        os.environ.setdefault(threads, "1")
    gc.set_threshold(100_000)  # the libraries' many objects stay: looking for garbage among them took 0.6 s of a run
    os.environ["PYTHONSAFEPATH"] = "1"  # no process begun here loads what lies in the folder that it is begun in
    try:
        from .console import make_readable

        make_readable()
        _find_home()
        from .main import run

        status = run(sys.argv[1:], stop)
    except BaseException as error:  # libraries make something else of an interrupt while they are loaded
        if not stop.is_set() and getattr(error, "errno", None) != errno.EMFILE:
            raise
        print(STOPPED if stop.is_set() else f"spinlev: {TOO_MANY_FILES}", file=sys.stderr)
        status = 1
    sys.exit(status)


def _open_streams() -> None:
    """Put something in the place of closed standard streams, lest the next opened file be taken for one."""
    for number, name, mode in ((0, "stdin", os.O_RDONLY), (1, "stdout", os.O_RDONLY), (2, "stderr", os.O_WRONLY)):
        if getattr(sys, name) is not None:
            continue
        opened = os.open(os.devnull, mode)
        if opened != number:
            os.dup2(opened, number)
            os.close(opened)
        os.set_inheritable(number, True)
        setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w", closefd=False))


def _find_home() -> None:
    home = os.path.expanduser("~")
    if os.path.isabs(home) and os.path.isdir(home):
        return
    from ...fem.cache import temporary_home

    with suppress(OSError):
        os.environ["HOME"] = str(instead := temporary_home())
        said = f"spinlev: there is no home folder: {instead} takes its place; HOME and SPINLEV_CACHE name others."
        if "SPINLEV_CACHE" not in os.environ:
            print(said, file=sys.stderr)


def _listen(stop: threading.Event) -> None:
    """Raise KeyboardInterrupt at Ctrl-C, SIGTERM and SIGHUP, which a closed terminal sends more than once."""
    terminals = [number for number in (1, 2) if os.isatty(number)]

    def stopped(number: int, _: object) -> None:
        stop.set()
        if number == signal.SIGHUP:
            signal.signal(signal.SIGHUP, signal.SIG_IGN)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            for gone in terminals:
                if not os.isatty(gone):
                    os.dup2(nowhere, gone)
            os.close(nowhere)
        raise KeyboardInterrupt

    def dropped(what: "sys.UnraisableHookArgs") -> None:  # in a destructor
        if issubclass(what.exc_type, KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, AGAIN)
        else:
            sys.__unraisablehook__(what)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, stopped)
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # else `nohup` wants it to go on
        signal.signal(signal.SIGHUP, stopped)
    sys.unraisablehook = dropped
