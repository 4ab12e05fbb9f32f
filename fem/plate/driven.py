"""A plate table as one self-describing netCDF file, and its place in the cache."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ...geometry.basics import Watch, unwatched
from ...geometry.scenes import Plate
from ..harmonics import FOUR_PI
from ..plate_currents import Region, cached_solver, digest
from ..rotor_tables import RotorTable
from ..storage import TableFileError, described, from_cache, program_of, read_checked, write_checked
from .driven_plate import plate_and_rotor_table
from .field_functions import Multipoles
from .plate_table import PlateErrors, PlateTable
from .share import RotorShare
from .tabulate import plate_table

FORMAT = "spinlev plate table 1"


def save_plate_table(table: PlateTable, path: str | Path, share: RotorShare | None = None) -> None:
    """Write a table, with the rotor's share of its signals if there is one; the file is whole or absent."""
    errors = (table.errors.mesh, table.errors.states, table.errors.functions)
    variables = {
        "size": (("axis",), table.size, "m"),
        "conductivity": ((), table.conductivity, "S/m"),
        "region": (("bound", "axis"), np.array([table.region.lower, table.region.upper]), "m"),
        "frequencies": (("bound",), np.array(table.frequencies), "Hz"),
        "rate": (("state",), table.rates, "1/s"),
        "multipole_center": (("multipole", "axis"), table.multipoles.centers, "m"),
        "multipole_kind": (("multipole", "degree_order_imaginary"), table.multipoles.kinds, "1"),
        "multipole_scale": ((), table.multipoles.scale, "m"),
        "weight": (("state", "multipole"), table.weights, "J^-1/2"),
        "error": (("mesh_states_functions",), np.array(errors), "1"),
    }
    if share:
        variables["rotor_series"] = (("harmonic", "state", "power"), share.series, "J^1/2")
        variables["rotor_distance"] = ((), share.distance, "m")
        variables["rotor_error"] = ((), share.error, "1")
    attributes = {
        "format": FORMAT,
        "title": "Eddy currents of a plate: passive network with harmonic field functions, in the plate's frame",
        "provenance": json.dumps(dict(table.provenance), sort_keys=True),
    }
    write_checked(described(variables, attributes), path)


def load_plate_table(path: str | Path) -> PlateTable:
    """Read a table.

    Raises
    ------
    TableFileError : the file is not a table of this format, or its content is not what was written
    """
    return _table(read_checked(path, FORMAT))


def load_driven_plate(path: str | Path) -> tuple[PlateTable, RotorShare]:
    """Read a table and the rotor's share of its signals.

    Raises
    ------
    TableFileError : as `load_plate_table`, or there is no share in the file
    """
    dataset = read_checked(path, FORMAT)
    if "rotor_series" not in dataset:
        raise TableFileError(f"Input {path} must hold a rotor's share of the signals; instead it has none.")
    distance, error = float(dataset["rotor_distance"]), float(dataset["rotor_error"])
    return _table(dataset), RotorShare(distance, dataset["rotor_series"].values, error)


def _table(dataset: xr.Dataset) -> PlateTable:
    data = {str(name): variable.values for name, variable in dataset.data_vars.items()}
    low, high = data["frequencies"]
    return PlateTable(
        size=data["size"],
        conductivity=float(data["conductivity"]),
        region=Region(*data["region"]),
        frequencies=(float(low), float(high)),
        rates=data["rate"],
        multipoles=Multipoles(data["multipole_center"], data["multipole_kind"], float(data["multipole_scale"])),
        weights=data["weight"],
        errors=PlateErrors(*(float(e) for e in data["error"])),
        provenance=json.loads(dataset.attrs["provenance"]),
    )


def plate_key(plate: Plate, region: Region, frequencies: tuple[float, float], rtol: float) -> str:
    """SHA-256 of the plate's size and conductivity, the ranges, the tolerance, and the programs; not of its pose."""
    return _hash("plate", [plate.box.size, [plate.conductivity, rtol], region.lower, region.upper, frequencies])


def driven_plate_key(
    plate: Plate,
    rotor: RotorTable,
    region: Region,
    frequencies: tuple[float, float],
    rtol: float,
    room: str = __package__,
) -> str:
    """SHA-256 of what is in `plate_key`, the plate's pose and the length of its way, and the rotor's field.

    `room` is that whose program makes the table. Coefficients of expansions count to nine digits: solved again, they
    differ in the last ones.
    """
    numbers: list[ArrayLike] = [
        plate.box.center,
        plate.box.rotation,
        [plate.lowering.distance if plate.lowering else 0.0],
    ]
    # By the magnets' strengths, not by their sum, which opposite ones leave no more of than round-off.
    strength = sum(float(np.linalg.norm(m.polarization)) * m.body.volume for m in rotor.magnets) or 1.0
    for magnet in rotor.uniform:
        numbers += [magnet.body.shape_numbers, magnet.body.center, magnet.body.rotation, magnet.polarization]
    for expansion in rotor.expansions:
        scaled = expansion.coefficients * (expansion.radius**3 * FOUR_PI / strength)
        numbers += [expansion.center, [expansion.radius], np.round(scaled.real, 9), np.round(scaled.imag, 9)]
    return digest(f"{program_of(room)} {plate_key(plate, region, frequencies, rtol)}", numbers)


def _hash(name: str, parts: Sequence[ArrayLike]) -> str:
    return digest(f"{FORMAT} {program_of(__package__)} {name}", parts)


def cached_plate_table(
    plate: Plate, region: Region, frequencies: tuple[float, float], rtol: float, report: Callable[[str], None]
) -> tuple[PlateTable, bool]:
    """A plate table, from the cache if it is there, and whether it was."""
    return from_cache(
        f"plate-{plate_key(plate, region, frequencies, rtol)}.nc",
        load_plate_table,
        lambda: plate_table(plate, region, frequencies, rtol),
        save_plate_table,
        report,
    )


def cached_driven_plate(
    plate: Plate,
    rotor: RotorTable,
    region: Region,
    frequencies: tuple[float, float],
    rtol: float,
    report: Callable[[str], None],
    watch: Watch = unwatched,
) -> tuple[PlateTable, RotorShare, bool]:
    """`plate_and_rotor_table` from the cache if it is there, and whether it was."""
    return cached_with_share(
        f"driven-plate-{driven_plate_key(plate, rotor, region, frequencies, rtol)}",
        lambda: plate_and_rotor_table(
            plate, rotor, region, frequencies, rtol, solve=cached_solver(report, watch), watch=watch
        ),
        report,
    )


def cached_with_share(
    name: str, make: Callable[[], tuple[PlateTable, RotorShare]], report: Callable[[str], None]
) -> tuple[PlateTable, RotorShare, bool]:
    """A plate's table with the rotor's share, from the cache if it is there under a name, and whether it was."""
    (table, share), found = from_cache(
        f"{name}.nc", load_driven_plate, make, lambda made, path: save_plate_table(made[0], path, made[1]), report
    )
    return table, share, found
