"""What permeability adds to the field in and next to magnets: finite elements of growing order, kept once solved."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array, Part
from ...geometry.bodies import Magnet
from ...geometry.meshes import MeshSettings
from ..closed_forms import carrier
from ..magnetostatics import RotorSolution, in_ball, potential_slopes, refinement_of, solve_rotor, strongest
from .accuracy import Accuracy
from .fem_model import fem_table
from .table import RotorTable

LOWEST = 3
"""Order of the elements at first."""
MOST_LAYERS = 5
"""At the edges; one more with every order up to here, as a step between equal layers does not tell what they leave."""
SLOWEST = 0.3
"""Least ratio of two steps that is believed."""
SPREAD = 2.0
"""Share of the root mean square of the last step that is added to it, whose zeros are not those of the error."""
OUTSIDE = 1e-5
"""Relative accuracy of what lies outside the ball of the elements."""


@dataclass(frozen=True, eq=False)
class Reaction:
    """-∇ψ at points and how well it is known.

    Parameters
    ----------
    field : (n, 3) T
    slope : (n, 3, 3) T/m
    error, slope_error : estimated, of both (n,) T and T/m
    order : of the elements; 0 where none were needed
    """

    field: Array
    slope: Array
    error: Array
    slope_error: Array
    order: int


class NearElements:
    """Finite elements of magnets, of any order that is asked for.

    Parameters
    ----------
    magnets : with closed forms of their `carriers` split off
    """

    def __init__(self, magnets: Sequence[Magnet]) -> None:
        self.magnets = tuple(magnets)
        self.carriers = tuple(carrier(magnet) for magnet in magnets)
        self._solved: dict[int, RotorSolution] = {}
        self._outside: dict[float, RotorTable] = {}

    @property
    def needed(self) -> bool:
        """Whether the carriers' closed forms leave anything to the elements."""
        return any(magnet.contrast or isinstance(magnet.body, Part) for magnet in self.magnets)

    def reaction(self, points: Array, allowed: float, highest: int) -> Reaction:
        """-∇ψ at points (n, 3) m, of elements whose order grows until two agree to `allowed` T, or is `highest`."""
        nothing = np.zeros(len(points))
        found = Reaction(np.zeros_like(points), np.zeros((len(points), 3, 3)), nothing, nothing.copy(), 0)
        if not self.needed or not len(points):
            return found
        inside = in_ball(self._solution(LOWEST), points)
        if inside.any():
            first, second, error, steep, order = self._climbed(points[inside], allowed, highest)
            found.field[inside], found.slope[inside] = -first, -second
            found.error[inside], found.slope_error[inside] = error, steep
            found = Reaction(found.field, found.slope, found.error, found.slope_error, order)
        if not inside.all():
            self._add_outside(found, points, ~inside, allowed)
        return found

    def _solution(self, order: int) -> RotorSolution:
        if order not in self._solved:
            refinement = refinement_of(order, MeshSettings(), strongest(self.magnets))
            if not any(isinstance(magnet.body, Part) for magnet in self.magnets):
                layers = max(refinement.mesh.hp_layers, min(order - LOWEST + 1, MOST_LAYERS))
                refinement = replace(refinement, mesh=replace(refinement.mesh, hp_layers=layers))
            self._solved[order] = solve_rotor(self.magnets, refinement, "split", 1, carriers=self.carriers)
        return self._solved[order]

    def _climbed(self, points: Array, allowed: float, highest: int) -> tuple[Array, Array, Array, Array, int]:
        """∇ψ, its slope, the estimated errors of both, and the order."""
        error, steep = np.full(len(points), np.inf), np.full(len(points), np.inf)
        first, second = potential_slopes(self._solution(LOWEST), points)
        step, step_of_slope = np.zeros(len(points)), np.zeros(len(points))
        for order in range(LOWEST + 1, highest + 1):
            before = first, second
            first, second = potential_slopes(self._solution(order), points)
            # a step that is small by chance does not tell the error: the one before it has a say
            step = np.maximum(np.linalg.norm(first - before[0], axis=1), SLOWEST * step)
            step_of_slope = np.maximum(np.linalg.norm(second - before[1], axis=(1, 2)), SLOWEST * step_of_slope)
            error, steep = _spread(step), _spread(step_of_slope)
            if error.max() <= allowed:
                return first, second, error, steep, order
        return first, second, error, steep, highest

    def _add_outside(self, found: Reaction, points: Array, outside: NDArray[np.bool_], allowed: float) -> None:
        """Outside the ball: the expansions of a table of the outer field."""
        largest = max(float(np.linalg.norm(magnet.polarization)) for magnet in self.magnets)
        rtol = min(allowed / largest, OUTSIDE) if largest else OUTSIDE
        if rtol not in self._outside:
            self._outside[rtol] = fem_table(self.magnets, Accuracy(rtol))
        table, places = self._outside[rtol], points[outside]
        for expansion in table.expansions:
            field, slope = expansion.evaluate(places)
            found.field[outside] += field
            found.slope[outside] += slope
        found.error[outside], found.slope_error[outside] = table.absolute_error(places)


def _spread(size: Array) -> Array:
    return np.asarray(size + SPREAD * float(np.sqrt(np.mean(size**2))))
