"""The currents that the turning rotor alone drives in a plate, known beforehand.

While the plate stands at depth d the rotor's share r_i = Re Σ_h r_ih e^{ihφ} of its signals leaves the states

    q_i(φ, d) = Re Σ_h λ_i/(λ_i + ihω) r_ih(d) e^{ihφ},    ∂q_i/∂t = -λ_i (q_i - r_i).

What is integrated is p_i - q_i.  It hears the floater, and of the rotor only that the plate goes down, with speed u:

    d(p_i - q_i)/dt = -λ_i (p_i - q_i - m·b_i) - u ∂q_i/∂d,    y_i = (p_i - q_i - m·b_i) + (q_i - r_i),

exact for every motion.  The rotor's harmonics would be the fastest motion among all states and decide how long a step
of Taylor's method may be; so they act on the floater alone, by the weak field of the currents q - r.

Energy.  With y_r = q - r and y_f = y - y_r, the energy ½ Σ y_r² of the rotor's currents alone, their heat and what the
motor gives for them balance each other whatever the floater does.  They are left out.  The rest, Σ (½ y_f² + y_f y_r),
loses, beside its work on the floater,

    Σ [λ y_f² + y_f (2λ y_r + ∂r/∂t) + u y_r ∂q/∂d],    and 2λ y_r + ∂r/∂t = (λ - ihω) y_rh harmonic by harmonic.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import heyoka as hy
import numpy as np

from ...fem.closed_forms import ComplexArray
from ...fem.plate_tables import RotorShare
from ...geometry.basics import Array
from .symbols import Parameter, Vector, combined

Basis = Sequence[Sequence[hy.expression]]
"""Functions of time by harmonic, and for each by power of the depth, as `RotorShare.series` has them."""


@dataclass(frozen=True, eq=False)
class RotorCurrents:
    """The rotor's share of a plate's signals, and what it leaves.

    Parameters
    ----------
    share : r
    rates : (states,) λ, 1/s
    angular_velocity : ω of the rotor, rad/s; it is compiled in
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
    def braking(self) -> RotorShare:
        """2λ (q - r) + ∂r/∂t while the plate stays, √J/s."""
        return self.share.filtered(np.conj(self._impedance) * (self.rates / self._impedance - 1.0))

    @property
    def _impedance(self) -> ComplexArray:
        """λ + ihω, (H+1, states)."""
        turns = np.arange(len(self.share.series) // 2 + 1)
        return np.asarray(self.rates + 1j * self.angular_velocity * turns[:, None])


@dataclass(frozen=True, eq=False)
class RotorTerms:
    """What the rotor's currents add to the equations of motion, in scaled units.

    Parameters
    ----------
    strengths : Σ W_ik (q_i - r_i) of every multipole
    lowering : -u ∂q/∂d of each state; none of a plate that stays
    stored : Σ y_f y_r
    spent : Σ [y_f (2λ y_r + ∂r/∂t) + u y_r ∂q/∂d]
    """

    strengths: Vector
    lowering: Vector
    stored: hy.expression
    spent: hy.expression


def rotor_terms(rotor: RotorCurrents, weights: Array, own: Vector) -> RotorTerms:
    """The rotor's part, by time.

    Parameters
    ----------
    weights : (states, k) W of the multipoles
    own : y_f of each state, scaled
    """
    names = hy.make_vars("rotor_angle", "plate_depth")
    speed = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_SPEED]
    depth = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_DEPTH] + speed * hy.time
    now = {"rotor_angle": hy.par[Parameter.RATE] * hy.time, "plate_depth": depth}
    functions = rotor.share.basis(*names)

    def scaled(rows: Basis) -> Basis:
        return [[hy.par[Parameter.PLATE_SHARE] * hy.subs(f, now) for f in row] for row in rows]

    here, currents = scaled(functions), rotor.currents
    strengths = replace(currents, series=np.einsum("hik,im->hmk", currents.series, weights)).expressions(here)
    stored = _paired(currents, here, own)
    spent, lowering = hy.par[Parameter.TIME] * _paired(rotor.braking, here, own), list[hy.expression]()
    if rotor.share.distance:
        sinking = scaled([[speed * hy.diff(f, names[1]) for f in row] for row in functions])
        lowering = [-term for term in rotor.left.expressions(sinking)]
        spent = spent + _paired(rotor.share, sinking, own) - _summed(currents.expressions(here), lowering)
    return RotorTerms(strengths, lowering, stored, spent)


def _paired(share: RotorShare, basis: Basis, states: Vector) -> hy.expression:
    """Σ share · state: the states are summed first, for each function of time."""
    pairs = [(function, column) for row, part in zip(basis, share.series, strict=True)
             for function, column in zip(row, part.T, strict=True)]  # fmt: skip
    return hy.sum([function * combined(column, states) for function, column in pairs if column.any()])


def _summed(a: Vector, b: Vector) -> hy.expression:
    return hy.sum([x * y for x, y in zip(a, b, strict=True)])
