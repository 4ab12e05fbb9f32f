"""Libraries that are loaded when they are used, or not at all: an answer from the cache needs no finite elements."""

from __future__ import annotations

import errno
import gc
import os
import signal
import sys
import threading
from contextlib import suppress
from importlib import import_module
from importlib.abc import MetaPathFinder
from threading import RLock
from types import ModuleType
from typing import Any


def load_late(*names: str) -> None:
    """Let `import` find stand-ins for these modules, which load all of them at the first use of any.

    The parts of a package follow it. What is loaded already stays as it is.
    """
    if any(name in sys.modules for name in names):
        return
    sleeping, loading = {name: _StandIn(name) for name in names}, RLock()

    def wake() -> None:
        with loading:
            for name in [name for name in names if sys.modules.get(name) is sleeping[name]]:
                del sys.modules[name]
            for name in names:
                import_module(name)

    for name, module in sleeping.items():
        vars(module)["_wake"] = wake
        sys.modules[name] = module
        package, _, part = name.rpartition(".")
        if package:
            vars(sleeping[package]).update({"__path__": [], part: module})


def leave_out(*names: str) -> None:
    """Let modules that others try to import be missing in this process; what is loaded already stays."""
    sys.meta_path.insert(0, _Missing(names))


class _Missing(MetaPathFinder):
    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names

    def find_spec(self, name: str, path: object, target: object = None) -> None:
        """None, to go on with others, or ModuleNotFoundError."""
        if name in self._names:
            raise ModuleNotFoundError(name, name=name)


class _StandIn(ModuleType):
    def __getattr__(self, name: str) -> Any:
        self._wake()
        return getattr(import_module(self.__name__), name)


STOPPED = "spinlev: stopped; what was finished is kept."
TOO_MANY_FILES = (
    "the computation failed to open a file: this shell allows too few at a time; `ulimit -n 256` allows more."
)
AGAIN = 0.01
"""Seconds until an interrupt is raised again that fell where Python drops exceptions."""
MANY = 50_000
"""New objects until Python looks for garbage: at its own 700 that is a tenth of a short run, for next to none."""


def main() -> None:
    """Load the command line, run it, and leave with its exit status."""
    stop = threading.Event()
    _open_streams()
    _listen(stop)
    gc.set_threshold(MANY)
    os.environ["PYTHONSAFEPATH"] = "1"  # no process begun here loads what lies in the folder that it is begun in
    try:
        from .console import make_readable

        load_late("netgen", "netgen.occ", "netgen.meshing", "ngsolve")
        if not any(argument.startswith("--scheduler") for argument in sys.argv):
            leave_out("dask.array")  # xarray would load it, for as long as a flight takes, to see if data are of it
        make_readable()
        _find_home()
        from .main import run

        status = run(sys.argv[1:], stop)
    except BaseException as error:  # libraries make something else of an interrupt while they are loaded
        if not stop.is_set() and getattr(error, "errno", None) != errno.EMFILE:
            raise
        print(STOPPED if stop.is_set() else f"spinlev: {TOO_MANY_FILES}", file=sys.stderr)
        status = 1
    gc.freeze()  # the system takes all memory back: nothing need be looked through once more
    sys.exit(status)


def _open_streams() -> None:
    """Put something in the place of standard streams that are closed, lest the next opened file be taken for one.

    What is said on standard error is then lost; the answer cannot be written, which is an error, as on a full disk.
    """
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
    """Give a user whose home is not known, or not there, one among the temporary files: libraries ask for it."""
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
    """Raise KeyboardInterrupt at Ctrl-C, at SIGTERM and at SIGHUP: a batch system stops like a person.

    A terminal that is closed says so more than once, and takes no more words: neither may disturb what is still kept.
    """
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

    def dropped(what: sys.UnraisableHookArgs) -> None:  # in a destructor
        if issubclass(what.exc_type, KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, AGAIN)
        else:
            sys.__unraisablehook__(what)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, stopped)
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # else `nohup` wants it to go on
        signal.signal(signal.SIGHUP, stopped)
    sys.unraisablehook = dropped
