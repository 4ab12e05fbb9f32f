"""What rotor and floater do to each other's magnetisation, as one energy: the table that the motion is driven by.

With the rotor's own field B0 and the floater's rigid moment m at x, beyond -m·B0 the energy is

    U = -½ α B0² - ½ Σ_k λ_k (M·b_k)² - u - M·V,    M = m + α B0,

with harmonic b_k (`answer_grid`; magnets as a whole also by the field at their centres, in which they answer to each
other).  α is the sphere's polarisability; that M stands for m lets the rotor answer to what B0 induces in the sphere.
The sphere's answer of degree 2 and more to B0 has the energy -u; the rotor answers to it with the field V at x, and so,
as derivatives of -M·V, come the sphere's answer of these degrees to the rotor's answer and their forces.
Left out is what goes to and fro once more: less than 2e-4 of what is told.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import MU_0, Array
from ...geometry.bodies import Magnet
from ..storage import compiled
from .answer_grid import AnswerGrid
from .point_kernel import grid_derivatives


@dataclass(frozen=True, eq=False)
class MutualTable:
    """The answers of a rotor and a floater to each other.

    Parameters
    ----------
    magnets : of the rotor
    grids : of those magnets that answer or are magnetised
    coupling : (3n, 3n) A m²/T: energies of the fields at the grids' centres, -½ bᵀ coupling b
    pairs : (n, n) J m⁸: energies of the sphere by the field gradients of two magnets' central dipoles
    polarizability : α, A m²/T
    gaps, errors : (k,) m between the bodies, and (k, 2) the largest relative errors of force and torque found there
    provenance : how the table was made; texts and numbers
    """

    magnets: tuple[Magnet, ...]
    grids: tuple[AnswerGrid, ...]
    coupling: Array
    pairs: Array
    polarizability: float
    gaps: Array = field(default_factory=lambda: np.array([1.0]))
    errors: Array = field(default_factory=lambda: np.zeros((1, 2)))
    provenance: dict[str, str | float] = field(default_factory=dict)

    def energy(
        self,
        position: Sequence[hy.expression],
        moment: Sequence[hy.expression],
        flux: Sequence[hy.expression],
        share: hy.expression | float = 1.0,
    ) -> hy.expression:
        """U, J times share², at a position (3 expressions, m) of a rigid moment (A m²) in a field B0 (T), times share.

        `share` lets the energy come in units of its own: it is one over their root.
        """
        whole = [m + self.polarizability * b for m, b in zip(moment, flux, strict=True)]
        parts = [-0.5 * self.polarizability * hy.sum([b * b for b in flux])]
        parts += [grid.energy(position, whole, share) for grid in self.grids]
        return hy.sum([*parts, self.coupled(position, whole, share)])

    def coupled(
        self, position: Sequence[hy.expression], whole: Sequence[hy.expression], share: hy.expression | float = 1.0
    ) -> hy.expression:
        """The part of the energy of the moment M that magnets have by what they are as a whole, as `energy`."""
        parts = [hy.expression(0.0)]
        if self.coupling.any():
            fields = [b for grid in self.grids for b in dipole_field(grid, position, whole)]
            parts += [
                float(-0.5 * (1 if a == b else 2) * self.coupling[a, b]) * (fields[a] * fields[b])
                for a, b in zip(*np.triu_indices(len(fields)), strict=True)
                if self.coupling[a, b]
            ]
        if self.pairs.any():
            slopes = [dipole_slope(grid, position) for grid in self.grids]
            for a, b in combinations(range(len(slopes)), 2):
                product = hy.sum([w * (p * q) for w, p, q in zip(FULL, slopes[a], slopes[b], strict=True)])
                parts.append(-float(self.pairs[a, b]) * share * share * product)
        return hy.sum(parts)

    def derivatives(self, places: Array, moments: Array) -> tuple[Array, Array, Array]:
        """Energy (n,) J of moments M without -½ α B0², gradient (n, 6) and second derivatives (n, 6, 6).

        By place (n, 3) m and moment (n, 3) A m², in this order.
        """
        rows = self._coupled(np.ascontiguousarray(np.concatenate([places, moments], axis=1).T))
        energy, slope, second = rows[0], rows[1:7].T, rows[7:].T.reshape(-1, 6, 6)
        for grid in self.grids:
            parts = grid_derivatives(grid, places, moments)
            energy, slope, second = energy + parts[0], slope + parts[1], second + parts[2]
        return energy, slope, second

    @cached_property
    def _coupled(self) -> Any:
        given = hy.make_vars("x", "y", "z", "m_x", "m_y", "m_z")
        energy = self.coupled(given[:3], given[3:])
        gradient = list(hy.diff_tensors([energy], diff_args=given, diff_order=1).gradient)
        second = np.asarray(hy.diff_tensors(gradient, diff_args=given, diff_order=1).jacobian)
        return compiled(hy.cfunc, [energy, *gradient, *second.ravel()], given, compact_mode=True)

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (n,) of what the answers add to force and torque, at points (n, 3) m."""
        places = np.asarray(points, float).reshape(-1, 3)
        radius = self.grids[0].radius
        gap = np.min([magnet.body.distance(places) for magnet in self.magnets], axis=0) - radius
        at = np.log(np.maximum(gap, self.gaps[0]))
        force, torque = (np.exp(np.interp(at, np.log(self.gaps), np.log(e))) for e in self.errors.T + 1e-12)
        return force, torque

    def __repr__(self) -> str:
        points = sum(len(grid.points) for grid in self.grids)
        told = ", ".join(
            f"{e:.1e} at {g * 1e3:.2g} mm" for g, e in zip(self.gaps, self.errors.max(axis=1), strict=True)
        )
        return f"MutualTable: {points} points in {len(self.grids)} magnets; relative error {told} from contact"


FULL = (1.0, 1.0, 1.0, 2.0, 2.0, 2.0)
"""How often the entries xx, yy, zz, xy, xz, yz of a symmetric tensor are in its square."""


def dipole_field(
    grid: AnswerGrid, position: Sequence[hy.expression], moment: Sequence[hy.expression]
) -> list[hy.expression]:
    """Field (3) T at a grid's centre of a moment (A m²) at a position (m), along the rotor's axes."""
    d = [x - float(c) for x, c in zip(position, grid.box.center, strict=True)]
    inverse = 1.0 / hy.sum([t * t for t in d])
    cube = (MU_0 / (4 * np.pi)) * (inverse * hy.sqrt(inverse))
    along = 3.0 * inverse * hy.sum([m * t for m, t in zip(moment, d, strict=True)])
    return [cube * (along * t - m) for t, m in zip(d, moment, strict=True)]


def dipole_slope(grid: AnswerGrid, position: Sequence[hy.expression]) -> list[hy.expression]:
    """Field gradient (xx yy zz xy xz yz, 1/m⁴) of a unit dipole along the remanence at the centre, by 3 μ0/4π."""
    j = grid.box.rotation @ grid.axis
    d = [x - float(c) for x, c in zip(position, grid.box.center, strict=True)]
    inverse = 1.0 / hy.sum([t * t for t in d])
    fifth = inverse * inverse * hy.sqrt(inverse)
    along = hy.sum([float(c) * t for c, t in zip(j, d, strict=True) if c])
    steep = 5.0 * inverse * along

    def entry(a: int, b: int) -> hy.expression:
        flat = float(j[a]) * d[b] + float(j[b]) * d[a]
        return fifth * ((flat + along if a == b else flat) - steep * (d[a] * d[b]))

    return [entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)]
