"""Compiled code of earlier processes: whole files with a checksum, under a key of what was compiled.

Who writes such a file decides what the processor does: each user has a folder of his own, and nothing is read that
another one could have written.  A file is what heyoka writes of a thing, which only that kind of thing reads; a pickle
would begin with the name of anything.

heyoka can keep machine code by itself, in a database without checksums: one flipped bit in a constant is a wrong
number, or the end of the process.  It would also have all expressions written anew by each command: a second of `run`.
"""

import io
import logging
import os
import pickle
import zlib
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from ..geometry.files import seal, unsealed, user, write_whole
from .cache import cache_folder, cache_limit, key_of, make_room, others_may_write

LIMIT = 2**29  # Size of all that is kept, bytes; what was not used for the longest time makes room
# Memory of functions kept at hand, bytes, beside those in use; integrators, which have a state, are read anew.
SHARED = 2**26
# What a function takes of it: so many bytes where it was compiled here, and so many times its file.
EACH, TIMES = 3_000_000, 20
KINDS = ("cfunc_dbl", "taylor_adaptive_dbl", "taylor_adaptive_batch_dbl")  # What is kept, by its name in heyoka
LOG = logging.getLogger("spinlev")
Compiled = TypeVar("Compiled")
_functions: OrderedDict[Path, tuple[Any, int]] = OrderedDict()


def compiled(compiler: Callable[..., Compiled], *arguments: Any, **options: Any) -> Compiled:
    """What a `compiler`, `heyoka.cfunc` or `taylor_adaptive`, makes of its arguments, cached where that works."""
    return compiled_later(compiler, lambda: arguments, arguments, **options)


def compiled_later(
    compiler: Callable[..., Compiled], write: Callable[[], Sequence[Any]], source: Any, **options: Any
) -> Compiled:
    """What a compiler makes of arguments that take longer to write than to say what they are written from.

    `compiler`, `options`: as of `compiled`; `write`: the compiler's arguments, called only where nothing is in the
    cache; `source`: all that they depend on, to be pickled; what else `write` does has the number of "code" in FORMATS.
    """
    name = f"{key_of('code', _target(), _content((compiler, source, options)))}.code"
    path = cache_folder() / name  # in this process; on the disk it is in the user's folder there
    found, taken = _functions.pop(path, (None, 0))
    if found is None:
        folder = _folder()
        found, size = _read(folder / name) if folder else (None, 0)
        if found is None:
            with _alone():
                found = compiler(*write(), **options)
            state, _ = cast(Any, found).__getstate__()
            content = zlib.compress(f"{name}\n{type(found).__name__}\n".encode() + state, 1)
            size = len(content)
            try:
                if folder:
                    write_whole(folder / name, seal(content))
                    make_room(folder, min(LIMIT, cache_limit()))
            except OSError as error:  # costs time only
                LOG.debug("Compiled code could not be kept: %s", error)
        taken = EACH + TIMES * size
    if compiler.__name__ == "cfunc":
        _functions[path] = found, taken
        while sum(taken for _, taken in _functions.values()) > SHARED and len(_functions) > 1:
            _functions.popitem(last=False)
    return cast(Compiled, found)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let heyoka evaluate in this thread alone; others wait busily for small work: 1.6 times the time of a search.

    Where the environment says that a process has one thread they do not come back: waking them takes a quarter of a
    command's processor time.
    """
    import heyoka as hy

    if (before := hy.get_nthreads()) > 1:
        hy.set_nthreads(1)
    try:
        yield
    finally:
        if before > 1 and os.environ.get("OMP_NUM_THREADS") != "1":
            hy.set_nthreads(before)


@contextmanager
def _alone() -> Iterator[None]:
    """Let heyoka keep nothing by itself, in this process neither: that would be 2 GB of what is kept here anyway."""
    import heyoka as hy

    states, limit = hy.llvm_state, hy.llvm_state.get_memcache_limit()
    on_disk = states.get_diskcache_enabled()
    states.set_memcache_limit(0)
    states.set_diskcache_enabled(False)
    try:
        with one_thread():
            yield
    finally:
        states.set_memcache_limit(limit)
        states.set_diskcache_enabled(on_disk)


def _folder() -> Path | None:
    """This user's folder for code, if no other user can write there; else that is said, once."""
    try:
        # Not as the user's mask would have it, which often lets a group write.
        (root := cache_folder()).mkdir(mode=0o755, parents=True, exist_ok=True)
        (folder := root / f"code-{user()}").mkdir(mode=0o700, exist_ok=True)
        reason = others_may_write(folder)
    except OSError as error:  # costs time only
        LOG.debug("Compiled code could not be kept: %s", error)
        return None
    if reason:
        _say(reason)
    return None if reason else folder


@cache
def _say(reason: str) -> None:
    LOG.info("Compiled code is neither read nor kept, which costs seconds: %s.", reason)


def _content(requested: object) -> bytes:
    """What is asked for, all its expressions as one: what they share is written once, not in each."""
    import heyoka as hy

    expressions: list[Any] = []

    class Writer(pickle.Pickler):
        def persistent_id(self, thing: Any) -> int | None:
            if not isinstance(thing, hy.expression):
                return None
            expressions.append(thing)
            return len(expressions)

    Writer(stream := io.BytesIO()).dump(requested)
    return stream.getvalue() + pickle.dumps(hy.dfun("asked", expressions))


@cache
def _target() -> str:
    import heyoka as hy

    with _alone():
        x = hy.make_vars("x")
        return f"{hy.__version__} {hy.cfunc([x], [x]).llvm_states}"


def _read(path: Path) -> tuple[Any, int]:
    import heyoka as hy

    try:
        content = unsealed(path, mine=True) or b""  # a folder that was open once may have something left of others
        name, kind, state = zlib.decompress(content).split(b"\n", 2)
        if name.decode() != path.name:
            return None, 0
        form = getattr(hy, KINDS[KINDS.index(kind.decode())])
        made = form.__new__(form)
        with _alone():
            made.__setstate__((state, {}))
        os.utime(path)
        return made, len(content)
    except Exception:  # missing, or of a heyoka that was built otherwise: it raises what it likes
        return None, 0
