"""Who computes the points of a sweep: this process, others of this machine, or a scheduler that is already there."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence, Set
from contextlib import closing
from dataclasses import dataclass
from functools import partial

import xarray as xr

from ..results import Point, Study
from ..terminal import Workers, note, silence
from .processes import Death, Job, NoProcessError, results

TRIES = 3
"""How often a point is begun whose process dies."""
Compute = Callable[[Point], xr.Dataset]
Prepared = Callable[[Sequence[Point]], Sequence[Callable[[], xr.Dataset]]] | None


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
    batches: list[Mapping[int, Point]] = [
        {k: points[k] for k in batch} for batch in grouped if not missing.isdisjoint(batch)
    ]
    if batches and by.scheduler is not None:
        from .scheduler import on_scheduler

        yield from on_scheduler(by.scheduler, study, batches, missing)
        return
    number = min(by.workers or os.cpu_count() or 1, len(batches))
    if number > 1:
        batches = yield from _in_processes(number, study, batches, missing)
    for batch in batches:
        yield from attempts(study.compute, study.prepared, batch, missing)


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


def silent_attempts(
    compute: Compute, prepared: Prepared, points: Mapping[int, Point], missing: Set[int]
) -> Iterator[Attempt]:
    """Attempts in a worker, whose messages would come in between those of the others."""
    with silence():
        yield from attempts(compute, prepared, points, missing)


def _in_processes(
    number: int, study: Study, batches: Sequence[Mapping[int, Point]], missing: Set[int]
) -> Generator[Attempt, None, list[Mapping[int, Point]]]:
    """The attempts of processes of this machine; returns the batches that are left where none can begin."""
    finished: set[int] = set()
    deaths: dict[int, int] = {}

    def job(batch: Mapping[int, Point]) -> Job:
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
                if len(left) > 1:  # one of them killed the process: which?
                    jobs.extend(job({k: batch[k]}) for k in left)
                    continue
                for k in left:
                    deaths[k] = deaths.get(k, 0) + 1
                    if deaths[k] < TRIES:
                        jobs.append(job({k: batch[k]}))
                    else:
                        yield k, Failure(f"its process {answer}, {TRIES} times")
    except NoProcessError as error:
        note(f"{error} The points are computed in this process, one after the other, as with --workers 1.")
        return [batch for *_, batch, _ in jobs]
    return []
