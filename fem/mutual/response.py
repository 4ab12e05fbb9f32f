"""The field of a rotor of permeable magnets in a ball beside it: by its own remanence and in answer to sources.

In the magnets H0 is the closed form of the remanent polarisation J (μr = 1) plus the field of the ball's sources. The
magnetisation (μ - 1)(H0 - ∇ψ) comes from finite elements on a mesh of the magnets alone, which serves every position of
the ball. Its field in the ball is a volume integral over the magnets, whose error is the square of that of ∇ψ.  The
direct part (μ - 1) H0, nearly all of it, is integrated with points apart from the mesh, which are enough for it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...geometry.basics import Array, Box
from ...geometry.bodies import Magnet
from ...geometry.meshes import MagnetMesh, mesh_magnets
from ..closed_forms import remanent_field, volume_rule
from ..harmonics import (
    Ball,
    Coefficients,
    box_rule,
    derivative,
    from_magnetization,
    interior_coefficients,
    outer_sums,
)
from ..magnetostatics import PermeableRegions, assemble_regions
from ..rotor_tables import RotorTable
from .answer_grid import point_counts

NODES = 24
"""Integration points per axis in a magnet for the closed form; its logarithm at the edges is met to round-off."""
DIRECT_DIGITS = 16.0
"""As `answer_grid.DIGITS`, for the direct part of the answer."""


@dataclass(frozen=True, eq=False)
class RotorResponse:
    """A rotor that answers to fields; made by `rotor_response`.

    Parameters
    ----------
    mesh : of the magnets
    regions : their finite elements, or None where every μ = 1
    """

    mesh: MagnetMesh
    regions: PermeableRegions | None

    @property
    def magnets(self) -> tuple[Magnet, ...]:
        """The bodies."""
        return self.mesh.magnets

    def own_field(self, ball: Ball, degree: int) -> Coefficients:
        """Coefficients a_lm (T) of the rotor's field alone, its permeability included, about the ball's centre."""
        return self.closed_field(ball, degree) + from_magnetization(*self.remanent_dipoles, ball, degree)

    def closed_field(self, ball: Ball, degree: int) -> Coefficients:
        """The same of the remanence alone, as if every μ were 1."""
        return interior_coefficients(lambda points: self._remanence.evaluate(points)[0], ball, degree)

    @cached_property
    def _remanence(self) -> RotorTable:
        magnetized = tuple(magnet for magnet in self.magnets if magnet.polarization.any())
        return RotorTable("cuboid", self.magnets, magnetized)

    def answer(self, sources: Coefficients, ball: Ball, degree: int) -> Coefficients:
        """Coefficients a_lm (T) of the field that the magnets send back to sources c_lm (T) in the ball."""
        if self.regions is None:
            return np.zeros((degree + 1, degree + 1), complex)
        return from_magnetization(*self.induced_dipoles(sources, ball), ball, degree)

    def induced_dipoles(self, sources: Coefficients, ball: Ball) -> tuple[Array, Array]:
        """Positions (n, 3) m and μ0 M dV (n, 3) T m³ of what sources c_lm (T) in the ball induce in the magnets."""
        if self.regions is None:
            return np.zeros((0, 3)), np.zeros((0, 3))
        potentials = [-derivative(sources, axis) for axis in range(3)]

        def field(points: Array) -> Array:
            return outer_sums(potentials, (points - ball.center) / ball.radius)

        fields = {name: field(points) for name, points in self._places.items()}
        points, tensors = direct_rule(self.magnets, ball.radius)
        direct = points, np.einsum("na,nab->nb", field(points), tensors)
        return _joined(self._dipoles(self._beyond(fields)), direct)

    @cached_property
    def remanent_dipoles(self) -> tuple[Array, Array]:
        """Positions (n, 3) m and μ0 M dV (n, 3) T m³ that the permeability adds to the remanence of the lone rotor.

        The part (μ - 1) H0 stands on points apart from the mesh, graded towards edges; that of ∇ψ on the mesh's.
        """
        if self.regions is None:
            return np.zeros((0, 3)), np.zeros((0, 3))
        fields = {name: remanent_field(self.magnets, points) for name, points in self._places.items()}
        return _joined(self._dipoles(self._beyond(fields)), closed_dipoles(self.magnets))

    def linear_response(self, direct: bool = True) -> tuple[Array, Array, Callable[[Array], Array]]:
        """Points (n, 3) m and weights (n,) m³, and what makes μ0 M (n, 3) T there of a field H0 (n, 3) T.

        M without its direct part (μ - 1) H0 if that is not wanted.
        """
        assert self.regions is not None
        regions, names = self.regions, list(self._places)
        ends = np.cumsum([len(self._places[name]) for name in names])[:-1]

        def magnetized(field: Array) -> Array:
            fields = dict(zip(names, np.split(field, ends), strict=True))
            found = regions.magnetization(fields) if direct else self._beyond(fields)
            return np.concatenate([found[name] for name in names])

        weights = np.concatenate([regions.points[name].weights for name in names]) * self.mesh.unit**3
        return np.concatenate([self._places[name] for name in names]), weights, magnetized

    def own_dipoles(self) -> tuple[Array, Array]:
        """As `remanent_dipoles`, on the mesh's points alone: good to a hundredth of what the permeability adds."""
        if self.regions is None:
            return np.zeros((0, 3)), np.zeros((0, 3))
        points, weights, magnetized = self.linear_response()
        return points, weights[:, None] * magnetized(remanent_field(self.magnets, points))

    @cached_property
    def _places(self) -> dict[str, Array]:
        """Integration points of every magnet (n, 3), m."""
        assert self.regions is not None
        return {
            name: self.magnets[int(name.removeprefix("magnet"))].body.within(self.mesh.to_meter(points.points))
            for name, points in self.regions.points.items()
        }

    def _beyond(self, fields: Mapping[str, Array]) -> dict[str, Array]:
        """μ0 M of fields H0 (n, 3) T at the mesh's points without its direct part (μ - 1) H0."""
        assert self.regions is not None
        total, chi = self.regions.magnetization(fields), self.regions.susceptibility
        return {name: total[name] - fields[name] @ chi[name] for name in total}

    def _dipoles(self, magnetization: Mapping[str, Array]) -> tuple[Array, Array]:
        assert self.regions is not None
        weights = {name: points.weights * self.mesh.unit**3 for name, points in self.regions.points.items()}
        moments = [weights[name][:, None] * values for name, values in magnetization.items()]
        return np.concatenate([self._places[name] for name in magnetization]), np.concatenate(moments)


def rotor_response(mesh: MagnetMesh, order: int = 3) -> RotorResponse:
    """Assemble and factorise a rotor on a mesh of `mesh_magnets`, with elements of degree `order`."""
    permeability = {f"magnet{k}": magnet.permeability_in_rotor for k, magnet in enumerate(mesh.magnets)}
    if all(np.array_equal(mu, np.eye(3)) for mu in permeability.values()):
        return RotorResponse(mesh, None)
    return RotorResponse(mesh, assemble_regions(mesh.mesh, permeability, mesh.ball_radius, order))


def direct_rule(magnets: Sequence[Magnet], nearest: float) -> tuple[Array, Array]:
    """Points (n, 3) m and (μ - 1) dV (n, 3, 3) m³ for fields with sources no nearer to the magnets than so many m."""
    points, tensors = [], []
    for magnet in magnets:
        counts = point_counts(magnet.box, nearest, DIRECT_DIGITS)
        places, volumes = (
            box_rule(magnet.body, counts)
            if isinstance(magnet.body, Box)
            else volume_rule(magnet.body, [magnet.body], max(counts))
        )
        points.append(places)
        tensors.append(volumes[:, None, None] * (magnet.permeability_in_rotor - np.eye(3)))
    return np.concatenate(points), np.concatenate(tensors)


def _joined(*parts: tuple[Array, Array]) -> tuple[Array, Array]:
    return np.concatenate([points for points, _ in parts]), np.concatenate([moments for _, moments in parts])


def closed_dipoles(magnets: Sequence[Magnet]) -> tuple[Array, Array]:
    """Positions (n, 3) m and μ0 M dV (n, 3) T m³ of the magnetisation (μ - 1) H0 of the remanence's closed form H0.

    The points are graded towards the edges, where H0 has a logarithm.
    """
    bodies = [magnet.body for magnet in magnets]
    points, moments = [], []
    for magnet in magnets:
        places, weights = volume_rule(magnet.body, bodies, NODES)
        field = remanent_field(magnets, places) @ (magnet.permeability_in_rotor - np.eye(3))
        points.append(places)
        moments.append(weights[:, None] * field)
    return np.concatenate(points), np.concatenate(moments)


def rotor_ladder(rotor: tuple[Magnet, ...], orders: tuple[int, ...] = (3, 4)) -> tuple[RotorResponse, ...]:
    """The same rotor on one mesh with elements of several degrees, from coarse to fine."""
    mesh = mesh_magnets(rotor)
    return tuple(rotor_response(mesh, order) for order in orders)
