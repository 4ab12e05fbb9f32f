"""Curves of solutions followed by their arc length: the one predictor and corrector for all of them.

k equations in k + 1 unknowns leave a curve.  From a point x₀ of it with the unit tangent t a step of length ℓ is

    f(x) = 0,     t·(x - x₀) = ℓ,

solved by Newton's method from x₀ + ℓt, so that a fold in any of the unknowns is a point like others (H. B. Keller,
Applications of Bifurcation Theory, 1977; E. L. Allgower and K. Georg, Numerical Continuation Methods, 1990, ch. 2, 6).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array
from .balance import Indices, tangent_basis

Truth = NDArray[np.bool_]
ON, SHORTER, END = 0, 1, 2
"""What may be said of a step: go on from it, try a shorter one instead, or it is the last."""
GROWTH = 1.4
"""Ratio of a step to the one before that succeeded."""
CLOSE, CORRECTIONS = 1e-10, 8
"""A point is on its curve when Newton's method moves it less than this, and how often it may move it."""
ROUNDED = 1e-7
"""Or when a move that is shorter than this has not halved since the one before: what is left is round-off."""
DIFFERENCE = 1e-5
"""Step of the central difference by a parameter of a curve, in its units."""
ONE: Indices = np.zeros(1, int)
"""The number of a curve that is followed alone."""


class Equations(Protocol):
    """k equations in k + 1 unknowns, at points of many curves in one call."""

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """What shall vanish (n, k) at points (n, k + 1) of curves `which` (n,), and its derivatives (n, k, k + 1)."""

    def onto(self, points: Array) -> Array:
        """The points, with what shall be a unit vector made one."""


class AtRest:
    """Unknowns of a floater at rest: position (3), unit vector of the moment (3), and any further numbers."""

    def onto(self, points: Array) -> Array:
        """The points (n, 6 + e), their moments of unit length."""
        points = points.copy()
        points[:, 3:6] /= np.linalg.norm(points[:, 3:6], axis=1, keepdims=True)
        return points

    @staticmethod
    def extended(value: Array, slope: Array, moment: Array) -> tuple[Array, Array]:
        """Equations (n, k) and derivatives (n, k, 5 + e) by position, tilts, the rest; one more keeps |m̂| = 1."""
        n, k, unknowns = slope.shape
        values, slopes = np.zeros((n, k + 1)), np.zeros((n, k + 1, unknowns + 1))
        values[:, :k], slopes[:, k, 3:6] = value, moment
        slopes[:, :k, :3], slopes[:, :k, 6:] = slope[:, :, :3], slope[:, :, 5:]
        slopes[:, :k, 3:6] = slope[:, :, 3:5] @ tangent_basis(moment)
        return values, slopes


@dataclass(frozen=True)
class Steps:
    """How a curve is followed.

    Parameters
    ----------
    longest, shortest : steps along the curve, in floater radii, rad and units of the parameters
    turn : largest angle between the tangents at the ends of a step, rad
    most : how many steps are tried at most
    first : the first step, as a part of the longest
    far : where the first three unknowns are a position farther than this from the origin, in floater radii, the longest
        step grows with the distance, as the scale of the field does
    """

    longest: float = 0.05
    shortest: float = 1e-7
    turn: float = 0.1
    most: int = 2000
    first: float = 1 / 8
    far: float = np.inf

    def limits(self, points: Array) -> Array:
        """The longest steps (n,) at points (n, k + 1)."""
        return np.asarray(self.longest * np.maximum(1.0, np.linalg.norm(points[:, :3], axis=1) / self.far))


Watch = Callable[[Indices, Array, Array, Array], int | NDArray[np.int_]]
"""Told which curves (n,) have come to what points (n, k + 1) with what tangents (n, k + 1) by steps (n,), all of which
came out well; says of them `ON`, `SHORTER` or `END`: one answer, or one of each."""


def follow(equations: Equations, points: Array, tangents: Array, steps: Steps, watch: Watch) -> None:
    """Follow curves from points (n, k + 1) along tangents (n, k + 1), all at once, each with its own steps.

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
    """Points and tangents (n, k + 1) at steps (n,) along the curves, and where Newton's method found these again.

    The tangents are by the derivatives of the last correction, which moved the points by less than `CLOSE`.
    """
    ahead = equations.onto(points + lengths[:, None] * tangents)
    ahead, good, slope = _corrected(equations, ahead, tangents, np.maximum(lengths / 2, 1e-8), which)
    turned = np.full(tangents.shape, np.nan)
    if good.any():
        turned[good] = _along(slope[good], tangents[good])
    return ahead, turned, good & np.isfinite(turned).all(axis=1)


def corrected(
    equations: Equations, points: Array, across: Array, reach: Array, which: Indices = ONE
) -> tuple[Array, Truth]:
    """Solutions in the planes through guesses (n, k + 1) across directions, and where one was within reach (n,)."""
    return _corrected(equations, points, across, reach, which)[:2]


def _corrected(
    equations: Equations, points: Array, across: Array, reach: Array, which: Indices
) -> tuple[Array, Truth, Array]:
    """The same, and the derivatives (n, k, k + 1) of the last correction."""
    slopes = np.full((len(points), points.shape[1] - 1, points.shape[1]), np.nan)
    points, good, active = points.copy(), np.zeros(len(points), bool), np.arange(len(points))
    before = np.full(len(points), np.inf)
    for _ in range(CORRECTIONS):
        value, slope = equations.linear(points[active], which[active])
        slopes[active] = slope
        change = _solved(slope, across[active], -value, 0.0)
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
    return points, good, slopes


def directions(equations: Equations, points: Array, before: Array, which: Indices = ONE) -> Array:
    """Unit tangents (n, k + 1) of the curves that go on as `before` (n, k + 1); not a number where there is none."""
    return _along(equations.linear(points, which)[1], before)


def _along(slope: Array, before: Array) -> Array:
    along = _solved(slope, before, np.zeros(slope.shape[:2]), 1.0)
    return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))


def _solved(slope: Array, row: Array, value: Array, last: float) -> Array:
    """What has the products (n, k) with derivatives (n, k, k + 1) and `last` with a row (n, k + 1); or not a number."""
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


def near_curve(equations: Equations, guess: Array, reach: float) -> Array | None:
    """The point of a curve (k + 1,) across its direction at a guess (k + 1,) that is nearer than about `reach`."""
    slope = equations.linear(guess[None], ONE)[1]
    if not np.isfinite(slope).all():
        return None
    points, good = corrected(equations, guess[None], np.linalg.svd(slope)[2][:, -1], np.array([reach]))
    return points[0] if good[0] else None


Traced = tuple[Array, Array]
"""Points and tangents (n, k + 1) of a curve."""


def whole_curves(
    equations: Equations, starts: Array, steps: Steps, inside: Callable[[Array], Truth]
) -> list[Traced | None]:
    """Points and tangents (n, k + 1) of the curve through each of the starts (m, k + 1), followed all at once.

    Each is followed both ways until it closes or leaves: the first point that is not `inside` belongs to it, and a
    closed curve ends in its start.  None where the equations do not fix a curve.
    """
    _, sizes, rows = np.linalg.svd(equations.linear(starts, np.zeros(len(starts), int))[1])
    fixed = np.flatnonzero(sizes[:, -1] >= 1e-12 * sizes[:, 0])
    begin, tangent = np.repeat(starts[fixed], 2, axis=0), np.repeat(rows[fixed, -1], 2, axis=0)
    tangent[1::2] *= -1
    ways = _followed(equations, begin, tangent, steps, inside)
    found: list[Traced | None] = [None] * len(starts)
    for number, curve in enumerate(fixed):
        found[curve] = _joined(ways[2 * number], ways[2 * number + 1])
    return found


def _followed(
    equations: Equations, starts: Array, tangents: Array, steps: Steps, inside: Callable[[Array], Truth]
) -> list[list[Traced]]:
    """The points and tangents (k + 1,) of curves from their starts (m, k + 1) on, one way."""
    found: list[list[Traced]] = [[pair] for pair in zip(starts, tangents, strict=True)]
    before = starts.copy()

    def watch(which: Indices, points: Array, turned: Array, lengths: Array) -> NDArray[np.int_]:
        travelled = np.linalg.norm(points - before[which], axis=1)
        near = np.linalg.norm(points - starts[which], axis=1) < travelled
        closed = near & (np.sum(turned * tangents[which], axis=1) > 0.9)
        before[which] = points
        for k, (curve, point, tangent) in enumerate(zip(which, points, turned, strict=True)):
            closed[k] &= len(found[curve]) > 2
            found[curve].append(found[curve][0] if closed[k] else (point, tangent))
        return np.where(closed | ~inside(points), END, ON)

    follow(equations, starts, tangents, steps, watch)
    return found


def _joined(ahead: list[Traced], behind: list[Traced]) -> Traced:
    """One curve from its two halves; a closed one is whole in the first."""
    if len(ahead) == 1 or ahead[-1] is not ahead[0]:
        ahead = [*((point, -tangent) for point, tangent in behind[:0:-1]), *ahead]
    points, tangents = (np.array(column) for column in zip(*ahead, strict=True))
    return points, tangents
