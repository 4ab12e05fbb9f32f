"""Losses of magnets and conductors as if they were balls: a closed form, to say how large they would be.

In a field of potential u = Σ α_lm r^l Y_lm that changes, a ball about the origin loses

    P = σ Σ_l l/((l+1)(2l+3)) R^(2l+3) Σ_m α̇_lm²

because A = r × ∇u/(l+1) is free of divergence and has no part across its surface; degree 1 is (2π/15) σ R⁵ Ḃ².
A dipole m at x gives α_lm = μ0/(2l+1) m·∇(Y_lm/x^(l+1)).
"""

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import MU_0, Solid
from ..harmonics import factorials, norm
from ..plate_tables import Multipoles
from .table import RotorLosses

DEGREE = 3
CUBE = 0.6092
"""Radius of the ball with the losses of a cube in a uniform field, over the cube's edge."""


def ball_losses(pieces: Sequence[tuple[Sequence[Solid], float]], degree: int = DEGREE) -> RotorLosses:
    """Table for pieces of metal (bodies, S/m), each body a ball as large as a cube of its volume makes.

    Beside a cube it is right to a fifth from 15 mm off a 10 mm one on, and to a half in contact.
    """
    centers, kinds, weights = [], [], []
    for bodies, conductivity in pieces:
        for body in bodies:
            radius = CUBE * body.volume ** (1 / 3)
            parts = [(l, m, part) for l in range(1, degree + 1) for m in range(l + 1) for part in (0, 1)[: 1 + (m > 0)]]
            centers += [body.center] * len(parts)
            kinds += parts
            weights += [_weight(l, m, radius, conductivity) for l, m, _ in parts]
    multipoles = Multipoles(np.array(centers), np.array(kinds, float), 1.0)
    return RotorLosses(multipoles, np.diag(weights), np.zeros(1), np.full(1, 0.5))


def _weight(l: int, m: int, radius: float, conductivity: float) -> float:
    """√W s/(A m²) of the field of one harmonic Θ_lm with lengths in metres."""
    loss = conductivity * l / ((l + 1) * (2 * l + 3)) * radius ** (2 * l + 3)
    harmonic = norm(l, m) / factorials(l)[l, m]
    both_signs = 1.0 if m == 0 else 2.0  # of m stand in one multipole
    return float(np.sqrt(loss) * MU_0 / (2 * l + 1) * harmonic / both_signs)
