"""A `MutualTable` as one self-describing netCDF file, and those that were made before."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import xarray as xr

from ...geometry.basics import Watch, unwatched
from ...geometry.bodies import Magnet
from ...geometry.scenes import Floater
from ..rotor_tables import at_home
from ..storage import described, from_cache, program_of, read_checked, write_checked
from .answer_fit import mutual_table
from .answer_grid import AnswerGrid, answer_box
from .table import MutualTable

FORMAT = "spinlev mutual table 3"


def cached_mutual_table(
    magnets: tuple[Magnet, ...], floater: Floater, report: Callable[[str], None], watch: Watch = unwatched
) -> tuple[MutualTable, bool]:
    """The answers of a rotor and a floater, see `mutual_table`, from the cache if they are there, and whether.

    A lone magnet answers in its own axes: one table serves it wherever it stands and however it is turned.
    """
    upright = at_home(magnets)
    table, found = from_cache(
        f"mutual-{mutual_key(upright, floater)}.nc",
        lambda path: from_dataset(read_checked(path, FORMAT), upright),
        lambda: mutual_table(upright, floater, watch=watch),
        lambda table, path: write_checked(to_dataset(table), path),
        report,
    )
    return _posed(table, magnets), found


def _posed(table: MutualTable, magnets: tuple[Magnet, ...]) -> MutualTable:
    """The table of a lone upright magnet where the magnet is; that of several as it is."""
    if len(magnets) > 1:
        return table
    turns = [magnet.box.rotation for magnet in magnets]
    turn = np.kron(np.eye(len(table.coupling) // 3), turns[0]) if turns else np.zeros((0, 0))
    coupling = turn @ table.coupling @ turn.T
    grids = tuple(replace(grid, box=answer_box(magnet.body)) for grid, magnet in zip(table.grids, magnets, strict=True))
    return replace(table, magnets=magnets, grids=grids, coupling=coupling)


def mutual_key(magnets: tuple[Magnet, ...], floater: Floater) -> str:
    """SHA-256 of all that decides the answers, and the programs that compute them."""
    digest = hashlib.sha256(f"{FORMAT} {program_of(__package__)}".encode())
    sphere = np.array([floater.radius, floater.remanence, floater.recoil_permeability])
    for magnet in magnets:
        for part in (magnet.body.shape_numbers, magnet.body.center, magnet.body.rotation, magnet.polarization):
            digest.update(np.ascontiguousarray(part + 0.0, dtype="<f8").tobytes())
        digest.update(np.ascontiguousarray(magnet.permeability_in_rotor + 0.0, dtype="<f8").tobytes())
    digest.update(np.ascontiguousarray(sphere, dtype="<f8").tobytes())
    return digest.hexdigest()


def to_dataset(table: MutualTable) -> xr.Dataset:
    """All numbers of a table with their units; the magnets are known to who asks for it."""
    grids = table.grids
    variables = {
        "axis": (("magnet", "body_axis"), np.array([grid.axis for grid in grids]), "1"),
        "counts": (("magnet", "body_axis"), np.array([grid.counts for grid in grids]), "1"),
        "strengths": (("point", "body_axis"), np.concatenate([grid.strengths for grid in grids]), "A m2/T"),
        "degrees": (("point", "power", "kind"), np.concatenate([grid.degrees for grid in grids]), "J"),
        "returned": (("point", "higher_power", "kind"), np.concatenate([grid.returned for grid in grids]), "T"),
        "coupling": (("field", "other_field"), table.coupling, "A m2/T"),
        "pairs": (("magnet", "other_magnet"), table.pairs, "J"),
        "mixed": (("magnet", "other_magnet"), table.mixed, "T"),
        "images": (("image",), table.images, "1"),
        "polarizability": ((), table.polarizability, "A m2/T"),
        "radius": ((), grids[0].radius, "m"),
        "gaps": (("gap",), table.gaps, "m"),
        "errors": (("gap", "of_force_or_torque"), table.errors, "1"),
    }
    attrs = {
        "format": FORMAT,
        "title": "Energies of the mutual magnetisation of a rotor and a sphere",
        "provenance": json.dumps(table.provenance, sort_keys=True),
    }
    return described(variables, attrs)


def from_dataset(dataset: xr.Dataset, magnets: tuple[Magnet, ...]) -> MutualTable:
    """The table of a data set that `to_dataset` made for these magnets."""
    data = {str(name): variable.values for name, variable in dataset.data_vars.items()}
    ends = np.cumsum(np.prod(data["counts"], axis=1))[:-1]
    parts = (np.split(data[name], ends) for name in ("strengths", "degrees", "returned"))
    grids = [
        AnswerGrid(answer_box(m.body), axis, float(data["radius"]), tuple(counts), *rest)
        for m, axis, counts, *rest in zip(magnets, data["axis"], data["counts"].tolist(), *parts, strict=True)
    ]
    return MutualTable(
        magnets=magnets,
        grids=tuple(grids),
        coupling=data["coupling"],
        pairs=data["pairs"],
        mixed=data["mixed"],
        images=data["images"],
        polarizability=float(data["polarizability"]),
        gaps=data["gaps"],
        errors=data["errors"],
        provenance=json.loads(dataset.attrs["provenance"]),
    )
