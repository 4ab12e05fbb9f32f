"""What the answers of rotor and floater are at sampled places, by finite elements and exactly for the sphere."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ...geometry.common import MU_0, Array, Watch, watched
from ...geometry.magnets import Magnet
from ...geometry.scene.contents import Floater
from ...geometry.solids import places_off
from ..harmonics.interior import FOUR_PI, Ball, dipole_sources, field_at_center, from_magnetization, multipole_force
from ..harmonics.solid import Coefficients, derivative, factorials, outer_sums
from .grid import AnswerGrid, induced_sources, reflection
from .response import RotorResponse, direct_rule, enough_degree

ROTOR_GAPS, SPHERE_GAPS = (0.1, 0.16, 0.25, 0.4, 0.7, 1.2, 2.5), (0.08, 0.16, 0.3, 0.55, 0.95, 1.6, 2.8)
NEAR_GAPS = (0.1, 0.13, 0.16, 0.2, 0.25, 0.35, 0.5, 1.0)
"""Gaps between the bodies at which samples are taken, in floater radii; the last for several magnets."""
ALIKE = 1e-4
"""Part of the largest energy of a field in the magnets below which one counts as none: 6e-5 of an answer in contact."""
CHUNK = 512
"""Points in the magnets at once, so that the fields of all dipoles there take some megabytes."""
TAIL, MOST_ADDED, MOST_RETURNED = 1e-4, 16, 24
"""Part of the sphere's answer that the degrees left out may hold, and the most degrees of the small parts."""


def places_around(magnets: Sequence[Magnet], radius: float, gaps: Sequence[float], number: int, seed: int) -> Array:
    """Centres (n, 3) m of floaters at gaps (radii) from a magnet, `number` for each gap and magnet, where they fit."""
    generator, found = np.random.default_rng(seed), []
    for magnet in magnets:
        for gap in gaps:
            directions = generator.normal(size=(number, 3))
            directions /= np.linalg.norm(directions, axis=1)[:, None]
            found.append(places_off(magnet.body, directions, (1 + gap) * radius))
    return _clear(magnets, np.concatenate(found), (1 + min(gaps)) * radius)


def places_facing(magnets: Sequence[Magnet], radius: float, gaps: Sequence[float]) -> Array:
    """The same before the middles of faces and edges and the corners of the magnets; of a lone one, on one side."""
    ways = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    if len(magnets) == 1:
        ways = ways[len(ways) // 2 :]
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    found = [places_off(m.body, ways @ m.body.rotation.T, (1 + gap) * radius) for m in magnets for gap in gaps]
    return _clear(magnets, np.concatenate(found), (1 + min(gaps)) * radius)


def _clear(magnets: Sequence[Magnet], places: Array, distance: float) -> Array:
    """Those of the places (n, 3) m that are no nearer to any magnet than a distance, m."""
    nearest = np.min([magnet.body.distance(places) for magnet in magnets], axis=0)
    return np.asarray(places[nearest >= distance * (1 - 1e-6)])


def unit_dipole_fields(points: Array, places: Array) -> Array:
    """Fields (3 p, n, 3) T at points (n, 3) m of unit moments along x, y, z at each of the places (p, 3) m."""
    d = points - places[:, None]
    distance = np.linalg.norm(d, axis=2)[..., None]
    fields = [3 * d * d[..., a : a + 1] / distance**5 - np.eye(3)[a] / distance**3 for a in range(3)]
    return np.asarray(MU_0 / FOUR_PI * np.stack(fields, axis=1).reshape(-1, len(points), 3))


def answer_products(rotor: RotorResponse, fine: RotorResponse, places: Array, watch: Watch) -> tuple[Array, Array]:
    """(3 p, 3 p) J: twice minus the rotor's energy for unit dipoles at places (p, 3) m, in pairs; symmetric.

    The direct part, exact but for round-off, and what the magnets' own field adds, by the fine elements: those of
    degree 2 err by a twentieth of it, those of degree 3 by a hundredth.
    """
    direct = _direct(rotor.magnets, places)
    size = np.sqrt(np.diag(direct))
    return direct, size * size[:, None] * _beyond(rotor, fine, places, size, watch)


def _direct(magnets: Sequence[Magnet], places: Array) -> Array:
    """The products by the direct part of the magnetisation, exact but for round-off."""
    nearest = min(float(np.min(magnet.body.distance(places))) for magnet in magnets)
    points, tensors = direct_rule(magnets, nearest)
    products = np.zeros((3 * len(places), 3 * len(places)))
    for start in range(0, len(points), CHUNK):
        some = slice(start, start + CHUNK)
        fields = unit_dipole_fields(points[some], places)
        products += np.einsum("pni,qnj,nij->pq", fields, fields, tensors[some], optimize=True)
    return products / MU_0


def _beyond(rotor: RotorResponse, fine: RotorResponse, places: Array, size: Array, watch: Watch) -> Array:
    """The products by the rest, of unit dipoles over `size` (3 p,).

    Their fields in the magnets are sums of far fewer, which the coarse elements' points tell.
    """
    points, weights, _ = rotor.linear_response(direct=False)
    alike = np.zeros((len(size), len(size)))
    for start in range(0, len(points), CHUNK):
        some = slice(start, start + CHUNK)
        fields = unit_dipole_fields(points[some], places) * (np.sqrt(weights[some])[:, None] / size[:, None, None])
        rows = fields.reshape(len(size), -1)
        alike += rows @ rows.T
    values, vectors = np.linalg.eigh(alike)
    kept = values > ALIKE * values[-1]
    shares = vectors[:, kept] * np.sqrt(values[kept])
    points, weights, magnetized = fine.linear_response(direct=False)
    parts = np.zeros((shares.shape[1], *points.shape))
    for k, place in enumerate(places):
        own = np.arange(3 * k, 3 * k + 3)
        given = unit_dipole_fields(points, place[None]) / size[own, None, None]
        parts += np.einsum("ak,ani->kni", vectors[own][:, kept] / np.sqrt(values[kept]), given)
    answers = np.array([magnetized(part) for part in watched(parts, watch, "rotor's answer")])
    parts *= weights[:, None]
    found = parts.reshape(len(parts), -1) @ answers.reshape(len(parts), -1).T / MU_0
    return np.asarray(shares @ ((found + found.T) / 2) @ shares.T)


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


def sphere_samples(rotor: RotorResponse, floater: Floater, places: Array, watch: Watch) -> SphereSamples:
    """The sphere's answer, degree by degree, to the rotor's own field."""
    dipoles, rows = rotor.own_dipoles(), []
    for place in watched(places, watch, "floater's answer"):
        ball = Ball(place, floater.radius)
        own = _own_field(rotor, dipoles, ball, enough_degree(rotor.magnets, ball, TAIL))
        sources = induced_sources(own, floater.recoil_permeability)
        first = sources.copy()
        first[2:] = 0.0
        whole, uniform = multipole_force(own, sources, ball), multipole_force(own, first, ball)
        energies = _energies(own, floater)
        rows.append((-energies[2:].sum(), whole - uniform, energies.sum(), np.linalg.norm(whole)))
    energy, force, size, strength = (np.array(column) for column in zip(*rows, strict=True))
    return SphereSamples(places, energy, force, size, strength)


@dataclass(frozen=True, eq=False)
class ReturnedSamples:
    """What the rotor answers to the sphere's answer of degree 2 and more to the rotor's field, at places (n, 3).

    Parameters
    ----------
    places : m
    field, slope : (n, 3) T at the sphere's centre, and (n, 3, 3) T/m: its change as the sphere moves along x, y, z
    """

    places: Array
    field: Array
    slope: Array


def returned_samples(
    rotor: RotorResponse,
    floater: Floater,
    grids: Sequence[AnswerGrid],
    inner: Array,
    coupling: Array,
    places: Array,
    watch: Watch,
) -> ReturnedSamples:
    """The same from the points that answer for the rotor: to 2e-3 what its finite elements give from 1 mm off contact.

    The energy is -M·V of the moment M. A unit moment and the sphere's answer to B0 are sources, the rotor answers to
    both, and the sphere to its answer to the moment: the forces of the three are the derivatives of V.
    """
    dipoles, fields, slopes = rotor.own_dipoles(), [], []

    def high(incident: Coefficients) -> Coefficients:
        sources = induced_sources(incident, floater.recoil_permeability)
        sources[:2] = 0.0
        return sources

    for place in watched(places, watch, "rotor's answer to it"):
        ball = Ball(place, floater.radius)
        degree = min(enough_degree(rotor.magnets, ball, TAIL), MOST_RETURNED)
        own = _own_field(rotor, dipoles, ball, degree)
        back, slope = point_answer(grids, inner, coupling, high(own), ball), []
        for unit in np.eye(3):
            moment = dipole_sources(unit, ball, degree)
            answer = point_answer(grids, inner, coupling, moment, ball)
            pairs = (answer, high(own)), (back, moment), (own, high(answer))
            slope.append(np.sum([multipole_force(*pair, ball) for pair in pairs], axis=0))
        fields.append(field_at_center(back))
        slopes.append(slope)
    return ReturnedSamples(places, np.array(fields), np.array(slopes))


def point_answer(
    grids: Sequence[AnswerGrid], inner: Array, coupling: Array, sources: Coefficients, ball: Ball
) -> Coefficients:
    """Coefficients a_lm (T) of what the points of magnets, and magnets as a whole, send back to sources in a ball."""
    frames = [grid.box for grid in grids]
    points = [box.center + grid.points @ box.rotation.T for grid, box in zip(grids, frames, strict=True)]
    places = np.concatenate([*points, inner])
    fields = outer_sums([-derivative(sources, axis) for axis in range(3)], (places - ball.center) / ball.radius)
    *seen, whole = np.split(fields, np.cumsum([len(p) for p in points]))
    moments = [
        (b @ box.rotation * grid.strengths) @ box.rotation.T for grid, box, b in zip(grids, frames, seen, strict=True)
    ]
    moments.append((coupling @ whole.ravel()).reshape(-1, 3))
    return from_magnetization(places, MU_0 * np.concatenate(moments), ball, len(sources) - 1)


def _own_field(rotor: RotorResponse, dipoles: tuple[Array, Array], ball: Ball, degree: int) -> Coefficients:
    """Of the rotor; what its permeability adds to its remanence, by the dipoles, up to a degree of its own."""
    own = rotor.closed_field(ball, degree)
    size = min(degree, MOST_ADDED) + 1
    own[:size, :size] += from_magnetization(*dipoles, ball, size - 1)
    return own


def _energies(incident: Coefficients, floater: Floater) -> Array:
    """Minus the energy (l,) J of each degree of the sphere's answer."""
    degree = len(incident) - 1
    twice = np.where(np.arange(degree + 1), 2.0, 1.0)
    parts = (np.abs(incident) ** 2 / factorials(degree) * twice).sum(axis=1)
    scale = FOUR_PI * floater.radius**3 / MU_0 / 2
    return np.asarray(scale * reflection(floater.recoil_permeability, degree) * parts)
