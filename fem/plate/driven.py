"""The table of a plate: the network of its currents, then its field functions."""

import json
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ...geometry.common import Array, InputError, Watch, unwatched
from ...geometry.meshes.plate import MeshRule
from ...geometry.scene.contents import Plate
from ..cache import TableFileError, described, from_cache, program_of, read_checked, write_checked
from ..harmonics.interior import FOUR_PI
from ..rotor.table import RotorTable
from .currents import OtherSources
from .field_functions import HIGHEST_DEGREE, Multipoles, candidates, fit_multipoles
from .network import NETWORK_SHARE, PlateNetwork, reduce_currents, reduce_plate
from .region import Region, outer_box, outer_frequencies
from .rotor_share import DOWN, MISSED, posed_rotor, rotor_parts, rotor_share, without_high_harmonics
from .solution import STRICT, PlateSolution, cached_solver, digest, error_of, solve_currents
from .table import PlateErrors, PlateTable, RotorShare

FUNCTION_SHARE = 0.1
"""Share of the tolerance for the field functions; what the other errors leave of it comes on top."""
CONDUCTOR = "this plate and this place of the floater"
"""In words, of which tolerances are told."""
STRICT_DEGREE = 7
"""Highest degree of the multipoles for strict tolerances."""


def plate_table(
    plate: Plate,
    region: Region,
    frequencies: tuple[float, float] = (0.5, 250.0),
    rtol: float = 1e-3,
    rule: MeshRule | None = None,
    others: OtherSources | None = None,
) -> PlateTable:
    """Table of `plate` for dipoles in `region` (plate's frame) and frequencies (Hz).

    Parameters
    ----------
    rtol : relative accuracy asked of reaction tensors G, Frobenius norm
    rule : mesh (default by `rtol`)
    others : more sources whose currents the network must hold

    Raises
    ------
    ValueError : region in the plate, or a parameter out of range
    AccuracyError : `rtol` not reached
    """
    table = tabulate(reduce_plate(plate, region, frequencies, rtol, rule, others), rtol)
    table.errors.check(rtol, CONDUCTOR)
    return table


def tabulate(network: PlateNetwork, rtol: float, watch: Watch = unwatched) -> PlateTable:
    """Field functions of a network as multipoles, whose errors may add up to more than `rtol`: see `PlateErrors.check`.

    `watch` hears of the progress.
    """
    start = time.perf_counter()
    region, half_edges = network.region, network.plate.box.half_edges
    points = region.surface(surface_counts(region))
    values = field_values(network, points)
    rates = np.concatenate(network.rates)
    low, high = (2 * np.pi * f for f in network.frequencies)
    middle = np.sqrt(low * high)
    state_scale = 1 / np.sqrt(rates + middle)
    point_scale = 1 / np.sqrt(np.sum((values * state_scale[:, None, None]) ** 2, axis=(0, 2)))

    def worst(error: Array) -> float:
        return max(tensor_error(values, error, rates, omega) for omega in (low, middle, high))

    choice = candidates(region, half_edges, HIGHEST_DEGREE if rtol >= STRICT else STRICT_DEGREE)
    fit = fit_multipoles(
        choice, points, values, state_scale, point_scale, rtol,
        lambda error: worst(error) <= FUNCTION_SHARE * rtol, watch=watch,
    )  # fmt: skip
    errors = PlateErrors(network.mesh_error, network.state_error, worst(fit.error))
    provenance: dict[str, str | float] = {
        "ngsolve": version("ngsolve"),
        "order": float(network.space.order),
        "cells": float(network.space.cells),
        "rtol": rtol,
        "seconds": network.seconds + time.perf_counter() - start,
    }
    return PlateTable(
        network.plate.box.size, network.plate.conductivity, region, network.frequencies, rates,
        fit.multipoles, fit.weights, errors, provenance,
    )  # fmt: skip


def surface_counts(region: Region) -> tuple[int, int, int]:
    """Points along each edge of the region: more along the longer ones."""
    extent = region.upper - region.lower
    x, y, z = np.clip(np.ceil(13 * np.sqrt(extent / extent.max())), 6, 13).astype(int)
    return int(x), int(y), int(z)


def field_values(network: PlateNetwork, points: Array) -> Array:
    """b_i (states, n, 3), T/√J, of the finite elements themselves."""
    couplings = np.concatenate([part.T for part in network.dipole_couplings(points)])
    return couplings.reshape(len(couplings), -1, 3)


def tensor_error(values: Array, error: Array, rates: Array, omega: float) -> float:
    """Largest relative error of reaction tensors from errors of the field functions."""
    weight = 1 / (rates + 1j * omega)
    exact, found = (np.einsum("ina,i,inb->nab", b, weight, b, optimize=True) for b in (values, values - error))
    return float(np.max(np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))))


ANGLES, DEPTHS = 8, 5
"""Training: the rotor at so many angles of a turn and depths of the plate; probes stand between them."""
SHARE_PART = 0.1
"""Share of the tolerance for the series of the rotor's signals."""
OTHERS_SHARE = 0.65
"""Share of what the finite elements leave of the tolerance for what dipoles around the rotor miss of it; the rest is
the left-out states'.  Above, the rotor itself is solved for, which takes as long again: a few more states cost less."""
INNER = 0.25
"""Part of a magnet's edges about its centre in which those dipoles are."""


def plate_and_rotor_table(
    plate: Plate,
    rotor: RotorTable,
    region: Region,
    frequencies: tuple[float, float] = (0.5, 250.0),
    rtol: float = 1e-3,
    rule: MeshRule | None = None,
    solve: Callable[..., PlateSolution] = solve_currents,
    watch: Watch = unwatched,
) -> tuple[PlateTable, RotorShare]:
    """Table of `plate` and the rotor's share of its signals, of one network.

    Parameters
    ----------
    plate : with its pose at the start and its lowering
    rotor : field table; whatever it knows drives the plate
    region : where the floater may be, in the plate's frame, during all of its way: see `reachable_region`
    frequencies : lowest and highest, Hz, of currents in the plate.  The field of a turning rotor has all multiples of
        its frequency.  Of a cube on the axis all but the first are below 3e-4; of one 2 mm off it, the second is 3 to
        6 per cent and the third below 4e-3: then the highest should be twice the rotor's
    rtol : relative accuracy of reaction tensors in the region, and there of the field of the rotor's currents
    rule : mesh (default by `rtol`)
    solve : finite elements; `cached_solver` has them from the cache
    watch : hears of the progress

    The finite elements are solved for dipoles in boxes around the region and around the rotor, on a coarse raster, so
    that neighbours of the scene and other models of the rotor need the same ones.  A rotor that these dipoles do not
    stand for gets its own.

    Raises
    ------
    InputError : the plate is too near to the rotor
    ValueError : region in the plate, or a parameter out of range
    AccuracyError : `rtol` not reached
    """
    others = turning_rotor(plate, rotor)
    half = plate.box.half_edges
    boxes = [outer_box(region, half), outer_box(rotor_box(plate, rotor), half)]
    outer = outer_frequencies(frequencies)
    solution = solve(plate, boxes, outer, rtol, rule)
    watch("network of the scene", 0.0)
    error = error_of(solution, others.probes)
    if error > OTHERS_SHARE * (NETWORK_SHARE * rtol - solution.mesh_error):
        solution = solve(plate, boxes, outer, rtol, rule, others)
        error = solution.space_error
    watch("network of the scene", 0.5)
    missed = max(error, solution.space_error)
    network = reduce_currents(plate, solution, region, frequencies, rtol, others, missed)
    watch("field functions", 0.0)
    table = tabulate(network, rtol, watch)
    if table.errors.total > rtol:  # more states leave room for what the field functions miss
        functions = table.errors.functions
        network = reduce_currents(plate, solution, region, frequencies, rtol, others, missed, functions)
        table = tabulate(network, rtol, watch)
        table.errors.check(rtol, CONDUCTOR)
    share = rotor_share(network, plate, rotor, SHARE_PART * rtol, watch=watch)
    return table, without_high_harmonics(share, table, MISSED * rtol)


def turning_rotor(plate: Plate, rotor: RotorTable) -> OtherSources:
    """The rotor at some angles and depths of the plate, to train and to probe a network with."""
    parts = rotor_parts(rotor, plate)
    way = plate.lowering.distance if plate.lowering else 0.0
    depths = way * (1 - np.cos(np.pi * np.arange(DEPTHS) / (DEPTHS - 1))) / 2 if way else np.zeros(1)
    angles = 2 * np.pi * np.arange(ANGLES) / ANGLES
    step = angles[1]
    training = [posed_rotor(parts, plate, angle, depth) for depth in depths for angle in angles]
    between = (depths[1:] + depths[:-1]) / 2 if way else depths
    probes = [posed_rotor(parts, plate, angle + step / 2, depth) for depth in between for angle in angles[:3]]
    centers = np.array([magnet.box.center for magnet in rotor.magnets])
    if not parts:  # a rotor without a field
        training, probes = [], []
    return OtherSources(training, probes, plate.box.to_body(centers))


def rotor_box(plate: Plate, rotor: RotorTable) -> Region:
    """Where the inner parts of the turning magnets are, in the plate's frame, on all of its way."""
    boxes = [magnet.box for magnet in rotor.magnets]
    inner = [INNER * float(box.size.max()) for box in boxes]
    radius = max(float(np.hypot(*box.center[:2])) + r for box, r in zip(boxes, inner, strict=True))
    low = min(float(box.center[2]) - r for box, r in zip(boxes, inner, strict=True))
    high = max(float(box.center[2]) + r for box, r in zip(boxes, inner, strict=True))
    way = plate.lowering.distance if plate.lowering else 0.0
    corners = np.stack(np.meshgrid((-radius, radius), (-radius, radius), (low, high + way)), -1).reshape(8, 3)
    body = plate.box.to_body(corners)
    return Region(body.min(axis=0), body.max(axis=0))


def reachable_region(plate: Plate, center: ArrayLike, half_edges: ArrayLike, radius: float = 0.0) -> Region:
    """Where a floater can come to in the plate's frame, during all of its lowering.

    The box about `center` and its image under the lowering are united; what is nearer to the plate than the floater's
    radius is cut off.

    Parameters
    ----------
    center, half_edges : (3,) m, box along the laboratory's axes, where the floater may be
    radius : of the floater, m

    Raises
    ------
    InputError : the centre is not farther than the radius from the plate's face, all the way
    """
    center, half = np.asarray(center, float), plate.box.half_edges
    way = plate.lowering.distance if plate.lowering else 0.0
    ends = plate.box.to_body(np.array([center, center - way * DOWN]))
    beyond = np.min(np.abs(ends) - half, axis=0)
    axis = int(np.argmax(beyond))
    if beyond[axis] <= radius or ends[0, axis] * ends[1, axis] < 0:
        raise InputError(
            f"Input center_mm must be farther than {radius * 1e3:.4g} mm from the plate's faces on all of its way; "
            f"instead received {np.round(center * 1e3, 6).tolist()}, {max(beyond[axis], 0) * 1e3:.4g} mm from them. "
            "Move the plate away."
        )
    signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3, indexing="ij"), -1).reshape(8, 3)
    corners = center + np.asarray(half_edges, float) * signs
    body = plate.box.to_body(np.concatenate([corners, corners - way * DOWN]))
    lower, upper = body.min(axis=0), body.max(axis=0)
    if ends[0, axis] > 0:
        lower[axis] = max(lower[axis], half[axis] + radius)
    else:
        upper[axis] = min(upper[axis], -half[axis] - radius)
    return Region(lower, upper)


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
    room: str = __name__,
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
    return digest(f"{FORMAT} {program_of(__name__)} {name}", parts)


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
