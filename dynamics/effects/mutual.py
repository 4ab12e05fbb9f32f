"""Mutual magnetisation: rotor and floater answer to each other's fields, by the energy of a table (`fem.mutual`)."""

from dataclasses import dataclass

import heyoka as hy

from ...fem.mutual import MutualTable
from ..motion import Added, Motion, Parameter, Vector, conservative


@dataclass(frozen=True, eq=False)
class Mutual:
    """Rotor and floater magnetise each other.

    Parameters
    ----------
    table : of their answers
    """

    table: MutualTable
    name: str = "mutual magnetisation"

    def added(self, motion: Motion) -> Added:
        """Force and torque are the derivatives of one energy."""

        def energy(position: Vector, moment: Vector, field: Vector) -> hy.expression:
            place = [hy.par[Parameter.LENGTH] * x for x in position]
            strength, share = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.PLATE_SHARE]
            return self.table.energy(place, [strength * m for m in moment], [share * b for b in field], share)

        return conservative(energy, motion)
