"""The finished points of a sweep on disk, so that one that is stopped goes on where it was."""

import shutil
from collections.abc import Callable
from pathlib import Path

import xarray as xr

from ...fem.storage import TableFileError, read_checked, write_checked, write_whole

FORMAT = "spinlev point 1"


class Journal:
    """A folder with one checked file for each finished point.

    Parameters
    ----------
    folder : made when the first point is kept
    identity : tells this sweep from every other; points that another one left in the folder are not used
    report : told about what is thrown away
    """

    def __init__(self, folder: Path, identity: str, report: Callable[[str], None]) -> None:
        self.folder, self.identity, self.report = folder, identity, report

    def finished(self) -> dict[int, xr.Dataset]:
        """The points that an earlier run of the same sweep has finished."""
        if not self.folder.exists():
            return {}
        label = self.folder / "identity.json"
        if not label.exists() or label.read_bytes() != self.identity.encode():
            self.report(f"{self.folder} is of another sweep or another version of the program: all is computed anew.")
            self.remove()
            return {}
        found = {int(path.stem): self._read(path) for path in sorted(self.folder.glob("[0-9]*.nc"))}
        return {number: point for number, point in found.items() if point is not None}

    def _read(self, path: Path) -> xr.Dataset | None:
        try:
            dataset = read_checked(path, FORMAT)
        except TableFileError as error:
            self.report(f"A finished point is damaged and is computed anew: {error}")
            return None
        del dataset.attrs["format"]
        return dataset

    def keep(self, number: int, result: xr.Dataset) -> None:
        """Keep the result of a point. Raises OSError where the folder cannot be written."""
        label = self.folder / "identity.json"
        if not label.exists():
            write_whole(label, self.identity.encode())
        write_checked(result.assign_attrs(format=FORMAT), self.folder / f"{number:06}.nc")

    def remove(self) -> None:
        """Forget the points."""
        shutil.rmtree(self.folder, ignore_errors=True)
