"""The currents that the turning rotor alone drives in a plate, known beforehand.

While the plate stands at depth d the rotor's share r_i = Re Σ_h r_ih e^{ihφ} of its signals leaves the states

    q_i(φ, d) = Re Σ_h λ_i/(λ_i + ihω) r_ih(d) e^{ihφ},    ∂q_i/∂t = -λ_i (q_i - r_i).

What is integrated is p_i - q_i.  It hears the floater, and of the rotor only that the plate goes down, with speed u:

    d(p_i - q_i)/dt = -λ_i (p_i - q_i - m·b_i) - u ∂q_i/∂d,    y_i = (p_i - q_i - m·b_i) + (q_i - r_i),

exact for every motion.  The rotor's harmonics would be the fastest motion among all states and decide how long a step
of Taylor's method may be; so they act on the floater alone, by the weak field of the currents q - r.

Energy.  To the floater the currents y_r = q - r are a field that is given as a function of time: they are what the
motor makes them to be, whatever the floater does.  So -m·Σ y_ri b_i is counted as the energy of a dipole in a field
from outside, and ½ Σ y_f², y_f = y - y_r, as what the floater has stored; together they lose, beside their work on it,

    Σ [λ y_f² + u y_f ∂q/∂d] + m·Σ b_i dy_ri/dt.

Whatever depends on the rotor's rate is a runtime parameter.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.closed_forms import ComplexArray
from ...fem.plate_tables import RotorShare
from ...geometry.basics import Array
from .symbols import Parameter, Vector, dotted


@dataclass(frozen=True, eq=False)
class RotorCurrents:
    """The rotor's share of a plate's signals, and what it leaves.

    Parameters
    ----------
    share : r
    rates : (states,) λ, 1/s
    angular_velocity : ω of the rotor, rad/s
    """

    share: RotorShare
    rates: Array
    angular_velocity: float

    @property
    def left(self) -> RotorShare:
        """The states q."""
        return self.share.filtered(self.rates / self._impedance)

    @property
    def currents(self) -> RotorShare:
        """The currents q - r."""
        return self.share.filtered(self.rates / self._impedance - 1.0)

    @property
    def _impedance(self) -> ComplexArray:
        """λ + ihω, (H+1, states)."""
        turns = np.arange(len(self.share.series) // 2 + 1)
        return np.asarray(self.rates + 1j * self.angular_velocity * turns[:, None])

    def numbers(self, weights: Array, reach: Sequence[int], unit: float, lowered: bool) -> Array:
        """Runtime parameters for `rotor_terms`, from the weights W (states, k) and the scaled unit of √energy."""
        strengths = np.einsum("nim,ik->nmk", self.currents.series[1:], weights).reshape(len(reach), -1)
        left = self.left.series.swapaxes(1, 2).ravel() if lowered else np.zeros(0)
        return unit * np.concatenate([*(row[:count] for row, count in zip(strengths, reach, strict=True)), left])


@dataclass(frozen=True, eq=False)
class RotorTerms:
    """What the rotor's currents add to the equations of motion, in scaled units.

    Parameters
    ----------
    strengths : Σ W_ik (q_i - r_i) of every function
    lowering : -u ∂q/∂d of each state; none of a plate that stays
    stored : the floater's energy in their field
    spent : its change by the field's own, and Σ u y_f ∂q/∂d
    """

    strengths: Vector
    lowering: Vector
    stored: hy.expression
    spent: hy.expression


def rotor_terms(
    share: RotorShare, reach: Sequence[int], first: int, lowered: bool, heard: Vector, own: Vector
) -> RotorTerms:
    """The rotor's part, by time.

    Parameters
    ----------
    share : of the rotor; only its shape counts, the numbers are runtime parameters from number `first` on
    reach : how many of the functions k have the terms of the share, those without h = 0 in their order
    lowered : whether the plate may go down
    heard : of each function k of the plate's fields what the floater's moment gives it
    own : y_f of each state, scaled
    """
    angle, depth = names = hy.make_vars("rotor_angle", "plate_depth")
    speed = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_SPEED]
    below = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_DEPTH] + speed * hy.time
    now = {"rotor_angle": hy.par[Parameter.RATE] * hy.time, "plate_depth": below}
    constant, *turning = share.basis(*names)
    functions = [f for row in turning for f in row]
    here = hy.subs(functions, now) if functions else []
    sinking = [speed * hy.subs(hy.diff(f, depth), now) for f in [*constant, *functions]] if lowered else []
    changing = [hy.par[Parameter.RATE] * hy.subs(hy.diff(f, angle), now) for f in functions]
    if lowered:
        changing = [a + b for a, b in zip(changing, sinking[len(constant) :], strict=True)]
    starts = [first + sum(reach[:n]) for n in range(len(reach) + 1)]
    rows = [[hy.par[start + k] for k in range(count)] for start, count in zip(starts[:-1], reach, strict=True)]
    sums = [dotted(row, heard[: len(row)]) for row in rows]
    lowering, start = list[hy.expression](), starts[-1]
    spent = dotted(changing, sums)
    if lowered:
        numbers = [[hy.par[start + n * len(own) + i] for n in range(len(sinking))] for i in range(len(own))]
        lowering = [-dotted(row, sinking) for row in numbers]
        spent = spent - dotted(own, lowering)
    strengths = [
        hy.sum([row[k] * f for row, f in zip(rows, here, strict=True) if k < len(row)]) for k in range(len(heard))
    ]
    return RotorTerms(strengths, lowering, -dotted(here, sums), spent)
