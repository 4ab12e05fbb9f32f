"""How far a `MutualTable` is from the magnetostatics of both bodies, by their gap."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...geometry.common import Array, InputError, Watch, unwatched, watched
from ...geometry.magnets import Magnet
from ...geometry.scene.contents import Floater
from ...geometry.solids import Part, places_off
from ..cache import TableKind
from ..harmonics.interior import Ball, field_at_center, gradient_at_center
from ..rotor.pose import at_home
from .grid import IMAGES, POWERS, RETURNED, AnswerGrid, answer_box, image_weights, point_counts
from .response import RotorResponse, enough_degree, rotor_ladder, two_body
from .samples import (
    NEAR_GAPS,
    ROTOR_GAPS,
    SPHERE_GAPS,
    answer_products,
    places_around,
    places_facing,
    returned_samples,
    sphere_samples,
    unit_dipole_fields,
)
from .table import MANY, PARALLEL, MutualTable, classes, least_squares, returned_fit, sphere_fit

GAPS, PLACES_EACH = (0.03, 0.08, 0.16, 0.5, 1.5), 2
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
        anywhere = places_around(rotor.magnets, floater.radius, (gap,), PLACES_EACH, 3)
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


NEAREST = 0.16
"""Gap in floater radii from which on force and torque are to be met to 1e-3: 1 mm for the article's floater."""
PART = "a part from a STEP file, whose remanence has no closed form. Choose --interaction rigid, or give it a shape."
OBLIQUE = (
    "one with two permeabilities and an easy axis along none of its edges, which its points cannot answer with. Choose "
    "--interaction rigid, give it one recoil_permeability, or turn the body with its magnetisation."
)
EACH, EACH_OF_MANY = 16, 6
"""Places of dipoles for each gap and magnet; of rotors of `MANY` magnets."""
EQUATIONS, AT_ONE_PLACE, SPARSE, NEAR_SPARSE = 8000, 5.0, 12, 6
"""Pairs of dipoles that are fitted; how much those at one place count, which alone make the energy; and at one of so
many places the rotor's answer to the sphere's is."""
INNER = 2
"""Points along each axis at which magnets beside each other answer beyond their direct answer."""


def mutual_table(
    magnets: tuple[Magnet, ...], floater: Floater, order: int = 2, watch: Watch = unwatched
) -> MutualTable:
    """The answers of a rotor and a floater, by finite elements of a degree, with errors against the next.

    `watch` hears of the progress.

    Raises
    ------
    InputError : a magnet's permeability has other axes than its body, or it is a part from a file
    """
    started = time.perf_counter()
    rotor, fine = rotor_ladder(magnets, (order, order + 1))
    counts = [point_counts(answer_box(m.body), (1 + NEAREST) * floater.radius) for m in magnets]
    grids = [_empty(magnet, floater, n) for magnet, n in zip(magnets, counts, strict=True)]
    images = image_weights(floater.recoil_permeability) if floater.recoil_permeability != 1 else np.zeros(len(IMAGES))
    inner = [grid.inner(INNER if 1 < len(grids) < MANY else 1) for grid in grids]
    coupling = np.zeros([3 * sum(len(points) for points in inner)] * 2)
    pairs = mixed = np.zeros((len(grids), len(grids)))
    if rotor.regions is not None:
        places = places_around(magnets, floater.radius, ROTOR_GAPS, EACH if len(grids) < MANY else EACH_OF_MANY, 1)
        grids, coupling = _rotor_fit(grids, inner, magnets, *answer_products(rotor, fine, places, watch), places)
    if floater.recoil_permeability != 1:
        facing = places_facing(magnets, floater.radius, SPHERE_GAPS)
        places = np.concatenate([facing, places_around(magnets, floater.radius, SPHERE_GAPS, 60, 2)])
        near = places_around(magnets, floater.radius, NEAR_GAPS, 90, 3) if len(magnets) > 1 else places[:0]
        samples = sphere_samples(rotor, floater, np.concatenate([places, near]), watch)
        grids, pairs = sphere_fit(grids, images, samples)
        if rotor.regions is not None:
            fewer = np.concatenate([facing, places[len(facing) :: SPARSE], near[::NEAR_SPARSE]])
            returned = returned_samples(rotor, floater, grids, np.concatenate(inner), coupling, fewer, watch)
            grids, mixed = returned_fit(grids, inner, images, returned)
    table = MutualTable(magnets, tuple(grids), coupling, pairs, mixed, images, floater.polarizability)
    gaps, errors = answer_errors(table, rotor, fine, floater, watch)
    return replace(
        table, gaps=gaps, errors=errors, provenance={"order": order, "seconds": time.perf_counter() - started}
    )


def unanswered(magnet: Magnet) -> str:
    """Why a magnet's answer to the floater is not known, with the way out; empty where it is."""
    if isinstance(magnet.body, Part):
        return PART
    turn = magnet.box.rotation
    inside = turn.T @ magnet.permeability_in_rotor @ turn
    return OBLIQUE if np.abs(inside - np.diag(np.diag(inside))).max() > PARALLEL else ""


def _empty(magnet: Magnet, floater: Floater, counts: tuple[int, int, int]) -> AnswerGrid:
    size = float(np.linalg.norm(magnet.polarization))
    if reason := unanswered(magnet):
        raise InputError(
            "Input magnets must be of the kinds that answer to the floater where both magnetise each other; instead "
            f"one is {reason}"
        )
    count = int(np.prod(counts))
    axis = magnet.polarization / size if size else np.zeros(3)
    zeros = np.zeros((count, 3)), np.zeros((count, len(POWERS), 2)), np.zeros((count, len(RETURNED), 2))
    return AnswerGrid(answer_box(magnet.body), axis, floater.radius, counts, *zeros)


def _rotor_fit(
    grids: Sequence[AnswerGrid],
    inner: Sequence[Array],
    magnets: Sequence[Magnet],
    direct: Array,
    beyond: Array,
    places: Array,
) -> tuple[list[AnswerGrid], Array]:
    """Strengths and coupling that give the products of fields of dipoles with the answers to them.

    The direct answers by points of one weight for a class, which mirrors keep; the rest by these and the coupling.
    """
    size = 1 / np.sqrt(np.diag(direct))
    first, second = np.triu_indices(len(direct))
    if len(first) > EQUATIONS:
        chosen = np.random.default_rng(0).choice(len(first), EQUATIONS, replace=False)
        chosen = np.union1d(chosen, np.flatnonzero(first // 3 == second // 3))
        first, second = first[chosen], second[chosen]
    counts = np.where(first // 3 == second // 3, AT_ONE_PLACE, 1.0)
    columns, kinds = [], [classes(g, True)[:, : None if m.contrast else 0] for g, m in zip(grids, magnets, strict=True)]
    for grid, kind in zip(grids, kinds, strict=True):
        fields = unit_dipole_fields(grid.box.center + grid.points @ grid.box.rotation.T, places) @ grid.box.rotation
        fields *= size[:, None, None]
        columns += [(fields[first, :, a] * fields[second, :, a]) @ kind for a in range(3)]
    alone = np.concatenate(columns, axis=1)
    whole = (unit_dipole_fields(np.concatenate(inner), places) * size[:, None, None]).reshape(len(size), -1)
    a, b = np.triu_indices(whole.shape[1] if len(grids) > 1 else 0)
    together = whole[first][:, a] * whole[second][:, b] + (a != b) * whole[first][:, b] * whole[second][:, a]
    alone, together = alone * counts[:, None], together * counts[:, None]
    direct, beyond = (part[first, second] * size[first] * size[second] * counts for part in (direct, beyond))
    held = np.arange(alone.shape[1] + len(a)) >= alone.shape[1]
    found = least_squares(np.concatenate([alone, together], axis=1), beyond, held)
    found[: alone.shape[1]] += least_squares(alone, direct, held[: alone.shape[1]])
    weights, made = list(found), []
    for grid, kind in zip(grids, kinds, strict=True):
        parts = [kind @ np.array([weights.pop(0) for _ in range(kind.shape[1])]) for _ in range(3)]
        made.append(replace(grid, strengths=np.stack(parts, axis=1)))
    coupling = np.zeros((whole.shape[1], whole.shape[1]))
    coupling[a, b] = coupling[b, a] = weights
    return made, coupling


MUTUAL = TableKind("mutual", MutualTable, "Energies of the mutual magnetisation of a rotor and a sphere")


def cached_mutual_table(
    magnets: tuple[Magnet, ...], floater: Floater, report: Callable[[str], None], watch: Watch = unwatched
) -> tuple[MutualTable, bool]:
    """The answers of a rotor and a floater, see `mutual_table`, from the cache if they are there, and whether.

    A lone magnet answers in its own axes: one table serves it wherever it stands and however it is turned.
    """
    upright = at_home(magnets)
    inputs = upright, floater.radius, floater.remanence, floater.recoil_permeability
    table, found = MUTUAL.cached(inputs, lambda: mutual_table(upright, floater, watch=watch), report)
    return _posed(table, magnets), found


def _posed(table: MutualTable, magnets: tuple[Magnet, ...]) -> MutualTable:
    """The table of a lone upright magnet where the magnet is; that of several as it is."""
    if len(magnets) > 1:
        return table
    turns = [magnet.box.rotation for magnet in magnets]
    turn = np.kron(np.eye(len(table.coupling) // 3), turns[0]) if turns else np.zeros((0, 0))
    coupling = turn @ table.coupling @ turn.T
    grids = tuple(replace(grid, box=answer_box(magnet.body)) for grid, magnet in zip(table.grids, magnets, strict=True))
    return replace(table, magnets=magnets, grids=grids, coupling=coupling)


def mutual_key(magnets: tuple[Magnet, ...], floater: Floater) -> str:
    """SHA-256 of all that decides the answers, and of what computes them."""
    return MUTUAL.key(magnets, floater.radius, floater.remanence, floater.recoil_permeability)
