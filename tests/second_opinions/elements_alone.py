"""The whole field by finite elements, without any closed form: one expansion about the common centre."""

import numpy as np

from spinlev.fem.elements.ladder import Refinement, RotorSolution, refined, refinement_of, solve_rotor, strongest
from spinlev.fem.harmonics.expansion import without_noise
from spinlev.fem.rotor.models import Accuracy, error_points, extrapolated_tail, nonzero
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.meshes.magnets import MeshSettings

SETTINGS = MeshSettings(ball_radius=1.15)
DEGREE = 24
"""Of the outer harmonics: they fall as (radius of the ball about the magnets / distance)^degree."""


def direct_table(magnets: tuple[Magnet, ...], accuracy: Accuracy | None = None) -> RotorTable:
    """Field of magnets by finite elements alone, from the harmonics of ψ on the outer sphere.

    Orders from 2 to 8 are tried until the estimated error of the elements meets the accuracy; what degrees beyond 24
    would add near the magnets is stated by the table.
    """
    accuracy = accuracy or Accuracy()
    points, scale = error_points(magnets, accuracy.clearance(magnets))

    def whole(order: int) -> RotorSolution:
        return solve_rotor(
            magnets, Refinement(order, refinement_of(order, SETTINGS, strongest(magnets)).mesh, DEGREE), "direct"
        )

    solution, _, steps = refined(whole, points, scale, accuracy.rtol / 2, SETTINGS)
    coefficients = without_noise(solution.coefficients[0], 1e-15)
    expansions = nonzero(solution.expansions([coefficients]))
    # a radius that is wrong by ε, as the meshed sphere's is by half its area error, changes degree l by (l + 1) ε
    error = max(part.boundary.area_error for part in solution.parts)
    roundness = error / 2 * np.arange(1, len(coefficients) + 1)[:, None] * coefficients
    doubts = {
        "tail": nonzero(extrapolated_tail(expansions)),
        **{cause: nonzero(step) for cause, step in steps.items()},
        "roundness": nonzero(solution.expansions([roundness])),
    }
    return RotorTable("fem", magnets, (), expansions, doubts)
