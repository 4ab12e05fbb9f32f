"""Eddy currents in one piece of metal by finite elements, where they are too weak to act back on the field.

A vector potential that changes at the rate Ȧ drives E = -(Ȧ + ∇φ), free of divergence and with n·E = 0 on the surface:

    ∫ ∇v·∇φ = -∫ Ȧ·∇v for all v,        ∫ E_a·E_b = ∫ A_a·A_b - ∫ ∇φ_a·∇φ_b.

The error of the dissipation is the square of that of ∇φ, and the gauge of A does not matter.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import ngsolve as ng
import numpy as np

from ..geometry.common import MU_0, Array, Watch, unwatched, watched
from ..geometry.meshes.solids import SolidMesh, mesh_metal
from ..geometry.solids import Solid
from .elements.condensed import require_memory
from .elements.spaces import IntegrationPoints, volume_points

Potentials = Callable[[Array], Array]  # Points (n, 3) m -> A (n, 3, k) of k sources
BLOCK, TOGETHER = 4000, 40  # Points, and places of dipoles, at a time


@dataclass(frozen=True, eq=False)
class Metal:
    """A piece of metal on a mesh; made by `metal_of`."""

    mesh: SolidMesh  # of the piece alone
    conductivity: float  # S/m
    space: Any  # H1
    inverse: Any  # of the Laplacian, one unknown held at zero
    points: IntegrationPoints  # integration points

    @cached_property
    def places(self) -> Array:
        return self.mesh.to_meter(self.points.points)

    @cached_property
    def weights(self) -> Array:
        """σ dV (n,) of the integration points, S m²."""
        return np.asarray(self.conductivity * self.mesh.unit**3 * self.points.weights)

    def dissipation(self, sources: Potentials, loads: Array | None = None) -> Array:
        """σ ∫ E_a·E_b dV (k, k) of the rates of k sources, whose `loads` may be known."""
        loads = self.loads(sources) if loads is None else loads
        whole = np.zeros((len(loads), len(loads)))
        for start in range(0, len(self.places), BLOCK):
            fields, weights = sources(self.places[start : start + BLOCK]), self.weights[start : start + BLOCK]
            whole += flat(fields).T @ flat(weights[:, None, None] * fields)
        # E is A without its gradient part, which is orthogonal to it.
        return np.asarray(whole - self.conductivity * self.mesh.unit**3 * loads @ self.solutions(loads).T)

    def loads(self, sources: Potentials) -> Array:
        """∫ A·∇v (k, unknowns), in units of the mesh."""
        fields, test, found = sources(self.places), self.space.TestFunction(), []
        for k in range(fields.shape[2]):
            form = ng.LinearForm(self.space)
            along = ng.CF(tuple(self.points.function(fields[:, axis, k]) for axis in range(3)))
            form += along * ng.grad(test) * self.points.measure
            form.Assemble()
            found.append(form.vec.FV().NumPy().copy())
        return np.array(found)

    def solutions(self, loads: Array) -> Array:
        """Potentials (k, unknowns) to loads (k, unknowns), of the sign of A."""
        right, result = ng.GridFunction(self.space), np.empty_like(loads)
        left = ng.GridFunction(self.space)
        for row, load in zip(result, loads, strict=True):
            right.vec.FV().NumPy()[:] = load
            left.vec.data = self.inverse * right.vec
            row[:] = left.vec.FV().NumPy()
        return result

    def gradients(self, potentials: Array) -> Array:
        """Gradients (n, 3, k) at the points of potentials (k, unknowns)."""
        function, found = ng.GridFunction(self.space), []
        for potential in potentials:
            function.vec.FV().NumPy()[:] = potential
            slope = ng.grad(function)
            found.append(self.points.sample(*(slope[axis] for axis in range(3))))
        return np.moveaxis(np.array(found), 0, 2)


def flat(values: Array) -> Array:
    """Fields (n, 3, k) as one column (3n,) for each of the k sources."""
    return values.reshape(-1, values.shape[-1])


def metal_of(bodies: Sequence[Solid], conductivity: float, order: int) -> Metal:
    """Mesh and factorise a piece of metal, bodies that touch, with elements of degree `order`.

    Raises TooLargeError: the memory does not hold the system.
    """
    return metal_on(mesh_metal(bodies), conductivity, order)


def metal_on(mesh: SolidMesh, conductivity: float, order: int) -> Metal:
    """The same on a mesh that is there."""
    space = ng.H1(mesh.mesh, order=order)
    free = space.FreeDofs()
    free[0] = False
    require_memory(space, free, "Leave out small conductors, or far ones")
    trial, test = space.TnT()
    form = ng.BilinearForm(space, symmetric=True)
    form += ng.grad(trial) * ng.grad(test) * ng.dx
    form.Assemble()
    points = volume_points(mesh.mesh, ".*", 2 * order)
    return Metal(mesh, conductivity, space, form.mat.Inverse(free, inverse="sparsecholesky"), points)


def of_places(positions: Array) -> Potentials:
    """Those of 1 A m² along x, y and z at each of `positions` (k, 3) m: A (n, 3, 3k) T m."""

    def potentials(points: Array) -> Array:
        offset = [points[:, axis, None] - positions[:, axis] for axis in range(3)]
        square = offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2
        strength = MU_0 / (4 * np.pi) / (square * np.sqrt(square))
        found = np.zeros((len(points), 3, len(positions), 3))  # e_i × pull: points, component, place, i
        for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
            found[:, j, :, i], found[:, k, :, i] = -strength * offset[k], strength * offset[j]
        return found.reshape(len(points), 3, -1)

    return potentials


def of_motion(position: Array, moment: Array) -> Potentials:
    """∂A/∂q (n, 3, 6) for a dipole (3,) A m² at (3,) m: T by its displacement, T m by its turn about x, y and z."""
    turned = np.cross(np.eye(3), moment)
    across = np.cross(moment, np.eye(3))

    def potentials(points: Array) -> Array:
        offset = points - position
        inverse = 1 / np.linalg.norm(offset, axis=1)
        found = np.empty((len(points), 3, 6))
        pull = 3 * (offset @ across) * inverse[:, None] ** 2  # 3 m × r / r²
        for a in range(3):
            found[:, :, a] = (pull * offset[:, [a]] - across[a]) * inverse[:, None] ** 3
            found[:, :, 3 + a] = (offset @ np.cross(turned[a], np.eye(3))) * inverse[:, None] ** 3
        return MU_0 / (4 * np.pi) * found

    return potentials


@dataclass(frozen=True, eq=False)
class CurrentPatterns:
    """Patterns of current in several pieces of metal."""

    metals: tuple[Metal, ...]  # the pieces
    patterns: tuple[Array, ...]  # (points, 3, k) of w_k σ dV at the integration points of each

    @property
    def count(self) -> int:
        return int(self.patterns[0].shape[2])

    def fields(self, positions: Array, watch: Watch = unwatched) -> Array:
        """c_k (k, n, 3) at positions (n, 3) m, √W s/(A m²); `watch` is a progress callback."""
        found = []
        for start in watched(range(0, len(positions), TOGETHER), watch, "their fields"):
            sources = of_places(positions[start : start + TOGETHER])
            parts = [
                flat(pattern).T @ flat(sources(metal.places))
                for metal, pattern in zip(self.metals, self.patterns, strict=True)
            ]
            found.append(np.sum(parts, axis=0).reshape(self.count, -1, 3))
        return np.concatenate(found, axis=1)


def current_patterns(
    metals: Sequence[Metal], positions: Array, left_out: float, watch: Watch = unwatched
) -> CurrentPatterns:
    """Patterns that dipoles at `positions` (n, 3) m drive, but for a part `left_out` of the loss at any place.

    `watch` is a progress callback.
    """
    grams, loads, blocks = [], [], range(0, len(positions), TOGETHER)
    for metal in metals:
        parts = [metal.loads(of_places(positions[k : k + TOGETHER])) for k in watched(blocks, watch, "patterns")]
        loads.append(np.concatenate(parts))
        grams.append(metal.dissipation(of_places(positions), loads[-1]))
    gram = np.sum(grams, axis=0)
    scale = np.repeat(np.sqrt(1 / gram.diagonal().reshape(-1, 3).sum(axis=1)), 3)
    energy, vectors = np.linalg.eigh(scale[:, None] * gram * scale)
    energy, vectors = energy[::-1], vectors[:, ::-1]
    shares = np.sum((energy * vectors**2).reshape(len(positions), 3, -1), axis=1)
    missing = 1 - np.cumsum(shares, axis=1).min(axis=0)
    count = int(np.argmax(missing <= left_out)) + 1 if np.any(missing <= left_out) else len(energy)
    mix = scale[:, None] * vectors[:, :count] / np.sqrt(energy[:count])
    patterns = [_pattern(metal, load, positions, mix) for metal, load in zip(metals, loads, strict=True)]
    return CurrentPatterns(tuple(metals), tuple(patterns))


def _pattern(metal: Metal, loads: Array, positions: Array, mix: Array) -> Array:
    fields = -metal.gradients(metal.solutions(mix.T @ loads))
    for start in range(0, len(positions), TOGETHER):
        part = of_places(positions[start : start + TOGETHER])(metal.places)
        fields += part @ mix[3 * start : 3 * (start + TOGETHER)]
    return np.asarray(metal.weights[:, None, None] * fields)
