"""Every way to compute the rotor's field, by name, for the study of speed against error."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...fem.closed_forms import added_by_closed_form, carrier
from ...fem.harmonics import uniform_moments, without_noise
from ...fem.magnetostatics import Refinement, refinement_of, solve_rotor
from ...fem.measured_maps import FieldMap, fit_field_map
from ...fem.rotor_tables import AccuracyWarning, FieldTable, RotorTable, rotor_table
from ...fem.verification import magnet_dipoles
from ...geometry.bodies import Magnet
from ...geometry.meshes import MeshSettings, mesh_magnets

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
