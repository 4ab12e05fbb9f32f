"""Eddy currents in the rotor's own metal (`fem.rotor_losses`): a brake that turns with the rotor.

The floater's dipole m drives current pattern k by u_k = d/dt m·c_k(x), as seen from the rotor.  The currents make the
field B = -Σ u_k c_k there, which acts on the floater by (m·∇)B and m × B and takes the power Σ u_k².
"""

from dataclasses import dataclass

import heyoka as hy

from ...fem.rotor_losses import RotorLosses
from ..motion import Added, Motion, Parameter, cross, dissipative, dot


@dataclass(frozen=True, eq=False)
class RotorCurrents:
    """The brake of a table."""

    table: RotorLosses
    name: str = "rotor currents"

    def added(self, motion: Motion) -> Added:
        """Its accelerations of place and spin."""
        length = hy.par[Parameter.LENGTH]
        # m T/√(M R²) per unit of turn: the square root of the power, in the unit of energy a unit of time
        strength = hy.par[Parameter.PLATE_MOMENT] * (1.0 / hy.sqrt(hy.par[Parameter.TIME]))
        multipoles = self.table.multipoles.expressions([length * x for x in motion.position])
        moment, drift = motion.moment, motion.drift
        turning = cross(motion.lag, moment)
        heard = []
        for field, slope in multipoles:
            carried = [dot(moment, [slope[i][j] for i in range(3)]) for j in range(3)]
            heard.append(length * dot(carried, drift) + dot(field, turning))
        rates = [
            strength * hy.sum([float(w) * h for w, h in zip(row, heard, strict=True) if w])
            for row in self.table.weights
        ]
        answers = [-strength * hy.sum([float(w) * r for w, r in zip(column, rates, strict=True) if w])
                   for column in self.table.weights.T]  # fmt: skip
        field = _summed([b for b, _ in multipoles], answers)
        slopes = [_summed([slope[i] for _, slope in multipoles], answers) for i in range(3)]
        force = [length * dot(moment, [slopes[i][j] for i in range(3)]) for j in range(3)]
        torque = [t / hy.par[Parameter.INERTIA] for t in cross(moment, field)]
        return dissipative(force, torque, motion)


def _summed(vectors: list[list[hy.expression]], strengths: list[hy.expression]) -> list[hy.expression]:
    return [hy.sum([s * v[i] for s, v in zip(strengths, vectors, strict=True)]) for i in range(3)]
