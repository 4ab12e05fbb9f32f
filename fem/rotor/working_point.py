"""Where a magnet works: the field against its polarisation, at its lowest and over its volume.

    h = μ0 H · e,        e the easy axis, along the polarisation;        the knee: h = -μ0 × coercivity.

Where h is below the knee a magnet loses polarisation; that is reported here, not followed (no hysteresis).  On an edge
the field can be infinite, so that h has no lowest value in a whole magnet.  What converges is the lowest value at
places that keep a stated distance from all edges, and the share of the volume that is below the knee.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ...geometry.common import MU_0, Array
from ...geometry.magnets import Magnet
from ...geometry.shapes import rotation_matrix
from ...geometry.solids import with_frame
from ..closed_forms.moments import carrier
from ..closed_forms.uniform import remanent_field
from .near_field import NearElements, NearField, near_field

RTOL = 1e-3  # error asked for, relative to the largest remanence: knees are known to per cents
HIGHEST = 5  # order of the elements; near edges they stop there, with the error that is stated
CLEAR = 0.02  # distance from edges that the lowest value keeps, in edges of a cube of the magnet's volume
JUST_INSIDE = 1e-7  # how far below the surface (m) a place may lie
BATCHES, PER_BATCH = 8, 10  # sets of 2^n evenly spread places in a magnet's volume
STARTS, LAST_STEP = 6, 1e-6  # places from which the lowest value is sought, and the step (m) at which the search ends
PHASES = 72  # places of the floater about the axis, while the rotor turns alone


@dataclass(frozen=True, eq=False)
class WorkingPoint:
    """The field along a magnet's easy axis: μ0 H · e."""

    lowest: float  # T, at all places that keep `clear` from edges
    place: Array  # (3,) m where that is, rotor's frame
    error: float  # estimated, T
    lowest_turning: float  # T, as `lowest` if the floater stays behind for a whole turn and the rotor turns alone
    clear: float  # m
    knee: float | None  # T, or None where the magnet has no coercivity
    share_below: float  # of the volume that is below the knee; 0 without a knee
    share_error: float  # estimated
    levels: Array  # (n,) T, from low to high: between two of them lie equal parts of the volume

    @property
    def margin(self) -> float | None:
        """Lowest value above the knee, T; negative where the magnet demagnetises."""
        return None if self.knee is None else self.lowest - self.knee


class EasyField:
    """μ0 H along the easy axis of each of a rotor's `magnets`, with a permeable `floater` beside it or none."""

    def __init__(self, magnets: Sequence[Magnet], floater: Magnet | None = None) -> None:
        self.magnets, self.floater = tuple(magnets), floater
        self.elements = NearElements(self.magnets if floater is None else (*self.magnets, floater))

    def at(self, number: int, points: Array) -> tuple[Array, Array]:
        """μ0 H · e and its estimated error (n,) T at points (n, 3) m in a magnet (counted from 0), off the edges."""
        found = self.near(points)
        return found.field @ easy_axis(self.magnets[number]), found.error

    def near(self, points: Array) -> NearField:
        """The field of all at points (n, 3) m."""
        return near_field(self.elements.magnets, points, RTOL, HIGHEST, self.elements)

    def section(self, number: int, first: Array, steps: int) -> tuple[Array, Array, Array, Array]:
        """μ0 H · e on a plane through a magnet's centre.

        (n, n) T, NaN beside the magnet; coordinates (n,) m of columns, along the easy axis, and of rows; and the rows'
        axis (3,). The magnet's `number` is from 0; the plane goes through `first` (3,) m, if that is not on the easy
        axis, with n `steps` along both of its axes.
        """
        body, along = self.magnets[number].body, easy_axis(self.magnets[number])
        away = first - body.center - along * ((first - body.center) @ along)
        if np.linalg.norm(away) < LAST_STEP * 10:
            away = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
        up = away / np.linalg.norm(away)
        u, v = (1.02 * np.linspace(-1, 1, steps) * float(body.reach(way[None])[0]) for way in (along, up))
        points = (body.center + u[None, :, None] * along + v[:, None, None] * up).reshape(-1, 3)
        inside = (body.distance(points) < -JUST_INSIDE) & (_edge_distance(self.magnets, points) > JUST_INSIDE * 10)
        values = np.full(len(points), np.nan)
        if inside.any():
            values[inside] = self.at(number, points[inside])[0]
        return values.reshape(steps, steps), u, v, up

    def of_floater(self, number: int, points: Array, turn_deg: float) -> Array:
        """μ0 H · e (n,) T, as `at` a `number` and `points`, of the floater alone, turned about z by `turn_deg`."""
        if self.floater is None:
            return np.zeros(len(points))
        there = replace(self.floater, body=with_frame(self.floater.body, rotation_matrix((0.0, 0.0, turn_deg))))
        return np.asarray(remanent_field([carrier(there)], points) @ easy_axis(self.magnets[number]))


def easy_axis(magnet: Magnet) -> Array:
    """(3,) unit vector along the polarisation, rotor's frame; zero without one."""
    size = float(np.linalg.norm(magnet.polarization))
    return magnet.polarization_in_rotor / size if size else np.zeros(3)


def working_points(field: EasyField) -> tuple[WorkingPoint | None, ...]:
    """The working point of every magnet, its `error` that of the elements; None for those without polarisation."""
    polarized = (magnet.polarization.any() for magnet in field.magnets)
    return tuple(_working_point(field, k) if found else None for k, found in enumerate(polarized))


def _working_point(field: EasyField, number: int) -> WorkingPoint:
    magnet = field.magnets[number]
    clear = CLEAR * float(np.cbrt(magnet.body.volume))
    points = np.concatenate([_spread_inside(magnet, seed) for seed in range(BATCHES)])
    free = _edge_distance(field.magnets, points) >= clear
    values, error = np.empty(len(points)), np.empty(len(points))
    for chosen in (free, ~free):  # places at edges, which converge slowly, do not drive the order of all
        if chosen.any():
            values[chosen], error[chosen] = field.at(number, points[chosen])
    seen, found, doubt = _lowest(field, number, points[free], values[free], clear)
    best = int(np.argmin(found))
    alone = found - field.of_floater(number, seen, 0.0)
    turned = [field.of_floater(number, seen, 360.0 * k / PHASES) for k in range(PHASES)]
    turning = min(float(found[best]), *(float((alone + one).min()) for one in turned))
    knee, share, share_error = None if magnet.coercivity is None else -MU_0 * magnet.coercivity, 0.0, 0.0
    if knee is not None:
        shares = np.mean(values.reshape(BATCHES, -1) < knee, axis=1)
        share = float(shares.mean())
        # scatter of the batches, and what the field's error does
        share_error = float(shares.std(ddof=1) / np.sqrt(BATCHES) + np.mean(np.abs(values - knee) < error))
    return WorkingPoint(
        float(found[best]), seen[best], float(doubt[best]), turning, clear, knee, share, share_error, np.sort(values)
    )


def _spread_inside(magnet: Magnet, seed: int) -> Array:
    body, wanted, found = magnet.body, 2**PER_BATCH, np.zeros((0, 3))
    draw = scipy.stats.qmc.Sobol(3, rng=np.random.default_rng(seed))
    while len(found) < wanted:
        points = body.center + (2 * draw.random(2 * wanted) - 1) * body.half_edges @ body.rotation.T
        off = (body.distance(points) < -JUST_INSIDE) & (body.edge_distance(points) > JUST_INSIDE)
        found = np.concatenate([found, points[off]])
    return found[:wanted]


def _edge_distance(magnets: Sequence[Magnet], points: Array) -> Array:
    return np.asarray(np.min([magnet.body.edge_distance(points) for magnet in magnets], axis=0))


def _lowest(field: EasyField, number: int, points: Array, values: Array, clear: float) -> tuple[Array, Array, Array]:
    """Places (n, 3) m that go down from the lowest of the given ones, step by step, with values and errors (n,) T."""
    body = field.magnets[number].body
    ways = np.array([w for w in np.ndindex(3, 3, 3) if w != (1, 1, 1)]) - 1.0
    here, low = points[(order := np.argsort(values)[:STARTS])], values[order]
    step = float(np.cbrt(body.volume)) / 16
    while step > LAST_STEP:
        tried = (here[:, None] + step * ways @ body.rotation.T).reshape(-1, 3)
        good = (body.distance(tried) < -JUST_INSIDE) & (_edge_distance(field.magnets, tried) >= clear)
        reached = np.full(len(tried), np.inf)
        if good.any():
            reached[good] = field.at(number, tried[good])[0]
        best = np.arange(len(here)) * len(ways) + reached.reshape(len(here), -1).argmin(axis=1)
        better = reached[best] < low
        low, here = np.where(better, reached[best], low), np.where(better[:, None], tried[best], here)
        step /= 2
    found = field.near(here)
    axis = easy_axis(field.magnets[number])
    return here, found.field @ axis, found.error + LAST_STEP * np.linalg.norm(axis @ found.gradient, axis=1)
