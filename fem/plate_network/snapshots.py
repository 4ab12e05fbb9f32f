"""Snapshots of the electric field in a plate: what the reduced network is made of.

A snapshot is e = A_s + A at the quadrature points of the plate (the electric field is -iωe), for combinations of
sources and one frequency, together with a, the potential of the current σe: from K A = -iω σe it is a = iA/ω,
so that no further problem has to be solved.  For real and imaginary parts, with the source's potential real,

    e = A_s + Re A,  a = -Im A/ω      and      e = Im A,  a = Re A/ω.

Fields are kept as rows of numbers weighted by the roots of the quadrature weights (with σ and the number of mirror
images), so that ∫ σ e·e' dV is the plain product of two rows.  Parity classes that the region's symmetry keeps apart
are separate groups; those that it mixes make one row together.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import ngsolve
import numpy as np

from ...geometry.basics import Array
from ..closed_forms import ComplexArray
from ..eddy_currents import EddySpace, FrequencySystem, Source
from ..elements import Parity

CHUNK = 48
"""Sources handled at a time: bounds the memory."""


@dataclass(frozen=True)
class Group:
    """Parity classes that the region mixes.

    Parameters
    ----------
    classes : their numbers among the classes of the mesh
    mirrors : axes that mirror mesh and region
    signs : the group's parity about each of them
    """

    classes: tuple[int, ...]
    mirrors: tuple[int, ...]
    signs: tuple[int, ...]


def parity_groups(parity: Parity, mirrors: Sequence[int]) -> list[Group]:
    """Classes of the mesh sorted by their parity about those of its planes that also mirror the region."""
    common = [k for k, axis in enumerate(parity.mirrors) if axis in mirrors]
    axes = tuple(parity.mirrors[k] for k in common)
    sorted_classes: dict[tuple[int, ...], list[int]] = {}
    for number, signs in enumerate(parity.classes):
        sorted_classes.setdefault(tuple(signs[k] for k in common), []).append(number)
    return [Group(tuple(numbers), axes, signs) for signs, numbers in sorted_classes.items()]


def group_rows(space: EddySpace, groups: Sequence[Group], sources: Sequence[Source]) -> list[Array]:
    """Weighted potentials of the sources: for each group (sources, points × 3 × classes)."""
    root = np.sqrt(space.weights * space.conductors.images)[:, None]
    parts: list[list[Array]] = [[] for _ in groups]
    for start in range(0, len(sources), CHUNK):
        images = space.class_images(sources[start : start + CHUNK]) * root
        for part, group in zip(parts, groups, strict=True):
            rows = images[list(group.classes)].swapaxes(0, 1)
            part.append(rows.reshape(len(rows), -1))
    return [np.concatenate(part) for part in parts]


@dataclass(frozen=True, eq=False)
class SourceModes:
    """Orthonormal combinations of the sources of one group that matter to the plate.

    Parameters
    ----------
    group : parity classes
    rows : (modes, width) weighted potentials, orthonormal
    loads : (modes, classes, unknowns) their loads
    amplitudes : (sources, modes) of the sources that the modes were made for
    """

    group: Group
    rows: Array
    loads: Array
    amplitudes: Array

    def extended(self, space: EddySpace, rows: Array, scale: Array, tolerance: float) -> SourceModes:
        """The modes, and after them those of what they miss of other sources; amplitudes of the other sources."""
        more = source_modes(space, self.group, rows - rows @ self.rows.T @ self.rows, scale, tolerance)
        both = np.concatenate([self.rows, more.rows])
        return SourceModes(self.group, both, np.concatenate([self.loads, more.loads]), rows @ both.T)


def row_loads(space: EddySpace, group: Group, rows: Array) -> Array:
    """(n, classes, unknowns) loads of weighted potentials (n, width)."""
    root = np.sqrt(space.weights * space.conductors.images)[:, None]
    potentials = rows.reshape(len(rows), len(group.classes), len(space.points), 3) / root
    return np.stack([space.loads(potentials[:, k]) for k in range(len(group.classes))], axis=1)


def source_modes(space: EddySpace, group: Group, rows: Array, scale: Array, tolerance: float) -> SourceModes:
    """Principal components of potentials (sources, width) weighted by `scale` (sources,).

    What is left out of the weighted rows has a squared norm of less than `tolerance` in the sum over sources.
    """
    weighted = rows * scale[:, None]
    values, vectors = np.linalg.eigh(weighted @ weighted.T)
    tail = np.cumsum(np.maximum(values, 0.0))
    kept = np.flatnonzero((tail > tolerance) & (values > 1e-13 * values[-1]))[::-1]
    modes = (vectors[:, kept] / np.sqrt(values[kept])).T @ weighted
    return SourceModes(group, modes, row_loads(space, group, modes), rows @ modes.T)


def solve_modes(space: EddySpace, modes: Iterable[SourceModes], frequency: float) -> list[ComplexArray]:
    """Reaction potentials A (modes, width) of every group at one frequency (Hz, positive), weighted like the rows."""
    system = FrequencySystem(space, frequency)
    root = np.sqrt(space.weights * space.conductors.images)[:, None]
    found = []
    for group_modes in modes:
        parts = []
        for k, number in enumerate(group_modes.group.classes):
            solutions, _ = system.solve(space.parity.classes[number], group_modes.loads[:, k])
            parts.append(at_points(space, solutions) * root)
        found.append(np.stack(parts, axis=1).reshape(group_modes.rows.shape))
    return found


def at_points(space: EddySpace, solutions: ComplexArray) -> ComplexArray:
    """Values (n, points, 3) of solutions (n, unknowns) at the quadrature points."""
    function = ngsolve.GridFunction(space.real)
    values = np.zeros((len(solutions), len(space.points), 3), complex)
    for row, solution in zip(values, solutions, strict=True):
        for factor, part in ((1.0, solution.real), (1j, solution.imag)):
            function.vec.FV().NumPy()[:] = part
            row += factor * space.point_values(function)
    return values
