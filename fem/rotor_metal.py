"""From magnets and conductors that turn with the rotor to the table of their losses."""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import scipy

from ...geometry.basics import Array, Box, InputError, Ring, Solid, Watch, places_off, unwatched, watched
from ...geometry.bodies import Conductor, Magnet, cut_magnets, separate_pieces
from ..plate_tables import Multipoles, fit_multipoles
from .current_patterns import CurrentPatterns, current_patterns
from .dipole_potentials import of_motion
from .metal_currents import Metal, metal_of
from .table import RotorLosses

ORDER = 5
"""Degree of the elements."""
LEFT_OUT = 1e-2
"""Part of the dissipation that may be left out where the floater touches; far less elsewhere."""
FIT = 1e-2
"""Relative error of the fields c_k there."""
DEGREE = 10
"""Of the multipoles."""
NOISE = 3e-3
"""Entries of unit columns below this come from elements that are not as symmetric as the bodies."""
SHELLS = (1.0, 1.5, 2.5, 5.0)
"""Distances from the rotor at which fields are fitted, over that in contact."""
CHECKED = (1.0, 1.5, 2.0, 3.0, 5.0)
"""The same for the errors that are stated; between them errors are interpolated."""
DIRECTIONS = 18
"""In which places are looked for from each body, in an octant: with their mirror images, as most rotors have them."""
POSES = 8
"""At each of these distances."""
Pieces = list[tuple[tuple[Solid, ...], float]]
"""Bodies that are one piece of metal, and its conductivity in S/m."""


def pieces_of(rotor: Sequence[Magnet], conductors: Sequence[Conductor]) -> Pieces:
    """The pieces of metal in which currents are modelled.

    No current flows from one to another: magnets are coated and glued, and conductors of unlike metal are joined by
    films.  Conductors that touch and have the same conductivity are one piece.
    """
    magnets: Pieces = [((magnet.body,), magnet.conductivity) for magnet in rotor if magnet.conductivity]
    groups = separate_pieces(conductors)
    return [*magnets, *((tuple(part.body for part in group), group[0].conductivity) for group in groups)]


def rotor_losses(
    rotor: Sequence[Magnet],
    conductors: Sequence[Conductor],
    nearest: float,
    directions: int = DIRECTIONS,
    watch: Watch = unwatched,
) -> RotorLosses:
    """Table of the dissipation for a floater whose centre is at least `nearest` (m) from every face.

    It is fitted in so many `directions` of each octant; `watch` hears of the progress.

    Raises
    ------
    ValueError : nothing conducts
    InputError : a ring conducts into whose hole the floater fits
    TooLargeError : the memory does not hold the finite elements
    """
    start, pieces = time.perf_counter(), pieces_of(rotor, conductors)
    if not pieces:
        raise ValueError("Input rotor must have a conductivity; instead neither magnets nor conductors have one.")
    for group, _ in pieces:
        _refuse_wide_holes(group, nearest)
    bodies: list[Solid] = [magnet.body for magnet in rotor] + [conductor.body for conductor in conductors]
    around = partial(places_around, bodies, directions=directions)
    metals = [metal_of(group, conductivity, ORDER) for group, conductivity in pieces]
    found = current_patterns(metals, around(nearest), LEFT_OUT, watch)
    places = np.concatenate([around(share * nearest) for share in SHELLS])
    values = found.fields(places, watch)
    scale = 1 / np.linalg.norm(values, axis=(0, 2))
    choice = _candidates([body for group, _ in pieces for body in group], nearest)
    fit = fit_multipoles(choice, places, values, np.ones(found.count), scale, FIT, lambda _: True)
    finer = [metal_of(group, conductivity, ORDER + 1) for group, conductivity in pieces]
    table = RotorLosses(fit.multipoles, sparse(fit.weights), nearest * np.array(CHECKED), np.zeros(len(CHECKED)))
    distances = watched(table.distances, watch, "errors")
    errors = [_error(table, finer, around(distance, seed=1)) for distance in distances]
    return replace(table, errors=np.array(errors), provenance=_made(found, start))


def _refuse_wide_holes(bodies: Sequence[Solid], nearest: float) -> None:
    """Refuse rings that the floater fits into: the multipoles lie in their holes, where their fields have no end."""
    for body in bodies:
        if isinstance(body, Ring) and body.inner_radius > nearest:
            raise InputError(
                f"Input conductivity_S_m must be left out of a ring into whose hole the floater fits; instead received "
                f"a {body.described_size} beside a floater of {2e3 * nearest:.4g} mm. Leave it out, or make the ring "
                "of cuboids."
            )


def sparse(weights: Array) -> Array:
    """Weights (K, J) with the same WᵀW, and zeros where symmetry and a triangle allow them.

    Any orthogonal mix of the fields gives the same dissipation; that of a QR decomposition has the fewest terms.
    """
    _, triangle, order = scipy.linalg.qr(weights / np.linalg.norm(weights, axis=0), mode="economic", pivoting=True)
    small = np.abs(triangle) < NOISE
    found = np.zeros_like(triangle)
    found[:, order] = np.where(small, 0.0, triangle)
    return np.asarray(found * np.linalg.norm(weights, axis=0))


def places_around(bodies: Sequence[Solid], distance: float, seed: int = 0, directions: int = DIRECTIONS) -> Array:
    """Places (n, 3) m at a `distance` (m) from the nearest face of the bodies, all around them."""
    octant = np.abs(np.random.default_rng(seed).normal(size=(directions, 3)))
    mirrored = np.concatenate([octant * signs for signs in product((1, -1), repeat=3)])
    mirrored /= np.linalg.norm(mirrored, axis=1)[:, None]
    places = np.concatenate([places_off(body, mirrored @ body.rotation.T, distance) for body in bodies])
    clear = np.min([body.distance(places) for body in bodies], axis=0)
    return np.asarray(places[clear > distance * (1 - 1e-6)])


def _candidates(bodies: Sequence[Solid], nearest: float) -> Multipoles:
    """Multipoles about the middles of parts of the bodies so compact that their expansions converge."""
    boxes = [Magnet(Box(body.size, body.center, body.rotation), np.zeros(3)) for body in bodies]
    centers = [part.box.center for parts in cut_magnets(boxes, nearest) for part in parts]
    kinds = [(l, m, part) for l in range(1, DEGREE + 1) for m in range(l + 1) for part in (0, 1)[: 1 + (m > 0)]]
    pairs = list(product(centers, kinds))
    return Multipoles(np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs], float), nearest)


def _error(table: RotorLosses, metals: Sequence[Metal], places: Array) -> float:
    """Largest error of D over its size, displacements by the distance of a centimetre and turns alike."""
    unit = np.repeat([1.0, 1e-2], 3)  # 1 cm: about a place's distance from the currents
    worst = 0.0
    generator = np.random.default_rng(2)
    for place in generator.permutation(places)[:POSES]:
        moment = generator.normal(size=3)
        exact = sum(metal.dissipation(of_motion(place, moment)) for metal in metals)
        missed = (table.dissipation(place[None], moment[None])[0] - exact) / unit[:, None] / unit
        worst = max(worst, float(np.linalg.norm(missed) / np.linalg.norm(exact / unit[:, None] / unit)))
    return worst


def _made(patterns: CurrentPatterns, start: float) -> dict[str, str | float]:
    return {
        "elements": sum(int(metal.mesh.mesh.ne) for metal in patterns.metals),
        "order": ORDER,
        "unknowns": sum(int(metal.space.ndof) for metal in patterns.metals),
        "seconds": time.perf_counter() - start,
    }
