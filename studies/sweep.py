"""Runs a study: its points one by one on the engine, kept as they come on disk, then joined."""

import hashlib
import json
import shutil
import sys
from collections.abc import Callable, Mapping
from contextlib import closing
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...fem.storage import program_of, seal, unsealed, write_whole
from ...geometry.basics import ComputationError, InputError
from ..results import Point, Study
from ..terminal import Workers, note, progress, to_json
from .processes import FLOORS
from .workers import Failure, computed


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
    with progress(f"{name}: {len(points)} points") as advance:
        advance(len(finished) / len(points))
        with closing(computed(engine, study, points, missing)) as attempts:
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
    """What computes a study's points: the rooms of its function, or of a user's own the text of its file as well."""
    function = getattr(study.compute, "compute", study.compute)  # of a study that is computed as a whole
    module = sys.modules.get(function.__module__)
    room = ".".join(function.__module__.split(".")[:3])
    if room.startswith("spinlev."):
        return program_of(room)
    path = Path(getattr(module, "__file__", None) or "")
    own = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
    return f"{program_of(*FLOORS)} {own}"


def forget(name: str, out: Path) -> None:
    """Remove the finished points of a sweep whose result is safe."""
    shutil.rmtree(out / f"{name}.points", ignore_errors=True)
