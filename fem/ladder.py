"""Tables of finite-element fields with a stated error, from a ladder of element orders.

The same mesh is solved with orders p-1 and p. Elements and quadrature are finer at p, and the functionals converge
fast, so that their difference bounds the error at p. What both share, a sphere that is not quite round, is added.
"""

from __future__ import annotations

import importlib.metadata
import resource
import time
from dataclasses import dataclass

import numpy as np

from ..geometry.box import Array
from ..geometry.magnet import Magnet
from ..geometry.mesh import MagnetMesh, MeshSettings, mesh_magnets
from .harmonics import Coefficients, field_spectrum
from .magnetostatics import Formulation, Solution, magnet_moments, solve, trace_moments
from .multipole import MultipoleExpansion, uniform_moments
from .table import RotorTable

ORDERS = range(2, 7)
SAFETY = 1.5
"""Factor on the difference of two orders. The true error was 0.06 to 0.5 of it up to degree 8, at most 1.23 at any."""
BOUNDARY_DEGREE = 8
"""Degree of the open boundary for `split`: the magnets hardly feel higher ones (below 1e-8 of B)."""
TAIL = 45
"""Degree to which uncertainties are continued."""


def with_tail(spectrum: Array) -> Array:
    """Continue a spectrum on the circumscribed sphere up to degree `TAIL`, where corners let it fall but slowly."""
    return np.concatenate([spectrum, np.full(max(TAIL + 1 - len(spectrum), 0), spectrum[-4:].max())])


@dataclass(frozen=True)
class Accuracy:
    """What a table must reach.

    Parameters
    ----------
    rtol : error of B relative to its root mean square over the spheres of `nearest`
    nearest : distance from the centre of an expansion from which on `rtol` holds, in radii of its sphere
    """

    rtol: float = 1e-5
    nearest: float = 1.5

    def __post_init__(self) -> None:
        if not 0 < self.rtol < 1:
            raise ValueError(f"Input rtol must lie between 0 and 1; instead received {self.rtol}.")
        if self.nearest <= 1:
            raise ValueError(f"Input nearest must exceed 1; instead received {self.nearest}.")

    def degree(self, contrast: float) -> int:
        """Degree where a part of the field that is `contrast` of the whole has fallen below `rtol`; 5 to 31."""
        needed = np.log(contrast / self.rtol) / np.log(self.nearest) if contrast > 0 else 0.0
        return int(np.clip(np.ceil(needed), 5, 31))


def fem_table(
    magnets: tuple[Magnet, ...],
    accuracy: Accuracy | None = None,
    formulation: Formulation = "split",
    settings: MeshSettings | None = None,
) -> RotorTable:
    """Field of magnets with recoil permeability, by finite elements.

    Orders from 3 to 6 are tried until the estimated error meets the accuracy; the last table is returned if none does,
    and its uncertainty says how far it is off. `split` gives one expansion per magnet, of what the permeability adds
    to the closed form; `direct` one of the whole field about the common centre, without any closed form.
    """
    accuracy = accuracy or Accuracy()
    start = time.perf_counter()
    mesh = mesh_magnets(magnets, settings)
    direct = formulation == "direct"
    degree = accuracy.degree(1.0 if direct else max(abs(m.recoil_permeability - 1) for m in magnets))
    boundary_degree = degree if direct else BOUNDARY_DEGREE
    spheres = [(center, accuracy.nearest * radius) for center, radius in _spheres(mesh, formulation)]
    points, allowed = _allowed_error(spheres, magnets, accuracy.rtol)
    coarse = _moments(solve(mesh, formulation, ORDERS[0], boundary_degree), degree)
    for order in ORDERS[1:]:
        solution = solve(mesh, formulation, order, boundary_degree)
        fine = _moments(solution, degree)
        errors = [
            SAFETY * field_spectrum(b - a) + _shared_error(solution, b) for a, b in zip(coarse, fine, strict=True)
        ]
        full = _table(mesh, formulation, fine, [with_tail(e) for e in errors])
        if np.max(_error(full, points)) <= allowed / 2:
            break
        coarse = fine
    kept, left_out = zip(*(_trim(c, allowed / (2 * len(fine)), accuracy.nearest) for c in fine), strict=True)
    uncertainty = [with_tail(error) + rest for error, rest in zip(errors, left_out, strict=True)]
    provenance = _provenance(solution, settings or MeshSettings(), time.perf_counter() - start)
    return _table(mesh, formulation, list(kept), uncertainty, provenance)


def _moments(solution: Solution, degree: int) -> list[Coefficients]:
    if solution.formulation == "direct":
        return [trace_moments(solution)]
    return list(magnet_moments(solution, degree))


def _shared_error(solution: Solution, coefficients: Coefficients) -> Array:
    """Spectrum (T) of the error that does not fall with the order: that of R^(l+1) in `direct`, of H0 in `split`."""
    if solution.formulation == "direct":
        return solution.boundary.area_error * np.arange(1, len(coefficients) + 1) * field_spectrum(coefficients)
    return np.full(len(coefficients), 1e-7 * field_spectrum(coefficients).max())


def _spheres(mesh: MagnetMesh, formulation: Formulation) -> list[tuple[Array, float]]:
    """Centre and radius of every expansion, m."""
    if formulation == "direct":
        return [(mesh.center, mesh.unit)]
    return [(magnet.box.center, magnet.box.circumradius) for magnet in mesh.magnets]


def _table(
    mesh: MagnetMesh,
    formulation: Formulation,
    coefficients: list[Coefficients],
    uncertainty: list[Array],
    provenance: dict[str, str | float] | None = None,
) -> RotorTable:
    spheres = _spheres(mesh, formulation)
    expansions = tuple(
        MultipoleExpansion(*sphere, c, u) for sphere, c, u in zip(spheres, coefficients, uncertainty, strict=True)
    )
    uniform = mesh.magnets if formulation == "split" else ()
    return RotorTable("fem", mesh.magnets, uniform, expansions, provenance or {})


def _allowed_error(spheres: list[tuple[Array, float]], magnets: tuple[Magnet, ...], rtol: float) -> tuple[Array, float]:
    """Points on the spheres (centre, radius), outside each other, and the error of B (T) allowed there.

    The scale of B is that of the magnets' dipoles, which is right to a few per cent.
    """
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    points = np.concatenate([center + radius * directions for center, radius in spheres])
    outside = np.all([np.linalg.norm(points - c, axis=1) >= (1 - 1e-9) * r for c, r in spheres], axis=0)
    dipoles = RotorTable("dipole", magnets, (), tuple(uniform_moments(magnet, 1) for magnet in magnets))
    field = dipoles.evaluate(points[outside])[0]
    return points[outside], rtol * float(np.sqrt(np.mean(np.sum(field**2, axis=1))))


def _error(table: RotorTable, points: Array) -> Array:
    return np.asarray(np.sum([expansion.field_error(points)[0] for expansion in table.expansions], axis=0))


def _trim(coefficients: Coefficients, allowed: float, nearest: float) -> tuple[Coefficients, Array]:
    """The coefficients that matter, and the spectrum of what is left out (extrapolated beyond the last degree).

    The terms that are left out, zeros by symmetry among them, add up to at most `allowed` (T) at `nearest`.
    """
    degrees = np.arange(len(coefficients))
    share = allowed / len(degrees) / (np.sqrt(2 * degrees + 1) * nearest ** -(degrees + 2.0))
    kept = np.array([_without_smallest(row, l, share[l]) for l, row in enumerate(coefficients)])
    left_out = with_tail(field_spectrum(coefficients))
    left_out[: len(degrees)] = field_spectrum(coefficients - kept)
    degree = max([1, *np.nonzero(kept)[0]])
    return kept[: degree + 1, : degree + 1], left_out


def _without_smallest(row: Coefficients, degree: int, allowed: float) -> Coefficients:
    """Coefficients of one degree without the smallest real and imaginary parts, `allowed` (T) in all."""
    kept = np.zeros_like(row)
    candidates = [(m, unit) for m in range(degree + 1) for unit in (1.0, 1j)]
    parts = [((row[m] / unit).real * unit, m) for m, unit in candidates]

    def size(part: tuple[complex, int]) -> float:
        alone = np.zeros((degree + 1, degree + 1), complex)
        alone[degree, part[1]] = part[0]
        return float(field_spectrum(alone)[degree])

    dropped = 0.0
    for value, m in sorted(parts, key=size):
        dropped += size((value, m)) ** 2
        if dropped > allowed**2:
            kept[m] += value
    return kept


def _provenance(solution: Solution, settings: MeshSettings, seconds: float) -> dict[str, str | float]:
    return {
        "solver": "ngsolve " + importlib.metadata.version("ngsolve"),
        "mesher": "netgen-mesher " + importlib.metadata.version("netgen-mesher"),
        "formulation": solution.formulation,
        "elements": solution.mesh.elements,
        "order": solution.order,
        "unknowns": solution.unknowns,
        "hp_layers": settings.hp_layers,
        "ball_radius_mm": solution.mesh.ball_radius * solution.mesh.unit * 1e3,
        "seconds": seconds,
        "peak_memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
