"""The levitating equilibrium of a rotor as a function of frequency, followed from where it is known for certain.

At high frequency the floater's moment hardly tilts, so that on the axis the static attraction alone carries its weight
at one far distance, an unstable equilibrium.  From there the branch goes down in frequency to its fold, where the far
equilibrium meets the near one, and up again along the near one until floater and rotor touch.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import AbsoluteStart, Scene
from ..equilibria import Steps
from ..motion import Parameter, Rates, Scales, parameters, rotor_gap
from ..steady import EVERY, EquilibriumError, solve
from .arclength import follow_branch
from .branch import FOLD, BranchPoint, Family, frequencies

UP = np.array([0.0, 0.0, 1.0])
UNIT = 50.0
"""Hz over which the equilibrium moves by about a radius of the floater."""
SLOWEST = 10.0
"""Branches are followed down to this frequency, Hz: all of the article's rotors have their fold above it."""
REACH = (8e-3, 0.15)
"""Distances on the axis between which the attraction is looked at, m."""
SAME = 0.05
"""Farther than this (radii) from its neighbours on the branch, Newton's method has found another equilibrium."""


@dataclass(frozen=True, eq=False)
class Branch:
    """The two sides of a rotor's levitating branch.

    Parameters
    ----------
    family : the problem
    far, near : its points, by growing frequency; both begin at the fold
    """

    family: Family
    far: tuple[BranchPoint, ...]
    near: tuple[BranchPoint, ...]

    @property
    def fold(self) -> BranchPoint:
        """The lowest frequency at which there is an equilibrium."""
        return self.near[0]

    def side(self, name: str, grid: Array) -> list[BranchPoint | None]:
        """The equilibrium on a side ("near", "far") at each frequency of `grid` to round-off; None beyond its end."""
        points = {"near": self.near, "far": self.far}[name]
        return [self._at(points, float(frequency)) for frequency in grid]

    def _at(self, points: tuple[BranchPoint, ...], frequency: float) -> BranchPoint | None:
        known = np.array([point.parameter for point in points])
        if not known[0] <= frequency <= known[-1]:
            return None
        # Near the fold places go with the root of the distance to it.
        ahead = np.sqrt(np.maximum(known - known[0], 0.0))
        states = np.array([point.state for point in points])
        guess = np.array([np.interp(np.sqrt(frequency - known[0]), ahead, column) for column in states.T])
        moment = guess[6:9] / np.linalg.norm(guess[6:9])
        position, moments, size = solve(self.family.balance(frequency), guess[None, :3], moment[None], EVERY)
        if not size[0] < 1e-8 or np.linalg.norm(position[0] - guess[:3]) > SAME:
            return None
        return self.family.point(position[0], moments[0], frequency)


def by_frequency(scene: Scene, rates: Rates) -> Family:
    """A scene's equilibria against the frequency of the rotor."""
    return Family(rates, frequencies(scene), UNIT)


def levitating_branch(scene: Scene, table: FieldTable, rates: Rates, highest: float) -> Branch:
    """The branch of a scene's floater up to the frequency `highest` (Hz) or contact; gravity along the axis, s = 0.

    Raises
    ------
    EquilibriumError : no distance at which attraction carries the weight, or no fold above `SLOWEST`
    """
    family = by_frequency(scene, rates)
    start = _hanging(replace(scene, frequency=highest), table, family)

    def over(point: BranchPoint) -> bool:
        return rotor_gap(scene, point.position) < 0

    points = follow_branch(family, start, highest, SLOWEST, Steps(longest=0.1), over)
    folds = [k for k, point in enumerate(points) if point.kind == FOLD]
    if not folds:
        raise EquilibriumError(f"The levitating branch has no fold between {SLOWEST:g} and {highest:g} Hz.")
    end = folds[1] + 1 if len(folds) > 1 else len(points)
    return Branch(family, tuple(points[folds[0] :: -1]), tuple(points[folds[0] : end]))


def kicked(scene: Scene, point: BranchPoint, speed: float) -> Scene:
    """The scene at the frequency of an equilibrium, beginning there with `speed` (m/s) upwards."""
    there = replace(scene, frequency=point.parameter)
    state = Scales.of(there).unpack(point.state)
    start = AbsoluteStart(state.position, state.velocity + speed * UP, state.moment, state.spin)
    return replace(there, start=start)


def _hanging(scene: Scene, table: FieldTable, family: Family) -> Array:
    """Scaled state (12,) near the far equilibrium: on the axis, upright, where attraction carries the weight."""
    scales, upright = Scales.of(scene), UP[None]
    weight = scene.floater.mass * abs(float(scene.gravity[2]))

    def excess(distance: float) -> float:
        return scene.floater.moment * float(table.evaluate([[0.0, 0.0, -distance]])[1][0, 2, 2]) - weight

    grid = np.geomspace(*REACH, 60)
    nearest = next((d for d in grid if table.in_range([[0.0, 0.0, -d]])[0]), grid[-1])
    grid = grid[grid >= nearest]
    carried = [k for k, d in enumerate(grid) if excess(d) > 0]
    if not carried or carried[-1] == len(grid) - 1:
        raise EquilibriumError(
            f"Nowhere from {1e3 * nearest:.3g} to {1e3 * REACH[1]:.3g} mm does the attraction carry the weight."
        )
    distance = float(scipy.optimize.brentq(excess, grid[carried[-1]], grid[carried[-1] + 1]))
    return np.asarray(family.balance(scene.frequency).states(-distance / scales.length * upright, upright)[0])


def distance_error(scene: Scene, table: FieldTable, family: Family, point: BranchPoint) -> float:
    """What the errors that a table and its effects state may change of the distance along the axis, first order, m."""
    here = replace(scene, frequency=point.parameter)
    scales = Scales.of(here)
    values = parameters(here, scales, frozen_spin=True)
    place = point.position[None]
    (field, gradient), (of_field, of_gradient) = table.evaluate(place), table.relative_error(place)
    torque = values[Parameter.TORQUE] * of_field[0] * np.linalg.norm(field)
    size = of_gradient[0] * np.linalg.norm(gradient)
    force = np.prod(values[[Parameter.TORQUE, Parameter.INERTIA, Parameter.LENGTH]]) * size
    slope = family.balance(point.parameter)(point.state[None, :3], point.state[None, 6:9])[1][0]
    shares = np.abs(np.linalg.inv(slope)[2])
    return float(shares @ np.array([force] * 3 + [torque] * 2)) * scales.length
