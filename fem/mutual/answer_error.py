"""How far a `MutualTable` is from the magnetostatics of both bodies, by their gap."""

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import Array, Watch, places_off, watched
from ...geometry.bodies import Magnet
from ...geometry.scenes import Floater
from ..harmonics import Ball, field_at_center, gradient_at_center
from .answer_samples import places_around
from .degree_needed import enough_degree
from .forces import two_body
from .rotor_response import RotorResponse
from .table import MutualTable

GAPS, EACH = (0.03, 0.08, 0.16, 0.5, 1.5), 2
"""Gaps at which both are compared, in floater radii, and at how many poses for each magnet beside that at its pole."""
DEGREES, SERIES = 1e-4, 1e-5
"""Where the degrees and the series of both bodies end."""
SAFETY = 4.0
"""For the poses that were not looked at."""
ELEMENTS = 0.2
"""Error of finite elements by what those of one degree less differ from them; 0.1 to 0.13 were measured."""


def answers(
    table: MutualTable, places: Array, moments: Array, field: Array, gradient: Array
) -> tuple[Array, Array, Array]:
    """Energy (n,) J, force (n, 3) N and torque (n, 3) N m at places (n, 3) m of moments (n, 3) A m² in B0 and ∇B0."""
    alpha = table.polarizability
    energy, slope, _ = table.derivatives(places, moments + alpha * field)
    by_place, by_moment = slope[:, :3], slope[:, 3:]
    energy = energy - alpha / 2 * np.sum(field**2, axis=1)
    force = -by_place + alpha * np.einsum("ni,nij->nj", field - by_moment, gradient)
    return energy, force, -np.cross(moments, by_moment)


def answer_errors(
    table: MutualTable, coarse: RotorResponse, rotor: RotorResponse, floater: Floater, watch: Watch
) -> tuple[Array, Array]:
    """Gaps (k,) m, and the largest relative errors (k, 2) of force and torque found at poses with these gaps.

    Of the table against the finite elements of `rotor`, and of these by the `coarse` ones.
    """
    generator = np.random.default_rng(4)
    errors = []
    for gap in watched(GAPS, watch, "errors"):
        worst = np.zeros(2)
        anywhere = places_around(rotor.magnets, floater.radius, (gap,), EACH, 3)
        for place in (*anywhere, *_at_poles(rotor.magnets, (1 + gap) * floater.radius)):
            direction = generator.normal(size=3)
            direction /= np.linalg.norm(direction)
            degree = enough_degree(rotor.magnets, Ball(place, floater.radius), DEGREES)
            both = two_body(rotor, floater, place, direction, degree, SERIES)
            added = both.total - both.rigid
            rough = two_body(coarse, floater, place, direction, degree, SERIES)
            unsure = added - (rough.total - rough.rigid)
            field, gradient = field_at_center(both.own), gradient_at_center(both.own, floater.radius)
            _, force, torque = answers(
                table, place[None], floater.moment * direction[None], field[None], gradient[None]
            )
            missed = [
                np.linalg.norm(told - true) + ELEMENTS * np.linalg.norm(step)
                for told, true, step in zip(
                    (force[0], torque[0]), (added.force, added.torque), (unsure.force, unsure.torque), strict=True
                )
            ]
            arm = floater.radius * np.linalg.norm(added.force)
            sizes = np.linalg.norm(added.force), max(float(np.linalg.norm(added.torque)), 0.1 * float(arm))
            worst = np.maximum(worst, np.array(missed) / np.maximum(np.array(sizes), np.finfo(float).tiny))
        errors.append(SAFETY * worst)
    return np.array(GAPS) * floater.radius, np.array(errors)


def _at_poles(magnets: Sequence[Magnet], distance: float) -> list[Array]:
    """Places (3,) m at a distance (m) from where the magnets' remanence points, where no other magnet is nearer."""
    places = []
    for magnet in magnets:
        size = float(np.linalg.norm(magnet.polarization))
        if size:
            (place,) = places_off(magnet.body, magnet.polarization_in_rotor[None] / size, distance)
            if min(float(other.body.distance(place)) for other in magnets) > distance * (1 - 1e-6):
                places.append(place)
    return places
