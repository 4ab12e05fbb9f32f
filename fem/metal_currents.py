"""Eddy currents in one piece of metal by finite elements, where they are too weak to act back on the field.

A vector potential that changes at the rate Ȧ drives E = -(Ȧ + ∇φ), free of divergence and with n·E = 0 on the surface:

    ∫ ∇v·∇φ = -∫ Ȧ·∇v for all v,        ∫ E_a·E_b = ∫ A_a·A_b - ∫ ∇φ_a·∇φ_b.

The error of the dissipation is the square of that of ∇φ, and the gauge of A does not matter.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import ngsolve as ng
import numpy as np

from ...geometry.basics import Array, Solid
from ...geometry.meshes import MetalMesh, mesh_metal
from ..elements import IntegrationPoints, require_memory, volume_points

Potentials = Callable[[Array], Array]
"""Points (n, 3) m -> A (n, 3, k) of k sources."""
BLOCK = 4000
"""Points at a time."""


@dataclass(frozen=True, eq=False)
class Metal:
    """A piece of metal on a mesh; made by `metal_of`.

    Parameters
    ----------
    mesh : of the piece alone
    conductivity : S/m
    space : H1
    inverse : of the Laplacian, one unknown held at zero
    points : integration points
    """

    mesh: MetalMesh
    conductivity: float
    space: Any
    inverse: Any
    points: IntegrationPoints

    @cached_property
    def places(self) -> Array:
        """Integration points (n, 3), m."""
        return self.mesh.to_meter(self.points.points)

    @cached_property
    def weights(self) -> Array:
        """σ dV (n,) of the integration points, S m²."""
        return np.asarray(self.conductivity * self.mesh.unit**3 * self.points.weights)

    def dissipation(self, sources: Potentials, loads: Array | None = None) -> Array:
        """σ ∫ E_a·E_b dV (k, k) of the rates of k sources; of many, whose fields are large, with their `loads`."""
        if loads is None:
            fields = sources(self.places)
            loads, blocks = self._integrals(fields), iter([(fields, self.weights)])
        else:
            blocks = self._blocks(sources)
        potentials = self.solutions(loads)
        whole = np.sum([flat(a).T @ flat(w[:, None, None] * a) for a, w in blocks], axis=0)
        return np.asarray(whole - self.conductivity * self.mesh.unit**3 * loads @ potentials.T)

    def loads(self, sources: Potentials) -> Array:
        """∫ A·∇v (k, unknowns), in units of the mesh."""
        return self._integrals(sources(self.places))

    def _integrals(self, fields: Array) -> Array:
        """∫ A·∇v (k, unknowns) of A (n, 3, k) at the points."""
        test, found = self.space.TestFunction(), []
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

    def _blocks(self, sources: Potentials) -> Iterator[tuple[Array, Array]]:
        for start in range(0, len(self.places), BLOCK):
            yield sources(self.places[start : start + BLOCK]), self.weights[start : start + BLOCK]


def flat(values: Array) -> Array:
    """Fields (n, 3, k) as one column (3n,) for each of the k sources."""
    return values.reshape(-1, values.shape[-1])


def metal_of(bodies: Sequence[Solid], conductivity: float, order: int) -> Metal:
    """Mesh and factorise a piece of metal, bodies that touch, with elements of degree `order`.

    Raises
    ------
    TooLargeError : the memory does not hold the system
    """
    return metal_on(mesh_metal(bodies), conductivity, order)


def metal_on(mesh: MetalMesh, conductivity: float, order: int) -> Metal:
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
