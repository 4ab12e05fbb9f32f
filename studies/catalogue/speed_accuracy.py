"""What one way to the rotor's field costs, and the field that it gives.

Every method runs in a process of its own, so that its time and memory are its own: from nothing (mesh, solution,
moments, table, compilation) to the field at points.
"""

import os
import tempfile
import time
import timeit
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import heyoka as hy
import magpylib
import numpy as np

from ...fem.rotor_tables import FieldTable
from ...fem.storage import compiled
from ...geometry.basics import Array
from ...geometry.bodies import Magnet, horizontal
from ..sweeps import safe_path
from .field_methods import methods

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
