"""Who computes the points of a sweep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from ...geometry.basics import InputError


@Parameter(name="*")
@dataclass(frozen=True)
class Workers:
    """Who computes.

    Parameters
    ----------
    workers
        Processes of a local cluster; 1 computes in this process. Left out: one for each core.
    scheduler
        Address of a dask scheduler that is already there, such as tcp://127.0.0.1:8786.
    """

    workers: Annotated[int | None, Parameter(negative="")] = None
    scheduler: str | None = None

    def checked(self) -> Workers:
        """Itself.

        Raises
        ------
        InputError : no number of workers, or both a number and a scheduler
        """
        if self.workers is not None and not 1 <= self.workers <= 1024:
            raise InputError(f"Input --workers must be between 1 and 1024; instead received {self.workers}.")
        if self.workers is not None and self.scheduler is not None:
            raise InputError("Input --workers must be left out where --scheduler is given; instead received both.")
        return self
