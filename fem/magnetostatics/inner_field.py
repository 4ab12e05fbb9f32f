"""What the elements know inside their ball: ∇ψ and its slope at any points, from one side of the mirror planes."""

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from .rotor_solution import RotorSolution

WITHIN = 0.999
"""Share of the ball's radius up to which its curved elements surely reach."""


def in_ball(solution: RotorSolution, points: Array) -> NDArray[np.bool_]:
    """Which of the points (n, 3) m in the rotor's frame lie in the ball of the elements: (n,)."""
    return np.asarray(np.linalg.norm(_in_mesh(solution, points), axis=1) < WITHIN * solution.mesh.ball_radius)


def potential_slopes(solution: RotorSolution, points: Array) -> tuple[Array, Array]:
    """∇ψ (n, 3) T and its slope ∂_i ∂_j ψ (n, 3, 3) T/m at points (n, 3) m in the ball, rotor's frame.

    On a face it is that of the side on which the mesh has the point.  ∇ψ converges as h^p, its slope one order slower.
    """
    mesh, planes, axes = solution.mesh, solution.symmetry.planes, solution.symmetry.axes
    places = _in_mesh(solution, points)
    flips = np.ones_like(places)
    for plane in solution.mesh.planes:
        flips[:, plane] = np.where(places[:, plane] < 0, -1.0, 1.0)
    assert set(solution.mesh.planes) <= set(planes)
    found = mesh.mesh(*(flips * places).T)
    first, second = np.zeros((len(points), 3)), np.zeros((len(points), 3, 3))
    for part in solution.parts:
        sign = np.ones(len(points))
        for plane, parity in zip(mesh.planes, part.signs, strict=True):
            sign *= np.where(flips[:, plane] < 0, parity, 1.0)
        first += sign[:, None] * np.asarray(ng.grad(part.potential)(found)).reshape(-1, 3)
        hesse = np.asarray(part.potential.Operator("hesse")(found)).reshape(-1, 3, 3)
        second += sign[:, None, None] * hesse
    first, second = first * flips, second * flips[:, :, None] * flips[:, None, :] / mesh.unit
    return first @ axes.T, np.asarray(axes @ second @ axes.T)


def _in_mesh(solution: RotorSolution, points: Array) -> Array:
    """Points (n, 3) in the mesh's coordinates, without regard to mirrors."""
    symmetry, mesh = solution.symmetry, solution.mesh
    return ((points - symmetry.center) @ symmetry.axes - mesh.center) / mesh.unit
