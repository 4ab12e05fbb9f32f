"""Synchronous equilibria as periodic motions: what a plate or tilted gravity makes of the fixed points without them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..motion.events import clearance
from ..motion.plate import PlateForce, PlateMemory
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales, State
from .balance import Indices
from .equilibrium import FOLD, IN_PLATE, IN_ROTOR, NOT_CONVERGED, PAST_TABLE, Equilibrium, LeftOut
from .orbits import Orbit, OrbitProblem, conserved, floquet_modes, periodic_orbit, resampled
from .path import DIFFERENCE, END, ON, Steps, directions, follow

SMALLEST_STEP = 1 / 64  # Of the way from no plate and gravity along the axis to the whole plate and the true gravity
JUMP = 0.5  # An orbit that moves farther in one longer step of that way, in floater radii, may be another one
# Along the curve of orbits, where a step of the way fails.
TURNING = Steps(longest=0.1, shortest=1e-5, turn=0.2, most=400)
SHAKING = [Parameter.GRAVITY_X, Parameter.GRAVITY_Y]
INSTANTS = 16  # Of a turn, at which a steady motion is looked at in the laboratory


@dataclass(frozen=True, eq=False)
class OrbitCurve:
    """A periodic motion as a function of one parameter, as equations of a curve: states divided by √n, parameter."""

    rates: Rates  # compiled equations of the rotor's field
    # parameter -> values of the runtime parameters, drag along the moment left out, and the plate's forces
    problem: Callable[[float], tuple[Array, PlateForce | None]]
    spin: float  # body spin s

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """Residual (1, 12 n) at one point (1, 12 n + 1), and its derivatives (1, 12 n, 12 n + 1).

        The equations of an orbit keep |m̂| and the spin, so that two of the 12 n + 2 follow from the others; of their
        singular value decomposition as many are taken as there are unknowns but one.
        """
        states, parameter = self.states(points[0, :-1]), float(points[0, -1])
        problem = self._at(states, parameter)
        residual, slope = problem(states)
        ends = [self._at(states, parameter + s * DIFFERENCE)(states)[0] for s in (1, -1)]
        rows, aims = conserved(states, self.spin * abs(problem.values[Parameter.RATE]))
        column = np.append((ends[0] - ends[1]) / (2 * DIFFERENCE), [0.0, 0.0])
        every = np.column_stack([np.vstack([slope, rows]) * np.sqrt(len(states)), column])
        if not np.isfinite(every).all():
            return np.full((1, states.size), np.nan), np.full((1, states.size, states.size + 1), np.nan)
        left = np.linalg.svd(every)[0][:, : states.size].T
        return (left @ np.append(residual, aims))[None], (left @ every)[None]

    def onto(self, points: Array) -> Array:
        """The points: that moments have length one is among the equations."""
        return points

    @staticmethod
    def states(unknowns: Array) -> Array:
        """States (n, 12) of unknowns (12 n,)."""
        states = unknowns.reshape(-1, 12)
        return np.asarray(states * np.sqrt(len(states)))

    def _at(self, states: Array, parameter: float) -> OrbitProblem:
        return OrbitProblem(self.rates, *self.problem(parameter), len(states))


@dataclass(frozen=True, eq=False)
class ForcedMotion:
    """A scene in which something makes the motion periodic."""

    scene: Scene  # gravity may have any direction
    rates: Rates  # compiled equations in the rotor's field
    values: Array  # their parameters, with the drag along the moment left out
    memory: PlateMemory | None  # the plate's currents, if they are modelled

    def reaches(self, known: Equilibrium) -> bool:
        """Whether the plate's table knows the places of an equilibrium through a whole turn."""
        if self.memory is None:
            return True
        return bool(np.all(self.memory.table.in_range(self.memory.plate.box.to_body(known.laboratory_turn.position))))

    def equilibrium(self, known: Equilibrium) -> Equilibrium | LeftOut:
        """Periodic motion that a fixed point, or one in tilted gravity without plate, becomes; or why it is none."""
        scales, fixed = Scales.of(self.scene), known.without or known
        begun = known.state if known.turn is None else known.turn
        orbit, why, part = self._followed(scales.pack(begun), known.spin, known.turn is None)
        if orbit is None:
            return LeftOut(known, why, part)
        turn, motion = scales.unpack(orbit.states), floquet_modes(orbit)
        found = Equilibrium(
            state=scales.unpack(orbit.mean),
            spin=fixed.spin,
            residual=orbit.error,
            position_error=self._position_error(orbit, known, scales),
            **motion.in_seconds(scales.time),
            turn=turn,
            currents=orbit.plate / self.values[Parameter.PLATE_SHARE] if self.memory else None,
            without=fixed,
        )
        why = overlap(self.scene, found) or ("" if self.reaches(found) else PAST_TABLE)
        return LeftOut(found, why) if why else found

    def _followed(self, start: Array, spin: float, tilts: bool) -> tuple[Orbit | None, str, float]:
        """The orbit that a state (12,), or a turn (n, 12) of them, becomes while the plate grows to its full size.

        Gravity across the axis grows with it where the start is without (`tilts`).  Where there is none, why, and up
        to which part of the way there is one.
        """

        def problem(part: float) -> tuple[Array, PlateForce | None]:
            values = self.values.copy()
            if tilts:
                values[SHAKING] *= part
            values[[Parameter.PLATE_MOMENT, Parameter.PLATE_SHARE, Parameter.INDUCED]] *= np.sqrt(part)
            return values, None if self.memory is None else PlateForce(self.memory, values)

        def orbit(part: float, states: Array) -> Orbit | None:
            values, plate = problem(part)
            return periodic_orbit(self.rates, values, spin, plate, states)

        found, done, step, states = None, 0.0, 1.0, start
        while done < 1.0 and step >= SMALLEST_STEP:
            ahead = orbit(min(1.0, done + step), states)
            if ahead is None or (step > SMALLEST_STEP and _moved(states, ahead.states) > JUMP):
                step /= 2
            else:
                found, done, states = ahead, min(1.0, done + step), ahead.states
        if done == 1.0 or found is None:
            return found, NOT_CONVERGED, done
        arrived, why, part = _turned(OrbitCurve(self.rates, problem, spin), states, done)
        return None if arrived is None else orbit(1.0, arrived), why, part

    def _position_error(self, orbit: Orbit, known: Equilibrium, scales: Scales) -> float:
        """The one's own without the plate, m, and the part of what the plate moves that its table may be wrong by."""
        wrong = 0.0
        if self.memory:
            places = known.position if known.turn is None else resampled(known.turn.position, len(orbit.states))
            moved = np.linalg.norm(orbit.states[:, :3] * scales.length - places, axis=1).max()
            wrong = self.memory.error * float(moved)
        return known.position_error + wrong + orbit.error * scales.length


def _turned(curve: OrbitCurve, states: Array, done: float) -> tuple[Array | None, str, float]:
    """States of an orbit at the whole of the way, by arc length from those (n, 12) at a part of it that is done.

    Where there is none, why, and up to which part there is one: a curve that turns back is one of a fold.
    """
    last, tangent = np.append(states.ravel() / np.sqrt(len(states)), done), np.zeros(states.size + 1)
    farthest = done

    def watch(which: Indices, points: Array, tangents: Array, lengths: Array) -> int:
        nonlocal last, tangent, farthest
        last, tangent, farthest = points[0], tangents[0], max(farthest, float(points[0, -1]))
        return END if tangent[-1] < 0 or last[-1] >= 1 else ON

    forward = np.append(0.0 * last[:-1], 1.0)[None]
    follow(curve, last[None], directions(curve, last[None], forward), TURNING, watch)
    if last[-1] >= 1:
        return curve.states(last[:-1]), NOT_CONVERGED, farthest
    return None, FOLD if tangent[-1] < 0 else NOT_CONVERGED, farthest


def _moved(before: Array, after: Array) -> float:
    """Distance of the means of an orbit (n, 12) and of another one, or a state (12,), in floater radii."""
    start = before if before.ndim == 1 else before.mean(axis=0)
    return float(np.linalg.norm((after.mean(axis=0) - start)[:3]))


def overlap(scene: Scene, known: Equilibrium) -> str:
    """Where in a turn the floater of an equilibrium would overlap the plate or the rotor, which; else nothing."""
    turn = known.turn or State(*(np.tile(vector, (INSTANTS, 1)) for vector in known.state.vectors))
    times = np.arange(len(turn.position)) / (len(turn.position) * (scene.frequency or np.inf))
    if clearance(scene, times, turn.position, turn.moment).min() >= 0:
        return ""
    free_of_rotor = clearance(replace(scene, plate=None), times, turn.position, turn.moment).min() >= 0
    return IN_PLATE if free_of_rotor else IN_ROTOR
