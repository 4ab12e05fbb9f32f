"""Every way to compute the rotor's field, by name, for the study of speed against error."""

import os
import tempfile
import time
import timeit
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import heyoka as hy
import magpylib
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ...fem.closed_forms.moments import added_by_closed_form, carrier
from ...fem.compiled_code import compiled
from ...fem.elements.ladder import Refinement, refinement_of, solve_rotor
from ...fem.elements.second_opinion import magnet_dipoles
from ...fem.harmonics.expansion import uniform_moments, without_noise
from ...fem.maps_of_B.columns import FieldMap
from ...fem.maps_of_B.table import fit_field_map
from ...fem.rotor.choice import rotor_table
from ...fem.rotor.models import AccuracyWarning
from ...fem.rotor.table import FieldTable, RotorTable
from ...geometry.common import Array
from ...geometry.magnets import Magnet
from ...geometry.meshes.magnets import MeshSettings, mesh_magnets
from ...geometry.rotor import horizontal
from ..cli.console import note
from ..figures.style import PAGE, PALETTE, panels, styled
from ..processes import safe_path
from ..result import variable
from ..study import study_of_one

Magnets = tuple[Magnet, ...]
INNER_SPHERE = 0.0087
"""Holds all sources of the article's cube, m."""


@dataclass(frozen=True)
class Method:
    """One way to the field.

    Parameters
    ----------
    family : methods that differ only in one number, joined by a line in the figure
    problem : "exact" (μr = 1) or "permeable" (μr = 1.05)
    build : takes the magnets and returns the table and its number of unknowns
    """

    family: str
    problem: str
    build: Callable[[Magnets], tuple[FieldTable, int]]


def _moments(degree: int, magnets: Magnets) -> tuple[FieldTable, int]:
    table = RotorTable("moments", magnets, (), tuple(uniform_moments(magnet, degree) for magnet in magnets))
    return table, degree * (degree + 2)


def _closed_form(magnets: Magnets) -> tuple[FieldTable, int]:
    return RotorTable("cuboid", magnets, magnets), 0


def _direct(order: int, magnets: Magnets) -> tuple[FieldTable, int]:
    """Finite elements without any closed form; the outer field from the harmonics on the outer sphere."""
    fine = MeshSettings(ball_radius=1.15, magnet_size=0.5, air_size=0.5, hp_layers=0, curve_order=min(order + 1, 8))
    solution = solve_rotor(magnets, Refinement(order, fine, 4 * order), "direct")
    return RotorTable("fem", magnets, (), tuple(solution.expansions(solution.coefficients))), solution.unknowns


def _split(order: int, magnets: Magnets) -> tuple[FieldTable, int]:
    """One order of elements: closed form of the remanence plus what the permeability adds."""
    degree = 6 + 4 * order
    carriers = tuple(carrier(magnet) for magnet in magnets)
    solution = solve_rotor(magnets, refinement_of(order, MeshSettings()), "split", degree, carriers=carriers)
    closed = added_by_closed_form([(magnet,) for magnet in magnets], magnets, carriers, degree)
    whole = [without_noise(a + b, 1e-15) for a, b in zip(closed, solution.coefficients, strict=True)]
    return RotorTable("fem", magnets, carriers, tuple(solution.expansions(whole))), solution.unknowns


def _table(rtol: float, magnets: Magnets) -> tuple[FieldTable, int]:
    """What a user gets: the ladder until the estimated error meets the tolerance."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)  # the study measures what is reached
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


def _gridded(step: float, magnets: Magnets) -> tuple[FieldTable, int]:
    """Fit of the exact values on a grid between 13 and 40 mm."""
    line = np.arange(-0.04, 0.04 + step / 2, step)
    grid = np.stack(np.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)
    radius = np.linalg.norm(grid, axis=1)
    points = grid[(radius >= 0.013) & (radius <= 0.04)]
    exact = RotorTable("cuboid", magnets, magnets).evaluate(points)[0]
    table = fit_field_map(FieldMap(points, exact), centers=np.zeros(3), radius=INNER_SPHERE)
    return table, 3 * len(points)


def methods(quick: bool) -> dict[str, Method]:
    """The catalogue; `quick` leaves out what takes longer than some seconds."""
    found = {"dipole": Method("moments", "exact", partial(_moments, 1))}
    found |= {f"moments to {d}": Method("moments", "exact", partial(_moments, d)) for d in (5, 9, 13, 21)}
    found["closed form"] = Method("closed form", "exact", _closed_form)
    for order in (1, 2, 3) if quick else (1, 2, 3, 4, 5, 6):
        found[f"direct, order {order}"] = Method("direct finite elements", "exact", partial(_direct, order))
    for step in (0.004,) if quick else (0.004, 0.002):
        found[f"gridded, {1e3 * step:g} mm"] = Method("gridded table", "exact", partial(_gridded, step))
    found["dipole, μr left out"] = Method("moments", "permeable", partial(_moments, 1))
    found["closed form, μr left out"] = Method("closed form", "permeable", _closed_form)
    for size in (0.5,) if quick else (0.5, 0.25):
        name = f"scikit-fem P2, size {size:g}"
        found[name] = Method("scikit-fem P2, mean only", "permeable", partial(_second_opinion, size))
    for order in (2, 3) if quick else (1, 2, 3, 4, 5, 6):
        name = f"direct, μr, order {order}"
        found[name] = Method("direct finite elements", "permeable", partial(_direct, order))
    for order in (2, 3) if quick else (2, 3, 4, 5, 6, 7):
        found[f"split, order {order}"] = Method("split finite elements", "permeable", partial(_split, order))
    for rtol in (1e-3, 1e-5) if quick else (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8):
        found[f"table, rtol {rtol:g}"] = Method("table of the ladder", "permeable", partial(_table, rtol))
    return found


DISTANCES = (0.013, 0.015, 0.02, 0.03, 0.05)
PERMEABILITIES = {"exact": 1.0, "permeable": 1.05}
TIMED_POINTS = 100_000


@dataclass(frozen=True, eq=False)
class Measured:
    """One method: field and gradient at the points, and what they cost.

    Parameters
    ----------
    field, gradient : (d, n, 3) T and (d, n, 3, 3) T/m
    stated : (d,) largest error of B that the table states
    unknowns : degrees of freedom
    seconds : from nothing to the field at the points, and `cpu_seconds` of the processor
    memory : what the process grew by, bytes
    per_point : seconds per point of an evaluation of B and its gradient at many
    """

    field: Array
    gradient: Array
    stated: Array
    unknowns: int
    seconds: float
    cpu_seconds: float
    memory: float
    per_point: float


def cube(problem: str) -> tuple[Magnet, ...]:
    """The article's cube at the origin."""
    return horizontal(0.0, 0.01, 1.305, PERMEABILITIES[problem])


def sphere_points(number: int = 200) -> Array:
    """Points (d, n, 3) m at the distances, all around the cube."""
    way = np.random.default_rng(5).normal(size=(number, 3))
    return np.asarray(np.array(DISTANCES)[:, None, None] * way / np.linalg.norm(way, axis=1)[:, None])


def measure(name: str, quick: bool, timed_points: int = TIMED_POINTS) -> Measured:
    """Run one method of the catalogue, and its table at `timed_points`; meant for a fresh process."""
    catalogue = methods(quick)
    method = catalogue[name]
    magnets, points = cube(method.problem), sphere_points()
    compiled(hy.cfunc, [hy.expression("x")], [hy.expression("x")])  # the compiler's own start is nobody's cost
    memory = _memory("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # the peak counts from here (Linux)
    began, processor = time.perf_counter(), time.process_time()
    table, unknowns = method.build(magnets)
    b, g = table.evaluate(points.reshape(-1, 3))
    seconds, cpu_seconds = time.perf_counter() - began, time.process_time() - processor
    grown = _memory("VmHWM") - memory
    stated = table.relative_error(points.reshape(-1, 3))[0].reshape(points.shape[:2]).max(axis=1)
    shape = points.shape
    return Measured(
        b.reshape(shape),
        g.reshape(*shape, 3),
        stated,
        unknowns,
        seconds,
        cpu_seconds,
        grown,
        _pace(table, timed_points),
    )


def _memory(entry: str) -> float:
    """An entry of the process's status, bytes: VmRSS what it holds, VmHWM the most that it held (Linux)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024.0 * next(float(line.split()[1]) for line in lines if line.startswith(entry))


def _pace(table: FieldTable, number: int) -> float:
    """Seconds per point of the fastest of five evaluations."""
    points = _many(number)
    table.evaluate(points)
    return _fastest(lambda: table.evaluate(points)) / number


def _fastest(work: Callable[[], object]) -> float:
    return min(timeit.repeat(work, timer=time.process_time, number=1))


def _many(number: int = TIMED_POINTS) -> Array:
    """Where a floater may be: all around, 13 to 40 mm from the cube's centre."""
    rng = np.random.default_rng(0)
    way = rng.normal(size=(number, 3))
    return np.asarray(rng.uniform(0.013, 0.04, (number, 1)) * way / np.linalg.norm(way, axis=1)[:, None])


def peer_pace() -> float:
    """Seconds per point of magpylib's B alone for the same cube."""
    peer = magpylib.magnet.Cuboid(polarization=(1.305, 0, 0), dimension=(0.01,) * 3)
    points = _many()
    peer.getB(points[:10])
    return _fastest(lambda: peer.getB(points)) / TIMED_POINTS


def apart(name: str, quick: bool) -> Measured:
    """`measure` in a process of its own with an empty cache, forked from one that has only imported the libraries."""
    fresh = get_context("forkserver")
    fresh.set_forkserver_preload([__name__])
    with safe_path(), tempfile.TemporaryDirectory() as cache, ProcessPoolExecutor(1, mp_context=fresh) as pool:
        return pool.submit(_measured_with, cache, name, quick).result()


def _measured_with(cache: str, name: str, quick: bool) -> Measured:
    os.environ["SPINLEV_CACHE"] = cache  # code from earlier runs would not be from nothing
    return measure(name, quick)


TRUTH_TOLERANCE, QUICK_TRUTH = 1e-9, 1e-8
"""Asked of the reference, in 24 and in 4 s of processor time."""


def speed_accuracy(quick: bool, names: Sequence[str] | None = None, truth: float | None = None) -> xr.Dataset:
    """Errors of B and of its gradient by method and distance, beside time, unknowns and memory.

    Parameters
    ----------
    names : of the methods; None for all
    truth : tolerance of the reference; None for the one of the study
    """
    catalogue = {name: method for name, method in methods(quick).items() if names is None or name in names}
    asked = truth or (QUICK_TRUTH if quick else TRUTH_TOLERANCE)
    truths = {problem: _truth(problem, asked) for problem in PERMEABILITIES}
    rows = []
    for name in catalogue:
        note(f"  {name} ...")
        rows.append(apart(name, quick))
    exact = [truths[method.problem] for method in catalogue.values()]
    errors = [
        (_largest(row.field, b, 1), _largest(row.gradient, g, 2)) for row, (b, g, _) in zip(rows, exact, strict=True)
    ]
    dims = ("approach", "distance")
    data = {
        "field_error": variable(dims, np.array([e for e, _ in errors]), "1", "largest relative error of B"),
        "gradient_error": variable(dims, np.array([e for _, e in errors]), "1", "largest relative error of grad B"),
        "stated_error": variable(dims, np.array([row.stated for row in rows]), "1", "error of B that is stated"),
        "truth_error": variable(dims, np.array([own for _, _, own in exact]), "1", "error of the reference itself"),
    }
    costs = {
        "unknowns": ("1", "degrees of freedom"),
        "seconds": ("s", "time from nothing"),
        "cpu_seconds": ("s", "processor time from nothing"),
        "memory": ("B", "memory that it took"),
        "per_point": ("s", "time of B and its gradient per point"),
    }
    for key, (units, label) in costs.items():
        data[key] = variable(("approach",), np.array([float(getattr(row, key)) for row in rows]), units, label)
    coords = {
        "approach": list(catalogue),
        "family": (("approach",), [method.family for method in catalogue.values()]),
        "problem": (("approach",), [method.problem for method in catalogue.values()]),
        "distance": variable(("distance",), np.array(DISTANCES), "m", "distance from the cube's centre"),
    }
    return xr.Dataset(data, coords, {"magpylib_seconds_per_point": peer_pace()})


def _truth(problem: str, rtol: float) -> tuple[Array, Array, Array]:
    """B, its gradient and the stated relative error (d,) of B at the points."""
    points = sphere_points()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)  # its own error is stored, whatever it is
        table = rotor_table(cube(problem), "auto", rtol)
    b, g = table.evaluate(points.reshape(-1, 3))
    own = table.relative_error(points.reshape(-1, 3))[0].reshape(points.shape[:2]).max(axis=1)
    return b.reshape(points.shape), g.reshape(*points.shape, 3), own


def _largest(values: Array, truth: Array, rank: int) -> Array:
    """Largest relative error (d,) over the points of each distance."""
    axes = tuple(range(2, 2 + rank))
    return np.asarray((np.linalg.norm(values - truth, axis=axes) / np.linalg.norm(truth, axis=axes)).max(axis=1))


ROUND_OFF = 1e-13
"""What is stated of a model that has no error but that."""


def speed_lines(result: xr.Dataset) -> list[str]:
    """The table of the study."""
    head = " ".join(f"{1e3 * d:4.0f} mm" + " " * 8 for d in result["distance"].values)
    lines = [
        "Largest relative error of B / of its gradient, and what it costs from nothing",
        f"{'method':26} {'s':>7} {'CPU s':>7} {'unknowns':>9} {'MB':>6} {'ns/pt':>6}  {head}",
    ]
    for name in result["approach"].values:
        row = result.sel(approach=name)
        pairs = zip(row["field_error"].values, row["gradient_error"].values, strict=True)
        lines.append(
            f"{name:26} {float(row['seconds']):7.2f} {float(row['cpu_seconds']):7.2f} {int(row['unknowns']):9d} "
            f"{float(row['memory']) / 1e6:6.0f} {1e9 * float(row['per_point']):6.0f}  "
            + "  ".join(f"{b:.0e} / {g:.0e}" for b, g in pairs)
        )
    pace = 1e9 * result.attrs["magpylib_seconds_per_point"]
    lines.append(f"magpylib, B alone: {pace:.0f} ns per point")
    own = result["truth_error"].where(result["problem"] == "permeable").max()
    return [*lines, f"The reference for μr = 1.05 states an error of at most {float(own):.1e}; for μr = 1 it is exact."]


@styled
def speed_figure(result: xr.Dataset) -> Figure:
    """Error of B at 20 mm (full) and 13 mm (faint) against the time from nothing, for both problems.

    Where a table estimates its own error, a bar reaches from the true error up to the stated one.
    """
    figure, (axes,) = panels(1, 2, (PAGE, 3.4), sharey=True)
    titles = {"exact": "μr = 1 (closed form known)", "permeable": "μr = 1.05"}
    families = list(dict.fromkeys(result["family"].values.tolist()))
    for panel, (problem, title) in zip(axes, titles.items(), strict=True):
        for family, color in zip(families, [*PALETTE, "0.4"], strict=False):
            rows = result.isel(approach=np.flatnonzero((result["family"] == family) & (result["problem"] == problem)))
            if not rows.sizes["approach"]:
                continue
            for distance, alpha, label in ((0.02, 1.0, family), (0.013, 0.35, None)):
                at = rows.sel(distance=distance)
                error = np.maximum(at["field_error"], 1e-16)
                stated = np.where(at["stated_error"] > ROUND_OFF, np.maximum(at["stated_error"] - error, 0.0), 0.0)
                bars = [np.zeros_like(stated), stated] if stated.any() else None
                style = {"ms": 4, "capsize": 2.5, "elinewidth": 1, "color": color, "alpha": alpha, "label": label}
                panel.errorbar(rows["cpu_seconds"], error, bars, fmt="o-", **style)
        panel.set(xscale="log", yscale="log")
        own = float(result["truth_error"].where(result["problem"] == problem).sel(distance=0.02).max())
        panel.axhspan(1e-17, max(own, 1e-16), facecolor="0.9", edgecolor="0.6", label="error of the reference")
        panel.set(xlabel="processor time from nothing (s)", title=title, ylim=(1e-16, None))
        panel.legend(frameon=True)
    axes[0].set_ylabel("relative error of B")
    return figure


FIGURES = {"speed-accuracy": speed_figure}


STUDY = study_of_one(
    name="speed-accuracy",
    summary="error of B and of its gradient against time, unknowns and memory, for every way to the rotor's field",
    compute=speed_accuracy,
    figures=FIGURES,
    report=speed_lines,
    timed=True,
)
