"""Compiled code of earlier processes: whole files with a checksum, under a key of what was compiled.

Who writes such a file decides what the processor does: each user has a folder of his own, and nothing is read that
another one could have written.  A file is what heyoka writes of a thing, which only that kind of thing reads; a pickle
would begin with the name of anything.

heyoka can keep machine code by itself, in a database without checksums: one flipped bit in a constant is a wrong
number, or the end of the process.  It would also have all expressions written anew by each command: a second of `run`.
"""

import hashlib
import io
import logging
import os
import pickle
import zlib
from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from .cache import cache_folder, cache_limit, digest_of, make_room, others_may_write, own_folder
from .files import seal, unsealed, write_whole

LIMIT = 2**29
"""Size of all that is kept, bytes; what was not used for the longest time makes room."""
SHARED = 2**26
"""Memory of functions that this process keeps at hand, bytes; those in use are not lost by it, and integrators, which
have a state, are read anew each time."""
EACH, TIMES = 3_000_000, 20
"""What a function takes of it: so many bytes where it was compiled here, and so many times its file."""
KINDS = ("cfunc_dbl", "taylor_adaptive_dbl", "taylor_adaptive_batch_dbl")
"""What is kept, by its name in heyoka."""
LOG = logging.getLogger("spinlev")
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
    name = f"{hashlib.sha256(_target() + _Asked.of(asked)).hexdigest()}.code"
    path = cache_folder() / name  # in this process; on the disk it is in the user's folder there
    found, taken = _functions.pop(path, (None, 0))
    if found is None:
        folder = _folder()
        found, size = _read(folder / name) if folder else (None, 0)
        if found is None:
            content = _written(found := make())
            size = len(content)
            if folder:
                _keep(content, folder / name)
        taken = EACH + TIMES * size
    if asked[0].__name__ == "cfunc":
        _functions[path] = found, taken
        while sum(taken for _, taken in _functions.values()) > SHARED and len(_functions) > 1:
            _functions.popitem(last=False)
    return cast(Compiled, found)


def _folder() -> Path | None:
    """The user's folder for code, if no other user can write there; else that is said, once."""
    try:
        folder = own_folder("code")
        reason = others_may_write(folder)
    except OSError as error:  # costs time only
        LOG.debug("Compiled code could not be kept: %s", error)
        return None
    if reason is None:
        return folder
    _say(reason)
    return None


@cache
def _say(reason: str) -> None:
    LOG.info("Compiled code is neither read nor kept, which costs seconds: %s.", reason)


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


def _written(made: Any) -> bytes:
    state, _ = made.__getstate__()
    return zlib.compress(type(made).__name__.encode() + b"\n" + state, 1)


def _read(path: Path) -> tuple[Any, int]:
    """What was kept, and its size; None where there is none to be trusted."""
    import heyoka as hy

    try:
        content = unsealed(path, path.name, mine=True)  # a folder that was open once may have something left of others
        if content is None:
            return None, 0
        kind, _, state = zlib.decompress(content).partition(b"\n")
        form = getattr(hy, KINDS[KINDS.index(kind.decode())])
        made = form.__new__(form)
        made.__setstate__((state, {}))
        os.utime(path)
        return made, len(content)
    except Exception:  # missing, or of a heyoka that was built otherwise: it raises what it likes
        return None, 0


def _keep(content: bytes, path: Path) -> None:
    try:
        write_whole(path, seal(content, path.name))
        make_room(path.parent, min(LIMIT, cache_limit()))
    except OSError as error:  # costs time only
        LOG.debug("Compiled code could not be kept: %s", error)


PLAIN = (0.0, 1.0, -1.0)
"""Numbers that symmetry makes so: they stay what they are, and make the code shorter."""


class RuntimeNumbers:
    """Takes a formula's numbers one by one and gives the parameter that stands for each.

    Parameters
    ----------
    first : number of the first parameter that is free
    """

    def __init__(self, first: int) -> None:
        self._first, self._known = first, dict[float, int]()

    def __call__(self, number: float) -> Any:
        """The parameter with this value; the same for the same value."""
        import heyoka as hy

        if number in PLAIN:
            return float(number)
        return hy.par[self._first + self._known.setdefault(float(number), len(self._known))]

    @property
    def values(self) -> list[float]:
        """Of the parameters so far."""
        return list(self._known)
