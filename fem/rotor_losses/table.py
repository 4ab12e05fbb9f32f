"""The rotor's currents as a table: exterior harmonic fields c_k with the power Σ_k (d/dt m·c_k(x))².

The rate is that of a dipole which moves and turns against the rotor.  With generalised velocities q̇ (its velocity in
the rotor's frame and its turn relative to the rotor) it is C q̇, and the force -D q̇ with D = CᵀC: symmetric and never
negative, whatever the fields are.  The fields are sums over a few multipoles in the metal, free of divergence and curl.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from ..plate_tables import Multipoles


@dataclass(frozen=True, eq=False)
class RotorLosses:
    """Dissipation in the rotor's metal.

    Parameters
    ----------
    multipoles : the J that all fields are made of
    weights : (K, J) c_k = Σ_j weight B_j, √W s/(A m²)
    distances : (d,) m from the rotor's nearest face, from contact on
    errors : (d,) largest relative error of D at these distances
    provenance : how the table was made; texts and numbers
    """

    multipoles: Multipoles
    weights: Array
    distances: Array
    errors: Array
    provenance: Mapping[str, str | float] = field(default_factory=dict)

    def rate_matrix(self, positions: ArrayLike, moments: ArrayLike) -> Array:
        """C (n, K, 6) √W s, for dipoles (n, 3) A m² at (n, 3) m: by velocity in m/s, then by turn in rad/s."""
        moments = np.asarray(moments, float)
        fields, slopes = self.fields(positions)
        return np.concatenate([np.einsum("ni,nkia->nka", moments, slopes), np.cross(moments[:, None], fields)], axis=2)

    def fields(self, positions: ArrayLike) -> tuple[Array, Array]:
        """c_k (n, K, 3) and ∂c_ki/∂x_j (n, K, 3, 3) at positions (n, 3) m."""
        fields, slopes = self.multipoles.evaluate(np.asarray(positions, float))
        return np.einsum("kj,nja->nka", self.weights, fields), np.einsum("kj,njab->nkab", self.weights, slopes)

    def dissipation(self, positions: ArrayLike, moments: ArrayLike) -> Array:
        """D (n, 6, 6) of dipoles (n, 3) A m² at (n, 3) m: N s/m, N s and N m s."""
        rates = self.rate_matrix(positions, moments)
        return np.asarray(np.einsum("nka,nkb->nab", rates, rates))

    def error_at(self, distance: float) -> float:
        """Relative error of D for a centre at this distance from the nearest face, m."""
        return float(np.interp(distance, self.distances, self.errors))

    def __repr__(self) -> str:
        size = f"{len(self.weights)} fields of {len(self.multipoles.kinds)} multipoles"
        return f"RotorLosses: {size}, error {self.errors[0]:.1e} in contact, {self.errors[-1]:.1e} far off"
