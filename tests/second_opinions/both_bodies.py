"""Rotor and floater meshed together and solved at once: an independent check of `two_body`.

Nothing is known beforehand of the sphere's answer and no series is summed: H0 is the closed form of both remanent
polarisations, and one finite-element solution gives the magnetisation that the permeability adds in either body.
"""

import numpy as np

from second_opinions.magnet_elements import assemble_regions
from second_opinions.two_bodies import TwoBodyMesh
from spinlev.fem.closed_forms.uniform import remanent_field
from spinlev.fem.harmonics.expansion import moments_of_magnetization
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
from spinlev.geometry.common import Array
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
