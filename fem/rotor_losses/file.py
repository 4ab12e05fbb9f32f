"""A table of losses as one self-describing netCDF file, and the cache of tables."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...geometry.basics import Solid, Watch, unwatched
from ...geometry.scenes import Scene
from ..plate_tables import Multipoles
from ..storage import described, from_cache, program_of, read_checked, write_checked
from .table import RotorLosses
from .tabulate import pieces_of, rotor_losses

FORMAT = "spinlev rotor losses 1"


def save_losses(table: RotorLosses, path: str | Path) -> None:
    """Write a table; the file is whole or absent."""
    multipoles = table.multipoles
    variables = {
        "center": (("multipole", "axis"), multipoles.centers, "m"),
        "kind": (("multipole", "number"), multipoles.kinds, "1"),
        "weight": (("field", "multipole"), table.weights, "W^0.5 s A-1 m-2 T-1"),
        "distance": (("distance",), table.distances, "m"),
        "error": (("distance",), table.errors, "1"),
    }
    attributes = {
        "format": FORMAT,
        "title": "Dissipation in a rotor's metal: power is the sum of squares of d/dt m·c",
        "scale": multipoles.scale,
        "provenance": json.dumps(dict(table.provenance), sort_keys=True),
    }
    write_checked(described(variables, attributes), path)


def load_losses(path: str | Path) -> RotorLosses:
    """Read a table.

    Raises
    ------
    TableFileError : the file is not a table of this format, or its content is not what was written
    """
    data = read_checked(path, FORMAT)
    multipoles = Multipoles(data["center"].values, data["kind"].values, float(data.attrs["scale"]))
    weights, distances, errors = (data[name].values for name in ("weight", "distance", "error"))
    return RotorLosses(multipoles, weights, distances, errors, json.loads(data.attrs["provenance"]))


def losses_key(scene: Scene) -> str:
    """SHA-256 of the rotor's bodies and what conducts, how near the floater can come, and the programs."""
    digest = hashlib.sha256(f"{FORMAT} {program_of(__package__)} {scene.floater.radius!r}".encode())
    for body in scene.turning_bodies:
        digest.update(_bytes(body))
    for bodies, conductivity in pieces_of(scene.rotor, scene.conductors):
        digest.update(f"piece {conductivity!r}".encode() + b"".join(map(_bytes, bodies)))
    return digest.hexdigest()


def cached_rotor_losses(
    scene: Scene, report: Callable[[str], None], watch: Watch = unwatched
) -> tuple[RotorLosses, bool]:
    """The losses in a scene's rotor, from the cache if they are there, and whether they were.

    `watch` hears of the progress.  At which frequencies they hold, `check_slow_enough` says.
    """
    return from_cache(
        f"rotor-losses-{losses_key(scene)}.nc",
        load_losses,
        lambda: rotor_losses(scene.rotor, scene.conductors, scene.floater.radius, watch=watch),
        save_losses,
        report,
    )


def _bytes(body: Solid) -> bytes:
    parts = [np.ascontiguousarray(part + 0.0, dtype="<f8") for part in (body.shape_numbers, body.center, body.rotation)]
    return type(body).__name__.encode() + b"".join(part.tobytes() for part in parts)
