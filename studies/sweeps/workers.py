"""Who computes the points of a sweep: this process, a local cluster, or a scheduler that is already there."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

import xarray as xr

from ...geometry.basics import InputError
from ..results import Point, Study
from ..terminal import Workers, note, silence

if TYPE_CHECKING:
    from distributed import Client, Future

Compute = Callable[[Point], xr.Dataset]
Prepared = Callable[[Sequence[Point]], Sequence[Callable[[], xr.Dataset]]] | None


@dataclass(frozen=True)
class Failure:
    """Why a point has no result."""

    reason: str


Attempt = tuple[int, xr.Dataset | Failure]
"""The number of a point, and its result."""


def computed(by: Workers, study: Study, points: Mapping[int, Point], missing: Set[int]) -> Iterator[Attempt]:
    """The results of the missing points as they come, each with its number; the others only help them.

    A point that raises, or whose worker dies again and again, is a `Failure`; the others go on.
    Raises InputError if the scheduler does not answer.
    """
    grouped = study.batches(points) if study.batches else [[k] for k in points]
    batches = [batch for batch in grouped if not missing.isdisjoint(batch)]
    number = min(by.workers or os.cpu_count() or 1, len(batches))
    if by.scheduler is None and number <= 1:
        for batch in batches:
            yield from attempts(study.compute, study.prepared, {k: points[k] for k in batch}, missing)
        return
    from distributed import as_completed

    with _client(by.scheduler, number) as client:

        def begin(batch: Sequence[int]) -> Future[Any]:
            asked = {k: points[k] for k in batch}
            return client.submit(_silently, study.compute, study.prepared, asked, missing, pure=False)

        futures = {begin(batch): batch for batch in batches}
        running = as_completed(list(futures), loop=client.loop)
        for future in running:
            batch, found = futures.pop(future), _collected(future)
            future.release()
            if not isinstance(found, Failure):
                yield from found
            elif len(batch) == 1:
                yield batch[0], found
            else:  # one of its points killed the worker: which?
                alone = {begin([k]): [k] for k in batch if k in missing}
                futures |= alone
                running.update(list(alone))


def attempts(compute: Compute, prepared: Prepared, points: Mapping[int, Point], missing: Set[int]) -> Iterator[Attempt]:
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


def _silently(compute: Compute, prepared: Prepared, points: Mapping[int, Point], missing: Set[int]) -> list[Attempt]:
    """Attempts in a worker, whose messages would come in between those of the others."""
    with silence():
        return list(attempts(compute, prepared, points, missing))


def _collected(future: Future[Any]) -> list[Attempt] | Failure:
    from distributed.scheduler import KilledWorker

    try:
        result: list[Attempt] = future.result()
    except KilledWorker as error:
        return Failure(f"its worker died {error.allowed_failures + 1} times (out of memory?)")
    return result


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Processes begun in this block do not hear Ctrl-C, which a terminal sends to all of a group; this one does later.

    They inherit that the signal waits, as do the threads begun here and what these begin afterwards.
    """
    resource_tracker.ensure_running()  # its beginning would let the signal through
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _client(scheduler: str | None, number: int) -> Iterator[Client]:
    """A client of the scheduler, or of a local cluster that listens on loopback only."""
    from distributed import Client, LocalCluster

    if scheduler is not None:
        note(f"Scheduler {scheduler} ...")
        try:
            client = Client(scheduler, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(
                f"Input --scheduler must be the address of a dask scheduler that answers, such as "
                f"tcp://127.0.0.1:8786; instead received {scheduler!r} ({type(error).__name__})."
            ) from None
        with client:
            yield client
        return
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # `silence_logs` is over before the cluster is
    # One thread in each worker, and (dask's default) in the numeric libraries inside it.
    with ExitStack() as stack:
        with _deaf_children():
            cluster = LocalCluster(
                n_workers=number,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",  # any free port: two sweeps at once must not meet
                silence_logs=logging.CRITICAL,
            )
            stack.enter_context(cluster)
        yield stack.enter_context(Client(cluster, set_as_default=False))
