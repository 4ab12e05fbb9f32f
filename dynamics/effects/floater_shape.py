"""A floater that is round but no sphere: its higher multipoles in the rotor's field, beyond its dipole.

A body of revolution about its moment has zonal multipoles alone, for its symmetry of odd degree l = 1, 3, 5.  Dipoles
p_i along m̂ at heights z_i of its axis have Q_l = Σ l p_i z_i^(l-1), so that those at 0, ±a, ±b, ±c have its first four;
then

    U = -Σ p_i m̂·B0(x + z_i m̂),   F = Σ p_i (m̂·∇) B0,   τ = Σ p_i m̂ × B0 + z_i m̂ × F_i.

Its turning is a sphere's: with the moment of inertia I across the moment and C about it, L/I = Ω⊥ + (C/I) Ω∥ obeys the
sphere's equations with I, as there is no torque about m̂ (`motion.Scales`).  Left out are degrees from 9 on: 1e-4 of the
force on a disc of 12 × 10 mm 20 mm below a cube of 10 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.floaters import FloaterSources, force_and_torque
from ...fem.rotor_tables import FieldFormula, FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Floater
from ..motion import Added, Motion, Parameter, cross, dot

FLOATER_SHAPE = "the floater's shape"
HEIGHTS = np.array([0.3, 0.6, 0.9])
"""Of the dipoles off the centre, in half heights of the floater."""


@dataclass(frozen=True, eq=False)
class FloaterShape:
    """What the shape of a cylinder polarised along its axis adds to the dipole at its centre.

    Parameters
    ----------
    field : the rotor's
    heights : (k,) m along the moment; the first is zero
    dipoles : (k,) by the moment of the equations
    floater, sources : whose shape it is
    """

    field: FieldFormula
    heights: Array
    dipoles: Array
    floater: Floater
    sources: FloaterSources
    name: str = FLOATER_SHAPE

    @classmethod
    def of(cls, floater: Floater, sources: FloaterSources, field: FieldFormula) -> FloaterShape:
        """The dipoles with the multipoles of a floater's sources, less the one that the equations have."""
        half = floater.solid.half_edges[2]
        heights = half * np.array([0.0, *HEIGHTS, *-HEIGHTS])
        degrees = 2 * np.arange(len(HEIGHTS) + 1) + 1
        powers = (heights / half) ** (degrees[:, None] - 1)
        wanted = sources.axial_moments(int(degrees[-1]))[degrees - 1] / (degrees * half ** (degrees - 1))
        dipoles = np.linalg.pinv(powers) @ wanted / (floater.moment or 1.0)
        return cls(field, heights, dipoles - (heights == 0) * bool(floater.moment), floater, sources)

    def added(self, motion: Motion) -> Added:
        """Force and torque of one energy."""
        length, torque, inertia = (hy.par[p] for p in (Parameter.LENGTH, Parameter.TORQUE, Parameter.INERTIA))
        moment, force, turn = motion.moment, [hy.expression(0.0)] * 3, [hy.expression(0.0)] * 3
        energy = hy.expression(0.0)
        for height, dipole in zip(self.heights, self.dipoles, strict=True):
            place = [length * x + float(height) * m for x, m in zip(motion.position, moment, strict=True)]
            field, gradient = self.field.expressions(place) if height else (motion.field, motion.gradient)
            strength = float(dipole) * torque
            pull = [strength * inertia * length * dot(moment, [gradient[i][j] for i in range(3)]) for j in range(3)]
            force = [a + b for a, b in zip(force, pull, strict=True)]
            arm = [float(height) / length / inertia * m for m in moment]
            turns = zip(cross(moment, field), cross(arm, pull), strict=True)
            turn = [a + strength * b + c for a, (b, c) in zip(turn, turns, strict=True)]
            energy = energy - strength * inertia * dot(moment, field)
        return Added(force, turn, energy=energy)

    def missed(self, table: FieldTable, position: Array, moment: Array) -> Array:
        """(n, 2) what the dipoles miss of torque and force over the moment, T and T/m, at (n, 3) m and (n, 3)."""
        axes = np.array([self.floater.axes(m) for m in moment])
        force, torque = force_and_torque(self.sources, table, position, axes)
        for height, dipole in zip(self.heights, self.dipoles + (self.heights == 0), strict=True):
            field, gradient = table.evaluate(position + height * moment)
            strength = dipole * self.floater.moment
            pull = strength * np.einsum("nj,nji->ni", moment, gradient)
            force -= pull
            torque -= strength * np.cross(moment, field) + height * np.cross(moment, pull)
        return np.asarray(np.linalg.norm([torque, force], axis=2).T / (self.floater.moment or 1.0))
