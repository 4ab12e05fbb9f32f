"""A rotor's and a floater's answers fitted to finite elements: the making of a `MutualTable`."""

import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ...geometry.basics import MU_0, Array, InputError, Part
from ...geometry.bodies import Magnet
from ...geometry.scenes import Floater
from ..harmonics import FOUR_PI
from .answer_error import answer_errors
from .answer_grid import POWERS, AnswerGrid, answer_box, orbits, point_counts
from .answer_samples import (
    ROTOR_GAPS,
    SPHERE_GAPS,
    SphereSamples,
    answer_products,
    places_around,
    sphere_samples,
    unit_dipole_fields,
)
from .permeable_sphere import reflection
from .rotor_response import rotor_ladder
from .table import FULL, MutualTable

NEAREST = 0.16
"""Gap in floater radii from which on force and torque are to be met to 1e-3: 1 mm for the article's floater."""
EQUATIONS, SMALL = 8000, 1e-9
"""Pairs of dipoles that are fitted, and the relative size of a singular value that is none."""
PARALLEL = 1e-9


def mutual_table(magnets: tuple[Magnet, ...], floater: Floater, order: int = 2) -> MutualTable:
    """The answers of a rotor and a floater, by finite elements of a degree, with errors against `two_body`.

    Raises
    ------
    InputError : a magnet's permeability has other axes than its body
    """
    started = time.perf_counter()
    (rotor,) = rotor_ladder(magnets, (order,))
    counts = [point_counts(answer_box(m.body), (1 + NEAREST) * floater.radius) for m in magnets]
    grids = [_empty(magnet, floater, n) for magnet, n in zip(magnets, counts, strict=True)]
    coupling, pairs = np.zeros((3 * len(grids), 3 * len(grids))), np.zeros((len(grids), len(grids)))
    if rotor.regions is not None:
        places = places_around(magnets, floater.radius, ROTOR_GAPS, 9, 1)
        grids, coupling = _rotor_fit(grids, magnets, answer_products(rotor, places), places)
    if floater.recoil_permeability != 1:
        places = places_around(magnets, floater.radius, SPHERE_GAPS, 30, 2)
        grids, pairs = _sphere_fit(grids, sphere_samples(rotor, floater, places))
    alpha = FOUR_PI * floater.radius**3 / MU_0 * float(reflection(floater.recoil_permeability, 1)[1])
    table = MutualTable(magnets, tuple(grids), coupling, pairs, alpha)
    gaps, errors = answer_errors(table, rotor, floater)
    return replace(
        table, gaps=gaps, errors=errors, provenance={"order": order, "seconds": time.perf_counter() - started}
    )


def oblique(magnet: Magnet) -> bool:
    """Whether the permeability has other axes than the body, which the points of a magnet cannot answer with.

    Nor can those of a part from a file, whose remanence has no closed form.
    """
    if isinstance(magnet.body, Part):
        return True
    turn = magnet.box.rotation
    inside = turn.T @ magnet.permeability_in_rotor @ turn
    return bool(np.abs(inside - np.diag(np.diag(inside))).max() > PARALLEL)


def _empty(magnet: Magnet, floater: Floater, counts: tuple[int, int, int]) -> AnswerGrid:
    size = float(np.linalg.norm(magnet.polarization))
    if oblique(magnet):
        raise InputError(
            "Input transverse_permeability must belong to a magnet polarised along one of its edges where rotor and "
            "floater magnetise each other; instead its easy axis is oblique. Choose --interaction rigid."
        )
    count = int(np.prod(counts))
    axis = magnet.polarization / size if size else np.zeros(3)
    return AnswerGrid(
        answer_box(magnet.body), axis, floater.radius, counts, np.zeros((count, 3)), np.zeros((count, 2, 2))
    )


def _classes(grid: AnswerGrid, mirrored: bool) -> Array:
    """(n, classes): which points belong to a class."""
    number = orbits(grid.points, mirrored)
    return np.asarray(np.eye(number.max() + 1)[number])


def _rotor_fit(
    grids: Sequence[AnswerGrid], magnets: Sequence[Magnet], products: Array, places: Array
) -> tuple[list[AnswerGrid], Array]:
    """Strengths and coupling that give the products of fields of dipoles with the answers to them."""
    size = 1 / np.sqrt(np.diag(products))
    first, second = np.triu_indices(len(products))
    if len(first) > EQUATIONS:
        chosen = np.random.default_rng(0).choice(len(first), EQUATIONS, replace=False)
        chosen = np.union1d(chosen, np.flatnonzero(first == second))
        first, second = first[chosen], second[chosen]
    columns, kinds, centers = [], [], []
    for grid, magnet in zip(grids, magnets, strict=True):
        classes = _classes(grid, mirrored=True) if magnet.contrast else np.zeros((len(grid.points), 0))
        fields = unit_dipole_fields(grid.box.center + grid.points @ grid.box.rotation.T, places) @ grid.box.rotation
        fields *= size[:, None, None]
        columns += [(fields[first, :, a] * fields[second, :, a]) @ classes for a in range(3)]
        kinds.append(classes)
        centers.append(unit_dipole_fields(grid.box.center[None], places)[:, 0] * size[:, None])
    whole = np.concatenate(centers, axis=1)
    couples = list(zip(*np.triu_indices(whole.shape[1]), strict=True))
    columns.append(
        np.array(
            [whole[first, a] * whole[second, b] + (a != b) * whole[first, b] * whole[second, a] for a, b in couples]
        ).T
    )
    found = list(_least_squares(np.concatenate(columns, axis=1), products[first, second] * size[first] * size[second]))
    made = []
    for grid, classes in zip(grids, kinds, strict=True):
        count = classes.shape[1]
        parts = [classes @ np.array([found.pop(0) for _ in range(count)]) for _ in range(3)]
        made.append(replace(grid, strengths=np.stack(parts, axis=1)))
    coupling = np.zeros((whole.shape[1], whole.shape[1]))
    for (a, b), value in zip(couples, found, strict=True):
        coupling[a, b] = coupling[b, a] = value
    return made, coupling


def _sphere_fit(grids: Sequence[AnswerGrid], samples: SphereSamples) -> tuple[list[AnswerGrid], Array]:
    """Weights of the points' powers, and of pairs of magnets, that give energy and force of the sphere's answer."""
    values, slopes, kinds = [], [], []
    for grid in grids:
        aligned = bool(np.sum(np.abs(grid.axis) > PARALLEL) == 1)
        classes = _classes(grid, mirrored=aligned) if grid.axis.any() else np.zeros((len(grid.points), 0))
        value, slope = _powers(grid, samples.places)
        values.append((value @ classes).reshape(len(value), -1))
        slopes.append((slope @ classes).reshape(*slope.shape[:2], -1))
        kinds.append(classes)
    pairs = list(combinations(range(len(grids)), 2))
    if pairs:
        step = 1e-4 * grids[0].radius
        at = [
            _pair_products(grids, samples.places + move)
            for move in (0 * np.eye(3)[0], *(step * np.eye(3)), *(-step * np.eye(3)))
        ]
        values.append(at[0])
        slopes.append(np.stack([(at[1 + a] - at[4 + a]) / (2 * step) for a in range(3)], axis=1))
    value, slope = np.concatenate(values, axis=1), np.concatenate(slopes, axis=2)
    rows = [value / samples.energy_size[:, None], *np.moveaxis(slope / samples.force_size[:, None, None], 1, 0)]
    right = [-samples.energy / samples.energy_size, *(samples.force / samples.force_size[:, None]).T]
    found = list(_least_squares(np.concatenate(rows), np.concatenate(right)))
    made = []
    for grid, classes in zip(grids, kinds, strict=True):
        count = classes.shape[1]
        parts = [classes @ np.array([found.pop(0) for _ in range(count)]) for _ in range(2 * len(POWERS))]
        made.append(replace(grid, degrees=np.stack(parts, axis=1).reshape(-1, len(POWERS), 2)))
    coupled = np.zeros((len(grids), len(grids)))
    for (a, b), weight in zip(pairs, found, strict=True):
        coupled[a, b] = coupled[b, a] = weight
    return made, coupled


def _powers(grid: AnswerGrid, places: Array) -> tuple[Array, Array]:
    """Of every point (n): 1 and (ĵ·d)²/d² times (R/d)^2p at places (m): (m, 4, n), and their gradients (m, 3, 4, n)."""
    d = grid.box.to_body(places)[:, None] - grid.points
    inverse = 1 / np.sum(d**2, axis=2)
    along = d @ grid.axis
    values, slopes = [], []
    for p in POWERS:
        power = grid.radius ** (2 * p) * inverse**p
        values += [power, power * along**2 * inverse]
        flat = (-2 * p * power * inverse)[..., None] * d
        steep = (-2 * (p + 1) * power * along**2 * inverse**2)[..., None] * d
        slopes += [flat, steep + (2 * power * along * inverse)[..., None] * grid.axis]
    turned = np.stack(slopes, axis=1) @ grid.box.rotation.T
    return np.stack(values, axis=1), np.moveaxis(turned, 3, 1)


def _pair_products(grids: Sequence[AnswerGrid], places: Array) -> Array:
    """Products (m, pairs) of the gradients of two magnets' central dipoles, as `dipole_slope`'s."""
    slopes = []
    for grid in grids:
        d, j = places - grid.box.center, grid.box.rotation @ grid.axis
        square = np.sum(d**2, axis=1)
        along = d @ j
        entries = []
        for a, b in (*((a, a) for a in range(3)), (0, 1), (0, 2), (1, 2)):
            entries.append(j[a] * d[:, b] + j[b] * d[:, a] + (a == b) * along - 5 * along * d[:, a] * d[:, b] / square)
        slopes.append(np.array(entries) / square**2.5)
    return np.array(
        [np.einsum("e,em,em->m", FULL, slopes[a], slopes[b]) for a, b in combinations(range(len(grids)), 2)]
    ).T


def _least_squares(columns: Array, values: Array) -> Array:
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    return np.asarray(np.linalg.lstsq(columns / size, values, rcond=SMALL)[0] / size)
