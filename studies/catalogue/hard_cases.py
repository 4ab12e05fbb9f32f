"""True and stated error of the rotor's table in hard cases, against an independent solution.

The reference has another mesh with smaller elements, a higher order and all moments; for μr = 1 it is Coulomb's law.
What it is worth its own last step in order tells.
"""

import time
import warnings
from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np
import xarray as xr

from ...fem.closed_forms import added_by_closed_form, carrier, oblique_contact
from ...fem.magnetostatics import Refinement, solve_rotor
from ...fem.rotor_tables import Accuracy, AccuracyWarning, RotorTable, fem_table, points_around, typical_field
from ...fem.verification import coulomb_field
from ...geometry.basics import Array
from ...geometry.bodies import cells_of, cut_magnets
from ..results import study_of_one, variable
from ..terminal import progress
from .field_hard_cases_figure import FIGURES, hard_case_lines
from .hard_cases import CASES, HardCase

RTOL = 1e-5
FARTHEST = 1.0
DEGREE = 33
"""Of the reference's expansions."""
BOUNDARY_DEGREE = 20
"""Of the reference's open boundary: a ball of 1.2 radii leaves (1/1.2)^(2 · 20 + 1), 6e-4 of what degree 20 adds."""
OBLIQUE_NODES = 192
"""Of the reference's rules for boxes that touch without being parallel."""
FINER_CELLS = 0.8
"""Of the reference's expansions of round magnets: they converge from nearer on than the table's."""
PLACES = 12
"""Distances from the faces, from the case's own nearest one to `FARTHEST`."""
ROUND_OFF = 1e-13


def field_hard_cases(quick: bool, cases: Mapping[str, HardCase] = CASES, places: int = PLACES) -> xr.Dataset:
    """Errors of B by case and distance from the faces; a quick run has few cases and coarse references."""
    if quick:
        cases = {name: replace(case, order=min(case.order, 4)) for name, case in cases.items() if case.quick}
    rows = []
    with progress("hard cases") as show:
        for case in cases.values():
            rows.append(case_errors(case, places // 2 if quick else places))
            show(len(rows) / len(cases))
    return xr.concat(rows, "case").assign_coords(case=list(cases))


def case_errors(case: HardCase, places: int) -> xr.Dataset:
    """Largest errors of a case's table at `places` distances, relative to the field that is typical there."""
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)
        table = fem_table(case.magnets, Accuracy(RTOL, case.nearest))
    seconds = time.process_time() - start
    distance = np.geomspace(case.clearance, FARTHEST, places)
    points = [extensions(case, d) if case.extensions else points_around(case.magnets, d) for d in distance]
    before, truth = reference(case, np.concatenate(points))
    ends = np.cumsum([len(p) for p in points])[:-1]
    rows = [
        _errors(table, case, *parts)
        for parts in zip(points, np.split(before, ends), np.split(truth, ends), strict=True)
    ]
    true, stated, own, cover = np.array(rows).T
    names = {
        "true_error": (true, "largest difference of B from the reference"),
        "stated_error": (stated, "largest error of B that the table states"),
        "reference_step": (own, "largest last step in order of the reference"),
        "shortfall": (cover, "largest ratio of the difference to stated error and reference's step"),
    }
    return xr.Dataset(
        {
            "distance": variable(("place",), distance, "m", "distance from the magnets' faces"),
            **{key: variable(("place",), values, "1", text) for key, (values, text) in names.items()},
            "order": variable((), float(table.provenance["order"]), "1", "order of the table's elements"),
            "unknowns": variable((), float(table.provenance["unknowns"]), "1", "unknowns of the table's elements"),
            "seconds": variable((), seconds, "s", "processor time of the table"),
        }
    )


def extensions(case: HardCase, distance: float) -> Array:
    """Points (n, 3) m on the extensions of edges, and of faces beyond the middles of edges, of the first magnet."""
    box = case.magnets[0].box
    found = []
    for axis, side, first, second in product(range(3), (-1, 1), (-1, 0, 1), (-1, 0, 1)):
        if first or second:
            place = np.insert(np.array([first, second]) * np.delete(box.half_edges, axis), axis, 0.0)
            place[axis] = side * (box.half_edges[axis] + distance)
            found.append(box.center + box.rotation @ place)
    return np.array(found)


def reference(case: HardCase, points: Array) -> tuple[Array, Array]:
    """B (n, 3) T of the reference one order lower and at its full order."""
    if not case.order:
        exact = np.sum([coulomb_field(magnet, points) for magnet in case.magnets], axis=0)
        return exact, exact
    pieces = cut_magnets(case.magnets, case.clearance)
    carriers = tuple(carrier(magnet) for magnet in case.magnets)
    remanent = RotorTable("cuboid", carriers, carriers).evaluate(points)[0]
    nodes = OBLIQUE_NODES if oblique_contact([magnet.box for magnet in case.magnets]) else None
    cells = [cells_of(piece.body, FINER_CELLS * case.clearance) for whole in pieces for piece in whole]
    closed = added_by_closed_form(pieces, case.magnets, carriers, DEGREE, nodes, cells)
    fields = []
    for order in (case.order - 1, case.order):
        refinement = Refinement(order, case.mesh, BOUNDARY_DEGREE)
        found = solve_rotor(case.magnets, refinement, "split", DEGREE, pieces, carriers=carriers, cells=cells)
        parts = found.expansions([a + b for a, b in zip(closed, found.coefficients, strict=True)])
        fields.append(remanent + sum(part.evaluate(points)[0] for part in parts))
    return fields[0], fields[1]


def _errors(table: RotorTable, case: HardCase, points: Array, before: Array, truth: Array) -> tuple[float, ...]:
    """True, stated, reference's own error and shortfall at points (n, 3) m of like distance."""
    scale = typical_field(case.magnets, points)
    true = np.linalg.norm(table.evaluate(points)[0] - truth, axis=1) / scale
    own = np.linalg.norm(truth - before, axis=1) / scale
    stated = table.absolute_error(points)[0] / scale + ROUND_OFF
    return float(true.max()), float(stated.max()), float(own.max()), float((true / (stated + own)).max())


STUDY = study_of_one(
    name="field-hard-cases",
    summary="true and stated error of the rotor's table in hard cases: contact,"
    " extensions, flat, touching, strong, many",
    compute=field_hard_cases,
    figures=FIGURES,
    report=hard_case_lines,
)
