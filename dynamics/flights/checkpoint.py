"""The file of a flight that lasts, so that it can go on where it was stopped, to the last bit."""

import hashlib
import io
import os
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...fem.files import write_whole
from ...geometry.common import InputError
from ...geometry.files import regular_file

KEPT = ("time", "state", "values", "times", "states", "interval", "steps", "changes", "region")
MOST = 2_000_000_000  # Bytes of a checkpoint
# What damage to a file of arrays is noticed by; its header may say any size.
BROKEN = (OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError, MemoryError, zipfile.BadZipFile, zlib.error)


@dataclass(frozen=True)
class Checkpoint:
    """The file in which a `Course` is kept while it lasts."""

    path: Path  # where it is
    identity: str  # everything that the flight depends on, as text; another flight's checkpoint is refused
    every: float = 5.0  # seconds between two writings

    @property
    def _key(self) -> str:
        return hashlib.sha256(self.identity.encode()).hexdigest()

    def write(self, content: Mapping[str, Any]) -> None:
        """Keep arrays by name; the file is whole or as it was."""
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, key=np.array(self._key), **content)
        write_whole(self.path, stream.getvalue())

    def read(self) -> dict[str, Any] | None:
        """Arrays by name, with the `region` (2, 3) m of the plate's table (zeros: none), or None without a file.

        Raises
        ------
        InputError : the file is damaged, or belongs to another flight
        """
        if not os.path.lexists(self.path):
            return None
        try:
            with regular_file(self.path, MOST, "checkpoint", "a regular file") as stream, np.load(stream) as data:
                content = {name: data[name] for name in ("key", *KEPT)}
            key = str(content.pop("key"))
        except InputError:
            raise
        except BROKEN as error:
            raise InputError(f"Input {self.path} must be a checkpoint; instead it is damaged: delete it.") from error
        if key != self._key:
            raise InputError(
                f"Input {self.path} must be a checkpoint of this flight; instead it was kept by another scene, model, "
                "duration or version: delete it, choose another --out, or leave out --resume."
            )
        return content

    def remove(self) -> None:
        self.path.unlink(missing_ok=True)
