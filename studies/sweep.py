"""Who computes the points of a sweep: this process, others of this machine, or a scheduler that is already there."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import shutil
import sys
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence, Set
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..fem.cache import program_digest
from ..fem.files import seal, unsealed, write_whole
from ..geometry.common import ComputationError, InputError
from .cli.console import note, progress, silence, to_json
from .cli.options import Workers
from .processes import Death, Job, NoProcessError, program, results
from .study import Point, Study

if TYPE_CHECKING:
    from distributed import Client, Future

SHOWING = ("studies/catalogue", "studies/cli", "studies/figures", "studies/page")
"""Rooms whose text does not change a point, but for the file of its own study."""
TRIES = 3
"""How often a point is begun whose process dies."""
Compute = Callable[[Point], xr.Dataset]
Prepared = Callable[[Sequence[Point]], Sequence[Callable[[], xr.Dataset]]] | None
Batch = Mapping[int, Point]
"""Numbered points that are computed together."""


@dataclass(frozen=True)
class Failure:
    """Why a point has no result."""

    reason: str


Attempt = tuple[int, xr.Dataset | Failure]
"""The number of a point, and its result."""


def computed(
    by: Workers, study: Study, points: Mapping[int, Point], missing: Set[int]
) -> Generator[Attempt, None, None]:
    """The results of the missing points as they come, each with its number; the others only help them.

    A point that raises, or whose worker dies again and again, is a `Failure`; the others go on.
    Raises InputError if the scheduler does not answer, ComputationError if it is lost.
    """
    grouped = study.batches(points) if study.batches else [[k] for k in points]
    batches: list[Batch] = [{k: points[k] for k in batch} for batch in grouped if not missing.isdisjoint(batch)]
    if batches and by.scheduler is not None:
        yield from _on_scheduler(by.scheduler, study, batches, missing)
        return
    number = min(by.workers or os.cpu_count() or 1, len(batches))
    if number > 1:
        batches = yield from _in_processes(number, study, batches, missing)
    for batch in batches:
        yield from attempts(study.compute, study.prepared, batch, missing)


def attempts(compute: Compute, prepared: Prepared, points: Batch, missing: Set[int]) -> Iterator[Attempt]:
    """The results of the missing ones of points that are computed together, or why there is none."""
    asked = list(points.values())
    jobs: Sequence[Callable[[], xr.Dataset]] = [partial(compute, point) for point in asked]
    if prepared is not None and len(asked) > 1:
        try:
            jobs = prepared(asked)
        except Exception as error:  # each for itself then, so that the others go on
            note(f"{len(asked)} points cannot help each other: {type(error).__name__}: {error}")
    for k, job in zip(points, jobs, strict=True):
        if k not in missing:
            continue
        try:
            yield k, job()
        except Exception as error:  # a sweep lives longer than its points: the reason is kept with the result
            yield k, Failure(f"{type(error).__name__}: {error}")


def silent_attempts(*asked: Any) -> Iterator[Attempt]:
    """Attempts in a worker, whose messages would come in between those of the others."""
    with silence():
        yield from attempts(*asked)


def _in_processes(
    number: int, study: Study, batches: Sequence[Batch], missing: Set[int]
) -> Generator[Attempt, None, list[Batch]]:
    """The attempts of processes of this machine; returns the batches that are left where none can begin."""
    finished: set[int] = set()
    deaths: Counter[int] = Counter()

    def job(batch: Batch) -> Job:
        return silent_attempts, study.compute, study.prepared, batch, missing

    jobs = deque(map(job, batches))
    try:
        with closing(results(number, jobs)) as answers:
            for (*_, batch, _), answer in answers:
                if not isinstance(answer, Death):
                    finished.add(answer[0])
                    yield answer
                    continue
                left = [k for k in batch if k in missing and k not in finished]
                if len(left) == 1:
                    deaths[left[0]] += 1
                    if deaths[left[0]] == TRIES:
                        yield left[0], Failure(f"its process {answer}, {TRIES} times")
                        continue
                jobs.extend(job({k: batch[k]}) for k in left)  # one of them killed the process: which?
    except NoProcessError as error:
        note(f"{error} The points are computed in this process, one after the other, as with --workers 1.")
        return [batch for *_, batch, _ in jobs]
    return []


LONGEST = 10.0
"""Seconds to wait for a scheduler, also for one that does not answer any more."""
WAY_OUT = "install the same version of spinlev and of its libraries there, or choose --workers"


def _on_scheduler(address: str, study: Study, batches: Sequence[Batch], missing: Set[int]) -> Iterator[Attempt]:
    """The attempts of the scheduler's workers; those of another version of the program are not used.

    Raises
    ------
    InputError : the scheduler does not answer, or all of its workers are of another version
    ComputationError : it is lost on the way
    """
    with _client(address) as client:
        try:
            yield from _answers(client, address, study, batches, missing)
        except (OSError, TimeoutError, RuntimeError) as error:
            if isinstance(error, ComputationError) or client.status == "running":
                raise
            raise _lost(address) from None


def _answers(
    client: Client, address: str, study: Study, batches: Sequence[Batch], missing: Set[int]
) -> Iterator[Attempt]:
    from concurrent.futures import CancelledError

    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    of_us = _workers_of_us(client, address)

    def begin(batch: Batch) -> Future[Any]:
        asked = (program(), study.compute, study.prepared, batch, missing)
        return client.submit(answered, *asked, pure=False, workers=of_us or None)

    futures = {begin(batch): batch for batch in batches}
    running = as_completed(list(futures), loop=client.loop)
    for future in running:
        batch, again = futures.pop(future), list[Batch]()
        try:
            found: list[Attempt] | None = future.result()
        except KilledWorker as error:
            found = []
            if len(batch) > 1:  # one of its points killed the worker: which?
                again = [{k: point} for k, point in batch.items() if k in missing]
            else:
                found = [(next(iter(batch)), Failure(f"its worker died {error.allowed_failures + 1} times"))]
        except (CancelledError, OSError):
            raise _lost(address) from None
        except Exception:  # of a worker that does not know what is asked of it
            found = None
        future.release()
        if found is None:  # of a worker that has come since
            of_us, again = _workers_of_us(client, address), [batch]
            if not of_us:
                raise _lost(address)
        yield from found or ()
        fresh = {begin(part): part for part in again}
        futures |= fresh
        running.update(list(fresh))


def answered(asked_by: str, *asked: Any) -> list[Attempt] | None:
    """The attempts of a worker; None from one whose program is not that of the asking one."""
    return list(silent_attempts(*asked)) if program() == asked_by else None


def _workers_of_us(client: Client, address: str) -> list[str]:
    """Addresses of the workers of this version of the program, none while there are no workers.

    Raises InputError where there are workers, but no such.
    """
    told = client.run(program, on_error="return")
    of_us = [worker for worker, answer in told.items() if answer == program()]
    others = sorted(set(told) - set(of_us))
    if others and not of_us:
        raise InputError(
            f"Input --scheduler must have workers of this version of the program; instead those of {address} "
            f"({', '.join(others[:3])}{' …' if others[3:] else ''}) are of another: {WAY_OUT}."
        )
    if others:
        note(f"{len(others)} of {len(told)} workers are of another version of the program and are not used.")
    return of_us


def _lost(address: str) -> ComputationError:
    return ComputationError(
        f"The scheduler {address} was lost. The finished points are kept: run the same command again, with --scheduler "
        "once it is back, or with --workers."
    )


@contextmanager
def _client(address: str) -> Iterator[Client]:
    try:
        from dask import config
        from dask.utils import parse_timedelta
        from distributed import Client
    except ModuleNotFoundError as error:
        raise InputError(
            f"Input --scheduler must be left out where dask is not installed; instead received {address!r} (no module "
            f"{error.name}). Install distributed, or choose --workers."
        ) from None
    patience = min(parse_timedelta(config.get("distributed.comm.timeouts.connect"), "s"), LONGEST)
    of_dask = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    for name in (*of_dask, "tornado.application", "asyncio"):  # what is wrong is said here
        logging.getLogger(name).setLevel(logging.CRITICAL)
    note(f"Scheduler {address} ...")
    try:
        client = Client(address, set_as_default=False, timeout=patience)
    except (OSError, ValueError, TimeoutError, TypeError, RuntimeError) as error:
        raise InputError(
            f"Input --scheduler must be the address of a dask scheduler that answers, such as "
            f"tcp://127.0.0.1:8786; instead received {address!r} ({type(error).__name__})."
        ) from None
    try:
        yield client
    finally:
        # Of a scheduler that is gone, until the client has given up; its thread must not outlive the interpreter.
        with suppress(OSError, TimeoutError):
            client.close(timeout=2 * patience)


class Journal:
    """A folder with one checked file for each finished point.

    Parameters
    ----------
    folder : made when the first point is kept
    identity : all that decides the sweep's points, and tells it from every other; each point's file says of which it is
    report : told about what is not used, and where it is
    """

    def __init__(self, folder: Path, identity: str, report: Callable[[str], None]) -> None:
        self.folder, self.identity, self.report = folder, identity, report

    def finished(self) -> dict[int, xr.Dataset]:
        """The points that an earlier run of the same sweep has finished."""
        if self.folder.exists() and not self._is_ours(self.folder):
            aside = self._set_aside()
            self.report(
                f"{self.folder} is of another sweep, of files that were replaced, or of another version of the "
                f"program. What it held is in {aside}; delete that when you need it no more."
            )
        if not self.folder.exists():
            older = [path for path in self.folder.parent.glob(f"{self.folder.name}.old*") if self._is_ours(path)]
            if not older:
                return {}
            older[0].rename(self.folder)
        found = {int(path.stem): self._read(path) for path in sorted(self.folder.glob("[0-9]*.json"))}
        return {number: point for number, point in found.items() if point is not None}

    def _is_ours(self, folder: Path) -> bool:
        label = folder / "identity.json"
        return label.is_file() and label.read_bytes() == self.identity.encode()

    def _set_aside(self) -> Path:
        """Give the folder a name that is free: its points may be hours of work."""
        names = (self.folder.with_name(f"{self.folder.name}.old{number or ''}") for number in count())
        aside = next(name for name in names if not name.exists())
        self.folder.rename(aside)
        return aside

    def _read(self, path: Path) -> xr.Dataset | None:
        try:
            content = unsealed(path)
        except InputError:
            content = None
        if content is None:
            self.report(f"The finished point {path} is damaged and is computed anew.")
            return None
        kept = json.loads(content)
        if kept.get("of") != self._of(int(path.stem)):
            self.report(f"The finished point {path} is of another sweep and is computed anew.")
            return None
        return _unpacked(kept)

    def _of(self, number: int) -> str:
        return hashlib.sha256(f"{number} {self.identity}".encode()).hexdigest()

    def keep(self, number: int, result: xr.Dataset) -> None:
        """Keep the result of a point. Raises OSError where the folder cannot be written."""
        label = self.folder / "identity.json"
        if not label.exists():
            write_whole(label, self.identity.encode())
        packed = {"of": self._of(number), **_packed(result)}
        text = json.dumps(packed, default=lambda value: value.tolist())
        write_whole(self.folder / f"{number:06}.json", seal(text.encode()))


def _packed(result: xr.Dataset) -> dict[str, Any]:
    """A small dataset for a text, to the last bit: written in 1.3 ms, which as a netCDF file takes 0.2 s."""
    variables = {
        name: [list(v.dims), list(v.shape), v.dtype.str, v.values.ravel().tolist(), v.attrs]
        for name, v in result.variables.items()
    }
    return {"variables": variables, "coordinates": list(result.coords), "attributes": result.attrs}


def _unpacked(kept: Mapping[str, Any]) -> xr.Dataset:
    variables = {
        name: (dims, np.array(data, dtype).reshape(shape), attributes)
        for name, (dims, shape, dtype, data, attributes) in kept["variables"].items()
    }
    return xr.Dataset(variables, attrs=kept["attributes"]).set_coords(kept["coordinates"])


class SweepError(ComputationError):
    """No point of a sweep could be computed."""


def swept(name: str, study: Study, points: Mapping[int, Point], engine: Workers, out: Path) -> xr.Dataset:
    """The joined result of a study at the points, each computed once even if the program is stopped between them.

    Finished points are kept in the folder NAME.points of `out`, which is removed by `forget` once the result is safe.
    Points that failed are named with their reasons in the attribute `failed_points`.

    Raises
    ------
    SweepError : all points failed
    InputError : the scheduler does not answer, or has no workers of this version of the program; or a file that the
        points are of was replaced meanwhile, and the finished ones are kept
    ComputationError : the scheduler is lost; the finished points are kept
    OSError : `out` cannot be written
    """
    asked = {"study": name, "settings": study.settings, "points": list(points.values())}
    identity = to_json({**asked, "program": _program(study)})
    journal = Journal(out / f"{name}.points", identity, note)
    finished = {k: point for k, point in journal.finished().items() if k in points}
    if finished:
        note(f"{len(finished)} of {len(points)} points are there from an earlier run.")
    failed: dict[int, str] = {}
    missing = frozenset(points) - frozenset(finished)
    engine = Workers(workers=1) if study.timed else engine
    with (
        progress(f"{name}: {len(points)} points") as advance,
        closing(computed(engine, study, points, missing)) as attempts,
    ):
        advance(len(finished) / len(points))
        for k, result in attempts:
            if isinstance(result, Failure):
                if study.check is not None:  # else each point to come fails for the same reason
                    study.check()
                failed[k] = result.reason
                note(f"Point {to_json(points[k])} failed: {result.reason}")
            else:
                journal.keep(k, result)
                finished[k] = result
            advance((len(finished) + len(failed)) / len(points))
    if not finished:
        raise SweepError(f"All {len(points)} points failed; the first: {failed[min(failed)]}")
    reasons = [{"point": points[k], "reason": failed[k]} for k in sorted(failed)]
    joined = study.gather([finished[k] for k in sorted(finished)])
    return joined.assign_attrs(study=name, failed_points=to_json({"failed": reasons}))


def _program(study: Study) -> str:
    """What computes a study's points: the program without the rooms that draw and say, and the study's own file."""
    function = study.compute
    if isinstance(function, partial):  # of a study that is computed as a whole
        (function,) = function.args
    module = sys.modules.get(function.__module__)
    path = Path(getattr(module, "__file__", None) or "")
    return f"{program_digest(*SHOWING)} {hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ''}"


def forget(name: str, out: Path) -> None:
    """Remove the finished points of a sweep whose result is safe."""
    shutil.rmtree(out / f"{name}.points", ignore_errors=True)
