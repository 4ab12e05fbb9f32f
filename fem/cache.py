"""Tables that were computed before, kept on disk under a hash of all that decides them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from importlib.metadata import version

import numpy as np

from ..geometry.magnet import Magnet
from .models import rotor_table
from .table import RotorTable
from .table_file import FORMAT, load_table, save_table
from .table_store import from_cache


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
    """A rotor table, from the cache if it is there, and whether it was."""
    return from_cache(
        f"rotor-{rotor_key(rotor, model, rtol)}.nc",
        load_table,
        lambda: rotor_table(rotor, model, rtol),
        save_table,
        report,
    )
