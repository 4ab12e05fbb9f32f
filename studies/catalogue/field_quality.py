"""Where models of the rotor's field can be trusted, and rotors whose field is hard to compute."""

import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from textwrap import fill
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ...fem.closed_forms.moments import added_by_closed_form, carriers_of, oblique_contact
from ...fem.elements.ladder import Refinement, solve_rotor
from ...fem.elements.magnetostatics import coulomb_field
from ...fem.harmonics.expansion import uniform_moments
from ...fem.rotor.choice import rotor_table
from ...fem.rotor.models import Accuracy, AccuracyWarning, fem_table, points_around, typical_field
from ...fem.rotor.table import RotorTable
from ...geometry.common import Array
from ...geometry.cutting import cells_of, cut_magnets
from ...geometry.magnets import Magnet, horizontal, tilt, vertical
from ...geometry.meshes.magnets import MeshSettings
from ...geometry.shapes import Box, Cylinder, ring, rotation_matrix
from ..cli.console import progress
from ..figures.style import PALETTE, drawn
from ..result import Columns, columns, variable
from ..study import study_of_one
from .article import EDGE, FLOATER, PERMEABILITY, QUICK_ROTORS, REMANENCE, rotor_label, rotor_scene
from .showing import explain, last_crossing, small_multiples, text_table

# Where the point dipole, and models between it and the field of the finite magnets, can be trusted.
#
# Region: distance below the lower magnet's centre × lateral offset, worst azimuth, for the article's three rotors.
# Truth: the finite-element table, whose own error is stored beside.
ROTORS = {f"{rotor[0]}, {rotor_label(*rotor)}": rotor_scene(*rotor).rotor for rotor in QUICK_ROTORS}
VALIDITY: Columns = {
    "field_error": (("rotor", "model", "distance", "offset"), "1", "largest relative error of B over the azimuth"),
    "gradient_error": (("rotor", "model", "distance", "offset"), "1", "largest relative error of grad B over it"),
    "truth_error": (("rotor", "distance", "offset"), "1", "stated relative error of the truth"),
}
AZIMUTHS = np.radians(np.arange(0.0, 360.0, 30.0))


def dipole_validity(quick: bool, rotors: Mapping[str, tuple[Magnet, ...]] = ROTORS) -> xr.Dataset:
    distance = np.linspace(0.0115, 0.05, 12 if quick else 60)
    offset = np.linspace(0.0, 0.01, 5 if quick else 21)
    d, r, phi = np.meshgrid(distance, offset, AZIMUTHS, indexing="ij")
    points = np.stack([r * np.cos(phi), r * np.sin(phi), -d], axis=-1).reshape(-1, 3)

    def worst(values: Array) -> Array:
        return np.asarray(values.reshape(d.shape).max(axis=2))

    rows = []
    for magnets in rotors.values():
        truth = rotor_table(magnets, "fem", 1e-6)
        exact, slope = truth.evaluate(points)
        size, steepness = np.linalg.norm(exact, axis=1), np.linalg.norm(slope, axis=(1, 2))
        factor = float(np.linalg.norm(truth.moment) / np.linalg.norm(sum(m.moment for m in magnets)))
        found = {name: table.evaluate(points) for name, table in models(magnets, factor).items()}
        errors = [worst(np.linalg.norm(b - exact, axis=1) / size) for b, _ in found.values()]
        gradients = [worst(np.linalg.norm(g - slope, axis=(1, 2)) / steepness) for _, g in found.values()]
        rows.append((errors, gradients, worst(truth.relative_error(points)[0])))
    coords = {
        "rotor": list(rotors),
        "model": list(found),
        "distance": variable(("distance",), distance, "m", "distance below the lower magnet's centre"),
        "offset": variable(("offset",), offset, "m", "distance from the axis"),
    }
    return xr.Dataset(columns(VALIDITY, list(zip(*rows, strict=True))), coords)


def models(magnets: tuple[Magnet, ...], factor: float) -> dict[str, RotorTable]:
    """Models from the article's dipole to the closed form; `factor` is true over remanent moment."""
    true = tuple(replace(magnet, polarization=factor * magnet.polarization) for magnet in magnets)
    return {
        "dipole": moments_table(magnets, 1),
        "dipole, true moment": moments_table(true, 1),
        "moments to 5, true moment": moments_table(true, 5),
        "moments to 13, true moment": moments_table(true, 13),
        "cuboid": RotorTable("cuboid", magnets, magnets),
        "cuboid, true moment": RotorTable("cuboid", true, true),
    }


def moments_table(magnets: tuple[Magnet, ...], degree: int) -> RotorTable:
    return RotorTable("moments", magnets, (), tuple(uniform_moments(magnet, degree) for magnet in magnets))


LEVELS = (1e-1, 1e-2, 1e-3, 1e-4)


def _validity_lines(result: xr.Dataset) -> list[str]:
    distance, rows = 1e3 * result["distance"].values, []

    def reach(error: Array, level: float) -> str:
        found = last_crossing(distance, error, level)
        if np.isnan(found):  # beyond the range
            return f">{distance[-1]:.1f}"
        return f"<{found:.1f}" if found == distance[0] else f"{found:.1f}"

    for rotor in result["rotor"].values:
        for model in result["model"].values:
            error = result["field_error"].sel(rotor=rotor, model=model).isel(offset=0).values
            rows.append((f"{rotor}, {model}", *(reach(error, level) for level in LEVELS)))
    words = "Distance (mm) below the lower magnet from which on B on the axis is good to each error:"
    return [words, *text_table(("rotor, model", *(f"{100 * level:g} %" for level in LEVELS)), rows)]


@drawn
def validity_figure(result: xr.Dataset) -> Figure:
    """Error of each model against the distance, on the axis and at the largest lateral offset, rotor by rotor."""
    distance, words = 1e3 * result["distance"].values, ("levitation distance (mm)", "relative error of B")
    rotors = {rotor.split(", ")[1]: result.sel(rotor=rotor) for rotor in result["rotor"].values.tolist()}
    figure, rows = small_multiples(rotors, 3.0, 3, *words, sharey=True)
    for panel, rotor in rows:
        for model, color in zip(result["model"].values.tolist(), PALETTE, strict=False):
            error = rotor["field_error"].sel(model=model)
            panel.semilogy(distance, error.isel(offset=0), color=color, label=model)
            panel.semilogy(distance, error.isel(offset=-1), ":", color=color)
        own = rotor["truth_error"].max("offset")
        panel.semilogy(distance, own, color="0.6", lw=2.5, label="error of the finite elements")
    widest = 1e3 * float(result["offset"][-1])
    explain(rows[0][0], {"on the axis": "-", f"{widest:g} mm off the axis, worst azimuth": ":"})
    return figure


DIPOLE_VALIDITY = study_of_one(
    name="dipole-validity",
    summary="where the dipole and each further model are good to 10, 1, 0.1 and 0.01 %",
    quick="all but 12 of 60 distances and 5 of 21 lateral offsets",
    compute=dipole_validity,
    figures={"dipole-validity": validity_figure},
    report=_validity_lines,
)


# Rotors whose field is hard to compute, and how fine an independent solution must be to judge a table of them.
CUBE = (EDGE, EDGE, EDGE)
CONTACT = FLOATER.radius  # m; it touches a face of the cube when their centres are 11.35 mm apart
OTHER_MESH = MeshSettings(ball_radius=1.2, magnet_size=0.6, hp_layers=2, hp_factor=0.2, curve_order=8)
# Near an edge of a very permeable magnet the field grows as r^-1/3, not as log r
MORE_LAYERS = replace(OTHER_MESH, hp_layers=4, hp_factor=0.15, magnet_size=0.4)
# Small elements in the air between magnets, where layers at their edges must match
BESIDE_EACH_OTHER = replace(OTHER_MESH, magnet_size=0.8, air_size=0.4)


@dataclass(frozen=True)
class HardCase:
    """A rotor, and the reference that judges its table."""

    magnets: tuple[Magnet, ...]  # of the rotor
    nearest: float | None = None  # distance from the faces from which on the tolerance holds, m; None: `Accuracy`'s own
    order: int = 5  # of the reference's elements; 0: Coulomb's law in 80-bit numbers (all permeabilities are 1)
    mesh: MeshSettings = OTHER_MESH  # of the reference
    extensions: bool = False  # look along the extensions of edges and faces instead of all around
    quick: bool = False  # short enough for a quick run

    @property
    def clearance(self) -> float:
        return Accuracy(nearest=self.nearest).clearance(self.magnets)


def _magnet(size: ArrayLike, polarization: ArrayLike, center: ArrayLike = (0, 0, 0), angles: Any = (0, 0, 0)) -> Magnet:
    box = Box(np.array(size, float), np.array(center, float), rotation_matrix(angles))
    return Magnet(box, np.array(polarization, float), PERMEABILITY)


def _cube(permeability: float) -> tuple[Magnet, ...]:
    return horizontal(0.002, EDGE, REMANENCE, permeability)


def _pair(distance: float) -> tuple[Magnet, ...]:
    return vertical(distance, EDGE, REMANENCE, PERMEABILITY)


SMALL = (0.006,) * 3
EDGE_WITHIN_A_FACE = (_magnet(CUBE, (1, 0, 0)), _magnet(SMALL, (0, 0.5, 1), (0.001, 0.0015, 0.008), (0, 0, 30)))
EIGHT = tuple(
    _magnet(SMALL, (1.2 + 0.01 * k, 0.1 * k, 0), (0.012 * np.cos(a), 0.012 * np.sin(a), 0.001 * k), (10 * k, 20, 30))
    for k, a in enumerate(np.arange(8) * np.pi / 4)
)
OBLIQUE = (replace(_magnet(CUBE, (1, 0, 0), angles=(15, 40, 70)), transverse_permeability=1.15),)
FLAT, LONG = (0.02, 0.02, 0.0005), (0.005, 0.005, 0.04)
ALONG, _, UP = np.eye(3)
DISC, THIN_RING = Cylinder(10e-3, 1e-3), ring(10e-3, 9e-3, 5e-3)
CASES = {
    "contact distance": HardCase(_cube(PERMEABILITY), CONTACT, quick=True),
    "extensions of edges and faces": HardCase(_cube(PERMEABILITY), extensions=True),
    "extensions, μr = 1": HardCase(_cube(1.0), order=0, extensions=True, quick=True),
    "μr = 1 + 1e-9": HardCase(_cube(1 + 1e-9)),
    "μr = 5": HardCase(_cube(5.0), order=8, mesh=MORE_LAYERS),
    "μr = 1000": HardCase(_cube(1000.0), order=8, mesh=MORE_LAYERS),
    "flat, across": HardCase((_magnet(FLAT, (0, 0, 1.3)),), CONTACT, order=4),
    "flat, along": HardCase((_magnet(FLAT, (1.3, 0, 0)),), CONTACT, order=4),
    "long": HardCase((_magnet(LONG, (1.3, 0, 0)),), CONTACT),
    "disc of 20 : 1, across": HardCase((Magnet(DISC, 1.3 * UP, PERMEABILITY),), CONTACT, order=4),
    "disc of 20 : 1, along": HardCase((Magnet(DISC, 1.3 * ALONG, PERMEABILITY),), CONTACT, order=4),
    "thin ring": HardCase((Magnet(THIN_RING, 1.3 * ALONG, PERMEABILITY),), CONTACT, order=4),
    "touching": HardCase(_pair(0.01)),
    "gap of 1 µm": HardCase(_pair(0.010001)),
    "gap of 50 µm": HardCase(_pair(0.01005), order=4),
    "any angle": HardCase(tilt(0.3, EDGE, REMANENCE, PERMEABILITY), quick=True),
    "anisotropic, any angle": HardCase(OBLIQUE),
    "an edge within a face": HardCase(EDGE_WITHIN_A_FACE, order=4),
    "eight magnets": HardCase(EIGHT, order=4, mesh=BESIDE_EACH_OTHER),
    "no polarisation": HardCase((_magnet(CUBE, (0, 0, 0)),), quick=True),
}  # By name, in the order of the figure


RTOL = 1e-5
FARTHEST = 1.0
DEGREE = 33  # Of the reference's expansions
# Of the reference's open boundary: a ball of 1.2 radii leaves (1/1.2)^(2 · 20 + 1), 6e-4 of what degree 20 adds
BOUNDARY_DEGREE = 20
OBLIQUE_NODES = 192  # Of the reference's rules for boxes that touch without being parallel
FINER_CELLS = 0.8  # Of the reference's expansions of round magnets: they converge from nearer on than the table's
PLACES = 12  # Distances from the faces, from the case's own nearest one to `FARTHEST`
ROUND_OFF = 1e-13
ERRORS = ("true_error", "stated_error", "reference_step", "shortfall")
COLUMNS: Columns = {
    "distance": (("place",), "m", "distance from the magnets' faces"),
    "true_error": (("place",), "1", "largest difference of B from the reference"),
    "stated_error": (("place",), "1", "largest error of B that the table states"),
    "reference_step": (("place",), "1", "largest last step in order of the reference"),
    "shortfall": (("place",), "1", "largest ratio of the difference to stated error and reference's step"),
    "order": ((), "1", "order of the table's elements"),
    "unknowns": ((), "1", "unknowns of the table's elements"),
    "seconds": ((), "s", "processor time of the table"),
}


def field_hard_cases(quick: bool, cases: Mapping[str, HardCase] = CASES, places: int = PLACES) -> xr.Dataset:
    """Errors of B of `cases` by name at `places` distances from the faces; `quick` has few, and coarse references."""
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
    with warnings.catch_warnings(action="ignore", category=AccuracyWarning):
        field = fem_table(case.magnets, Accuracy(RTOL, case.nearest))
    seconds = time.process_time() - start
    distance = np.geomspace(case.clearance, FARTHEST, places)
    points = [extensions(case, d) if case.extensions else points_around(case.magnets, d) for d in distance]
    before, truth = reference(case, np.concatenate(points))
    ends = np.cumsum([len(p) for p in points])[:-1]
    rows = []
    for there, lower, exact in zip(points, np.split(before, ends), np.split(truth, ends), strict=True):
        scale = typical_field(case.magnets, there)
        true, own = (np.linalg.norm(b - exact, axis=1) / scale for b in (field.evaluate(there)[0], lower))
        stated = field.absolute_error(there)[0] / scale + ROUND_OFF
        rows.append((true.max(), stated.max(), own.max(), (true / (stated + own)).max()))
    found = {key: field.provenance[key] for key in ("order", "unknowns")}
    found |= dict(zip(ERRORS, np.array(rows).T, strict=True)) | {"distance": distance, "seconds": seconds}
    return xr.Dataset(columns(COLUMNS, {key: np.asarray(value, float) for key, value in found.items()}))


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
    carriers = carriers_of(case.magnets)
    remanent = RotorTable("cuboid", carriers, carriers).evaluate(points)[0]
    nodes = OBLIQUE_NODES if oblique_contact([magnet.box for magnet in case.magnets]) else None
    cells = [cells_of(piece.body, FINER_CELLS * case.clearance) for whole in pieces for piece in whole]
    closed = added_by_closed_form(pieces, case.magnets, carriers, DEGREE, nodes, cells)

    def total(order: int) -> Array:
        refinement = Refinement(order, case.mesh, BOUNDARY_DEGREE)
        found = solve_rotor(case.magnets, refinement, "split", DEGREE, pieces, carriers=carriers, cells=cells)
        parts = found.expansions([a + b for a, b in zip(closed, found.coefficients, strict=True)])
        return np.asarray(remanent + sum(part.evaluate(points)[0] for part in parts))

    return total(case.order - 1), total(case.order)


LINES = {
    "stated_error": ("stated by the table", "s--", PALETTE[1]),
    "true_error": ("difference from the reference", "o-", PALETTE[0]),
    "reference_step": ("last step of the reference", ":", "0.45"),
}


@drawn
def hard_case_figure(result: xr.Dataset) -> Figure:
    """True and stated error over the distance, a panel for each case with a field."""
    names = [name for name in result["case"].values if float(result["true_error"].sel(case=name).max()) > 0]
    cases, words = {fill(name, 24): result.sel(case=name) for name in names}, ("distance (mm)", "error of B")
    figure, rows = small_multiples(cases, 1.5, 4, *words, sharex=True)
    for panel, row in rows:
        for key, (label, style, color) in LINES.items():
            values = np.where(row[key] > 0, np.maximum(row[key], 1e-17), np.nan)
            panel.loglog(1e3 * row["distance"], values, style, color=color, ms=3, label=label)
        panel.axhline(RTOL, color="0.2", lw=0.7, label="tolerance asked for")
        small = float(row["true_error"].min()) < 1e-11  # such panels show round-off too
        panel.set(ylim=(3e-17 if small else 1e-10, 1e-4))
    return figure


def hard_case_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for name in result["case"].values:
        row = result.sel(case=name)
        near, far = row.isel(place=0), row.where(row["distance"] >= 0.1).max()
        errors = [" / ".join(f"{float(at[key]):.1e}" for key in ERRORS[:3]) for at in (near, far)]
        cover, order, seconds = float(row["shortfall"].max()), int(row["order"]), float(row["seconds"])
        rows.append((name, f"{1e3 * float(near['distance']):.2f}", *errors, f"{cover:.2f}", order, f"{seconds:.1f}"))
    head = ("case", "nearest (mm)", "errors there", "10 cm and farther", "cover", "order", "CPU (s)")
    return [
        "Largest relative error of B: true / stated / last step of the reference",
        *text_table(head, rows),
        "cover: true error over stated error and reference's step; above 1 the table states too little.",
    ]


FIELD_HARD_CASES = study_of_one(
    name="field-hard-cases",
    summary="true and stated error of the rotor's table in hard cases: contact, extensions, flat, touching, many",
    quick="all but the cases that are quick, half of the distances; references of order 4 at most",
    compute=field_hard_cases,
    figures={"field-hard-cases": hard_case_figure},
    report=hard_case_lines,
)
