"""The table of a plate: the network of its currents, then its field functions."""

import time
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import Array, InputError, Watch, unwatched
from ...geometry.meshes.plate import MeshRule
from ...geometry.scene.contents import Plate
from ..cache import TableKind
from ..rotor.table import RotorTable
from .currents import OtherSources
from .field_functions import HIGHEST_DEGREE, candidates, fit_multipoles
from .network import NETWORK_SHARE, PlateNetwork, reduce_currents, reduce_plate
from .region import Region, outer_box, outer_frequencies
from .rotor_share import DOWN, MISSED, posed_rotor, rotor_parts, rotor_share, without_high_harmonics
from .solution import STRICT, PlateSolution, cached_solver, error_of, solve_currents
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


TITLE = "Eddy currents of a plate: passive network with harmonic field functions, in the plate's frame"
PLATE = TableKind("plate", PlateTable, TITLE)
DRIVEN = TableKind("driven-plate", tuple[PlateTable, RotorShare], f"{TITLE}, and the rotor's share of their signals")


def cached_plate_table(
    plate: Plate, region: Region, frequencies: tuple[float, float], rtol: float, report: Callable[[str], None]
) -> tuple[PlateTable, bool]:
    """A plate table, from the cache if it is there, and whether it was; it is the same for every pose of the plate."""
    inputs = plate.box.size, plate.conductivity, region, frequencies, rtol
    return PLATE.cached(inputs, lambda: plate_table(plate, region, frequencies, rtol), report)


def deciding(
    plate: Plate, rotor: RotorTable, region: Region, frequencies: tuple[float, float], rtol: float
) -> tuple[Any, ...]:
    """What decides a plate's table and the rotor's share: the way of a lowering does, but not when and how fast."""
    way = plate.lowering.distance if plate.lowering else 0.0
    return plate.box, plate.conductivity, way, rotor.uniform, rotor.expansions, region, frequencies, rtol


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
    asked, solve = (plate, rotor, region, frequencies, rtol), cached_solver(report, watch)
    make = partial(plate_and_rotor_table, *asked, solve=solve, watch=watch)
    (table, share), found = DRIVEN.cached(deciding(*asked), make, report)
    return table, share, found
