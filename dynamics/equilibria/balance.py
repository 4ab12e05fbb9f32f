"""Balance of forces and torques on a floater at rest in the frame that turns with the rotor.

Unknown are the position and the direction of the moment.  At rest the velocity is W × r and the spin is
Ω = W ẑ + (s - cos θ) W m̂, which turns with the frame and has the component s W along the moment: L = IΩ is that of
a synchronous floater with body spin s.  What remains to vanish are three forces and the two torques across the moment.
The torque of drag along the moment is left out: it moves s, slowly; s is what the caller fixes.
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array
from ..motion.rates import Rates
from ..motion.state import Parameter

Indices = NDArray[np.intp]
LATERAL: Indices = np.array([0, 1, 3, 4])  # The four balances but the axial force, and the four unknowns but the height
EVERY: Indices = np.arange(5)
AXIAL = 2
CONVERGED_STEP = 1e-8  # of Newton's method, in floater radii or rad: squared, it leaves round-off
DUPLICATE_DISTANCE = 1e-6  # within which two solutions are one
# Part of what a model leaves out that is wrong of its effect to first order, by all causes together and by each. Below
# three vertical and four tilted rotors of permeable cubes the place by finite elements differed by 0.59 to 0.79 of the
# error so stated for dipoles and cuboids (72 equilibria), below five horizontal ones by 0.1 to 1 of it, below ten
# random rotors by 0.18 to 0.67 of it.
SECOND_ORDER = 0.25


@dataclass(frozen=True, eq=False)
class Balance:
    """Five balances as functions of five unknowns, all in scaled units, at many points in one call."""

    rates: Rates  # compiled rates and their derivatives
    # their parameters, with the drag along the moment left out: (p,), or (n, p) where every point has its own, or
    # (k n, p) where it has several
    values: Array
    spin: float | Array  # body spin s = Ω·m̂/ω, of all points or (n,)
    top: float = 0.0  # beside a rotor at rest, where s means nothing, the spin about the moment itself
    still: bool = False  # whether the body stands still in the rotor's frame: then s is `spin` times cos θ

    def at(self, rows: NDArray[Any]) -> Self:
        if self.values.ndim == 1:
            return self
        spin = self.spin if np.ndim(self.spin) == 0 else np.asarray(self.spin)[rows]
        return replace(self, values=self.values.T[:, rows].T, spin=spin)

    def states(self, position: Array, moment: Array) -> Array:
        """States (n, 12) at rest in the rotor's frame at positions and moments (n, 3)."""
        rate = np.asarray(self.values[..., [Parameter.RATE]])
        velocity = rate * np.stack([-position[:, 1], position[:, 0], 0 * position[:, 0]], axis=1)
        own = np.asarray(self.spin)[..., None] * (moment[:, 2:] if self.still else 1.0)
        spin = rate * ((own - moment[:, 2:]) * moment + np.array([0.0, 0.0, 1.0]))
        spin = spin + self.top * moment
        return np.concatenate([position, velocity, moment, spin], axis=1)

    def __call__(self, position: Array, moment: Array) -> tuple[Array, Array]:
        """Balances (n, 5), force and torque along two tangents; derivatives (n, 5, 5) by place and such tilts."""
        tangents = tangent_basis(moment)
        return self.rates.balance(position, moment, tangents, np.asarray(self.spin), self.values, self.still)


def place_error(
    inverse: Array, residual: Array, values: Array, doubt: Array, moment: Array, directions: Array
) -> float:
    """Estimated error of the place where balances of three forces and k torques vanish, scaled.

    From the `inverse` (3 + k, 3 + k) of the balances' derivatives, their `residual` (3 + k,), `values` (p,) of the
    parameters, the `doubt` (2 + 12 c,) of the field there (see `field_doubts`), the unit `moment` (3,), and the
    `directions` (k, 3) of the torques.
    """
    torque, length, inertia = values[[Parameter.TORQUE, Parameter.LENGTH, Parameter.INERTIA]]
    pull = inertia * length
    unsure = np.abs(residual) + torque * np.array([pull * doubt[1]] * 3 + [doubt[0]] * len(directions))
    error = float(np.linalg.norm((np.abs(inverse) @ unsure)[:3]))
    # What a model leaves out moves the place in a known direction, and several causes may cancel; their sizes never do.
    left_out = doubt[2:].reshape(-1, 4, 3)
    forces, torques = pull * (left_out[:, 1:] @ moment), np.cross(moment, left_out[:, 0]) @ directions.T
    moved = (torque * np.concatenate([forces, torques], axis=1) @ inverse.T)[:, :3]
    together, each = np.linalg.norm(moved.sum(axis=0)), np.linalg.norm(moved, axis=1)
    return error + float((1 + SECOND_ORDER) * together + SECOND_ORDER * each.sum())


def tangent_basis(moment: Array) -> Array:
    """Two unit vectors (n, 2, 3) across each (n, 3), nowhere singular (T. Duff, J. Comput. Graph. Tech. 6 (2017) 1)."""
    x, y, z = moment.T
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    basis = np.empty((len(moment), 2, 3))
    basis[:, 0, 0], basis[:, 0, 1], basis[:, 0, 2] = 1 + sign * x * x * a, sign * x * y * a, -sign * x
    basis[:, 1, 0], basis[:, 1, 1], basis[:, 1, 2] = x * y * a, sign + y * y * a, -y
    return basis


def moved_pose(position: Array, moment: Array, step: Array) -> tuple[Array, Array]:
    """A `position` and `moment` (n, 3) each after a `step` (n, 5) of the unknowns; the moments stay unit vectors."""
    moment = moment + np.einsum("nk,nka->na", step[:, 3:], tangent_basis(moment))
    return position + step[:, :3], moment / np.linalg.norm(moment, axis=1, keepdims=True)


def solve(
    balance: Balance,
    position: Array,
    moment: Array,
    free: Indices,
    iterations: int = 60,
    reach: float = 0.3,
    far: float = np.inf,
) -> tuple[Array, Array, Array]:
    """Newton's method for a `balance` from many starts `position` and `moment` (n, 3) at once.

    Returns positions and moments (n, 3), and lengths (n,) of the last steps: the errors before these; infinite where it
    failed. `free` says which unknowns move and which balances count, e.g. `LATERAL` to keep the height. There are so
    many `iterations` at most, with steps of `reach` (floater radii, and rad) at most; farther than `far` (radii) from
    the origin this grows with the distance, as the scale of the field does.
    """
    position, moment, active = position.copy(), moment.copy(), np.arange(len(position))
    length = np.full(len(position), np.inf)
    for _ in range(iterations):
        value, slope = balance.at(active)(position[active], moment[active])
        step = np.zeros((len(active), 5))
        good = np.isfinite(slope).all(axis=(1, 2))
        value, slope = value[:, free], slope[:, free[:, None], free]
        right = -value[good, :, None]
        try:
            found = np.linalg.solve(slope[good], right)
        except np.linalg.LinAlgError:  # one of them is singular to the last bit
            found = np.linalg.pinv(slope[good]) @ right
        step[np.ix_(good, free)] = found[..., 0]
        shift, tilt = np.linalg.norm(step[:, :3], axis=1), np.linalg.norm(step[:, 3:], axis=1)
        scale = np.maximum(1.0, np.linalg.norm(position[active], axis=1) / far)
        step *= (reach / np.maximum(np.maximum(shift / scale, tilt), reach))[:, None]
        position[active], moment[active] = moved_pose(position[active], moment[active], step)
        length[active] = np.where(good, np.maximum(shift, tilt), np.inf)
        active = active[good & (length[active] >= 1e-11)]
        if not len(active):
            break
    return position, moment, length
