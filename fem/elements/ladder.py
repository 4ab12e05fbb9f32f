"""The field of a whole rotor at one level of refinement: symmetry, parity parts, moments."""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ...geometry.basics import Array, MeshError, Solid
from ...geometry.bodies import (
    Cells,
    Magnet,
    Symmetry,
    cells_of,
    closing_shifts,
    find_symmetry,
    parity_parts,
    shifted_magnet,
)
from ...geometry.meshes import OTHERWISE, MagnetMesh, MeshSettings, mesh_magnets
from ..closed_forms import by_cells
from ..harmonics import Coefficients, MultipoleExpansion, rotated_harmonics
from .moments import reaction_dipoles, reaction_moments, trace_moments
from .solver import Formulation, Solution, System, assemble, solve

SIZES = tuple(zip((1.0, 0.8, 0.5), OTHERWISE, strict=True))
"""Of elements in magnets, and the least at round surfaces of parts, that are tried, relative to what is asked for."""


@dataclass(frozen=True)
class Refinement:
    """How fine a solution is.

    Parameters
    ----------
    order : of the elements
    mesh : the mesh's settings
    boundary_degree : to which the outer boundary is exactly open
    """

    order: int
    mesh: MeshSettings
    boundary_degree: int


@dataclass(frozen=True, eq=False)
class RotorSolution:
    """Expansions of ψ's field outside, in the rotor's frame.

    Parameters
    ----------
    coefficients : c_lm (T), one per cell of every piece about its centre in `split`, one about the mesh's in `direct`
    spheres : centre (3,) m and radius m of every expansion, in the rotor's frame
    mesh : of the part of space that the mirror planes leave, in their frame
    unknowns : number of unknowns
    area_error : relative error of the area of the outer sphere
    layers : of elements at the edges; fewer than asked for where the mesher cannot match more
    symmetry : the frame of the mesh and its mirror planes
    parts : the potentials of every parity
    shifts : (n, 3) m by which the magnets were moved to close narrow gaps
    """

    coefficients: tuple[Coefficients, ...]
    spheres: tuple[tuple[Array, float], ...]
    mesh: MagnetMesh
    unknowns: int
    area_error: float
    layers: int
    symmetry: Symmetry
    parts: tuple[Solution, ...]
    shifts: Array

    def expansions(self, coefficients: Sequence[Coefficients]) -> list[MultipoleExpansion]:
        """Expansions about the same spheres with other coefficients."""
        return [MultipoleExpansion(*sphere, c) for sphere, c in zip(self.spheres, coefficients, strict=True)]


def solve_rotor(
    magnets: Sequence[Magnet],
    refinement: Refinement,
    formulation: Formulation = "split",
    degree: int = 1,
    pieces: Sequence[Sequence[Magnet]] | None = None,
    use_symmetry: bool = True,
    carriers: Sequence[Magnet] | None = None,
    cells: Sequence[Cells] | None = None,
) -> RotorSolution:
    """Solve for every parity part of the polarisation and add up; gaps too narrow for elements are closed.

    Parameters
    ----------
    degree : of the moments in `split`, where they are those of -(μ - 1) ∇ψ; in `direct` it is the boundary's
    pieces : of every magnet, each with its own expansion; by default the magnets
    use_symmetry : whether to mesh only one side of the mirror planes
    carriers : in `split`, the magnets with μr = 1 whose closed form is split off, each in the place of one of the
        magnets; by default the magnets' own remanence
    cells : of every piece, each with its own expansion; by default one

    Raises
    ------
    ConvergenceError : the iteration for the open boundary stalls
    MeshError : no mesh of the magnets fits together
    """
    cut = pieces or [(magnet,) for magnet in magnets]
    shifts = closing_shifts(magnets)
    closed = [shifted_magnet(magnet, shift) for magnet, shift in zip(magnets, shifts, strict=True)]
    symmetry = find_symmetry(closed)
    planes = symmetry.planes if use_symmetry else ()
    seen = [symmetry.to_frame(magnet) for magnet in closed]
    bodies = [piece for whole in cut for piece in whole]
    known = cells or [cells_of(body.body, np.inf) for body in bodies]
    meshed = [symmetry.to_frame(shifted_magnet(p, s)) for whole, s in zip(cut, shifts, strict=True) for p in whole]
    mesh, system, layers = _meshed_system(meshed, refinement, planes, [magnet.body for magnet in seen])
    total: list[Coefficients] = []
    solutions = []
    owners = [k for k, whole in enumerate(cut) for _ in whole]
    for signs, (own, carried) in parity_parts(seen, planes, _polarizations(magnets, carriers, symmetry)):
        sources = [Magnet(m.body, m.body.rotation.T @ j) for m, j in zip(seen, carried, strict=True)]
        rest = (own - carried)[owners]
        solution = solve(system, sources, formulation, refinement.boundary_degree, signs, rest)
        solutions.append(solution)
        if formulation == "direct":
            part = [rotated_harmonics(trace_moments(solution), symmetry.axes)]
        else:
            part = _of_cells(solution, symmetry, known, shifts[owners], degree)
        total = [a + b for a, b in zip(total, part, strict=True)] if total else part
    spheres = tuple((c, float(r)) for own in known for c, r in zip(own.centers, own.radii, strict=True))
    size = degree
    if formulation == "direct":
        spheres, size = ((symmetry.center + symmetry.axes @ mesh.center, mesh.unit),), refinement.boundary_degree
    nothing = [np.zeros((size + 1, size + 1), complex)] * len(spheres)
    area_error = max((solution.boundary.area_error for solution in solutions), default=0.0)
    return RotorSolution(
        tuple(total or nothing), spheres, mesh, system.unknowns, area_error, layers, symmetry, tuple(solutions), shifts
    )


def _of_cells(
    solution: Solution, symmetry: Symmetry, cells: Sequence[Cells], shifts: Array, degree: int
) -> list[Coefficients]:
    """Coefficients (T) of -(μ - 1) ∇ψ of every cell of every piece, about its centre, in the rotor's frame."""
    whole, found = reaction_moments(solution, degree), list[Coefficients]()
    for k, (own, shift) in enumerate(zip(cells, shifts, strict=True)):
        if len(own.radii) == 1:
            found.append(rotated_harmonics(whole[k], symmetry.axes))
            continue
        points, weights, values = reaction_dipoles(solution, k)
        places = symmetry.center + points @ symmetry.axes.T - shift
        found += by_cells(places, weights, values @ symmetry.axes.T, own, degree)
    return found


def _meshed_system(
    bodies: list[Magnet], refinement: Refinement, planes: tuple[int, ...], edges_of: list[Solid]
) -> tuple[MagnetMesh, System, int]:
    """Mesh, matrix, layers at the edges: where the mesher fails or they do not match, smaller elements, else fewer.

    Two elements that touch edges of magnets near each other may be refined otherwise on the face between them; in
    another mesh of nearly the same size they are mostly not there.
    """
    asked = refinement.mesh
    reason = MeshError("The mesh of the magnets does not fit together; change their positions slightly.")
    for layers, (size, smallest) in product(range(asked.hp_layers, -1, -1), SIZES):
        settings = replace(asked, magnet_size=size * asked.magnet_size, smallest=smallest * asked.smallest)
        try:
            mesh = mesh_magnets(bodies, replace(settings, hp_layers=layers), planes, edges_of)
        except MeshError as error:
            reason = error
            continue
        with contextlib.suppress(MeshError):
            return mesh, assemble(mesh, refinement.order), layers
    raise reason


def _polarizations(magnets: Sequence[Magnet], carriers: Sequence[Magnet] | None, symmetry: Symmetry) -> Array:
    """(2, n, 3) T in the mirrors' frame: of the magnets and of their carriers."""
    groups = (magnets, carriers or magnets)
    return np.array([[magnet.polarization_in_rotor for magnet in group] for group in groups]) @ symmetry.axes
