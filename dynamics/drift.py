"""The slow drift of the body spin: averaged flights of minutes and hours along a branch of equilibria.

The magnetic torque of a rigid moment has no part along the moment, so that s = Ω·m̂/ω is moved by air drag and by the
floater's own eddy currents alone, over minutes, while everything else has settled.  The floater follows the branch of
its equilibria in s.  With arc length ℓ along the branch and ds/dt = a(s, ℓ), the flight is the solution of

    dℓ/dτ = a,     dt/dτ = ds/dℓ,

which is smooth at a fold (ds/dℓ = 0, reached in a finite time) and at a balance (a = 0, reached for t → ∞).
The model leaves out what a flight does within the time of a bounce (0.1 s), and the last fall of about that time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator

from ..fem.table import FieldTable
from ..geometry.box import Array
from ..geometry.scene import Scene
from .arclength import Steps, follow_branch
from .branch import FOLD, Family, Point, spins
from .equilibria import find_equilibria
from .equilibrium import Equilibrium, EquilibriumError
from .events import clearance
from .rates import Rates
from .slow_torque import SlowTorque
from .state import Scales

BALANCE, DURATION, INSTABILITY, CONTACT = "balance", "duration", "instability", "contact"
SETTLED = 1e-3
"""A balance is reached where ds/dt has fallen to this part of what it was at the start."""
E_FOLDS = 7.0
"""Growth after which a disturbance has ended the flight: from micrometres to millimetres."""
SAMPLES = 400


@dataclass(frozen=True, eq=False)
class Drift:
    """An averaged flight.

    Parameters
    ----------
    time : (n,) s
    spin : (n,) body spin s
    distance : (n,) from the rotor's origin, m
    growth_per_s : (n,) largest growth of a small motion
    ended_by : "balance", "fold", "instability", "contact" or "duration"
    balance_spin : the spin s* at which the slow torques balance, if the branch reaches it, else NaN
    fold_spin : where the branch ends in a fold, if that is known, else NaN
    """

    time: Array
    spin: Array
    distance: Array
    growth_per_s: Array
    ended_by: str
    balance_spin: float
    fold_spin: float

    @property
    def levitated_s(self) -> float:
        """How long the floater stayed up, s; infinite where it comes to a balance."""
        return np.inf if self.ended_by == BALANCE else float(self.time[-1])

    def fall_rate(self, start: float, end: float) -> float:
        """Mean rate at which the distance grows between two parts (0 to 1) of the flight, m/s."""
        times = np.array([start, end]) * self.time[-1]
        ends = np.interp(times, self.time, self.distance)
        return float((ends[1] - ends[0]) / (times[1] - times[0]))


def drift(
    scene: Scene,
    table: FieldTable,
    spin: float = 0.0,
    duration: float = 250.0,
    rates: Rates | None = None,
    start: Equilibrium | None = None,
    stokes: bool = False,
) -> Drift:
    """Follow the stable equilibrium of a scene while its body spin drifts.

    Parameters
    ----------
    scene : its drag and the floater's conductivity are the slow torques; its plate is left out
    table : the rotor's field
    spin : body spin at the start
    duration : at most, s; may be infinite where there is a slow torque
    rates : `Rates` of the same table, to compile them once for many scenes
    start : equilibrium at `spin`, if it is known; else the one at which small motions grow the slowest
    stokes : drag proportional to spin, as in `simulate`, instead of `air_torque`

    Raises
    ------
    EquilibriumError : no equilibrium at the start
    """
    rates = rates or Rates.of(scene, table)
    torque = SlowTorque.of(scene, rates, stokes)
    start = start or _start(scene, table, spin, rates)
    state = Scales.of(scene).pack(start.state)
    first = torque(state)
    if not first:
        return _steady(start, duration)
    towards = spin + np.copysign(3.0, first)

    def over(point: Point) -> bool:
        return point.kind == FOLD or torque(point.state) * (towards - spin) <= 0 or _touches(scene, point)

    points = follow_branch(Family(rates, spins(scene)), state, spin, towards, Steps(longest=0.03, turn=0.05), over)
    fold = next((k for k, point in enumerate(points) if point.kind == FOLD), None)
    if fold is not None:
        return _flown(torque, points[: fold + 1], duration, FOLD)
    return _flown(torque, points, duration, CONTACT if _touches(scene, points[-1]) else BALANCE)


def _start(scene: Scene, table: FieldTable, spin: float, rates: Rates) -> Equilibrium:
    """The equilibrium at which small motions grow the slowest."""
    known = find_equilibria(scene, table, spin, rates=rates)
    if not known:
        raise EquilibriumError(f"At {scene.frequency:g} Hz the floater has no equilibrium with body spin {spin:g}.")
    return min(known, key=lambda equilibrium: equilibrium.growth_per_s)


def _steady(start: Equilibrium, duration: float) -> Drift:
    """A flight on which nothing moves the spin."""
    growth = max(0.0, start.growth_per_s - start.growth_error_per_s)
    ended = INSTABILITY if growth * duration > E_FOLDS else DURATION
    time = np.array([0.0, E_FOLDS / growth if ended == INSTABILITY else duration])
    same = [np.full(2, value) for value in (start.spin, start.distance, start.growth_per_s)]
    return Drift(time, *same, ended, np.nan, np.nan)


def _touches(scene: Scene, point: Point) -> bool:
    return bool(clearance(replace(scene, plate=None), np.zeros(1), point.position[None])[0] < 0)


def _flown(torque: SlowTorque, points: list[Point], duration: float, end: str) -> Drift:
    """The flight along the points of a branch, to its `end` or to what comes first."""
    arc, course = _course(points)
    pace = CubicSpline(arc, [torque(p.state) for p in points])
    growth = PchipInterpolator(arc, [p.growth_per_s for p in points])
    first = abs(float(pace(0.0)))

    def change(_: float, y: Array) -> list[float]:
        slope = abs(float(course(y[0], 1)[0]))
        return [abs(float(pace(y[0]))), slope, slope * max(0.0, float(growth(y[0])))]

    limits: dict[str, Callable[[float, Array], float]] = {
        end: lambda _, y: y[0] - arc[-1],
        BALANCE: lambda _, y: abs(float(pace(y[0]))) / first - SETTLED,
        DURATION: lambda _, y: y[1] - duration if np.isfinite(duration) else -1.0,
        INSTABILITY: lambda _, y: y[2] - E_FOLDS,
    }
    for limit in limits.values():
        limit.terminal = True  # type: ignore[attr-defined]
    span = (0.0, 1e6 * arc[-1] / first)
    found = solve_ivp(
        change, span, [0.0, 0.0, 0.0], "LSODA", events=list(limits.values()), rtol=1e-9, atol=1e-12, dense_output=True
    )
    ended = next(name for name, hits in zip(limits, found.t_events, strict=True) if len(hits))
    lengths, times, _ = found.sol(np.linspace(0.0, found.t[-1], SAMPLES))
    spin, distance = course(lengths).T
    balances = pace.roots(extrapolate=False)
    return Drift(
        time=times,
        spin=spin,
        distance=distance,
        growth_per_s=growth(lengths),
        ended_by=ended,
        balance_spin=float(course(balances[0])[0]) if len(balances) else np.nan,
        fold_spin=points[-1].spin if end == FOLD else np.nan,
    )


def _course(points: list[Point]) -> tuple[Array, CubicHermiteSpline]:
    """Length along the branch (n,), and spin and distance as functions of it."""
    places = np.array([np.concatenate([p.state[:3], p.state[6:9], [p.spin]]) for p in points])
    arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
    values = np.array([[p.spin, p.distance] for p in points])
    slopes = np.array([[p.tangent[6], p.tangent[:3] @ p.position / np.linalg.norm(p.state[:3])] for p in points])
    return arc, CubicHermiteSpline(arc, values, slopes)
