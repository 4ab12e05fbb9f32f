"""Messages, progress and answers on the terminal, and what to install where a library is missing."""

import codecs
import ctypes
import importlib.util
import io
import json
import logging
import os
import platform
import sys
import threading
import time
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from ...geometry.common import printable

# Name of the error handler for encodings: it writes what an encoding lacks in ASCII instead of raising an error.
READABLE = "spinlev-readable"
LETTERS = {"Ω": "Omega", "ω": "omega", "Δ": "Delta", "δ": "delta", "λ": "lambda", "μ": "u", "π": "pi", "θ": "theta"}
SIGNS = {"±": "+-", "×": "x", "·": ".", "•": "*", "⁄": "/", "≤": "<=", "≥": ">=", "≈": "~", "→": "->", "°": "deg"}
MARKS = {"∞": "inf", "√": "sqrt", "∂": "d", **dict.fromkeys("−–—‐", "-"), **dict.fromkeys("“”", '"'), "’": "'"}
ASCII = str.maketrans(LETTERS | SIGNS | MARKS)


def make_readable() -> None:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=READABLE)


def _readable(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = unicodedata.normalize("NFKD", error.object[error.start : error.end]).translate(ASCII)
    return "".join(c if c.isascii() else "?" for c in text if not unicodedata.combining(c)), error.end


codecs.register_error(READABLE, _readable)


# What is not needed by the first run, and the modules of each.
EXTRAS = {
    "view": ("pyvista", "vtkmodules", "imageio", "trame_vtk"),
    "studies": ("skfem", "magpylib", "dynesty", "jinja2"),
    "explore": ("tornado",),
    "cluster": ("distributed", "dask"),
}
FORTRAN, DRAWING = "libraries of Fortran", "3-D pictures"
PACKAGES = {
    "Debian or Ubuntu": {FORTRAN: "apt-get install libquadmath0", DRAWING: "apt-get install libegl1 libgl1"},
    "Fedora": {FORTRAN: "dnf install libquadmath", DRAWING: "dnf install mesa-libEGL mesa-libGL mesa-dri-drivers"},
    "macOS": {FORTRAN: "brew install gcc", DRAWING: "nothing to install, the system draws"},
}
# By a word of /etc/os-release.
FAMILIES = {"debian": "Debian or Ubuntu", "ubuntu": "Debian or Ubuntu", "fedora": "Fedora", "rhel": "Fedora"}
QUADMATH = "libquadmath.so.0"


def way_out(need: str) -> str:
    """A sentence: what to install for FORTRAN or DRAWING, on this system or, where it is not known here, on each."""
    system = "macOS" if sys.platform == "darwin" else None
    with suppress(OSError):  # no such file
        release = platform.freedesktop_os_release()
        words = [release.get("ID", ""), *release.get("ID_LIKE", "").split()]
        system = next((FAMILIES[word] for word in words if word in FAMILIES), system)
    return "; ".join(f"{name}: {needs[need]}" for name, needs in PACKAGES.items() if system in (name, None)) + "."


def is_missing_library(error: BaseException) -> bool:
    """Whether an error is that a module's compiled code did not find a library of the system."""
    return isinstance(error, ImportError) and any(word in str(error) for word in ("shared object", "dlopen"))


def missing_extra(error: BaseException) -> str | None:
    """A sentence: what to install where an optional library is missing; None for other errors."""
    top = (getattr(error, "name", None) or "").partition(".")[0] if isinstance(error, ModuleNotFoundError) else ""
    extra = next((extra for extra, modules in EXTRAS.items() if top in modules), None)
    way = f"pip install 'spinlev[{extra}]', or `make develop` in a checkout"
    return extra and f"{top} is needed for this and is not installed: {way}."


def lend_quadmath() -> Path | None:
    """Give NGSolve's libgfortran the libquadmath of numpy's or scipy's wheel where there is none; returns the link.

    None where it is not needed or no wheel has one. Raises OSError where the folder cannot be written.
    """
    home = _folder("ngsolve_openblas")
    if home is None or not list(home.glob("libgfortran.so*")) or _loads(QUADMATH):
        return None
    for owner in ("numpy", "scipy"):
        package = _folder(owner)
        lent = sorted(package.with_name(f"{owner}.libs").glob("libquadmath*.so*")) if package else []
        if lent and _loads(str(lent[0])):
            link = home / QUADMATH
            link.unlink(missing_ok=True)  # an older one, of a version of numpy that is no more
            link.symlink_to(lent[0])
            return link
    return None


def _folder(package: str) -> Path | None:
    found = importlib.util.find_spec(package)
    return Path(found.origin).parent if found and found.origin else None


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


PAUSE = 2.5  # silence after which a line is said, s, once; after long steps a 60th of their time


class Heartbeat(threading.Thread):
    """Says (by `say`) how far a step has come, or how long it has taken, after a `pause` (s) without other words."""

    def __init__(self, say: Callable[[str], None], pause: float = PAUSE) -> None:
        super().__init__(name="heartbeat", daemon=True)
        self._say, self._pause, self._over = say, pause, threading.Event()
        self._began: float | None = None
        self._around: float | None = None  # when the step began of which the present one is a part
        self._said, self._stage, self._fraction = time.monotonic(), "", 0.0

    def said(self, text: str = "") -> None:
        """Something was shown. A text that ends in " ..." begins a step, any other ends it; that around it goes on."""
        self._said = time.monotonic()
        if text:
            self._began = self._said if text.endswith(" ...") else self._around
            self.advanced(0.0)
        if self._began and self.ident is None:
            self.start()

    @contextmanager
    def around(self) -> Iterator[None]:
        """Steps inside the block are parts of the present one."""
        outer, self._around = self._around, self._began
        try:
            yield
        finally:
            self._around = outer

    def advanced(self, fraction: float, stage: str = "") -> None:
        """Finished share of the step, 0 to 1, or of one of its stages."""
        self._fraction, self._stage = fraction, stage

    def stop(self) -> None:
        """Say no more; returns when the thread has ended."""
        self._over.set()
        if self.ident is not None:
            self.join()

    def run(self) -> None:
        last = ("", "")
        while not self._over.wait(self._pause / 5):
            now, began = time.monotonic(), self._began
            if began is not None and now - self._said > max(self._pause, (now - began) / 60):
                self._said = now
                # The last of a hundred parts may take long: 100 % would look like the end.
                known = 0.01 <= self._fraction < 0.995
                share, taken = f"{self._fraction:.0%}" if known else "", f"{now - began:.0f} s so far"
                # A share that stands still says that nothing happens, which is not so.
                parts = (self._stage, share, taken if (self._stage, share) == last or not share else "")
                last = self._stage, share
                self._say(f"  {', '.join(filter(None, parts))}")


LOG = logging.getLogger("spinlev")
ERRORS = Console(stderr=True, highlight=False, soft_wrap=True, emoji=False)


def note(text: str) -> None:
    """A message; on the command line, and where a caller asks for it, it goes to standard error."""
    LOG.info(text)


def detail(text: str) -> None:
    """Print a message if the user wants to know everything (`--verbose`)."""
    LOG.debug(text)


class _Printed(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self.heartbeat = Heartbeat(lambda text: ERRORS.print(text, markup=False))

    def emit(self, record: logging.LogRecord) -> None:
        text = printable(record.getMessage())
        self.heartbeat.said(text)
        ERRORS.print(text, markup=False)

    def close(self) -> None:
        self.heartbeat.stop()
        super().close()


@contextmanager
def printing(wanted: bool = True, verbose: bool = False) -> Iterator[None]:
    """Messages and progress on standard error inside the block, if they are wanted; details too where `verbose`."""
    if not wanted or LOG.handlers:
        yield
        return
    handler, level = _Printed(), LOG.level
    LOG.addHandler(handler)
    LOG.setLevel(logging.DEBUG if verbose else logging.INFO)
    try:
        yield
    finally:
        LOG.removeHandler(handler)
        LOG.setLevel(level)
        handler.close()


@contextmanager
def progress(label: str) -> Iterator[Callable[..., None]]:
    """A progress bar, if messages are printed; gives a function that takes the finished fraction and a new label."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    shown = LOG.handlers and (ERRORS.is_interactive or ERRORS.is_jupyter)
    with ExitStack() as parts, Progress(*columns, console=ERRORS, transient=True, disable=not shown) as bar:
        task = bar.add_task(label, total=1.0)
        heartbeats = [handler.heartbeat for handler in LOG.handlers if isinstance(handler, _Printed)]
        for heartbeat in heartbeats:
            parts.enter_context(heartbeat.around())

        def advance(fraction: float, text: str = label) -> None:
            if text != bar.tasks[task].description:
                bar.reset(task, description=text)
            bar.update(task, completed=fraction)
            for heartbeat in heartbeats:
                if shown:
                    heartbeat.said()
                else:
                    heartbeat.advanced(fraction, text.partition(": ")[2])

        yield advance


@contextmanager
def stages(label: str) -> Iterator[Callable[[str, float], None]]:
    """A progress bar for work in stages; gives a function that takes a stage's name and its finished fraction."""
    with progress(label) as advance:
        yield lambda name, fraction: advance(fraction, f"{label}: {name}")


@contextmanager
def answers_only() -> Iterator[TextIO]:
    """Give the true standard output; what else prints there, as libraries do from C++, goes to standard error."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        stream = os.fdopen(os.dup(kept), "w", encoding=sys.stdout.encoding, errors=READABLE)
        yield stream
        with suppress(OSError):  # who prints flushes, and gets the error then
            stream.close()
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)


def aligned(rows: Sequence[Sequence[str]], sides: str) -> list[str]:
    """Lines of cells in columns, each to the left "<" or right ">" as `sides` say, of which the last is the rest's."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = sides.ljust(len(widths), sides[-1])
    forms = [f"{{:{side}{width}}}" for side, width in zip(sides, widths, strict=False)]
    return ["  ".join(map(str.format, forms, row)).rstrip() for row in rows]


def to_json(answer: Mapping[str, Any], encoding: str | None = "utf-8") -> str:
    """One JSON object, null for what is not finite; escapes stand for the characters that `encoding` may not have."""
    from pydantic_core import to_jsonable_python

    escaped = encoding is not None and not encoding.lower().startswith("utf")
    plain = to_jsonable_python(answer, inf_nan_mode="null", fallback=lambda array: array.tolist())
    return json.dumps(plain, allow_nan=False, ensure_ascii=escaped)
