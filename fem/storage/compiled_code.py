"""Compiled code of earlier processes: whole files with a checksum, under a key of what was compiled.

heyoka can keep machine code by itself, in a database without checksums: one flipped bit in a constant is a wrong
number.  What it has compiled can be pickled with the code in it, which is read again in hundredths of a second.
"""

import hashlib
import io
import logging
import os
import pickle
import zlib
from collections import OrderedDict
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from .cache import cache_folder, make_room
from .program_text import digest_of
from .whole_files import seal, unsealed, write_whole

LIMIT = 2**29
"""Size of all that is kept, bytes; what was not used for the longest time makes room."""
SHARED = 2**23
"""The same of functions that this process keeps at hand, which take 20 times as much of its memory; those in use are
not lost by it, and integrators, which have a state, are read anew each time."""
Compiled = TypeVar("Compiled")
_functions: OrderedDict[Path, tuple[Any, int]] = OrderedDict()


def compiled(compiler: Callable[..., Compiled], *arguments: Any, **options: Any) -> Compiled:
    """What a compiler makes of its arguments, from the cache if it is there.

    Damaged code is thrown away without a word and compiled anew; a cache that cannot be written does no harm.

    Parameters
    ----------
    compiler : ``heyoka.cfunc`` or ``heyoka.taylor_adaptive``
    arguments, options : the compiler's
    """
    return _kept((compiler, arguments, options), lambda: compiler(*arguments, **options))


def compiled_later(
    compiler: Callable[..., Compiled], write: Callable[[], Sequence[Any]], source: Any, package: str, **options: Any
) -> Compiled:
    """What a compiler makes of arguments that take longer to write than to say what they are written from.

    Parameters
    ----------
    compiler, options : as of `compiled`
    write : the compiler's arguments; called only where nothing is in the cache
    source : all that they depend on, which can be pickled
    package : the room of `write`, with all that it imports: its text is part of the key
    """
    asked = compiler, source, digest_of(package), options
    return _kept(asked, lambda: compiler(*write(), **options))


def _kept(asked: tuple[Any, ...], make: Callable[[], Compiled]) -> Compiled:
    path = cache_folder() / "code" / f"{hashlib.sha256(_target() + _Asked.of(asked)).hexdigest()}.code"
    known, size = _functions.pop(path, (None, 0))
    found: Compiled | None = known or _read(path)
    if found is None:
        found = make()
        _keep(found, path)
    if asked[0].__name__ == "cfunc":
        _functions[path] = found, size or _size(path)
        while sum(size for _, size in _functions.values()) > SHARED and len(_functions) > 1:
            _functions.popitem(last=False)
    return found


def _size(path: Path) -> int:
    with suppress(OSError):  # it could not be kept
        return path.stat().st_size
    return 0


class _Asked(pickle.Pickler):
    """Writes what is asked for with all its expressions as one: what they share is written once, not in each."""

    def __init__(self, stream: io.BytesIO) -> None:
        import heyoka as hy

        super().__init__(stream)
        self._kind, self._found = hy.expression, list[Any]()

    def persistent_id(self, thing: Any) -> int | None:
        """The number of an expression; None for what is no expression."""
        if not isinstance(thing, self._kind):
            return None
        self._found.append(thing)
        return len(self._found)

    @classmethod
    def of(cls, asked: object) -> bytes:
        """All of it as bytes."""
        import heyoka as hy

        writer = cls(stream := io.BytesIO())
        writer.dump(asked)
        return stream.getvalue() + pickle.dumps(hy.dfun("asked", writer._found))


@cache
def _target() -> bytes:
    """What code is compiled for: heyoka, and the processor as its compiler sees it.

    From here on heyoka keeps none by itself, in a process neither: that would be 2 GB of what is kept here anyway.
    """
    import heyoka as hy

    hy.set_nthreads(1)  # a second one waits busily for small work to share: 1.6 times the processor time of a search
    hy.llvm_state.set_diskcache_enabled(False)
    hy.llvm_state.set_memcache_limit(0)
    x = hy.make_vars("x")
    return f"{hy.__version__} {hy.cfunc([x], [x]).llvm_states}".encode()


def _read(path: Path) -> Any:
    try:
        content = unsealed(path)
        if content is None:
            return None
        os.utime(path)
        return pickle.loads(zlib.decompress(content))
    except Exception:  # missing, or of a heyoka that was built otherwise: it raises what it likes
        return None


def _keep(made: object, path: Path) -> None:
    try:
        write_whole(path, seal(zlib.compress(pickle.dumps(made), 1)))
        make_room(path.parent, LIMIT)
    except OSError as error:  # costs time only
        logging.getLogger("spinlev").debug("Compiled code could not be kept: %s", error)
