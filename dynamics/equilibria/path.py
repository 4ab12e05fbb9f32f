"""Curves of solutions followed by their arc length: the one predictor and corrector for all of them.

k equations in k + 1 unknowns leave a curve.  From a point x₀ of it with the unit tangent t a step of length ℓ is

    f(x) = 0,     t·(x - x₀) = ℓ,

solved by Newton's method from x₀ + ℓt, so that a fold in any of the unknowns is a point like others (H. B. Keller,
Applications of Bifurcation Theory, 1977; E. L. Allgower and K. Georg, Numerical Continuation Methods, 1990, ch. 2, 6).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array
from ..motion.state import Parameter
from .balance import CONVERGED_STEP, EVERY, Balance, Indices, solve, tangent_basis

Truth = NDArray[np.bool_]
ON, SHORTER, END = 0, 1, 2  # What may be said of a step: go on from it, try a shorter one instead, or it is the last
GROWTH = 1.4  # Ratio of a step to the one before that succeeded
CLOSE = 1e-10  # a correction by which a point is on its curve, in the curve's units
CORRECTIONS = 8
ROUNDED = 1e-7  # a correction below which one that has not halved since the one before is round-off
DIFFERENCE = 1e-5  # Step of the central difference by a parameter of a curve, in its units
ONE: Indices = np.zeros(1, int)  # The number of a curve that is followed alone


class Equations(Protocol):
    """k equations in k + 1 unknowns, at points of many curves in one call."""

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """Residuals (n, k) at points (n, k + 1) of curves `which` (n,), and its derivatives (n, k, k + 1)."""

    def onto(self, points: Array) -> Array:
        """The points, with what shall be a unit vector made one."""


class AtRest:
    """Unknowns of a floater at rest: position (3), unit vector of the moment (3), and any further numbers."""

    def onto(self, points: Array) -> Array:
        points = points.copy()
        points[:, 3:6] /= np.linalg.norm(points[:, 3:6], axis=1, keepdims=True)
        return points

    @staticmethod
    def extended(value: Array, slope: Array, moment: Array) -> tuple[Array, Array]:
        """Equations with |m̂| = 1 and slopes (n, 6 + e): `value` (n, k), `slope` (n, k, 5 + e) by tilts of `moment`."""
        n, k, unknowns = slope.shape
        values, slopes = np.zeros((n, k + 1)), np.zeros((n, k + 1, unknowns + 1))
        values[:, :k], slopes[:, k, 3:6] = value, moment
        slopes[:, :k, :3], slopes[:, :k, 6:] = slope[:, :, :3], slope[:, :, 5:]
        slopes[:, :k, 3:6] = slope[:, :, 3:5] @ tangent_basis(moment)
        return values, slopes


class BalanceCurve(AtRest, ABC):
    """All five balances on curves with one parameter each: unknown are position, moment, and the parameter by its unit.

    `unit`: of the parameter, a typical change over which an equilibrium moves by its radius.
    """

    unit: float

    @abstractmethod
    def balances(self, parameter: Array, which: Indices) -> Balance:
        """The balance at values (n,) of the parameters of curves `which` (n,)."""

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """Balances and |m̂| = 1 (n, 6) at points (n, 7), and their derivatives (n, 6, 7).

        That by the parameter is a central difference, good to 1e-9; a fold is found where the other columns are
        singular, which does not depend on it.
        """
        position, moment, n = points[:, :3], points[:, 3:6], len(points)
        around = [(points[:, 6] + s * DIFFERENCE) * self.unit for s in (0, 1, -1)]
        values, slopes = self.balances(np.concatenate(around), np.tile(which, 3))(position, moment)
        along = (values[n : 2 * n] - values[2 * n :]) / (2 * DIFFERENCE)
        return self.extended(values[:n], np.concatenate([slopes[:n], along[:, :, None]], axis=2), moment)


@dataclass(frozen=True)
class Steps:
    """Step control along a curve."""

    #: longest, shortest: steps along the curve, in floater radii, rad and units of the parameters
    longest: float = 0.05
    shortest: float = 1e-7
    turn: float = 0.1  #: largest angle between the tangents at the ends of a step, rad
    most: int = 2000  #: how many steps are tried at most
    first: float = 1 / 8  #: the first step, as a part of the longest
    #: where the first three unknowns are a position farther than this from the origin, in floater radii, the longest
    #: step grows with the distance, as the scale of the field does
    far: float = np.inf

    def limits(self, points: Array) -> Array:
        return np.asarray(self.longest * np.maximum(1.0, np.linalg.norm(points[:, :3], axis=1) / self.far))


# Called with the numbers of curves (n,), the points (n, k + 1) that they have come to, tangents (n, k + 1) there and
# the steps (n,) taken, all of which came out well; says `ON`, `SHORTER` or `END` of them: one answer, or one of each.
Watch = Callable[[Indices, Array, Array, Array], int | NDArray[np.int_]]


def follow(equations: Equations, points: Array, tangents: Array, steps: Steps, watch: Watch) -> None:
    """Follow curves of `equations` from `points` (n, k + 1) along `tangents`, all at once, each with its own `steps`.

    A curve ends where `watch` says so, or where no step that is long enough succeeds.
    """
    which, length = np.arange(len(points)), steps.first * steps.limits(points)
    for _ in range(steps.most):
        if not len(which):
            return
        ahead, turned, good = stepped(equations, points, tangents, length, which)
        good &= np.sum(turned * tangents, axis=1) > np.cos(steps.turn)
        said = np.full(len(which), SHORTER)
        if good.any():
            said[good] = watch(which[good], ahead[good], turned[good], length[good])
        went = said != SHORTER
        points, tangents = np.where(went[:, None], ahead, points), np.where(went[:, None], turned, tangents)
        length = np.where(went, np.minimum(GROWTH * length, steps.limits(points)), length / 2)
        kept = (said != END) & (length > steps.shortest)
        which, points, tangents, length = which[kept], points[kept], tangents[kept], length[kept]


def stepped(
    equations: Equations, points: Array, tangents: Array, lengths: Array, which: Indices = ONE
) -> tuple[Array, Array, Truth]:
    """Points and tangents (n, k + 1) at `lengths` (n,) along curves of `equations`, `which` of them, and where found.

    From `points` and `tangents` (n, k + 1). Those found are by the last correction, which moved less than `CLOSE`, in
    the planes through the ends of the steps across them, where none moved farther than half of a step.
    """
    points, reach = equations.onto(points + lengths[:, None] * tangents), np.maximum(lengths / 2, 1e-8)
    slopes = np.full((len(points), points.shape[1] - 1, points.shape[1]), np.nan)
    good, active, before = np.zeros(len(points), bool), np.arange(len(points)), np.full(len(points), np.inf)
    for _ in range(CORRECTIONS):
        value, slope = equations.linear(points[active], which[active])
        slopes[active] = slope
        change = _solved(slope, tangents[active], -value, 0.0)
        size = np.linalg.norm(change, axis=1)
        near = size <= reach[active]  # not a number is not near
        active, change, size = active[near], change[near], size[near]
        points[active] = equations.onto(points[active] + change)
        met = (size < CLOSE) | ((size < ROUNDED) & (size > before[active] / 2))
        before[active] = size
        good[active[met]] = True
        active = active[~met]
        if not len(active):
            break
    turned = np.full(tangents.shape, np.nan)
    if good.any():
        turned[good] = _along(slopes[good], tangents[good])
    return points, turned, good & np.isfinite(turned).all(axis=1)


def directions(equations: Equations, points: Array, before: Array, which: Indices = ONE) -> Array:
    """Unit tangents (n, k + 1) of `which` `equations` at `points` that go on as `before`; NaN where there is none."""
    return _along(equations.linear(points, which)[1], before)


def _along(slope: Array, before: Array) -> Array:
    along = _solved(slope, before, np.zeros(slope.shape[:2]), 1.0)
    return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))


def _solved(slope: Array, row: Array, value: Array, last: float) -> Array:
    """Vectors with products (n, k) with derivatives (n, k, k + 1) and `last` with a row (n, k + 1); or not a number."""
    matrices = np.concatenate([slope, row[:, None]], axis=1)
    found = np.full((*row.shape, 1), last)
    found[:, :-1, 0] = value
    try:
        found = np.linalg.solve(matrices, found)
    except np.linalg.LinAlgError:  # one of them is singular to the last bit
        good = np.isfinite(matrices).all(axis=(1, 2))
        good[good] = np.linalg.slogdet(matrices[good])[0] != 0
        found[good], found[~good] = np.linalg.solve(matrices[good], found[good]), np.nan
    return np.asarray(found[..., 0])


Traced = tuple[Array, Array]  # Points and tangents (n, k + 1) of a curve


def whole_curves(
    equations: Equations, starts: Array, steps: Steps, inside: Callable[[Array], Truth]
) -> list[Traced | None]:
    """Points and tangents (n, k + 1) of the curve through each of the `starts` (m, k + 1), followed all at once.

    Each is followed by its own `steps`, both ways until it closes or leaves: the first point that is not `inside`
    belongs to it, and a closed curve ends in its start.  None where the `equations` do not fix a curve.
    """
    _, sizes, rows = np.linalg.svd(equations.linear(starts, np.zeros(len(starts), int))[1])
    fixed = np.flatnonzero(sizes[:, -1] >= 1e-12 * sizes[:, 0])
    begin, tangent = np.repeat(starts[fixed], 2, axis=0), np.repeat(rows[fixed, -1], 2, axis=0)
    tangent[1::2] *= -1
    ways, before = [[pair] for pair in zip(begin, tangent, strict=True)], begin.copy()

    def watch(which: Indices, points: Array, turned: Array, lengths: Array) -> NDArray[np.int_]:
        near = np.linalg.norm(points - begin[which], axis=1) < np.linalg.norm(points - before[which], axis=1)
        closed = near & (np.sum(turned * tangent[which], axis=1) > 0.9)
        before[which] = points
        for k, (way, point, direction) in enumerate(zip(which, points, turned, strict=True)):
            closed[k] &= len(ways[way]) > 2
            ways[way].append(ways[way][0] if closed[k] else (point, direction))
        return np.where(closed | ~inside(points), END, ON)

    follow(equations, begin, tangent, steps, watch)
    found: list[Traced | None] = [None] * len(starts)
    for curve, ahead, behind in zip(fixed, ways[::2], ways[1::2], strict=True):
        if len(ahead) == 1 or ahead[-1] is not ahead[0]:  # a closed one is whole in its first half
            ahead = [*((point, -direction) for point, direction in behind[:0:-1]), *ahead]
        found[curve] = np.array([point for point, _ in ahead]), np.array([direction for _, direction in ahead])
    return found


NEWTON_STEPS = 12  # Of Newton's method from a problem's equilibrium to that of one nearby
# What it finds farther away than this (radii and rad) may be another branch's: then the branch itself is followed.
NEAR = 0.15
WAY_STEPS = Steps(longest=0.1, shortest=1e-5, turn=0.2, most=300)


@dataclass(frozen=True, eq=False)
class Ways(BalanceCurve):
    """The ways from balances, one of each curve, to others with the same code; the parameter grows from 0 to 1."""

    start: Balance
    end: Balance
    unit: float = 10.0

    def balances(self, parameter: Array, which: Indices) -> Balance:
        start, end = self.start.at(which), self.end.at(which)
        values = start.values + parameter[:, None] * (end.values - start.values)
        values[:, Parameter.NEXT], values[:, Parameter.BETWEEN] = end.values[:, Parameter.TABLE], parameter
        values[:, Parameter.TABLE] = start.values[:, Parameter.TABLE]
        spin = np.asarray(start.spin)
        return replace(start, values=values, spin=spin + parameter * (np.asarray(end.spin) - spin))


def continued(
    start: Balance, end: Balance, position: Array, moment: Array, bound: float
) -> tuple[Indices, Truth, Array, Array]:
    """Equilibria to which others lead while the parameters of their problem change steadily to those of another one.

    Returns which (k,) were followed; whether to the end, or beyond a fold to others at the start; position and moment
    (k, 3). `start`, `end`: with the same equations; `position`, `moment`: (n, 3) of equilibria at the start, scaled;
    `bound`: farther from the origin than this, in floater radii, none is followed.
    """
    places, turned, size = solve(end, position, moment, EVERY, NEWTON_STEPS)
    apart = np.linalg.norm(np.concatenate([places - position, turned - moment], axis=1), axis=1)
    good = (size < CONVERGED_STEP) & (apart < NEAR)
    rest = np.flatnonzero(~good)
    begin = np.column_stack([position, moment, np.zeros(len(position))])[rest]
    ways = Ways(start.at(rest), end.at(rest))
    ends: list[tuple[Indices, Array]] = [(rest[:0], begin[:0])]

    def watch(which: Indices, points: Array, tangents: Array, lengths: Array) -> NDArray[np.int_]:
        over = (points[:, 6] * ways.unit >= 1) | (points[:, 6] <= 0)
        ends.append((which[over], points[over]))
        return np.where(over | (np.linalg.norm(points[:, :3], axis=1) > bound), END, ON)

    if len(rest):
        forward = np.tile(np.eye(7)[6], (len(rest), 1))
        follow(ways, begin, directions(ways, begin, forward, np.arange(len(rest))), WAY_STEPS, watch)
    which, points = (np.concatenate(part) for part in zip(*ends, strict=True))
    there = points[:, 6] > 0
    landed = solve(ways.balances(there.astype(float), which), points[:, :3], points[:, 3:6], EVERY, NEWTON_STEPS)
    met = landed[2] < CONVERGED_STEP
    position, moment = (np.concatenate([a[good], b[met]]) for a, b in ((places, landed[0]), (turned, landed[1])))
    followed = np.concatenate([np.flatnonzero(good), rest[which[met]]])
    return followed, np.concatenate([np.ones(good.sum(), bool), there[met]]), position, moment
