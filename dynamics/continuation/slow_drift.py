"""An averaged flight along a branch of equilibria whose body spin drifts.

With arc length ℓ along the branch and ds/dt = a(ℓ), the flight is the solution of

    dℓ/dτ = a,     dt/dτ = ds/dℓ,

which is smooth at a fold (ds/dℓ = 0, reached in a finite time) and at a balance (a = 0, reached for t → ∞).

The floater does not notice the fold at once.  Near it the slow mode obeys ẍ = αt + βx², the first equation of Painlevé,
whose solution on the branch escapes at t = 3.40922 (αβ)^(-1/5); the mode's frequency tells αβ: Ω⁴ = 4αβ (-t).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator

from ...geometry.basics import Array
from ..branches import FOLD, BranchPoint
from .slow_torque import SlowTorque

BALANCE, DURATION, INSTABILITY, CONTACT = "balance", "duration", "instability", "contact"
SETTLED = 1e-3
"""A balance is reached where ds/dt has fallen to this part of what it was at the start."""
E_FOLDS = 7.0
"""Growth after which a disturbance has ended the flight, unless it is given: from 3 µm to 3 mm."""
SAMPLES = 400
ESCAPE = 3.40922
"""Where the solution of y'' = t + y² that comes from y = -√(-t) becomes infinite; found numerically."""


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
    last_fall_s : time from the fold to the loss, s; 0 unless the flight ended by a fold
    """

    time: Array
    spin: Array
    distance: Array
    growth_per_s: Array
    ended_by: str
    balance_spin: float
    last_fall_s: float = 0.0

    @property
    def levitated_s(self) -> float:
        """How long the floater stayed up, s; infinite where it comes to a balance."""
        return np.inf if self.ended_by == BALANCE else float(self.time[-1]) + self.last_fall_s

    def fall_rate(self, start: float, end: float) -> float:
        """Mean rate at which the distance grows between two parts (0 to 1) of the flight, m/s."""
        times = np.array([start, end]) * self.time[-1]
        ends = np.interp(times, self.time, self.distance)
        return float((ends[1] - ends[0]) / (times[1] - times[0]))


def steady(start: BranchPoint, duration: float, e_folds: float = E_FOLDS) -> Drift:
    """A flight on which nothing moves the spin."""
    growth = max(0.0, start.growth_per_s - start.doubt_per_s)
    ended = INSTABILITY if growth * duration > e_folds else DURATION
    time = np.array([0.0, e_folds / growth if ended == INSTABILITY else duration])
    spin, distance, rate = (np.full(2, value) for value in (start.spin, start.distance, start.growth_per_s))
    return Drift(time, spin, distance, rate, ended, np.nan)


def flown(torque: SlowTorque, points: list[BranchPoint], duration: float, end: str, e_folds: float = E_FOLDS) -> Drift:
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
        INSTABILITY: lambda _, y: y[2] - e_folds,
    }
    for limit in limits.values():
        limit.terminal = True  # type: ignore[attr-defined]
    span = (0.0, 1e6 * arc[-1] / first)
    found = solve_ivp(
        change, span, [0.0, 0.0, 0.0], "LSODA", events=list(limits.values()), rtol=1e-9, atol=1e-12, dense_output=True
    )
    ended = next(name for name, hits in zip(limits, found.t_events, strict=True) if len(hits))
    lengths, times, folds = found.sol(np.linspace(0.0, found.t[-1], SAMPLES))
    rate = float(growth(lengths[-1]))
    if ended == BALANCE and rate > points[-1].doubt_per_s:  # it stays there only until this has grown
        wait = (e_folds - folds[-1]) / rate
        ended = INSTABILITY if times[-1] + wait < duration else DURATION
        lengths, times = np.append(lengths, lengths[-1]), np.append(times, min(times[-1] + wait, duration))
    spin, distance = course(lengths).T
    balances = pace.roots(extrapolate=False)
    return Drift(
        time=times,
        spin=spin,
        distance=distance,
        growth_per_s=growth(lengths),
        ended_by=ended,
        balance_spin=float(course(balances[0])[0]) if len(balances) else np.nan,
        last_fall_s=_escape(points, arc, float(course(arc[-1], 2)[0] / pace(arc[-1]))) if ended == FOLD else 0.0,
    )


def _course(points: list[BranchPoint]) -> tuple[Array, CubicHermiteSpline]:
    """Length along the branch (n,), and spin and distance as functions of it."""
    places = np.array([np.concatenate([p.state[:3], p.state[6:9], [p.spin]]) for p in points])
    arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
    values = np.array([[p.spin, p.distance] for p in points])
    slopes = np.array([[p.tangent[6], p.tangent[:3] @ p.position / np.linalg.norm(p.state[:3])] for p in points])
    return arc, CubicHermiteSpline(arc, values, slopes)


def _escape(points: list[BranchPoint], arc: Array, bend: float) -> float:
    """Time from the fold to the loss, s; `bend` is d²s/dℓ² over ds/dt there."""
    before = next(k for k in range(len(points) - 2, -1, -1) if arc[-1] - arc[k] > 0.01 or k == 0)
    slowest = float(points[before].motion.angular_frequencies[0]) / points[before].time_unit
    remaining = abs(bend) / 2 * (arc[-1] - arc[before]) ** 2
    return float(ESCAPE * (4 * remaining / slowest**4) ** 0.2)
