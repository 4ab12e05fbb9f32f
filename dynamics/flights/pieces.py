"""A long flight kept on disk while it lasts, so that it can go on where it was stopped, to the last bit.

What determines the rest of a flight is the integrator's state at the end of a piece, its time (two numbers, so that
it loses nothing over millions of turns) and what has been recorded.
"""

from __future__ import annotations

import hashlib
import io
import os
import zipfile
import zlib
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

from ...fem.storage import write_whole
from ...geometry.basics import Array, InputError, regular_file
from .compiled_flight import Flight
from .local_flight import LocalFlight
from .recorder import Recorder
from .trajectory import FieldChanges

MOST = 2_000_000_000
"""Bytes of a checkpoint."""
BROKEN = (OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError, MemoryError)
"""What damage to a file of arrays is told by; its header may say any size."""


@dataclass(frozen=True, eq=False)
class Progress:
    """How far a flight is.

    Parameters
    ----------
    time : (2,) scaled time as a sum of two numbers
    state : of the integrator
    values : runtime parameters
    times, states : samples so far
    interval : of the samples
    steps : Taylor steps so far
    changes : (4,) numbers of `FieldChanges` so far, energies scaled
    region : (2, 3) bounds of the plate's table, m, in the plate's frame; zeros without one
    """

    time: Array
    state: Array
    values: Array
    times: Array
    states: Array
    interval: float
    steps: int
    changes: Array
    region: Array

    @classmethod
    def of(cls, flight: Flight, values: Array, recorder: Recorder, steps: int, changes: FieldChanges) -> Progress:
        """Where a flight is now."""
        integrator, known = flight.integrator, flight.memory
        region = np.zeros((2, 3)) if known is None else np.array([known.table.region.lower, known.table.region.upper])
        return cls(
            np.array(integrator.dtime), integrator.state.copy(), values.copy(),
            recorder.times.copy(), recorder.states.copy(), recorder.interval, steps, np.array(astuple(changes)),
            region,
        )  # fmt: skip

    def restore(self, flight: Flight | LocalFlight, recorder: Recorder) -> tuple[Array, int, FieldChanges]:
        """Put everything back to where it was; the runtime parameters, the steps and the changes so far."""
        integrator = flight.part(self.values).integrator
        integrator.dtime = (float(self.time[0]), float(self.time[1]))
        integrator.state[:] = self.state
        integrator.reset_cooldowns()
        recorder.put(self.times, self.states)
        recorder.interval = self.interval
        count, *rest = self.changes.tolist()
        return self.values.copy(), self.steps, FieldChanges(int(count), *rest)


@dataclass(frozen=True)
class Checkpoint:
    """The file of a flight.

    Parameters
    ----------
    path : where it is
    identity : everything that the flight depends on, as text; another flight's checkpoint is refused
    every : seconds between two writings
    """

    path: Path
    identity: str
    every: float = 5.0

    @property
    def _key(self) -> str:
        return hashlib.sha256(self.identity.encode()).hexdigest()

    def write(self, progress: Progress) -> None:
        """Keep the progress; the file is whole or as it was."""
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, key=np.array(self._key), **vars(progress))
        write_whole(self.path, stream.getvalue())

    def read(self) -> Progress | None:
        """What was kept, or None if there is nothing.

        Raises
        ------
        InputError : the file is damaged, or belongs to another flight
        """
        if not os.path.lexists(self.path):
            return None
        try:
            with regular_file(self.path, MOST, "checkpoint", "a regular file") as stream, np.load(stream) as data:
                content = {name: data[name] for name in data.files}
            key = str(content.pop("key"))
            found = Progress(**{**content, "interval": float(content["interval"]), "steps": int(content["steps"])})
        except InputError:
            raise
        except (*BROKEN, zipfile.BadZipFile, zlib.error) as error:
            raise InputError(f"Input {self.path} must be a checkpoint; instead it is damaged: delete it.") from error
        if key != self._key:
            raise InputError(
                f"Input {self.path} must be a checkpoint of this flight; instead it was kept by another scene, model, "
                "duration or version: delete it, choose another --out, or leave out --resume."
            )
        return found

    def remove(self) -> None:
        """The flight is over."""
        self.path.unlink(missing_ok=True)
