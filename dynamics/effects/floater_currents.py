"""Eddy currents of a conducting floater in the field that turns past it, taken as uniform (`fem.closed_forms`).

Slowly enough for its skin depth the torque is -κ [(Ω - W) B² - B B·(Ω - W)].
"""

from dataclasses import dataclass

import heyoka as hy

from ..motion import NOTHING, Added, Motion, Parameter, dissipative, dot

FLOATER_CURRENTS = "currents in the floater"


@dataclass(frozen=True)
class FloaterCurrents:
    """The floater's own eddy currents; how strong they are, the runtime parameters say."""

    name: str = FLOATER_CURRENTS

    def added(self, motion: Motion) -> Added:
        """Its acceleration of the spin; across the moment and along it."""
        tilt, along = hy.par[Parameter.TILT_EDDY], hy.par[Parameter.SPIN_EDDY]
        moment, field, lag = motion.moment, motion.field, motion.lag
        square, turning = dot(field, field), dot(field, lag)
        torque = [turning * field[i] - square * lag[i] for i in range(3)]
        excess = (along - tilt) * dot(torque, moment)
        return dissipative(NOTHING, [tilt * torque[i] + excess * moment[i] for i in range(3)], motion)
