"""The points of a sweep on a dask scheduler that is already there."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from ...geometry.basics import ComputationError, InputError
from ..results import Point, Study
from ..terminal import note
from .processes import program
from .workers import Attempt, Failure, silent_attempts

if TYPE_CHECKING:
    from distributed import Client, Future

LONGEST = 10.0
"""Seconds to wait for a scheduler, also for one that does not answer any more."""
WAY_OUT = "install the same version of spinlev and of its libraries there, or choose --workers"


def on_scheduler(
    address: str, study: Study, batches: Sequence[Mapping[int, Point]], missing: Set[int]
) -> Iterator[Attempt]:
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
    client: Client, address: str, study: Study, batches: Sequence[Mapping[int, Point]], missing: Set[int]
) -> Iterator[Attempt]:
    from concurrent.futures import CancelledError

    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    of_us = _workers_of_us(client, address)

    def begin(batch: Mapping[int, Point]) -> Future[Any]:
        asked = (program(), study.compute, study.prepared, batch, missing)
        return client.submit(answered, *asked, pure=False, workers=of_us or None)

    futures = {begin(batch): batch for batch in batches}
    running = as_completed(list(futures), loop=client.loop)
    for future in running:
        batch, again = futures.pop(future), list[Mapping[int, Point]]()
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
