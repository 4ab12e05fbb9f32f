"""Finite elements of magnets that respond to a field: what the charges on their surfaces are compared with.

With a given field H0 (sources outside or remanence, in T) and μ0 H = H0 - ∇ψ in a ball of air with open space outside,

    ∫ ∇v·μ∇ψ = ∫_bodies ∇v·(μ - 1) H0,        μ0 M = (μ - 1)(H0 - ∇ψ).

H0 enters and M leaves at integration points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import ngsolve as ng
import numpy as np
import scipy
from numpy.typing import NDArray

from spinlev.fem.closed_forms.uniform import UniformField, remanent_field
from spinlev.fem.elements.magnetostatics import BOUNDARY_DEGREE, stiffness_of
from spinlev.fem.elements.spaces import OpenBoundary, solve_condensed, volume_points
from spinlev.fem.harmonics.interior import Ball, from_magnetization, interior_coefficients
from spinlev.fem.harmonics.solid import Coefficients, derivative, outer_sums
from spinlev.fem.mutual.response import closed_dipoles, direct_rule
from spinlev.geometry.common import Array
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.meshes.magnets import MagnetMesh, mesh_magnets


def lacking(boundary: OpenBoundary, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Load vectors (k, `size`) p and factors (k,) d, none of them 0, of its map Σ d p pᵀ."""
    factors = boundary.copies * (boundary.degrees - 1) / boundary.radius**3
    used = factors != 0
    loads = np.zeros((int(used.sum()), size))
    loads[:, boundary.unknowns] = boundary.projection[:, used].T
    return loads, factors[used]


class OpenFactor:
    """A factor that knows the open boundary: many loads, each at the price of one in the ball of air alone.

    It is made by a solution for each harmonic of the boundary; for a single load `solve_open` takes fewer.

    What the boundary adds to the matrix K is of low rank, P D Pᵀ, so that with U = K⁻¹P a solution is
    u - U (D⁻¹ + Pᵀ U)⁻¹ Pᵀ u of K u = f (Sherman, Morrison, Woodbury).

    Parameters
    ----------
    form : assembled with `condense=True`
    inverse : of its matrix on the free coupling unknowns
    boundary : whose harmonics are added
    """

    def __init__(self, form: ng.BilinearForm, inverse: ng.BaseMatrix, boundary: OpenBoundary) -> None:
        self._form, self._inverse = form, inverse
        self._loads, factors = lacking(boundary, form.space.ndof)
        answers = solve_condensed(form, inverse, self._loads)
        self._mixed = np.linalg.solve(np.diag(1 / factors) + self._loads @ answers.T, answers)

    def solve(self, loads: Array) -> Array:
        """Solutions (n, unknowns) for loads (n, unknowns)."""
        alone = solve_condensed(self._form, self._inverse, loads)
        return np.asarray(alone - (alone @ self._loads.T) @ self._mixed)


@dataclass(frozen=True, eq=False)
class PermeableRegions:
    """Bodies, their matrix and its factors; made by `assemble_regions`."""

    names: tuple[str, ...]  # of the bodies
    owner: NDArray[np.intp]  # (n,) number of the body of each integration point
    # points, weights: (n, 3) and (n,) in the mesh's coordinates
    points: Array
    weights: Array
    susceptibility: Array  # (n, 3, 3) μ - 1 at each
    slopes: scipy.sparse.csr_matrix  # (3n, unknowns) gradients of the basis at the points
    factor: OpenFactor  # of the matrix

    def magnetization(self, field: Array) -> Array:
        """μ0 M (n, 3) T at the points for a given field H0 (n, 3) T there."""
        source = self.direct(field)
        load = self.slopes.T @ (source * self.weights[:, None]).ravel()
        (potential,) = self.factor.solve(load[None])
        return np.asarray(source - self.direct((self.slopes @ potential).reshape(-1, 3)))

    def direct(self, field: Array) -> Array:
        """(μ - 1) H (n, 3) T of a field (n, 3) T at the points."""
        return np.asarray(np.einsum("ni,nij->nj", field, self.susceptibility))


def assemble_regions(mesh: Any, permeability: Mapping[str, Array], ball_radius: float, order: int) -> PermeableRegions:
    """Assemble and factorise.

    Parameters
    ----------
    mesh : NGSolve mesh of a ball about the origin with the boundary `outer`
    permeability : (3, 3) μ by region name; regions not named have μ = 1
    ball_radius : in the mesh's coordinates
    order : degree of the elements

    Raises
    ------
    TooLargeError : the memory does not hold the system
    """
    space, stiffness = stiffness_of(mesh, permeability, ball_radius, order, "Take elements of a lower degree")
    boundary = OpenBoundary(space, ball_radius, BOUNDARY_DEGREE)
    inverse = stiffness.mat.Inverse(space.FreeDofs(True), inverse="sparsecholesky")
    rules = [volume_points(mesh, name, 2 * order - 2) for name in permeability]
    owner = np.repeat(np.arange(len(rules)), [len(rule.weights) for rule in rules])
    return PermeableRegions(
        tuple(permeability),
        owner,
        np.concatenate([rule.points for rule in rules]),
        np.concatenate([rule.weights for rule in rules]),
        (np.array([*permeability.values()]) - np.eye(3))[owner],
        scipy.sparse.vstack([rule.value_matrix(space, ng.grad(space.TrialFunction())) for rule in rules], format="csr"),
        OpenFactor(stiffness, inverse, boundary),
    )


@dataclass(frozen=True, eq=False)
class ElementResponse:
    """A rotor that responds by its finite elements; made by `element_response`."""

    mesh: MagnetMesh  # of the magnets
    regions: PermeableRegions | None  # their finite elements, or None where every μ = 1

    @property
    def magnets(self) -> tuple[Magnet, ...]:
        """The bodies."""
        return self.mesh.magnets

    def own_field(self, ball: Ball, degree: int) -> Coefficients:
        """See `ChargeResponse`."""
        own = sum(interior_coefficients(UniformField(m).field, ball, degree) for m in self.magnets)
        return own + from_magnetization(*self.remanent_dipoles, ball, degree)

    def answer(self, sources: Coefficients, ball: Ball, degree: int) -> Coefficients:
        """See `ChargeResponse`."""
        return from_magnetization(*self.induced_dipoles(sources, ball), ball, degree)

    def induced_dipoles(self, sources: Coefficients, ball: Ball) -> tuple[Array, Array]:
        """Positions (n, 3) m and μ0 M dV (n, 3) T m³ of what sources c_lm (T) in the ball induce in the magnets."""
        if self.regions is None:
            return np.zeros((0, 3)), np.zeros((0, 3))
        potentials = [-derivative(sources, axis) for axis in range(3)]
        points, tensors = direct_rule(self.magnets, ball.radius)
        places = np.concatenate([self.places, points])
        field, direct = np.split(outer_sums(potentials, (places - ball.center) / ball.radius), [len(self.places)])
        moments = self.weights[:, None] * self.beyond(field), np.einsum("na,nab->nb", direct, tensors)
        return places, np.concatenate(moments)

    @cached_property
    def remanent_dipoles(self) -> tuple[Array, Array]:
        """Positions (n, 3) m and μ0 M dV (n, 3) T m³ that the permeability adds to the remanence of the lone rotor.

        The part (μ - 1) H0 stands on points apart from the mesh, graded towards edges; that of ∇ψ on the mesh's.
        """
        if self.regions is None:
            return np.zeros((0, 3)), np.zeros((0, 3))
        moments = self.weights[:, None] * self.beyond(remanent_field(self.magnets, self.places))
        places, closed = closed_dipoles(self.magnets, [m.permeability_in_rotor - np.eye(3) for m in self.magnets])
        return np.concatenate([self.places, places]), np.concatenate([moments, closed])

    def beyond(self, field: Array) -> Array:
        """μ0 M (n, 3) T of a field H0 (n, 3) T at `places` without its direct part (μ - 1) H0."""
        assert self.regions is not None
        return self.regions.magnetization(field) - self.regions.direct(field)

    @cached_property
    def places(self) -> Array:
        """Integration points in the magnets (n, 3), m."""
        assert self.regions is not None
        places = self.mesh.to_meter(self.regions.points)
        for k, name in enumerate(self.regions.names):  # curved elements leave a round body by a little
            mine = self.regions.owner == k
            places[mine] = self.magnets[int(name.removeprefix("magnet"))].body.within(places[mine])
        return places

    @property
    def weights(self) -> Array:
        """Of the integration points (n,), m³."""
        assert self.regions is not None
        return self.regions.weights * self.mesh.unit**3


def element_response(mesh: MagnetMesh, order: int = 3) -> ElementResponse:
    """Assemble and factorise a rotor on a mesh of `mesh_magnets`, with elements of degree `order`."""
    permeability = {f"magnet{k}": magnet.permeability_in_rotor for k, magnet in enumerate(mesh.magnets)}
    if all(np.array_equal(mu, np.eye(3)) for mu in permeability.values()):
        return ElementResponse(mesh, None)
    return ElementResponse(mesh, assemble_regions(mesh.mesh, permeability, mesh.ball_radius, order))


def element_ladder(rotor: tuple[Magnet, ...], orders: tuple[int, ...] = (3, 4)) -> tuple[ElementResponse, ...]:
    """The same rotor on one mesh with elements of several degrees, from coarse to fine."""
    mesh = mesh_magnets(rotor)
    return tuple(element_response(mesh, order) for order in orders)
