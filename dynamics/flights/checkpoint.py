"""The file of a flight that lasts, so that it can go on where it was stopped, to the last bit."""

import hashlib
import io
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...fem.files import seal, unsealed, write_whole
from ...geometry.common import InputError


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
        write_whole(self.path, seal(stream.getvalue()))

    def read(self) -> dict[str, Any] | None:
        """Arrays by name, with the `region` (2, 3) m of the plate's table (zeros: none), or None without a file.

        Raises InputError: the file is damaged, or belongs to another flight.
        """
        if not os.path.lexists(self.path):
            return None
        whole = unsealed(self.path)  # so that no library meets a damaged archive
        if whole is None:
            raise InputError(f"Input {self.path} must be a checkpoint; instead it is damaged: delete it.")
        with np.load(io.BytesIO(whole)) as data:
            content = dict(data)
        if str(content.pop("key")) != self._key:
            raise InputError(
                f"Input {self.path} must be a checkpoint of this flight; instead it was kept by another scene, model, "
                "duration or version: delete it, choose another --out, or leave out --resume."
            )
        return content

    def remove(self) -> None:
        self.path.unlink(missing_ok=True)
