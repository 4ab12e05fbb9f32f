"""Responses of rotor and floater at sampled places: by charges on the magnets' surfaces, and exactly for the sphere."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from ...geometry.common import MU_0, Array, Watch, watched
from ...geometry.magnets import Magnet
from ...geometry.scene.floater import Floater
from ...geometry.solids import places_off
from ..closed_forms.potentials import unit_dipole_fields, unit_dipole_potentials
from ..harmonics.interior import Ball, dipole_sources, field_at_center, from_magnetization, multipole_force
from ..harmonics.solid import FOUR_PI, Coefficients, derivative, factorials, outer_sums
from .response import ChargeResponse, enough_degree
from .table import ResponseGrid, effort, induced_sources, reflection

ROTOR_GAPS, SPHERE_GAPS = (0.1, 0.16, 0.25, 0.4, 0.7, 1.2, 2.5), (0.08, 0.16, 0.3, 0.55, 0.95, 1.6, 2.8)
# Gaps between the bodies at which samples are taken, in floater radii; the last for several magnets
NEAR_GAPS = (0.1, 0.13, 0.16, 0.2, 0.25, 0.35, 0.5, 1.0)
CHUNK = 512  # points in the magnets at once, so that the fields of all dipoles there take some megabytes
# Part of the sphere's response that the degrees left out may hold, and the most degrees of the rotor's response to it
TAIL, MOST_RETURNED = 1e-4, 24


def places_around(magnets: Sequence[Magnet], radius: float, gaps: Sequence[float], number: int, seed: int) -> Array:
    """Centres (n, 3) m of floaters beside magnets, where they fit.

    Parameters
    ----------
    radius : of the floater, m
    gaps : from a magnet, in radii
    number, seed : of random directions for each gap and magnet
    """
    generator, found = np.random.default_rng(seed), []
    for magnet in magnets:
        for gap in gaps:
            directions = generator.normal(size=(number, 3))
            directions /= np.linalg.norm(directions, axis=1)[:, None]
            found.append(places_off(magnet.body, directions, (1 + gap) * radius))
    return _clear(magnets, np.concatenate(found), (1 + min(gaps)) * radius)


def places_facing(magnets: Sequence[Magnet], radius: float, gaps: Sequence[float]) -> Array:
    """Centres (n, 3) m of floaters before the middles of faces and edges and the corners of magnets, where they fit.

    Parameters
    ----------
    magnets : of a lone one, places on one side; of many, before the faces' middles alone
    radius, gaps : of the floater, m, and from a magnet, in radii
    """
    ways = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    if len(magnets) == 1:
        ways = ways[len(ways) // 2 :]
    if not effort(len(magnets)).corners:
        ways = ways[np.count_nonzero(ways, axis=1) == 1]
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    found = [places_off(m.body, ways @ m.body.rotation.T, (1 + gap) * radius) for m in magnets for gap in gaps]
    return _clear(magnets, np.concatenate(found), (1 + min(gaps)) * radius)


def _clear(magnets: Sequence[Magnet], places: Array, distance: float) -> Array:
    """Those of the places (n, 3) m that are no nearer to any magnet than a distance, m."""
    nearest = np.min([magnet.body.distance(places) for magnet in magnets], axis=0)
    return np.asarray(places[nearest >= distance * (1 - 1e-6)])


def response_products(rotor: ChargeResponse, places: Array) -> tuple[Array, Array]:
    """(3 p, 3 p) J: twice minus the rotor's energy for unit dipoles at places (p, 3) m, in pairs; symmetric.

    Parameters
    ----------
    rotor : that responds
    places : no nearer to the magnets than the floater's centre can be

    Returns
    -------
    The part of `ChargeResponse.direct`, and that of the charges beyond it.
    """
    nearest = min(float(np.min(magnet.body.distance(places))) for magnet in rotor.magnets)
    points, tensors = rotor.direct(nearest)
    direct = np.zeros((3 * len(places), 3 * len(places)))
    for start in range(0, len(points), CHUNK):
        some = slice(start, start + CHUNK)
        fields = unit_dipole_fields(points[some], places)
        direct += np.einsum("pni,qnj,nij->pq", fields, fields, tensors[some], optimize=True)
    charges = rotor.charges
    normal = np.einsum("pni,ni->np", unit_dipole_fields(charges.places, places), charges.normals)
    # ∫ M·b dV = -∮ σ ψ dS
    found = -unit_dipole_potentials(charges.places, places).T @ (charges.areas[:, None] * rotor.beyond(normal))
    return direct / MU_0, (found + found.T) / (2 * MU_0)


def sphere_samples(rotor: ChargeResponse, floater: Floater, places: Array, watch: Watch) -> list[Array]:
    """The sphere's response, degree by degree, to the rotor's own field.

    Parameters
    ----------
    rotor, floater : each alone
    places : (n, 3) m of the floater's centre
    watch : called with the progress

    Returns
    -------
    Energy (n,) J and force (n, 3) N of the response of degree 2 and more, and the sizes (n,) of those of the whole
    """
    rows = []
    for place in watched(places, watch, "induced magnetisation of the floater"):
        ball = Ball(place, floater.radius)
        own = rotor.own_field(ball, enough_degree(rotor.magnets, ball, TAIL))
        degree, sources = len(own) - 1, induced_sources(own, floater.recoil_permeability)
        first = sources.copy()
        first[2:] = 0.0
        whole, uniform = multipole_force(own, sources, ball), multipole_force(own, first, ball)
        # minus the energy of each degree: half of (4π R³/μ0) t_l Σ_m |a_lm|²/((l-m)! (l+m)!), m of both signs
        twice = np.where(np.arange(degree + 1), 2.0, 1.0)
        square = (np.abs(own) ** 2 / factorials(degree) * twice).sum(axis=1)
        scale = FOUR_PI * floater.radius**3 / MU_0 / 2
        energies = scale * reflection(floater.recoil_permeability, degree) * square
        rows.append((-energies[2:].sum(), whole - uniform, energies.sum(), np.linalg.norm(whole)))
    return [np.array(column) for column in zip(*rows, strict=True)]


def returned_samples(
    rotor: ChargeResponse,
    floater: Floater,
    grids: Sequence[ResponseGrid],
    inner: Array,
    coupling: Array,
    places: Array,
    watch: Watch,
) -> tuple[Array, Array]:
    """The rotor's response to the sphere's response of degree 2 and more to the rotor's field.

    By the points that respond for the rotor: to 2e-3 what it gives itself from 1 mm off contact.

    The energy is -M·V of the moment M. A unit moment and the sphere's response to B0 are sources, the rotor responds to
    both, and the sphere to its response to the moment: the forces of the three are the derivatives of V.

    Parameters
    ----------
    rotor, floater : each alone
    grids, inner, coupling : points (n, 3) m and weights that respond for the rotor, see `MutualTable`
    places : (n, 3) m of the floater's centre
    watch : called with the progress

    Returns
    -------
    (n, 3) T at the sphere's centre, and (n, 3, 3) T/m: its change as the sphere moves along x, y, z
    """
    fields, slopes = [], []

    def high(incident: Coefficients) -> Coefficients:
        sources = induced_sources(incident, floater.recoil_permeability)
        sources[:2] = 0.0
        return sources

    for place in watched(places, watch, "rotor's response to it"):
        ball = Ball(place, floater.radius)
        degree = min(enough_degree(rotor.magnets, ball, TAIL), MOST_RETURNED)
        own = rotor.own_field(ball, degree)
        back, slope = point_response(grids, inner, coupling, high(own), ball), []
        for unit in np.eye(3):
            moment = dipole_sources(unit, ball, degree)
            answer = point_response(grids, inner, coupling, moment, ball)
            pairs = (answer, high(own)), (back, moment), (own, high(answer))
            slope.append(np.sum([multipole_force(*pair, ball) for pair in pairs], axis=0))
        fields.append(field_at_center(back))
        slopes.append(slope)
    return np.array(fields), np.array(slopes)


def point_response(
    grids: Sequence[ResponseGrid], inner: Array, coupling: Array, sources: Coefficients, ball: Ball
) -> Coefficients:
    """Coefficients a_lm (T) of what the points of magnets, and magnets as a whole, send back to sources in a ball.

    Parameters
    ----------
    grids : of the magnets
    inner, coupling : (k, 3) m and (3k, 3k) A m²/T, for the magnets as a whole
    sources, ball : c_lm (T) and the ball in which they are
    """
    places = np.concatenate([*(grid.places for grid in grids), inner])
    fields = outer_sums([-derivative(sources, axis) for axis in range(3)], (places - ball.center) / ball.radius)
    *seen, whole = np.split(fields, np.cumsum([len(grid.points) for grid in grids]))
    frames = [grid.box.rotation for grid in grids]
    moments = [(b @ r * grid.strengths) @ r.T for grid, r, b in zip(grids, frames, seen, strict=True)]
    moments.append((coupling @ whole.ravel()).reshape(-1, 3))
    return from_magnetization(places, MU_0 * np.concatenate(moments), ball, len(sources) - 1)
