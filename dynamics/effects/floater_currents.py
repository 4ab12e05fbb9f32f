"""Eddy currents of a conducting floater in the rotor's field, as the turning and moving floater sees it change.

Slowly enough for its skin depth a ball in a field of potential degree l loses a power quadratic in its rate of change
(`fem.rotor_losses`, `balls`): κ |Ḃ|² of the field and (2/21) R² κ |Ġ|² of its gradient G, κ = (2π/15) σ R⁵, with

    Ḃ = G v - w × B,        Ġ = (v·∇) G - (w× G - G w×),        v, w: drift and lag, seen from the rotor.

Force and torque are minus half the derivatives of the power by v and w: symmetric, and never driving.  Degree 3 is
left out; it changes the growth of small motions by 1 to 2 % of this effect's at 14 to 22 mm, more nearer by.
"""

from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ..motion import Added, Motion, Parameter, Vector, cross, dissipative, dot, subtract

Matrix = list[list[hy.expression]]
GRADIENT = 2 / 21
"""Share of a unit gradient in the loss, lengths in radii; κ is that of a unit field."""

FLOATER_CURRENTS = "currents in the floater"


@dataclass(frozen=True)
class FloaterCurrents:
    """The floater's own eddy currents; how strong they are, the runtime parameters say."""

    name: str = FLOATER_CURRENTS

    def added(self, motion: Motion) -> Added:
        """Its accelerations of place and spin; the spin's across the moment and along it."""
        length, inertia = hy.par[Parameter.LENGTH], hy.par[Parameter.INERTIA]
        tilt, along = hy.par[Parameter.TILT_EDDY], hy.par[Parameter.SPIN_EDDY]
        moment, drift = motion.moment, motion.drift
        gradient = [[length * entry for entry in row] for row in motion.gradient]
        bend = curvature(motion)
        change = subtract([dot(row, drift) for row in gradient], cross(motion.lag, motion.field))
        sheared = _commutator(motion.lag, gradient)
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
