"""Every way to compute the rotor's field: its error against what it costs."""

import os
import resource
import tempfile
import time
import timeit
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ...fem.closed_forms.moments import added_by_closed_form, carriers_of
from ...fem.compiled_code import compiled
from ...fem.elements.ladder import Refinement, refinement_of, solve_rotor
from ...fem.elements.magnetostatics import magnet_dipoles
from ...fem.harmonics.expansion import without_noise
from ...fem.maps_of_B.columns import FieldMap
from ...fem.maps_of_B.table import fit_field_map
from ...fem.rotor.choice import rotor_table
from ...fem.rotor.models import AccuracyWarning
from ...fem.rotor.table import FieldTable, RotorTable
from ...geometry.common import Array
from ...geometry.magnets import Magnet, horizontal
from ...geometry.meshes.magnets import MeshSettings, mesh_magnets
from ..cli.console import note
from ..figures.style import PALETTE, drawn
from ..processes import safe_path
from ..result import Columns, columns, variable
from ..study import study_of_one
from .article import EDGE, REMANENCE
from .field_quality import moments_table
from .showing import explain, small_multiples, text_table

Magnets = tuple[Magnet, ...]
Build = Callable[[Any, Magnets], tuple[FieldTable, int]]  # Makes a table, and says its number of unknowns
INNER_SPHERE = 0.0087  # Holds all sources of the article's cube, m


class Method(NamedTuple):
    """One way to the field."""

    family: str  # methods that differ only in one number, joined by a line in the figure
    problem: str  # "exact" (μr = 1) or "permeable" (μr = 1.05)
    build: Callable[[Magnets], tuple[FieldTable, int]]  # the table and its number of unknowns, from the magnets


def _moments(degree: int, magnets: Magnets) -> tuple[FieldTable, int]:
    return moments_table(magnets, degree), degree * (degree + 2)


def _closed_form(_: int, magnets: Magnets) -> tuple[FieldTable, int]:
    return RotorTable("cuboid", magnets, magnets), 0


def _direct(order: int, magnets: Magnets) -> tuple[FieldTable, int]:
    """Finite elements without any closed form; the outer field from the harmonics on the outer sphere."""
    fine = MeshSettings(ball_radius=1.15, magnet_size=0.5, air_size=0.5, hp_layers=0, curve_order=min(order + 1, 8))
    solution = solve_rotor(magnets, Refinement(order, fine, 4 * order), "direct")
    return RotorTable("fem", magnets, (), tuple(solution.expansions(solution.coefficients))), solution.unknowns


def _split(order: int, magnets: Magnets) -> tuple[FieldTable, int]:
    """One order of elements: closed form of the remanence plus what the permeability adds."""
    degree = 6 + 4 * order
    carriers = carriers_of(magnets)
    solution = solve_rotor(magnets, refinement_of(order, MeshSettings()), "split", degree, carriers=carriers)
    closed = added_by_closed_form([(magnet,) for magnet in magnets], magnets, carriers, degree)
    whole = [without_noise(a + b, 1e-15) for a, b in zip(closed, solution.coefficients, strict=True)]
    return RotorTable("fem", magnets, carriers, tuple(solution.expansions(whole))), solution.unknowns


def _table(rtol: float, magnets: Magnets) -> tuple[FieldTable, int]:
    """What a user gets: the ladder until the estimated error meets the tolerance."""
    with warnings.catch_warnings(action="ignore", category=AccuracyWarning):  # the study measures what is reached
        table = rotor_table(magnets, "fem", rtol)
    return table, int(table.provenance.get("unknowns", 0))


def _second_opinion(size: float, magnets: Magnets) -> tuple[FieldTable, int]:
    """scikit-fem, P2: closed form of cuboids whose polarisation is raised by the mean of what the permeability adds."""
    mesh = mesh_magnets(magnets, MeshSettings(hp_layers=0, magnet_size=size, air_size=2 * size, curve_order=1))
    added = magnet_dipoles(mesh)
    raised = tuple(
        replace(m, polarization=m.polarization + m.box.rotation.T @ (dipole / m.body.volume))
        for m, dipole in zip(magnets, added, strict=True)
    )
    return RotorTable("cuboid", raised, raised), int(mesh.mesh.nv + mesh.mesh.nedge)


def _gridded(step_mm: float, magnets: Magnets) -> tuple[FieldTable, int]:
    """Fit of the exact values on a grid between 13 and 40 mm."""
    step = 1e-3 * step_mm
    line = np.arange(-0.04, 0.04 + step / 2, step)
    grid = np.stack(np.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)
    radius = np.linalg.norm(grid, axis=1)
    points = grid[(radius >= 0.013) & (radius <= 0.04)]
    exact = RotorTable("cuboid", magnets, magnets).evaluate(points)[0]
    return fit_field_map(FieldMap(points, exact), centers=np.zeros(3), radius=INNER_SPHERE), 3 * len(points)


def methods(quick: bool) -> dict[str, Method]:
    orders, sizes, steps = ((1, 2, 3), (0.5,), (4,)) if quick else ((1, 2, 3, 4, 5, 6), (0.5, 0.25), (4, 2))
    direct, split = ((2, 3), (2, 3)) if quick else (orders, (2, 3, 4, 5, 6, 7))
    rtols = (1e-3, 1e-5) if quick else (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
    dipole, elements = "moments", "direct finite elements"
    rows: tuple[tuple[str, str, str, Build, Sequence[float]], ...] = (
        ("exact", "dipole", dipole, _moments, (1,)),
        ("exact", "moments to {}", dipole, _moments, (5, 9, 13, 21)),
        ("exact", "closed form", "closed form", _closed_form, (0,)),
        ("exact", "direct, order {}", elements, _direct, orders),
        ("exact", "gridded, {} mm", "gridded table", _gridded, steps),
        ("permeable", "dipole, μr left out", dipole, _moments, (1,)),
        ("permeable", "closed form, μr left out", "closed form", _closed_form, (0,)),
        ("permeable", "scikit-fem P2, size {}", "scikit-fem P2, mean only", _second_opinion, sizes),
        ("permeable", "direct, μr, order {}", elements, _direct, direct),
        ("permeable", "split, order {}", "split finite elements", _split, split),
        ("permeable", "table, rtol {:g}", "table of the ladder", _table, rtols),
    )  # problem, name, family, what makes the table, and for which numbers
    return {
        name.format(number): Method(family, problem, partial(build, number))
        for problem, name, family, build, numbers in rows
        for number in numbers
    }


DISTANCES = (0.013, 0.015, 0.02, 0.03, 0.05)
PERMEABILITIES = {"exact": 1.0, "permeable": 1.05}
TIMED_POINTS = 100_000


class Measured(NamedTuple):
    """One method's field and gradient at the points, the largest error of B that it states (d,), and `COSTS`."""

    field: Array  # (d, n, 3) T and (d, n, 3, 3) T/m
    gradient: Array
    stated: Array
    costs: dict[str, float]


COSTS: Columns = {
    "unknowns": (("approach",), "1", "degrees of freedom"),
    "seconds": (("approach",), "s", "time from nothing"),
    "cpu_seconds": (("approach",), "s", "processor time from nothing"),
    "memory": (("approach",), "B", "memory that it took"),
    "per_point": (("approach",), "s", "time of B and its gradient per point"),
}
ERRORS: Columns = {
    "field_error": (("approach", "distance"), "1", "largest relative error of B"),
    "gradient_error": (("approach", "distance"), "1", "largest relative error of grad B"),
    "stated_error": (("approach", "distance"), "1", "error of B that is stated"),
    "truth_error": (("approach", "distance"), "1", "error of the reference itself"),
}


def cube(problem: str) -> tuple[Magnet, ...]:
    return horizontal(0.0, EDGE, REMANENCE, PERMEABILITIES[problem])


def sphere_points() -> Array:  # (d, 200, 3) m at the distances, all around the cube
    return np.array(DISTANCES)[:, None, None] * _directions(5, 200)


def _directions(seed: int, number: int) -> Array:
    way = np.random.default_rng(seed).normal(size=(number, 3))
    return np.asarray(way / np.linalg.norm(way, axis=1)[:, None])


def measure(name: str, quick: bool, timed_points: int = TIMED_POINTS) -> Measured:
    """Run one method of the catalogue `methods`, its table timed at `timed_points`; meant for a fresh process."""
    method = methods(quick)[name]
    magnets = cube(method.problem)
    compiled(hy.cfunc, [hy.expression("x")], [hy.expression("x")])  # the compiler's own start is nobody's cost
    memory = _peak_memory()
    began, processor = time.perf_counter(), time.process_time()
    table, unknowns = method.build(magnets)
    field, gradient, stated = _at_points(table)
    seconds, cpu_seconds = time.perf_counter() - began, time.process_time() - processor
    grown = _peak_memory() - memory
    costs = dict(zip(COSTS, (unknowns, seconds, cpu_seconds, grown, _pace(table.evaluate, timed_points)), strict=True))
    return Measured(field, gradient, stated, costs)


def _at_points(table: FieldTable) -> tuple[Array, Array, Array]:
    """B (d, n, 3), its gradient (d, n, 3, 3) and the largest relative error (d,) of B that is stated."""
    b, g = table.evaluate(points := sphere_points())
    return b, g, table.relative_error(points)[0].max(axis=1)


def _peak_memory() -> float:
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _pace(evaluate: Callable[[Array], Any], number: int = TIMED_POINTS) -> float:
    """Processor time of a point, of a number of them where a floater may be: 13 to 40 mm from the cube's centre."""
    many = np.linspace(0.013, 0.04, number)[:, None] * _directions(0, number)
    evaluate(many[:10])
    return min(timeit.repeat(lambda: evaluate(many), timer=time.process_time, number=1)) / number


def apart(name: str, quick: bool) -> Measured:
    """`measure` with an empty cache, in a copy of a process that has only imported the libraries: memory is its own."""
    fresh = get_context("forkserver")
    fresh.set_forkserver_preload([__name__])
    with safe_path(), tempfile.TemporaryDirectory() as cache, ProcessPoolExecutor(1, mp_context=fresh) as pool:
        return pool.submit(_measured_with, cache, name, quick).result()


def _measured_with(cache: str, name: str, quick: bool) -> Measured:
    os.environ["SPINLEV_CACHE"] = cache  # code from earlier runs would not be from nothing
    return measure(name, quick)


TRUTH_TOLERANCE, QUICK_TRUTH = 1e-9, 1e-8  # Asked of the reference, in 24 and in 4 s of processor time
ROUND_OFF = 1e-13  # What is stated of a model that has no error but that


def speed_accuracy(quick: bool, names: Sequence[str] | None = None, truth: float | None = None) -> xr.Dataset:
    """Errors of B and of its gradient by method and distance, beside time, unknowns and memory.

    All or `quick`, or of `names`, against a reference of tolerance `truth` (None: the study's own).
    """
    import magpylib

    catalogue = {name: method for name, method in methods(quick).items() if names is None or name in names}
    requested = truth or (QUICK_TRUTH if quick else TRUTH_TOLERANCE)
    truths = {}
    for problem in PERMEABILITIES:
        with warnings.catch_warnings(action="ignore", category=AccuracyWarning):  # its own error is stored
            truths[problem] = _at_points(rotor_table(cube(problem), "auto", requested))
    errors, costs = [], []
    for name, method in catalogue.items():
        note(f"  {name} ...")
        row, (b, g, own) = apart(name, quick), truths[method.problem]
        errors.append([_largest(row.field, b, 1), _largest(row.gradient, g, 2), row.stated, own])
        costs.append(list(row.costs.values()))
    data = columns({**ERRORS, **COSTS}, (*np.array(errors).swapaxes(0, 1), *np.array(costs, float).T))
    coords = {
        "approach": list(catalogue),
        "family": ("approach", [method.family for method in catalogue.values()]),
        "problem": ("approach", [method.problem for method in catalogue.values()]),
        "distance": variable(("distance",), np.array(DISTANCES), "m", "distance from the cube's centre"),
    }
    peer = magpylib.magnet.Cuboid(polarization=(1.305, 0, 0), dimension=(0.01,) * 3)
    return xr.Dataset(data, coords, {"magpylib_seconds_per_point": _pace(peer.getB)})  # of B alone, for the same cube


def _largest(values: Array, truth: Array, rank: int) -> Array:
    axes = tuple(range(2, 2 + rank))
    return np.asarray((np.linalg.norm(values - truth, axis=axes) / np.linalg.norm(truth, axis=axes)).max(axis=1))


def _speed_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for name in result["approach"].values:
        row = result.sel(approach=name)
        pairs = zip(row["field_error"].values, row["gradient_error"].values, strict=True)
        costs = [float(row[key]) * scale for key, scale in (("memory", 1e-6), ("per_point", 1e9))]
        times = [f"{float(row[key]):.2f}" for key in ("seconds", "cpu_seconds")]
        errors = [f"{b:.0e} / {g:.0e}" for b, g in pairs]
        rows.append((name, *times, str(int(row["unknowns"])), *(f"{cost:.0f}" for cost in costs), *errors))
    distances = [f"{1e3 * distance:g} mm" for distance in result["distance"].values]
    own = float(result["truth_error"].where(result["problem"] == "permeable").max())
    return [
        "Largest relative error of B / of its gradient, and what it costs from nothing",
        *text_table(("method", "s", "CPU s", "unknowns", "MB", "ns/point", *distances), rows),
        f"magpylib, B alone: {1e9 * result.attrs['magpylib_seconds_per_point']:.0f} ns per point",
        f"The reference for μr = 1.05 states an error of at most {own:.1e}; for μr = 1 it is exact.",
    ]


@drawn
def speed_figure(result: xr.Dataset) -> Figure:
    """Error of B at 20 mm against the time from nothing, for both problems; open: the error that is stated."""
    titles = {"μr = 1 (closed form known)": "exact", "μr = 1.05": "permeable"}
    words = "processor time from nothing (s)", "relative error of B at 20 mm"
    figure, panels = small_multiples(titles, 3.4, 2, *words, sharey=True)
    at = result.sel(distance=0.02)
    families = dict.fromkeys(result["family"].values.tolist())
    for panel, problem in panels:
        for family, color in zip(families, [*PALETTE, "0.4"], strict=False):
            rows = at.isel(approach=np.flatnonzero((at["family"] == family) & (at["problem"] == problem)))
            look: dict[str, Any] = {"ms": 4, "color": color}
            panel.loglog(rows["cpu_seconds"], np.maximum(rows["field_error"], 1e-16), "o-", label=family, **look)
            stated = rows["stated_error"].where(rows["stated_error"] > ROUND_OFF)
            panel.loglog(rows["cpu_seconds"], stated, "o", mfc="none", **look)
        own = float(at["truth_error"].where(at["problem"] == problem).max())
        panel.axhspan(1e-17, max(own, 1e-16), facecolor="0.9", edgecolor="0.6", label="error of the reference")
        panel.set_ylim(1e-17, None)
    explain(panels[0][0], {"error that the table states": "o"}, mfc="none", ms=4)
    return figure


STUDY = study_of_one(
    name="speed-accuracy",
    summary="error of B and of its gradient against time, unknowns and memory, for every way to the rotor's field",
    quick="orders above 3, cells below 0.5 mm, all tolerances but 1e-3 and 1e-5",
    compute=speed_accuracy,
    figures={"speed-accuracy": speed_figure},
    report=_speed_lines,
    timed=True,
)
