"""Where the command begins: Ctrl-C is heard while all the rest, which takes about a second, is still being loaded."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading

STOPPED = "spinlev: stopped; what was finished is kept."
AGAIN = 0.01
"""Seconds until an interrupt is raised again that fell where Python drops exceptions."""
MANY = 50_000
"""New objects until Python looks for garbage: at its own 700 that is a tenth of a short run, for next to none."""


def main() -> None:
    """Load the command line, run it, and leave with its exit status."""
    stop = threading.Event()
    _listen(stop)
    gc.set_threshold(MANY)
    os.environ["PYTHONSAFEPATH"] = "1"  # no process begun here loads what lies in the folder that it is begun in
    try:
        from ..terminal import make_readable
        from .late import leave_out, load_late

        load_late("netgen", "netgen.occ", "netgen.meshing", "ngsolve")
        if not any(argument.startswith("--scheduler") for argument in sys.argv):
            leave_out("dask.array")  # xarray would load it, for as long as a flight takes, to see if data are of it
        make_readable()
        from .cli import run

        status = run(sys.argv[1:], stop)
    except BaseException:  # libraries make something else of an interrupt while they are loaded
        if not stop.is_set():
            raise
        print(STOPPED, file=sys.stderr)
        status = 1
    gc.freeze()  # the system takes all memory back: nothing need be looked through once more
    sys.exit(status)


def _listen(stop: threading.Event) -> None:
    """Raise KeyboardInterrupt at Ctrl-C and at SIGTERM: a batch system stops like a person."""

    def stopped(*_: object) -> None:
        stop.set()
        raise KeyboardInterrupt

    def dropped(what: sys.UnraisableHookArgs) -> None:  # in a destructor
        if issubclass(what.exc_type, KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, AGAIN)
        else:
            sys.__unraisablehook__(what)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, stopped)
    sys.unraisablehook = dropped
