"""Eddy currents of a conducting floater in the rotor's field, as the turning and moving floater sees it change.

In a field that turns against the ball with angular velocity -w, each of its modes follows the field with a delay
τ = μ0σR²/z², z a zero of the spherical Bessel function j_{l-1} for a field of potential degree l (W. R. Smythe, Static
and Dynamic Electricity, 3rd ed., section 10.06).  With X = w× of the field B of degree 1, and the commutator with w× of
its gradient G of degree 2, the ball takes the dipole and quadrupole moments -κ Ḃ and -(2/21) R² κ Ġ, κ = (2π/15) σ R⁵,

    Ḃ = Σ c [(1 - τX)⁻² G v - X (1 - τX)⁻¹ B],        Ġ = Σ c [(v·∇) G - X (1 - τX)⁻¹ G],

where the sums run over the modes, c ∝ 1/z⁴, Σ c = 1, and v, w are drift and lag, seen from the rotor.  Exact for a
steady turn at every frequency: what is odd in X of X (1 - τX)⁻¹ = X + τX² … is the torque, which the skin effect
weakens, the even part the ball's lift, its push out of the field.  What changes the turn, and the drift through G, is
taken as slow against the delays (`slow_error`); a magnet's motions are not always (`too_slow`).  Where skin depth is
large against R all is that of a thin field, a loss κ |Ḃ|² + (2/21) R² κ |Ġ|² whose derivatives by v and w force and
torque are.  Degree 3 is left out; it changes the growth of small motions by 1 to 2 % of this effect's at 14 to 22 mm,
more nearer by.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.closed_forms.eddy_sphere import skin_number
from ...geometry.common import InputError
from ...geometry.scene.contents import Scene
from .effect import Added, Motion, dissipative
from .state import Parameter, Vector, cross, dot

Matrix = list[list[hy.expression]]
GRADIENT = 2 / 21  # Share of a unit gradient in the loss, lengths in radii; κ is that of a unit field
# The first of j0 and of j1; all others together are as fast as the field.
ZEROS = (
    tuple(float(n * np.pi) for n in range(1, 9)),
    (4.493409457909064, 7.725251836937707, 10.904121659428899, 14.066193912831473, 17.22075527193077),
)
SUMS = ((1 / 90, 1 / 945), (1 / 350, 1 / 7875))  # Σ 1/z⁴ and Σ 1/z⁶ over all zeros (Rayleigh)
# Largest ωμ0σR², 2 R² over the skin depth's square: there the other modes are missed by 2 % of the torque.
THINNEST = 300.0

# Largest `slow_error` beside a remanence, which makes motions fast: there it would be a growth rate's error.
SLOW_ENOUGH = 0.25
ROUNDED = 0.995  # What is named as the most that would do is less by so much, so that its three digits will do

FLOATER_CURRENTS = "currents in the floater"


def check_floater_metal(scene: Scene) -> None:
    """Refuse a floater whose currents are more modes than are followed, or too slow for the motions of a magnet.

    Raises InputError: with the skin depth, and the conductivity or frequency up to which it would do.
    """
    floater, frequency = scene.floater, scene.frequency
    number = skin_number(floater.radius, floater.conductivity or 0.0, frequency)
    if too_slow(scene):
        rule = "leave its skin depth large against it where it has a remanence"
        said = f"{2 * frequency:.4g} Hz, twice the rotor's frequency,"
        depth, share = floater.radius / np.sqrt(number), np.sqrt(SLOW_ENOUGH * 105) / 2 / number
    elif number > THINNEST:
        rule = f"leave its skin depth at least {np.sqrt(2 / THINNEST):.2g} of its radius"
        said, depth, share = f"{frequency:.4g} Hz", floater.radius * np.sqrt(2 / number), THINNEST / number
    else:
        return
    most = ROUNDED * share
    raise InputError(
        f"Input floater.conductivity_S_m must {rule}; instead received {floater.conductivity:.3g} S/m: "
        f"{depth * 1e3:.3g} mm at {said} in a ball of {2e3 * floater.radius:.4g} mm. Take at most "
        f"{most * (floater.conductivity or 0):.3g} S/m or {most * frequency:.3g} Hz, or leave it out."
    )


def slow_error(scene: Scene) -> float:
    """Relative error, at most 1, of what a conducting floater's currents do to motions: they are taken as slow.

    As for the rotor's metal (`fem.rotor_metal`) the fastest are at twice the rotor's frequency.
    """
    floater = scene.floater
    return min(1.0, (2 * skin_number(floater.radius, floater.conductivity or 0.0, scene.frequency)) ** 2 / 105)


def too_slow(scene: Scene) -> bool:
    """Whether currents of the floater are too slow for its motions: those of a magnet are as fast as the rotor."""
    return scene.floater.remanence > 0 and slow_error(scene) > SLOW_ENOUGH


@dataclass(frozen=True)
class FloaterCurrents:
    """The floater's own eddy currents; how strong and how slow they are, the runtime parameters say."""

    name: str = FLOATER_CURRENTS

    def added(self, motion: Motion) -> Added:
        length, inertia = hy.par[Parameter.LENGTH], hy.par[Parameter.INERTIA]
        tilt, along = hy.par[Parameter.TILT_EDDY], hy.par[Parameter.SPIN_EDDY]
        moment, drift, lag = motion.moment, motion.drift, motion.lag
        gradient = [[length * entry for entry in row] for row in motion.gradient]
        bend = curvature(motion)
        change = _changed_field(lag, motion.field, [dot(row, drift) for row in gradient])
        sheared = _turned_gradient(lag, gradient)
        changes = [[dot(bend[i][j], drift) - sheared[i][j] for j in range(3)] for i in range(3)]
        pull = [_contracted(changes, [[bend[i][j][k] for j in range(3)] for i in range(3)]) for k in range(3)]
        force = [
            -tilt * inertia * (dot([gradient[i][k] for i in range(3)], change) + GRADIENT * pull[k]) for k in range(3)
        ]
        product = [[dot(changes[i], gradient[j]) for j in range(3)] for i in range(3)]
        twist = [product[i][j] - product[j][i] for i, j in ((1, 2), (2, 0), (0, 1))]
        turn = cross(motion.field, change)
        torque = [turn[k] - 2 * GRADIENT * twist[k] for k in range(3)]
        excess = (along - tilt) * dot(torque, moment)
        return dissipative(force, [tilt * torque[i] + excess * moment[i] for i in range(3)], motion)


@dataclass(frozen=True, eq=False)
class _Mode:
    """A mode at a lag: its share c, its delay τ, and q² = w²τ²."""

    share: float
    delay: hy.expression
    square: hy.expression


def _modes(degree: int, lag: Vector) -> list[_Mode]:
    """Those that are followed, and one for all others, so fast that it is never behind by much."""
    inverse = np.array(ZEROS[degree - 1]) ** -2.0
    fourth, sixth = SUMS[degree - 1]
    shares, delays = inverse**2 / fourth, inverse
    rest = 1 - shares.sum()
    square, slowness = dot(lag, lag), hy.par[Parameter.SLOWNESS]
    modes = [_Mode(float(c), t * slowness, square * (t * slowness) ** 2.0) for c, t in zip(shares, delays, strict=True)]
    last = float(sixth / fourth - shares @ delays) / rest
    return [*modes, _Mode(float(rest), last * slowness, square * (last * slowness) ** 2.0)]


def _changed_field(lag: Vector, field: Vector, moving: Vector) -> Vector:
    """Σ c [(1 - τX)⁻² G v - X (1 - τX)⁻¹ B], from X³ = -w² X."""
    modes = _modes(1, lag)
    once = [1 / (1 + mode.square) for mode in modes]
    turned = hy.sum([m.share * o for m, o in zip(modes, once, strict=True)])
    lifted = hy.sum([m.share * m.delay * o for m, o in zip(modes, once, strict=True)])
    late = hy.sum([2 * m.share * m.delay * o * o for m, o in zip(modes, once, strict=True)])
    later = hy.sum([m.share * m.delay**2.0 * (3 + m.square) * o * o for m, o in zip(modes, once, strict=True)])
    sheared = [late * a - turned * b for a, b in zip(moving, field, strict=True)]
    twice = [later * a - lifted * b for a, b in zip(moving, field, strict=True)]
    following = cross(lag, [a + b for a, b in zip(sheared, cross(lag, twice), strict=True)])
    return [a + b for a, b in zip(moving, following, strict=True)]


def _turned_gradient(lag: Vector, gradient: Matrix) -> Matrix:
    """Σ c X (1 - τX)⁻¹ G, from X (X² + w²) (X² + 4w²) = 0: 1/(1 - τ²X²) by Newton's differences at 0, w², 4w²."""
    modes, square = _modes(2, lag), dot(lag, lag)
    first = _commutator(lag, gradient)
    second = _commutator(lag, first)
    powers = [first, second, _commutator(lag, second)]
    powers.append(_commutator(lag, powers[2]))
    powers.append(_combined([-5.0 * square, -4.0 * square * square], [powers[2], first]))
    odd, even = [], []
    for m in modes:
        once, both = 1 / (1 + m.square), 1 / ((1 + m.square) * (1 + 4 * m.square))
        weights = [m.share * (m.delay**2.0 * once + square * m.delay**4.0 * both), m.share * m.delay**4.0 * both]
        odd.append(weights)
        even.append([m.delay * weight for weight in weights])
    slow = hy.sum([m.share * m.delay for m in modes])
    terms = [hy.expression(1.0), slow]
    # X²ⁿ⁺¹ goes with the odd part, X²ⁿ⁺² with the even one, which is one delay more
    terms += [hy.sum([row[0] for row in odd]), hy.sum([row[0] for row in even]), hy.sum([row[1] for row in odd])]
    sixth = _combined([-5.0 * square, -4.0 * square * square], [powers[3], second])
    return _combined([*terms, hy.sum([row[1] for row in even])], [*powers, sixth])


def _combined(factors: Sequence[hy.expression], matrices: Sequence[Matrix]) -> Matrix:
    return [[hy.sum([f * m[i][j] for f, m in zip(factors, matrices, strict=True)]) for j in range(3)] for i in range(3)]


def curvature(motion: Motion) -> list[Matrix]:
    """∂²B_i/∂x_j∂x_k (T) with lengths in radii: symmetric in all indices and without trace, so that seven suffice."""
    gradient, upper = motion.gradient, ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2))
    tensors = hy.diff_tensors([gradient[i][j] for i, j in upper], diff_args=list(motion.position), diff_order=1)
    slopes = hy.par[Parameter.LENGTH] * np.asarray(tensors.jacobian).reshape(5, 3)
    known = {(0, *pair): slopes[row, 0] for row, pair in enumerate(upper)}
    known |= {(1, 1, 1): slopes[3, 1], (1, 1, 2): slopes[4, 1]}
    known |= {(0, 2, 2): -known[0, 0, 0] - known[0, 1, 1], (1, 2, 2): -known[0, 0, 1] - known[1, 1, 1]}
    known |= {(2, 2, 2): -known[0, 0, 2] - known[1, 1, 2]}
    return [[[known[_sorted(i, j, k)] for k in range(3)] for j in range(3)] for i in range(3)]


def _sorted(i: int, j: int, k: int) -> tuple[int, int, int]:
    low, middle, high = sorted((i, j, k))
    return low, middle, high


def _commutator(turn: Vector, matrix: Matrix) -> Matrix:
    """w× M - M w× of a symmetric matrix: symmetric."""
    columns = [cross(turn, column) for column in matrix]  # [j][i]: of w× M
    return [[columns[j][i] + columns[i][j] for j in range(3)] for i in range(3)]


def _contracted(a: Matrix, b: Matrix) -> hy.expression:
    return hy.sum([a[i][j] * b[i][j] for i in range(3) for j in range(3)])
