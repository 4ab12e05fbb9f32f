"""Where the command begins: Ctrl-C is heard while all the rest, which takes about a second, is still being loaded."""

from __future__ import annotations

import signal
import sys
import threading

STOPPED = "spinlev: stopped; what was finished is kept."


def main() -> None:
    """Load the command line, run it, and leave with its exit status."""
    stop = threading.Event()

    def stopped(*_: object) -> None:
        stop.set()
        raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stopped)
    try:
        from .cli import main as command_line

        command_line()  # has handlers of its own
    except BaseException:  # libraries make something else of an interrupt while they are loaded
        if not stop.is_set():
            raise
        print(STOPPED, file=sys.stderr)
        sys.exit(1)
