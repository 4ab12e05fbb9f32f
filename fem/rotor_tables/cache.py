"""Tables that were computed before, kept on disk under a hash of all that decides them."""

import hashlib
from collections.abc import Callable
from functools import partial

import numpy as np

from ...geometry.basics import Watch, unwatched
from ...geometry.bodies import Magnet
from ..storage import from_cache, program_of
from .choice import rotor_table
from .home import at_home, taken_along
from .table import RotorTable
from .table_file import FORMAT, load_table, save_table


def rotor_key(rotor: tuple[Magnet, ...], model: str, rtol: float, nearest: float | None = None) -> str:
    """SHA-256 of the magnets, the model, the accuracy asked for and where, and the programs that compute them."""
    digest = hashlib.sha256(f"{FORMAT} {program_of(__package__)} {model} {rtol!r} {nearest!r}".encode())
    for magnet in rotor:
        for part in (magnet.body.shape_numbers, magnet.body.center, magnet.body.rotation, magnet.polarization):
            digest.update(np.ascontiguousarray(part + 0.0, dtype="<f8").tobytes())
        digest.update(np.ascontiguousarray(magnet.permeability_in_rotor + 0.0, dtype="<f8").tobytes())
    return digest.hexdigest()


def cached_rotor_table(
    rotor: tuple[Magnet, ...],
    model: str,
    rtol: float,
    report: Callable[[str], None],
    nearest: float | None = None,
    watch: Watch = unwatched,
) -> tuple[RotorTable, bool]:
    """A rotor table, see `rotor_table`, from the cache if it is there, and whether it was.

    A lone magnet has one, wherever it is in the rotor.
    """
    home = at_home(rotor)
    name = f"rotor-{rotor_key(home, model, rtol, nearest)}.nc"
    make = partial(rotor_table, home, model, rtol, nearest, watch)
    table, found = from_cache(name, load_table, make, save_table, report)
    return taken_along(table, rotor), found
