"""Making of a `MutualTable`: fits to what charges on surfaces give, and its error by the gap of the bodies."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
import scipy

from ...geometry.common import Array, InputError, Watch, unwatched, watched
from ...geometry.cutting import united
from ...geometry.magnets import Magnet
from ...geometry.scene.floater import Floater
from ...geometry.shapes import Box, Cylinder
from ...geometry.solids import Part, places_off
from ..cache import TableKind
from ..closed_forms.potentials import unit_dipole_fields
from ..elements.surface import gap as gap_of
from ..harmonics.interior import Ball, field_at_center, gradient_at_center
from ..rotor.table import alike
from . import response, table as formulas
from .response import ChargeResponse
from .table import PARALLEL, Grids, MutualTable, ResponseGrid, effort

# Relative size of a singular value that is none, for so many weights. No QR with pivots: derivatives would jump.
SMALL, FEW_WEIGHTS = 1e-9, 500
# What a weight costs that is held, by an error of the size of all that is fitted, and one that is not; where there are
# not `ENOUGH` values for each of these they run wild between the samples (errors of 7000 instead of 0.4 were seen)
PENALTY, FREE, FEW, ENOUGH = 1e-3, 1e-6, 1e-2, 15
# Points along an edge where there are several magnets: between the samples of some hundred places more run wild
MOST = 8
# Rows of equations at once, and places beside all points: all would take hundreds of megabytes
CHUNK, BESIDE = 512, 128
# Points of cuboids beside each other, up to which each has a weight of its own; in round magnets that gains nothing
SINGLE = 250
GAPS = (0.03, 0.08, 0.16, 0.5, 1.5)  # at which both are compared, in floater radii
# Of dipoles whose responses are fitted; with 200 a ring beside a block errs by 22 near contact, with 250 by 3
MOST_PLACES = 250
MEANS = 0.2  # of what is added, by the difference of two permeabilities whose mean the charges have: 0.09 measured
CHARGED = 1.0  # error of the finer charges by what the coarser ones differ from them


def mutual_errors(
    table: MutualTable, coarse: ChargeResponse, rotor: ChargeResponse, floater: Floater, watch: Watch
) -> tuple[Array, Array]:
    """Gaps (k,) m, and the largest relative errors (k, 2) of force and torque of `table` found at poses there.

    `coarse` and `rotor`, of two numbers of nodes, tell their error of the response to `floater`; `watch` gets progress.
    """
    generator = np.random.default_rng(4)
    apart = max(float(np.ptp(np.linalg.eigvalsh(m.permeability_in_rotor))) for m in rotor.magnets)
    errors, taken = [], effort(len(rotor.magnets))
    for gap in watched(GAPS, watch, "error estimate"):
        worst = np.zeros(2)
        anywhere = response.places_around(rotor.magnets, floater.radius, (gap,), taken.poses, 3)
        for place in (*anywhere, *_at_poles(rotor.magnets, (1 + gap) * floater.radius)):
            direction = generator.normal(size=3)
            direction /= np.linalg.norm(direction)
            degree = response.enough_degree(rotor.magnets, Ball(place, floater.radius), taken.degrees)
            both = response.two_body(rotor, floater, place, direction, degree, taken.series)
            added, unsure = both.total - both.rigid, both.differing(coarse)
            field, gradient = field_at_center(both.own), gradient_at_center(both.own, floater.radius)
            _, force, torque = table.added(place[None], floater.moment * direction[None], field[None], gradient[None])
            true, step = (np.array([one.force, one.torque]) for one in (added, unsure))
            missed, steps, sizes = (
                np.linalg.norm(part, axis=1) for part in (np.concatenate([force, torque]) - true, step, true)
            )
            sizes[1] = max(sizes[1], 0.1 * floater.radius * sizes[0])
            worst = np.maximum(worst, (missed + CHARGED * steps) / np.maximum(sizes, np.finfo(float).tiny))
        errors.append(taken.safety * worst + MEANS * apart)
    return np.array(GAPS) * floater.radius, np.array(errors)


def _at_poles(magnets: Sequence[Magnet], distance: float) -> list[Array]:
    """Places (3,) m at a distance (m) from where the magnets' remanence points, where no other magnet is nearer."""
    places = []
    for magnet in magnets:
        if size := float(np.linalg.norm(magnet.polarization)):
            (place,) = places_off(magnet.body, magnet.polarization_in_rotor[None] / size, distance)
            if min(float(other.body.distance(place)) for other in magnets) > distance * (1 - 1e-6):
                places.append(place)
    return places


# Gap of magnets, in the smallest edge of both, from which on a point of each is enough for what it does as a whole
APART = 0.8
# Gap in floater radii from which on force and torque are to be met to 1e-3: 1 mm for the article's floater
NEAREST = 0.16
PART = "a part from a STEP file, whose remanence has no closed form. Choose --interaction rigid, or give it a shape."
OBLIQUE = (
    "one with two permeabilities and an easy axis along none of its edges, which its points cannot follow. Choose "
    "--interaction rigid, give it one recoil_permeability, or turn the body with its magnetisation."
)
# Pairs of fitted dipoles, of one magnet and of several; weight of those at one place; strides of samples that return
EQUATIONS, AT_ONE_PLACE, SPARSE, NEAR_SPARSE, FACING = (8000, 5000), 5.0, 6, 6, 3
# Places at each of `SPHERE_GAPS` and `NEAR_GAPS`: of one magnet, of two with a weight for each point, and of others
SAMPLES = np.array([[30, 0], [120, 180], [60, 90]])
# Samples by `ENOUGH` for two magnets with a weight for each point, and by all: with fewer these are wild near contact
SPARE, LEAST = 1.1, 0.5


def mutual_table(
    magnets: tuple[Magnet, ...], floater: Floater, watch: Watch = unwatched, like: MutualTable | None = None
) -> MutualTable:
    """Mutual magnetisation of `magnets` and a spherical `floater`, whose radius, remanence and permeability count.

    They respond at as many points as those of a table they are `like`; left out, at as many as the accuracy needs.
    `watch` is called with the progress. Raises InputError: a permeability has other axes than its body, or a part from
    a file.
    """
    started, magnets, grids = time.perf_counter(), united(magnets), list[ResponseGrid]()
    for k, magnet in enumerate(magnets):
        if reason := without_response(magnet):
            raise InputError(
                "Input magnets must be of the kinds that respond to the floater where both magnetise each other; "
                f"instead one is {reason}"
            )
        box, size = formulas.response_box(magnet.body), float(np.linalg.norm(magnet.polarization))
        counts = like.grids[k].counts if like else _counts(magnet, floater.radius, len(magnets))
        axis = magnet.polarization / size if size else np.zeros(3)
        # where the floater can be in a ring's hole, no point is: with them weights run wild again, errors of 21
        hole = magnet.body.inner_radius if isinstance(magnet.body, Cylinder) else 0.0
        hole = hole if hole > floater.radius else 0.0
        n = len(formulas.response_points(box, counts, hole))
        zeros = np.zeros((n, 3)), np.zeros((n, len(formulas.POWERS), 2)), np.zeros((n, len(formulas.RETURNED), 2))
        grids.append(ResponseGrid(box, axis, floater.radius, counts, *zeros, hole))
    taken = effort(len(magnets))
    coarse, rotor = (ChargeResponse(magnets, nodes, min(nodes, response.OWN)) for nodes in taken.nodes)
    images = formulas.image_weights(floater.recoil_permeability)
    number = like.inner if like else _inner(grids, magnets)
    inner = [grid.inner(number) for grid in grids]
    coupling = np.zeros([3 * sum(len(points) for points in inner)] * 2)
    pairs = mixed = np.zeros((len(grids), len(grids)))
    if rotor.permeable:
        places = response.places_around(magnets, floater.radius, response.ROTOR_GAPS, taken.dipoles, 1)
        places = places[:: max(1, -(-len(places) // MOST_PLACES))]
        grids, coupling = _rotor_fit(grids, inner, magnets, *response.response_products(rotor, places), places)
    if floater.recoil_permeability != 1:
        distances = response.SPHERE_GAPS
        facing = response.places_facing(magnets, floater.radius, distances)
        cuboids = 1 < len(magnets) < formulas.MANY and all(isinstance(magnet.body, Box) for magnet in magnets)
        single = cuboids and sum(len(grid.points) for grid in grids) <= SINGLE
        kind = 0 if len(magnets) == 1 else 1 if single and len(magnets) == 2 else 2
        around, beside = SAMPLES[kind] // len(magnets)
        places = response.places_around(magnets, floater.radius, distances, around, 2)
        near = response.places_around(magnets, floater.radius, response.NEAR_GAPS, beside, 3)
        if kind == 1:
            share = max(_enough_samples(grids, len(facing)) / (len(places) + len(near)), LEAST)
            places, near = (part[np.arange(0, len(part), max(1.0, 1 / share)).astype(int)] for part in (places, near))
        places = np.concatenate([facing, places])
        both = np.concatenate([places, near])
        grids, pairs = sphere_fit(grids, single, images, both, response.sphere_samples(rotor, floater, both, watch))
        if rotor.permeable:
            before = facing[:: FACING if len(magnets) > 1 else 1]
            fewer = np.concatenate([before, places[len(facing) :: SPARSE], near[::NEAR_SPARSE]])
            returned = response.returned_samples(rotor, floater, grids, np.concatenate(inner), coupling, fewer, watch)
            grids, mixed = returned_fit(grids, single, inner, images, fewer, returned)
    table = MutualTable(magnets, tuple(grids), coupling, pairs, mixed, images, floater.polarizability)
    gaps, errors = mutual_errors(table, coarse, rotor, floater, watch)
    return replace(table, gaps=gaps, errors=errors, provenance={"seconds": time.perf_counter() - started})


def _enough_samples(grids: Grids, facing: int) -> float:
    """Places beside those `facing` the magnets that do for the weights of both `_fitted`."""
    free = SPARE * ENOUGH * sum(_classes(grid).shape[1] for grid in grids)
    # of the sphere's response four values a place for two weights a power; of what returns twelve at fewer places
    direct = 2 * len(formulas.POWERS) / 4 * free - facing
    return float(max(direct, SPARSE * (2 * len(formulas.RETURNED) / 12 * free - facing / FACING)))


def _counts(magnet: Magnet, radius: float, number: int) -> tuple[int, int, int]:
    enough = formulas.point_counts(formulas.response_box(magnet.body), (1 + NEAREST) * radius, effort(number).digits)
    x, y, z = enough if number == 1 else np.minimum(enough, MOST).tolist()
    return x, y, z


def _inner(grids: Grids, magnets: Sequence[Magnet]) -> int:
    """Points along each axis of a magnet for what it does as a whole: of a ring two, as one would be in its hole."""
    near = any(gap_of(*pair) < APART for pair in combinations([magnet.body for magnet in magnets], 2))
    number = effort(len(magnets)).inner if near else 1
    return max(number, 2) if len(grids) > 1 and any(grid.hole for grid in grids) else number


def all_points(magnets: Sequence[Magnet], radius: float) -> int:
    """Points in all `magnets` of a table for a floater of this `radius`, m."""
    magnets = united(magnets)
    return sum(int(np.prod(_counts(magnet, radius, len(magnets)))) for magnet in magnets)


def without_response(magnet: Magnet) -> str:
    """Why a magnet's response to the floater is not computed, with the way out; empty where it is."""
    if isinstance(magnet.body, Part):
        return PART
    turn = magnet.box.rotation
    inside = turn.T @ magnet.permeability_in_rotor @ turn
    return OBLIQUE if np.abs(inside - np.diag(np.diag(inside))).max() > PARALLEL else ""


def _rotor_fit(
    grids: Grids, inner: Sequence[Array], magnets: Sequence[Magnet], direct: Array, beyond: Array, places: Array
) -> tuple[list[ResponseGrid], Array]:
    """Strengths λ and coupling that give the products of dipoles' fields with the responses to them.

    `direct`, by points of one weight for a class; what is `beyond` by these and the coupling. At places (p, 3) m, (3 p,
    3 p) J.
    """
    size = 1 / np.sqrt(np.diag(direct))
    first, second = np.triu_indices(len(direct))
    if len(first) > (most := EQUATIONS[len(grids) > 1]):
        chosen = np.random.default_rng(0).choice(len(first), most, replace=False)
        chosen = np.union1d(chosen, np.flatnonzero(first // 3 == second // 3))
        first, second = first[chosen], second[chosen]
    counts = np.where(first // 3 == second // 3, AT_ONE_PLACE, 1.0)
    columns, kinds = [], [classes(g, True)[:, : None if m.contrast else 0] for g, m in zip(grids, magnets, strict=True)]
    rows = [slice(start, start + CHUNK) for start in range(0, len(first), CHUNK)]
    for grid, kind in zip(grids, kinds, strict=True):
        fields = unit_dipole_fields(grid.places, places) * size[:, None, None]
        for axis in grid.box.rotation.T:
            along = fields @ axis
            columns.append(np.concatenate([(along[first[some]] * along[second[some]]) @ kind for some in rows]))
    whole = (unit_dipole_fields(np.concatenate(inner), places) * size[:, None, None]).reshape(len(size), -1)
    # a lone magnet's points do it alone; the coupling is symmetric, and counted once
    a, b = np.triu_indices(whole.shape[1] if len(grids) > 1 else 0)
    direct, beyond = (part[first, second] * size[first] * size[second] * counts for part in (direct, beyond))
    alone = np.concatenate(columns, axis=1) * counts[:, None]
    ends, number = np.cumsum([column.shape[1] for column in columns]), alone.shape[1]
    if len(a):
        square, right = np.zeros([number + len(a)] * 2, order="F"), np.zeros(number + len(a))
        for some in rows:
            one, other = whole[first[some]], whole[second[some]]
            coupled = one[:, a] * other[:, b] + (a != b) * one[:, b] * other[:, a]
            both = np.concatenate([alone[some], counts[some, None] * coupled], axis=1)
            square = scipy.linalg.blas.dsyrk(1.0, both.T, beta=1.0, c=square, overwrite_c=True)
            right += beyond[some] @ both
        found = _held(square, right, len(alone), np.arange(len(square)) >= number)
    else:
        found = least_squares(alone, beyond, np.zeros(number, bool))
    found[:number] += least_squares(alone, direct, np.zeros(number, bool))
    parts = iter(np.split(found, ends))
    strengths = [np.stack([kind @ next(parts) for _ in range(3)], axis=1) for kind in kinds]
    made = [replace(grid, strengths=part) for grid, part in zip(grids, strengths, strict=True)]
    coupling = np.zeros((whole.shape[1], whole.shape[1]))
    coupling[a, b] = coupling[b, a] = next(parts)
    return made, coupling


MUTUAL = TableKind("mutual", MutualTable, "Energies of the mutual magnetisation of a rotor and a sphere")


def mutual_key(magnets: tuple[Magnet, ...], floater: Floater) -> str:
    """SHA-256 of all that decides a mutual table, and of what computes it."""
    return MUTUAL.key(*_inputs(tuple(magnet.magnetic for magnet in united(magnets)), floater))


def _inputs(magnets: tuple[Magnet, ...], floater: Floater) -> tuple[tuple[Magnet, ...], float, float, float]:
    return magnets, floater.radius, floater.remanence, floater.recoil_permeability


def cached_mutual_table(
    magnets: tuple[Magnet, ...], floater: Floater, report: Callable[[str], None], watch: Watch = unwatched
) -> tuple[MutualTable, bool]:
    """`mutual_table` of `magnets`, `floater` and `watch` from the cache if it is there, and whether it was.

    A lone magnet has one table, however it lies; `report` is called with a message where the cache is damaged.
    """
    magnets = united(magnets)
    upright = alike(magnets)
    table, found = MUTUAL.cached(_inputs(upright, floater), lambda: mutual_table(upright, floater, watch=watch), report)
    return moved_mutual(table, magnets), found


def moved_mutual(table: MutualTable, magnets: tuple[Magnet, ...]) -> MutualTable:
    """The table of magnets that differ from its own in the pose of a lone one, whose points keep their size."""
    if len(magnets) != 1:
        return replace(table, magnets=magnets)
    (magnet,), (grid,) = magnets, table.grids
    turn = np.kron(np.eye(len(table.coupling) // 3), magnet.box.rotation @ grid.box.rotation.T)
    grids = (replace(grid, box=replace(grid.box, center=magnet.box.center, rotation=magnet.box.rotation)),)
    return replace(table, magnets=magnets, grids=grids, coupling=turn @ table.coupling @ turn.T)


def mutual_table_beside(
    table: MutualTable, magnets: tuple[Magnet, ...], floater: Floater, report: Callable[[str], None]
) -> MutualTable:
    """The table of other magnets and another floater with as many points as `table`, for differences of the two."""
    inputs = *_inputs(alike(magnets), floater), table.inner, [grid.counts for grid in table.grids]
    make = partial(mutual_table, alike(magnets), floater, like=table)
    return moved_mutual(MUTUAL.cached(inputs, make, report)[0], magnets)


def sphere_fit(
    grids: Grids, single: bool, images: Array, places: Array, samples: Sequence[Array]
) -> tuple[list[ResponseGrid], Array]:
    """`grids` with `degrees`, and weights of pairs, that give the `samples` of `sphere_samples` at `places` (n, 3) m.

    `single`: whether each point has a weight of its own, and not its class alone; `images`: weights of the sphere's.
    """
    energy, force, energy_size, force_size = samples

    def of_points(direction: Array, field: Array, change: Array) -> Array:
        return -np.concatenate([(field @ direction)[..., None], direction @ change], axis=-1)

    pairs, number = np.triu_indices(len(grids), 1), effort(len(grids)).charges
    sums = [formulas.charge_sum(grids[a], grids[b], images, number) for a, b in np.transpose(pairs).tolist()]
    derivatives = [one.derivatives(places, np.zeros_like(places), 1) for one in sums]
    others = [np.column_stack([value, slope[:, :3]]) for value, slope, _ in derivatives]
    right, sizes = np.column_stack([energy, -force]), np.column_stack([energy_size, *[force_size] * 3])
    found, weights = _fitted(grids, single, formulas.POWERS, places, of_points, others, right, sizes, PENALTY)
    coupled = np.zeros((len(grids), len(grids)))
    coupled[pairs] = coupled[pairs[::-1]] = weights
    return [replace(grid, degrees=part) for grid, part in zip(grids, found, strict=True)], coupled


def returned_fit(
    grids: Grids, single: bool, inner: Sequence[Array], images: Array, places: Array, samples: tuple[Array, Array]
) -> tuple[list[ResponseGrid], Array]:
    """`grids` with `returned`, and weights of pairs, that give the `samples` of `returned_samples` at `places`.

    `single` and `images` are as of `sphere_fit`; `inner` (k, 3) m of each magnet respond for the whole of it.
    """
    field, change = samples

    def rows(field: Array, change: Array) -> Array:
        # the energy is -M·V
        return -np.concatenate([field, change.reshape(*change.shape[:-2], 9)], axis=-1)

    pairs, number = np.nonzero(~np.eye(len(grids), dtype=bool)), effort(len(grids)).reflected
    sums = [formulas.charge_sum(grids[a], inner[b], images, number) for a, b in np.transpose(pairs).tolist()]
    derivatives = [one.derivatives(places, np.zeros_like(places)) for one in sums]
    others = [-rows(slope[:, 3:], second[:, 3:, :3]) for _, slope, second in derivatives]
    right, each = rows(field, change), (np.linalg.norm(field, axis=1), np.linalg.norm(change, axis=(1, 2)))
    sizes = np.repeat(np.column_stack(each), (3, 9), axis=1)
    found, weights = _fitted(
        grids, single, formulas.RETURNED, places, lambda _, *known: rows(*known), others, right, sizes, 10 * PENALTY
    )
    mixed = np.zeros((len(grids), len(grids)))
    mixed[pairs] = weights
    return [replace(grid, returned=part) for grid, part in zip(grids, found, strict=True)], mixed


def _fitted(
    grids: Sequence[ResponseGrid],
    single: bool,
    powers: Sequence[int],
    places: Array,
    of_points: Callable[[Array, Array, Array], Array],
    others: Sequence[Array],
    right: Array,
    sizes: Array,
    cost: float,
) -> tuple[list[Array], Array]:
    """Weights of the points' powers (n, powers, 2) of each grid, and those (k,) of what `others` (k, m, rows) do.

    `of_points` makes of the direction (3,) of a remanence and of what `ResponseGrid.fields` gives at `places` (m, 3) m
    what each point does (n, m, rows); `right` (m, rows) is what they shall do, and counts by `sizes`.
    """
    small, kinds, blocks = list[Array](), list[tuple[Array, int]](), list[Array]()
    for grid in grids:
        kind = _classes(grid)
        alone = len(kind) if single and kind.size else 0
        kinds.append((kind, alone))
        small += [np.repeat([False, True], (kind.shape[1], alone))] * (2 * len(powers))
    for start in range(0, len(places), BESIDE):
        here, columns = slice(start, start + BESIDE), list[Array]()
        for grid, (kind, alone) in zip(grids, kinds, strict=True):
            for field, change in grid.fields(powers, places[here]):
                done = of_points(grid.box.rotation @ grid.axis, field, change) / sizes[here]
                rows = done.reshape(len(kind), -1)
                columns += [kind.T @ rows, rows[:alone]]
        blocks.append(np.concatenate([*columns, *((one[here] / sizes[here]).reshape(1, -1) for one in others)]))
    small.append(np.zeros(len(others), bool))
    found = least_squares(np.concatenate(blocks, axis=1).T, (right / sizes).ravel(), np.concatenate(small), cost)
    *parts, weights = np.split(found, np.cumsum([len(some) for some in small])[:-1])
    each = []
    for k, (kind, alone) in enumerate(kinds):
        whole = np.concatenate([kind, np.eye(len(kind))[:, :alone]], axis=1)
        mine = parts[2 * len(powers) * k : 2 * len(powers) * (k + 1)]
        each.append(np.stack([whole @ part for part in mine], axis=1).reshape(len(kind), -1, 2))
    return each, weights


def _classes(grid: ResponseGrid) -> Array:
    """`classes` of points whose powers weigh the same; none without a remanence."""
    kind = classes(grid, mirrored=bool(np.sum(np.abs(grid.axis) > PARALLEL) == 1))
    return kind[:, : None if grid.axis.any() else 0]


def classes(grid: ResponseGrid, mirrored: bool) -> Array:
    """(n, classes): which points are exchanged by mirrors at the body's planes, or else by its centre."""
    key = np.round(grid.points * 1e9).astype(int)
    if mirrored:
        key = np.abs(key)
    else:
        first = np.array([next((v for v in row if v), 0) for row in key])
        key = key * np.where(first < 0, -1, 1)[:, None]
    number = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    return np.asarray(np.eye(number.max() + 1)[number])


def least_squares(columns: Array, values: Array, small: Array, cost: float = PENALTY) -> Array:
    """Weights (k,) of `columns` (n, k) that give `values` (n,); those that are `small` (k,) are kept so,

    at a `cost` by an error of the size of all values: by themselves they are hardly determined.
    """
    if not small.any() and len(small) <= FEW_WEIGHTS:
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1.0
        return np.asarray(np.linalg.lstsq(columns / size, values, rcond=SMALL)[0] / size)
    return _held((columns.T @ columns).T, columns.T @ values, len(values), small, cost)


def _held(square: Array, right: Array, values: int, small: Array, cost: float = PENALTY) -> Array:
    """`least_squares` by the normal equations (k, k), whose upper triangle counts and which go, of so many `values`."""
    size = np.sqrt(np.diag(square))
    size[size == 0] = 1.0
    square /= size
    square /= size[:, None]
    free = FREE if values >= ENOUGH * np.count_nonzero(np.logical_not(small)) else FEW
    square[np.diag_indices_from(square)] += np.where(small, cost, free) ** 2
    factor = scipy.linalg.cho_factor(square, overwrite_a=True, check_finite=False)
    return np.asarray(scipy.linalg.cho_solve(factor, right / size) / size)
