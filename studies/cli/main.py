"""The command line: `spinlev`.

Exit status 0: done; 2: bad input, with one message that says what is allowed; 1: the computation failed.
"""

import errno
import os
import sys
import threading
import time
import traceback
from importlib.metadata import version
from pathlib import Path
from typing import Any

from cyclopts import App, CycloptsError
from rich.console import Console

from ...geometry.common import SpinlevError, printable
from ..figures.style import figures_across
from . import commands
from .console import FORTRAN, answers_only, is_missing_library, missing_extra, note, printing, to_json, way_out
from .options import Output
from .start import STOPPED, TOO_MANY_FILES

LONGEST = 1000  # characters of a line of a message

app = App(
    name="spinlev",
    version=lambda: version("spinlev"),
    help="Magnetic levitation by rotation: fields of finite magnets, complete motion.",
    help_format="markdown",
    suppress_keyboard_interrupt=False,
)
NAMES = "run field plate equilibria compare simulate study design figure show report cite new export explore"
for name in NAMES.split():  # in the order of the help
    app.command(getattr(commands, name))
app.register_install_completion_command()


def run(arguments: list[str], stop: threading.Event) -> int:
    """Answer on standard output; the exit status."""
    with answers_only() as out:
        return _status(arguments, out, stop)


def _status(arguments: list[str], out: Any, stop: threading.Event | None = None) -> int:
    with printing(verbose="--verbose" in arguments):
        try:
            _answer(arguments, out)
        except CycloptsError as error:
            note(f"{_message(error)}\nTry: spinlev --help")
            return 2
        except SpinlevError as error:
            note(_message(error))
            return error.exit_status
        except OSError as error:
            where = error.filename or "standard output"
            what = f"the computation failed to write or read {where}: {error.strerror or error}; see --out."
            note(f"spinlev: {TOO_MANY_FILES if error.errno == errno.EMFILE else what}")
            return 1
        except (KeyboardInterrupt, Exception) as error:
            stopped = isinstance(error, KeyboardInterrupt) or (stop and stop.is_set())
            if not stopped and "SPINLEV_TRACEBACK" in os.environ:
                raise
            # the last resort: what and where, without a traceback
            note(STOPPED if stopped else f"spinlev: {missing_extra(error) or _unforeseen(error)}")
            return 1
    return 0


def _message(error: Exception) -> str:
    lines = f"spinlev: {error}".split("\n")
    return "\n".join(line if len(line) <= LONGEST else f"{line[:LONGEST]} ..." for line in lines)


def _unforeseen(error: BaseException) -> str:
    if is_missing_library(error):
        mend = f"{sys.executable} -m {__package__}.installation"
        return f"a library cannot be loaded: {error}. It may be enough to run {mend}. {way_out(FORTRAN)}"
    frame = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{Path(frame.filename).parent.name}/{Path(frame.filename).name}:{frame.lineno}"
    return f"the computation failed at {where}: {type(error).__name__}: {error}"


def _answer(arguments: list[str], out: Any) -> None:
    began = time.perf_counter()
    said_of_itself = Console(file=out)  # help and version
    command, bound, _ = app.parse_args(arguments, console=said_of_itself, exit_on_error=False, print_error=False)
    output = bound.arguments.get("output", Output())
    with figures_across(output.width):
        answer = command(*bound.args, **bound.kwargs)
    if isinstance(answer, tuple):  # help and version have said theirs
        values, lines, *then = answer
        timed = {**values, "seconds": time.perf_counter() - began}
        said = to_json(timed, getattr(out, "encoding", None)) if output.json else printable("\n".join(lines))
        print(said, file=out, flush=True)
        for follows in then:
            follows()
