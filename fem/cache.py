"""Tables that were computed before, kept on disk under a hash of all that decides them."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ..geometry.magnet import Magnet
from .models import rotor_table
from .table import RotorTable
from .table_file import FORMAT, TableFileError, load_table, save_table


def cache_folder() -> Path:
    """Where tables are kept: $SPINLEV_CACHE, else $XDG_CACHE_HOME/spinlev, else ~/.cache/spinlev."""
    if folder := os.environ.get("SPINLEV_CACHE"):
        return Path(folder)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "spinlev"


def rotor_key(rotor: tuple[Magnet, ...], model: str, rtol: float) -> str:
    """SHA-256 of the magnets, the model, the tolerance, and the programs that compute them."""
    digest = hashlib.sha256(f"{FORMAT} {version('spinlev')} {version('ngsolve')} {model} {rtol!r}".encode())
    for magnet in rotor:
        for part in (magnet.box.size, magnet.box.center, magnet.box.rotation, magnet.polarization):
            digest.update(np.ascontiguousarray(part + 0.0, dtype="<f8").tobytes())
        digest.update(np.ascontiguousarray(magnet.permeability_in_rotor + 0.0, dtype="<f8").tobytes())
    return digest.hexdigest()


def cached_rotor_table(
    rotor: tuple[Magnet, ...], model: str, rtol: float, report: Callable[[str], None]
) -> tuple[RotorTable, bool]:
    """A rotor table, from the cache if it is there, and whether it was.

    A damaged entry is reported, computed anew and replaced; a cache that cannot be written is reported and
    does no harm.
    """
    path = cache_folder() / f"rotor-{rotor_key(rotor, model, rtol)}.nc"
    if path.exists():
        try:
            return load_table(path), True
        except (TableFileError, OSError) as error:
            report(f"The cached table is damaged and is computed anew: {error}")
    table = rotor_table(rotor, model, rtol)
    try:
        save_table(table, path)
    except OSError as error:
        report(f"The table could not be cached: {error}")
    return table, False
