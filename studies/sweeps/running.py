"""Runs a study: its points one by one on the engine, kept as they come, then joined, written, drawn and reported."""

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

import xarray as xr

from ...fem.storage import digest_of
from ...geometry.basics import ComputationError
from ..results import LIBRARIES, Point, Study
from ..terminal import Workers, note, progress, to_json
from .finished_points import Journal
from .workers import Failure, computed

FLOORS = ("spinlev.geometry", "spinlev.fem", "spinlev.dynamics", "spinlev.studies")
"""What another program has computed is not mixed into a result."""


class SweepError(ComputationError):
    """No point of a sweep could be computed."""


def swept(name: str, study: Study, points: Mapping[int, Point], engine: Workers, out: Path) -> xr.Dataset:
    """The joined result of a study at the points, each computed once even if the program is stopped between them.

    Finished points are kept in the folder NAME.points of `out`, which is removed by `forget` once the result is safe.
    Points that failed are named with their reasons in the attribute `failed_points`.

    Raises
    ------
    SweepError : all points failed
    InputError : the scheduler does not answer
    OSError : `out` cannot be written
    """
    journal = _journal(name, study, points, out)
    finished = {k: point for k, point in journal.finished().items() if k in points}
    if finished:
        note(f"{len(finished)} of {len(points)} points are there from an earlier run.")
    failed: dict[int, str] = {}
    missing = {k: point for k, point in points.items() if k not in finished}
    engine = Workers(workers=1) if study.timed else engine
    with progress(f"{name}: {len(points)} points") as advance:
        advance(len(finished) / len(points))
        for k, result in computed(engine, study.compute, missing) if missing else ():
            if isinstance(result, Failure):
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


def forget(name: str, out: Path) -> None:
    """Remove the finished points of a sweep whose result is safe."""
    Journal(out / f"{name}.points", "", note).remove()


def _journal(name: str, study: Study, points: Mapping[int, Point], out: Path) -> Journal:
    versions = {library: version(library) for library in LIBRARIES}
    asked = {"study": name, "settings": study.settings, "points": list(points.values())}
    return Journal(out / f"{name}.points", to_json({**asked, **versions, "program": digest_of(*FLOORS)}), note)
