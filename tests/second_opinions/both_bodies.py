"""Rotor and floater meshed together and solved at once: an independent check of mutual magnetisation.

Nothing is known beforehand of a sphere's answer and no series is summed: H0 is the closed form of both remanent
polarisations, and one finite-element solution gives the magnetisation that the permeability adds in either body.

Of a floater of any shape the same mesh is solved with each body permeable alone, too. Elements meet what either body is
alone badly at its edges, where its own H0 has a logarithm; in what the two add, these errors cancel.
"""

from collections.abc import Sequence

import numpy as np

from second_opinions.magnet_elements import assemble_regions
from second_opinions.two_bodies import TwoBodyMesh, mesh_with
from spinlev.fem.closed_forms.uniform import UniformField, remanent_field
from spinlev.fem.harmonics.expansion import moments_of_magnetization, polynomial_rule
from spinlev.fem.harmonics.interior import (
    Ball,
    dipole_sources,
    from_magnetization,
    interior_coefficients,
    multipole_force,
    multipole_torque,
)
from spinlev.fem.harmonics.solid import derivative, outer_sums
from spinlev.fem.mutual.response import Wrench, closed_dipoles
from spinlev.geometry.common import MU_0, Array
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.scene.floater import Floater


def solve_both_bodies(
    mesh: TwoBodyMesh, floater: Floater, position: Array, direction: Array, order: int = 3, degree: int = 12
) -> Wrench:
    """Force and torque on the floater.

    Parameters
    ----------
    mesh : of both bodies, the floater at `position` (3,) m
    direction : (3,) unit vector of its remanent polarisation
    degree : highest degree of multipoles about its centre
    """
    ball = Ball(np.asarray(position, float), floater.radius)
    names = [f"magnet{k}" for k in range(len(mesh.magnets))]
    permeability = {n: magnet.permeability_in_rotor for n, magnet in zip(names, mesh.magnets, strict=True)}
    permeability["floater"] = floater.recoil_permeability * np.eye(3)
    regions = assemble_regions(mesh.mesh, permeability, mesh.ball_radius, order)
    places, weights = mesh.to_meter(regions.points), regions.weights * mesh.unit**3
    mine = {name: regions.owner == k for k, name in enumerate(regions.names)}
    for name, magnet in zip(names, mesh.magnets, strict=True):
        places[mine[name]] = magnet.body.within(places[mine[name]])  # curved elements leave a round body by a little
    polarization = floater.remanence * np.asarray(direction, float)
    whole = dipole_sources(floater.moment * direction * (floater.recoil_permeability + 2) / 3, ball, 1)
    outer = [-derivative(whole, axis) for axis in range(3)]
    inside, rotor = mine["floater"], ~mine["floater"]
    from_rotor = remanent_field(mesh.magnets, places)
    field = from_rotor.copy()
    field[rotor] += outer_sums(outer, (places[rotor] - ball.center) / ball.radius)
    field[inside] -= polarization / 3
    induced = regions.magnetization(field)
    incident = interior_coefficients(lambda points: remanent_field(mesh.magnets, points), ball, degree)
    rest = weights[:, None] * (induced - regions.direct(from_rotor))
    incident += from_magnetization(places[rotor], rest[rotor], ball, degree)
    incident += from_magnetization(
        *closed_dipoles(mesh.magnets, [m.permeability_in_rotor - np.eye(3) for m in mesh.magnets]), ball, degree
    )
    sources = moments_of_magnetization(
        places[inside], weights[inside], induced[inside], ball.center, ball.radius, degree
    )
    sources[:2, :2] += whole
    return Wrench(multipole_force(incident, sources, ball), multipole_torque(incident, sources, ball))


def added_to_body(magnets: Sequence[Magnet], floater: Magnet, size: float = 0.2, order: int = 3) -> Wrench:
    """Force and torque on a floater of any shape by what rotor and floater induce in each other.

    Beyond those of what each is alone, with its own permeability.

    Parameters
    ----------
    magnets, floater : the rotor, and the floater as a magnet in its place
    size, order : of the elements, see `mesh_with`
    """
    mesh = mesh_with(magnets, floater.body, size)
    bodies = [*magnets, floater]
    names = [f"magnet{k}" for k in range(len(magnets))] + ["floater"]

    def induced(*responding: int) -> tuple[Array, Array, Array]:
        """Places (n, 3) m, whether they are the floater's, and μ0 M dV (n, 3) T m³ with these alone permeable."""
        permeability = [b.permeability_in_rotor if k in responding else np.eye(3) for k, b in enumerate(bodies)]
        regions = assemble_regions(mesh.mesh, dict(zip(names, permeability, strict=True)), mesh.ball_radius, order)
        places = mesh.to_meter(regions.points)
        for k, body in enumerate(bodies):
            # curved elements leave a round body by a little
            places[regions.owner == k] = body.body.within(places[regions.owner == k])
        field = remanent_field([bodies[k] for k in responding], places)
        moments = regions.magnetization(field) * (regions.weights * mesh.unit**3)[:, None]
        mine = regions.owner == len(magnets)
        return places, mine, moments

    rotor = range(len(magnets))
    places, mine, together = induced(*rotor, len(magnets))
    alone = induced(*rotor)[2] + induced(len(magnets))[2]
    rule, weights = polynomial_rule(floater.body, 20)
    own = rule, weights[:, None] * floater.polarization_in_rotor
    change = together - alone
    parts = [
        _on_dipoles(floater.body.center, places[mine], change[mine], *_field_of_magnets(magnets, places[mine])),
        _between(floater.body.center, (places[~mine], change[~mine]), own),
        _between(floater.body.center, (places[~mine], together[~mine]), (places[mine], together[mine])),
        _between(floater.body.center, (places[~mine], -alone[~mine]), (places[mine], alone[mine])),
    ]
    return Wrench(np.sum([p.force for p in parts], axis=0), np.sum([p.torque for p in parts], axis=0))


def _field_of_magnets(magnets: Sequence[Magnet], points: Array) -> tuple[Array, Array]:
    """B (n, 3) T and its gradient (n, 3, 3) T/m of the remanences."""
    parts = [UniformField(magnet).evaluate(points) for magnet in magnets]
    return sum(part[0] for part in parts), sum(part[1] for part in parts)


def _on_dipoles(center: Array, places: Array, moments: Array, field: Array, gradient: Array) -> Wrench:
    """Force, and torque about a centre, on μ0 M dV (n, 3) T m³ in a field with its gradient."""
    pulls = np.einsum("ni,nij->nj", moments, gradient) / MU_0
    turns = np.cross(moments, field) / MU_0 + np.cross(places - center, pulls)
    return Wrench(pulls.sum(axis=0), turns.sum(axis=0))


def _between(center: Array, sources: tuple[Array, Array], dipoles: tuple[Array, Array]) -> Wrench:
    """That on dipoles by sources, each places (n, 3) m and μ0 M dV (n, 3) T m³."""
    force, torque = np.zeros(3), np.zeros(3)
    for place, moment in zip(*dipoles, strict=True):
        d = place - sources[0]
        near = 1 / np.sqrt(np.sum(d * d, axis=1))
        along, ahead = np.sum(sources[1] * d, axis=1), d @ moment
        field = (3 * along * near**5) @ d - near**3 @ sources[1]
        pull = 3 * ((near**5 * along).sum() * moment + (near**5 * ahead) @ sources[1])
        pull += 3 * (near**5 * (sources[1] @ moment) - 5 * near**7 * along * ahead) @ d
        force += pull
        torque += np.cross(moment, field) + np.cross(place - center, pull)
    return Wrench(force / (4 * np.pi * MU_0), torque / (4 * np.pi * MU_0))
