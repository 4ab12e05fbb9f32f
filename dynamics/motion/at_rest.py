"""The equations of motion of a floater at rest in the rotor's frame: five balances of its five freedoms.

Position r and moment m̂ with velocity W × r and spin Ω = W ẑ + (s - cos θ) W m̂.  What has to vanish is the force and
the torque along two tangents of m̂; their derivatives are by r and by tilts of m̂ along the same tangents.
"""

import heyoka as hy
import numpy as np

from .equations import NAMES, Equations
from .symbols import Parameter, Vector, dot

GIVEN = ("x", "y", "z", "m_x", "m_y", "m_z", "t_x", "t_y", "t_z", "u_x", "u_y", "u_z", "body_spin")
"""Position, moment, its two tangents, and body spin s: what balances are functions of."""
TILTS = ("tilt_t", "tilt_u")


def balances(equations: Equations) -> tuple[list[hy.expression], list[hy.expression]]:
    """The balances (5,) of a motion with their derivatives (5 × 5, row by row), and their variables (13,)."""
    given, tilts = list(hy.make_vars(*GIVEN)), list(hy.make_vars(*TILTS))
    position, tangents, spin = given[:3], (given[6:9], given[9:12]), given[12]
    moment = [given[3 + i] + tilts[0] * tangents[0][i] + tilts[1] * tangents[1][i] for i in range(3)]
    rates = hy.subs(list(equations.rates[:12]), dict(zip(NAMES, _state(position, moment, spin), strict=True)))
    force, torque = rates[3:6], rates[9:12]
    values = [*force, *(dot(tangent, torque) for tangent in tangents)]
    free = [*position, *tilts]
    slopes = np.asarray(hy.diff_tensors(values, diff_args=free, diff_order=1).jacobian).reshape(5, 5)
    for k in (3, 4):
        slopes[k, k] = slopes[k, k] - dot(moment, torque)  # the tangents turn with the moment
    untilted = {name: hy.expression(0.0) for name in TILTS}
    return hy.subs([*values, *slopes.ravel()], untilted), given


def _state(position: Vector, moment: Vector, spin: hy.expression) -> list[hy.expression]:
    rate = hy.par[Parameter.RATE]
    along = rate * (spin - moment[2])
    velocity = [-rate * position[1], rate * position[0], hy.expression(0.0)]
    return [*position, *velocity, *moment, along * moment[0], along * moment[1], along * moment[2] + rate]
