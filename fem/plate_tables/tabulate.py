"""The table of a plate: the network of its currents, then its field functions."""

import time
from importlib.metadata import version

import numpy as np

from ...geometry.basics import Array, Watch, unwatched
from ...geometry.meshes import MeshRule
from ...geometry.scenes import Plate
from ..plate_currents import STRICT, OtherSources, Region
from ..plate_network import PlateNetwork, reduce_plate
from .field_functions import HIGHEST_DEGREE, candidates
from .multipole_fit import fit_multipoles
from .plate_table import PlateErrors, PlateTable

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
