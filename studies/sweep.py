"""The points of a study, computed by this process, others of this machine or a dask scheduler; what is done is kept."""

import hashlib
import json
import logging
import os
import sys
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence, Set
from contextlib import closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..fem.cache import program_digest
from ..geometry.common import ComputationError, InputError, counted
from ..geometry.files import seal, unsealed, write_whole
from .cli.console import missing_extra, note, progress, to_json
from .cli.options import Workers, wrong
from .processes import Death, NoProcessError, program, results
from .study import Batch, Compute, Point, Prepared, Study

# Rooms whose text does not change a point, but for the file of its own study.
SHOWING = ("studies/catalogue", "studies/cli", "studies/figures", "studies/page")
TRIES = 3  # how often a point is begun whose process dies
PATIENCE = 10.0  # seconds to wait for a scheduler, also for one that does not answer any more
Attempt = tuple[int, xr.Dataset | str]  # the number of a point, and its result or why it has none
Answers = Generator[tuple[Batch, Attempt | Death], None, None]  # of other processes


class SweepError(ComputationError):
    """No point of a sweep could be computed."""


def swept(study: Study, points: Sequence[Point], engine: Workers, out: Path) -> xr.Dataset:
    """Joined result of a `study` at the `points`, each computed once even if the program is stopped between them.

    By an `engine`, or this process where times are measured; finished points are kept in NAME.points of `out`, until
    `forget`. Raises SweepError: all failed; InputError: the scheduler does not answer or has other versions, or a file
    of the points was replaced; ComputationError: the scheduler is lost; OSError: `out` cannot be written.
    """
    journal = Journal(study, points, out)
    if finished := journal.finished():
        note(f"{len(finished)} of {len(points)} points are there from an earlier run.")
    failed: dict[int, str] = {}
    missing = frozenset(range(len(points))) - frozenset(finished)
    attempts = computed(Workers(workers=1) if study.timed else engine, study, points, missing)
    if missing:
        note(f"{study.name}, {counted(len(missing), 'point')} ...")
    with progress(f"{study.name}: {len(points)} points") as advance, closing(attempts):
        advance(len(finished) / len(points))
        for k, result in attempts:
            if isinstance(result, str):
                if study.check is not None:  # else each point to come fails for the same reason
                    study.check()
                failed[k] = result
                note(f"Point {to_json(points[k])} failed: {result}")
            else:
                journal.keep(k, result)
                finished[k] = result
            advance((len(finished) + len(failed)) / len(points))
    if not finished:
        raise SweepError(f"All {len(points)} points failed; the first: {failed[min(failed)]}")
    reasons = [{"point": points[k], "reason": failed[k]} for k in sorted(failed)]
    joined = study.gather([finished[k] for k in sorted(finished)])
    return joined.assign_attrs(study=study.name, failed_points=to_json({"failed": reasons}))


def forget(study: Study, points: Sequence[Point], out: Path) -> None:
    """Remove the finished points of a `study` in `out` whose result is safe; `points` as of `swept`."""
    journal = Journal(study, points, out)
    for path in journal.files():
        path.unlink()
    with suppress(OSError):  # it is not there, or holds points of another sweep
        journal.folder.rmdir()


class Journal:
    """One sealed file a finished point of a `study` in NAME.points of `out`, named by the `points` and the program."""

    def __init__(self, study: Study, points: Sequence[Point], out: Path) -> None:
        function = study.compute
        if isinstance(function, partial):  # of a study that is computed as a whole
            (function,) = function.args
        path = Path(getattr(sys.modules.get(function.__module__), "__file__", None) or "")
        # what computes a study's points: the program without the rooms that draw and say, and its own file
        own = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
        computing = f"{program_digest(*SHOWING)} {own}"
        requested = {"study": study.name, "settings": study.settings, "points": points, "program": computing}
        self.folder = out / f"{study.name}.points"
        self._sweep = hashlib.sha256(to_json(requested).encode()).hexdigest()[:16]

    def files(self) -> list[Path]:
        return sorted(self.folder.glob(f"*-{self._sweep}.json"))

    def finished(self) -> dict[int, xr.Dataset]:
        ours, found = self.files(), {}
        if others := len(list(self.folder.glob("*.json"))) - len(ours):
            note(
                f"{self.folder} also holds {others} points of another sweep, of files that were replaced, or of "
                "another version of the program; they are not used. Delete them when you need them no more."
            )
        for path in ours:
            content = None
            with suppress(InputError):
                content = unsealed(path)
            name, _, text = (content or b"").partition(b"\n")
            if name != path.name.encode():
                why = "damaged" if content is None else "of another sweep or point"
                note(f"The finished point {path} is {why} and is computed anew.")
                continue
            kept = json.loads(text)
            variables = {
                name: (dims, np.array(data, dtype).reshape(shape), attributes)
                for name, (dims, shape, dtype, data, attributes) in kept["variables"].items()
            }
            dataset = xr.Dataset(variables, attrs=kept["attributes"]).set_coords(kept["coordinates"])
            found[int(path.name.partition("-")[0])] = dataset
        return found

    def keep(self, number: int, result: xr.Dataset) -> None:
        """Keep the result of a point. Raises OSError where the folder cannot be written."""
        path = self.folder / f"{number:06}-{self._sweep}.json"
        # to the last bit: a text is written in 1.3 ms, which as a netCDF file takes 0.2 s
        variables = {
            name: [list(v.dims), list(v.shape), v.dtype.str, v.values.ravel().tolist(), v.attrs]
            for name, v in result.variables.items()
        }
        kept = {"variables": variables, "coordinates": list(result.coords), "attributes": result.attrs}
        text = json.dumps(kept, default=lambda value: value.tolist())
        write_whole(path, seal(f"{path.name}\n{text}".encode()))


# Who computes


def computed(by: Workers, study: Study, points: Sequence[Point], missing: Set[int]) -> Generator[Attempt, None, None]:
    """Results of the `missing` numbers of `points` of a `study` as they come, `by` workers, or the reason for none.

    Raises InputError: the scheduler does not answer, or has none of this version; ComputationError: it is lost.
    """
    numbered = dict(enumerate(points))
    grouped = study.batches(numbered) if study.batches else [[k] for k in numbered]
    wanted = [batch for batch in grouped if not missing.isdisjoint(batch)]
    batches: deque[Batch] = deque({k: points[k] for k in batch} for batch in wanted)
    job = partial(attempts, study.compute, study.prepared, missing)
    number = min(by.workers or os.cpu_count() or 1, len(batches))
    if batches and by.scheduler is not None:
        yield from _completed(_on_scheduler(by.scheduler, job, batches), batches, missing)
    elif number > 1:
        try:
            yield from _completed(results(number, job, batches), batches, missing)
        except NoProcessError as error:
            note(f"{error} The points are computed in this process, one after the other, as with --workers 1.")
    while batches:
        yield from job(batches.popleft())


def attempts(compute: Compute, prepared: Prepared | None, missing: Set[int], points: Batch) -> Iterator[Attempt]:
    """Results of the `missing` ones of numbered `points`, by `compute` and `prepared` of a study, or why none is."""
    requested = list(points.values())
    jobs: Sequence[Callable[[], xr.Dataset]] = [partial(compute, point) for point in requested]
    if prepared is not None and len(requested) > 1:
        try:
            jobs = prepared(requested)
        except Exception as error:  # each for itself then, so that the others go on
            note(f"{len(requested)} points cannot help each other: {type(error).__name__}: {error}")
    for k, job in zip(points, jobs, strict=True):
        if k in missing:
            try:
                yield k, job()
            except Exception as error:  # a sweep lives longer than its points: the reason is kept with the result
                yield k, missing_extra(error) or f"{type(error).__name__}: {error}"


def _completed(answers: Answers, batches: deque[Batch], missing: Set[int]) -> Iterator[Attempt]:
    """The attempts of other processes; what is left of a batch whose process died goes back to `batches`."""
    finished: set[int] = set()
    deaths: Counter[int] = Counter()
    with closing(answers):
        for batch, answer in answers:
            if not isinstance(answer, Death):
                finished.add(answer[0])
                yield answer
                continue
            left = [k for k in batch if k in missing and k not in finished]
            if len(left) == 1:
                deaths[left[0]] += answer.times
                if deaths[left[0]] >= TRIES:
                    yield left[0], f"its process {answer.how}, {deaths[left[0]]} times"
                    continue
            batches.extend({k: batch[k]} for k in left)  # one of them killed the process: which?


def _on_scheduler(address: str, job: Any, batches: deque[Batch]) -> Answers:
    """The attempts of the scheduler's workers; those of another version of the program are not used."""
    with _client(address) as client:
        from concurrent.futures import CancelledError

        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        of_us = _workers_of_us(client, address)
        begun = dict[Any, Batch]()
        running = as_completed(loop=client.loop)
        while batches or begun:
            while batches:
                batch = batches.popleft()
                future = client.submit(answered, program(), job, batch, pure=False, workers=of_us or None)
                begun[future] = batch
                running.add(future)
            batch = begun.pop(future := next(running))
            try:
                found: list[Attempt] | None = future.result()
            except KilledWorker as error:
                yield batch, Death("died", error.allowed_failures + 1)
                continue
            except (CancelledError, OSError):
                raise _lost(address) from None
            except Exception:  # of a worker that does not know what is asked of it
                found = None
            future.release()
            if found is None:  # of a worker that has come since
                if not (of_us := _workers_of_us(client, address)):
                    raise _lost(address)
                batches.append(batch)
            yield from ((batch, attempt) for attempt in found or ())


def answered(requesting: str, job: Any, batch: Batch) -> list[Attempt] | None:
    """The attempts of a worker at a `batch` by `job`; None where its program is not `requesting`, the asking one's."""
    return list(job(batch)) if program() == requesting else None


def _workers_of_us(client: Any, address: str) -> list[str]:
    """Addresses of the workers of this version, none while there are no workers. InputError where all are of others."""
    versions = client.run(program, on_error="return")
    of_us = [worker for worker, answer in versions.items() if answer == program()]
    others = sorted(set(versions) - set(of_us))
    if others and not of_us:
        them = f"{', '.join(others[:3])}{' …' if others[3:] else ''}"
        way_out = "install the same version of spinlev and of its libraries there, or choose --workers."
        instead = f"those of {address} ({them}) are of another: {way_out}"
        raise wrong("--scheduler", "have workers of this version of the program", instead)
    if others:
        note(f"{len(others)} of {len(versions)} workers are of another version of the program and are not used.")
    return of_us


def _lost(address: str) -> ComputationError:
    return ComputationError(
        f"The scheduler {address} was lost. The finished points are kept: run the same command again, with --scheduler "
        "once it is back, or with --workers."
    )


@contextmanager
def _client(address: str) -> Iterator[Any]:
    from dask import config
    from dask.utils import parse_timedelta
    from distributed import Client
    from distributed.comm.addressing import get_address_host_port

    patience = min(parse_timedelta(config.get("distributed.comm.timeouts.connect"), "s"), PATIENCE)
    of_dask = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    for name in (*of_dask, "tornado.application", "asyncio"):  # what is wrong is said here
        logging.getLogger(name).setLevel(logging.CRITICAL)
    note(f"Scheduler {address} ...")
    try:
        get_address_host_port(address)  # a client that does not get so far raises once more where it is dropped
        client = Client(address, set_as_default=False, timeout=patience)
    except (OSError, ValueError, TimeoutError, TypeError, RuntimeError) as error:
        rule = "be the address of a dask scheduler that answers, such as tcp://127.0.0.1:8786"
        raise wrong("--scheduler", rule, f"received {address!r} ({type(error).__name__}).") from None
    try:
        yield client
    except (OSError, TimeoutError, RuntimeError) as error:
        if isinstance(error, ComputationError) or client.status == "running":
            raise
        raise _lost(address) from None
    finally:
        # Of a scheduler that is gone, until the client has given up; its thread must not outlive the interpreter.
        with suppress(OSError, TimeoutError):
            client.close(timeout=2 * patience)
