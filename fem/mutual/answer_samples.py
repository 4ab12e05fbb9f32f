"""What the answers of rotor and floater are at sampled places, by finite elements and exactly for the sphere."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import MU_0, Array, places_off
from ...geometry.bodies import Magnet
from ...geometry.scenes import Floater
from ..closed_forms import remanent_field
from ..harmonics import (
    FOUR_PI,
    Ball,
    Coefficients,
    factorials,
    from_magnetization,
    interior_coefficients,
    multipole_force,
)
from .degree_needed import enough_degree
from .permeable_sphere import induced_sources, reflection
from .rotor_response import RotorResponse

ROTOR_GAPS, SPHERE_GAPS = (0.1, 0.25, 0.6, 1.2, 2.5), (0.08, 0.16, 0.3, 0.55, 0.95, 1.6, 2.8)
"""Gaps between the bodies at which samples are taken, in floater radii."""
TAIL = 1e-4
"""Part of the sphere's answer that the degrees left out may hold."""


def places_around(magnets: Sequence[Magnet], radius: float, gaps: Sequence[float], number: int, seed: int) -> Array:
    """Centres (n, 3) m of floaters at gaps (radii) from a magnet, `number` for each gap and magnet, where they fit."""
    generator, found = np.random.default_rng(seed), []
    for magnet in magnets:
        for gap in gaps:
            directions = generator.normal(size=(number, 3))
            directions /= np.linalg.norm(directions, axis=1)[:, None]
            found.append(places_off(magnet.body, directions, (1 + gap) * radius))
    places = np.concatenate(found)
    clear = np.min([magnet.body.distance(places) for magnet in magnets], axis=0) >= (1 + min(gaps)) * radius * (
        1 - 1e-6
    )
    return np.asarray(places[clear])


def unit_dipole_fields(points: Array, places: Array) -> Array:
    """Fields (3 p, n, 3) T at points (n, 3) m of unit moments along x, y, z at each of the places (p, 3) m."""
    d = points - places[:, None]
    distance = np.linalg.norm(d, axis=2)[..., None]
    fields = [3 * d * d[..., a : a + 1] / distance**5 - np.eye(3)[a] / distance**3 for a in range(3)]
    return np.asarray(MU_0 / FOUR_PI * np.stack(fields, axis=1).reshape(-1, len(points), 3))


def answer_products(rotor: RotorResponse, places: Array) -> Array:
    """(3 p, 3 p) J: twice minus the rotor's energy for unit dipoles at places (p, 3) m, in pairs; symmetric."""
    points, weights, magnetized = rotor.linear_response()
    fields = unit_dipole_fields(points, places)
    answers = np.array([magnetized(given) for given in fields])
    return np.asarray(np.einsum("pni,qni,n->pq", fields, answers, weights, optimize=True) / MU_0)


@dataclass(frozen=True, eq=False)
class SphereSamples:
    """The sphere's answer to the rotor's field at places (n, 3).

    Parameters
    ----------
    places : m
    energy, force : (n,) J and (n, 3) N of the answer of degree 2 and more
    energy_size, force_size : (n,) of the whole answer
    """

    places: Array
    energy: Array
    force: Array
    energy_size: Array
    force_size: Array


def sphere_samples(rotor: RotorResponse, floater: Floater, places: Array) -> SphereSamples:
    """The sphere's answer, degree by degree, to the rotor's own field."""
    dipoles, rows = rotor.own_dipoles(), []
    for place in places:
        ball = Ball(place, floater.radius)
        degree = int(np.clip(enough_degree(rotor.magnets, ball, TAIL), 8, 16))
        own = interior_coefficients(lambda points: remanent_field(rotor.magnets, points), ball, degree)
        own = own + from_magnetization(*dipoles, ball, degree)
        sources = induced_sources(own, floater.recoil_permeability)
        first = sources.copy()
        first[2:] = 0.0
        whole, uniform = multipole_force(own, sources, ball), multipole_force(own, first, ball)
        energies = _energies(own, floater)
        rows.append((-energies[2:].sum(), whole - uniform, energies.sum(), np.linalg.norm(whole)))
    energy, force, size, strength = (np.array(column) for column in zip(*rows, strict=True))
    return SphereSamples(places, energy, force, size, strength)


def _energies(incident: Coefficients, floater: Floater) -> Array:
    """Minus the energy (l,) J of each degree of the sphere's answer."""
    degree = len(incident) - 1
    twice = np.where(np.arange(degree + 1), 2.0, 1.0)
    parts = (np.abs(incident) ** 2 / factorials(degree) * twice).sum(axis=1)
    scale = FOUR_PI * floater.radius**3 / MU_0 / 2
    return np.asarray(scale * reflection(floater.recoil_permeability, degree) * parts)
