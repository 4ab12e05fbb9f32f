"""Slow drift of the body spin: torques along the floater's own moment, on which magnetic torque has no part.

That of air goes beyond Stokes' range (`motion.floater_effects`): 8πηR³Ω times f for a steady spin, times h for
a small swing.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Self

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator

from ...fem.rotor.table import FieldTable
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import Scene
from ..equilibria.equilibrium import FOLD, EquilibriumError
from ..equilibria.path import Steps
from ..equilibria.search import find_equilibria
from ..motion.effects import with_effects
from ..motion.equations import parameters
from ..motion.events import rotor_gap
from ..motion.floater_effects import reynolds, spinning, swinging
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales, State
from .branch import BranchPoint, Family, follow_branch, spins
from .frequencies import BORDER, HIGHEST, LONG_STEPS, LOWEST, at_frequency, by_frequency, is_over

BALANCE, DURATION, INSTABILITY, CONTACT = "balance", "duration", "instability", "contact"
SETTLED = 1e-3  # A balance is reached where ds/dt has fallen to this part of what it was at the start
E_FOLDS = 7.0  # Growth after which a disturbance has ended the trajectory, unless it is given: from 3 µm to 3 mm
SAMPLES = 400
ESCAPE = 3.40922  # Where the solution of y'' = t + y² that comes from y = -√(-t) becomes infinite; found numerically
# Frequencies along the branch at which trajectories are tried first: what lasts only between two of them is missed.
POINTS = 16
RESOLUTION = 0.5  # Of the ends of a range in which they last, Hz


@dataclass(frozen=True, eq=False)
class SlowTorque:
    """Rate of the body spin at rest in the rotor's frame: air drag, and own eddy currents towards cos θ.

    In this frame nothing changes within a turn, so that the average over it is the value itself:

        ds/dt = -(γ/I) [f s_z cos θ + h (s - s_z cos θ)] + κ B⊥² (cos θ - s) / I,   B⊥² = B² - (m̂·B)²,

    with γ and κ of `motion.equations` and the gradient's part of `FloaterCurrents`, compiled and evaluated here, and
    with the air's factors f of the steady spin s_z ω = (sin²θ + s cos θ) ω and h of the swing across it.  As h > f, the
    swing, which the rotor keeps up, drives s to a small positive value instead of zero, about (h/f - 1) sin²θ.  To
    second order in θ it also drives a steady flow, but none about the axis: the mean of a × (a × r) over a turn, with a
    the turning rate of a shell of air, has no such part.  Of a dipole at distance d the gradient adds (12/7) (R/d)² of
    κ; a plating of copper and nickel, t thick, adds 5 σ't/(σR) of it: a half for 5 µm of each of Ni, Cu and Ni.
    """

    rates: Rates  # compiled equations
    values: Array  # their parameters, all slow torques included
    radius: float  # of the floater, m
    beyond_stokes: bool  # whether drag goes beyond Stokes' here, as it does not in the compiled equations

    @classmethod
    def of(cls, scene: Scene, rates: Rates, stokes: bool = False) -> Self:
        """The slow torques of a `scene` by its `rates`, Stokes' with `stokes`. Raises InputError but for a sphere."""
        if (shape := scene.floater.shape) != "sphere":
            raise InputError(
                f'Input floater.shape must be "sphere" for its slow drift; instead received "{shape}". Simulate it '
                "(`simulate`)."
            )
        return cls(rates, parameters(scene, Scales.of(scene)), scene.floater.radius, not (stokes or scene.drag.air))

    def __call__(self, state: Array) -> float:
        """ds/dt, 1/s, at a scaled state (12,) at rest in the rotor's frame."""
        moment, spin = state[6:9], state[9:]
        change = self.rates(state[None], self.values)[0][0]
        rate = change[9:] @ moment + spin @ change[6:9]
        if self.beyond_stokes:
            # Scaled spin about the moment, each part times what its drag is more than Stokes'.
            time, turning = self.values[Parameter.TIME], self.values[Parameter.RATE]
            steady = spin[2] * moment[2]
            more = (float(spinning(reynolds(self.radius, spin[2] / time))) - 1) * steady
            more += (float(swinging(reynolds(self.radius, turning / time))) - 1) * (spin @ moment - steady)
            rate -= self.values[Parameter.SPIN_DRAG] * more
        return float(rate / self.values[Parameter.RATE] / self.values[Parameter.TIME])


@dataclass(frozen=True, eq=False)
class Drift:
    """An averaged trajectory."""

    time: Array  #: (n,) s
    spin: Array  #: (n,) body spin s
    distance: Array  #: (n,) from the rotor's origin, m
    growth_per_s: Array  #: (n,) largest growth of a mode
    ended_by: str  #: "balance", "fold", "instability", "contact" or "duration"
    balance_spin: float  #: the spin s* at which the slow torques balance, if the branch reaches it, else NaN
    last_fall_s: float = 0.0  #: time from the fold to the loss, s; 0 unless the trajectory ended by a fold

    @property
    def levitated_s(self) -> float:
        """Levitation time, s; infinite where the floater comes to a balance."""
        return np.inf if self.ended_by == BALANCE else float(self.time[-1]) + self.last_fall_s

    def fall_rate(self, start: float, end: float) -> float:
        """Mean rate at which the distance grows between two parts (0 to 1) of the trajectory, m/s."""
        times = np.array([start, end]) * self.time[-1]
        return float(np.diff(np.interp(times, self.time, self.distance))[0] / np.diff(times)[0])


def _averaged(torque: SlowTorque, points: list[BranchPoint], duration: float, end: str, e_folds: float) -> Drift:
    """The trajectory along the points of a branch, to its `end` or to what comes first."""
    places = np.array([np.concatenate([p.state[:3], p.state[6:9], [p.spin]]) for p in points])
    arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
    slopes = [(p.tangent[6], p.tangent[:3] @ p.position / np.linalg.norm(p.state[:3])) for p in points]
    course = CubicHermiteSpline(arc, [(p.spin, p.distance) for p in points], slopes)  # spin and distance by arc length
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
    balances, last_fall = pace.roots(extrapolate=False), 0.0
    if ended == FOLD:
        before = next(k for k in range(len(points) - 2, -1, -1) if arc[-1] - arc[k] > 0.01 or k == 0)
        slowest = float(points[before].motion.angular_frequencies[0]) / points[before].time_unit
        bend = float(course(arc[-1], 2)[0] / pace(arc[-1]))  # d²s/dℓ² over ds/dt there
        remaining = abs(bend) / 2 * (arc[-1] - arc[before]) ** 2
        last_fall = float(ESCAPE * (4 * remaining / slowest**4) ** 0.2)
    balance_spin = float(course(balances[0])[0]) if len(balances) else np.nan
    return Drift(times, spin, distance, growth(lengths), ended, balance_spin, last_fall)


def drift(
    scene: Scene,
    table: FieldTable,
    spin: float = 0.0,
    duration: float = 250.0,
    rates: Rates | None = None,
    start: State | None = None,
    stokes: bool = False,
    e_folds: float = E_FOLDS,
) -> Drift:
    """Follow the stable equilibrium of a `scene` in the field of `table` while its body spin drifts from `spin`.

    Raises EquilibriumError: no equilibrium at the start. Drag and the floater's conductivity are the slow torques; the
    plate is left out. `duration` is in s, infinite at most where there is a slow torque; `rates` are of the same table,
    to compile them once for many scenes; `start` is the equilibrium at `spin`, if it is known, else the one whose modes
    grow the slowest. Drag is proportional to spin with `stokes`, unless the scene's is that of real air, as in
    `simulate`; a mode has ended the trajectory after growth by `e_folds`.
    """
    rates = rates or Rates(with_effects(scene, table))
    torque = SlowTorque.of(scene, rates, stokes)
    family = Family(rates, spins(scene), spin_ratio=scene.floater.spin_ratio)
    if start is None:
        if not (known := find_equilibria(scene, table, spin, rates=rates)):
            raise EquilibriumError(f"At {scene.frequency:g} Hz the floater has no equilibrium with body spin {spin:g}.")
        start = min(known, key=lambda equilibrium: equilibrium.growth_per_s).state
    state = Scales.of(scene).pack(start)
    if not np.any(torque.values[[Parameter.SPIN_DRAG, Parameter.SPIN_EDDY]]):  # nothing moves the spin
        point = family.point(state[:3], state[6:9], spin)
        growth = max(0.0, point.growth_per_s - point.doubt_per_s)
        ended = INSTABILITY if growth * duration > e_folds else DURATION
        time = np.array([0.0, e_folds / growth if ended == INSTABILITY else duration])
        spin_, distance, rate = (np.full(2, value) for value in (point.spin, point.distance, point.growth_per_s))
        return Drift(time, spin_, distance, rate, ended, np.nan)
    towards = spin + np.copysign(3.0, torque(state))

    def over(point: BranchPoint) -> bool:
        return is_over(scene, point) or torque(point.state) * (towards - spin) <= 0

    points = follow_branch(family, state, spin, towards, Steps(longest=0.03, turn=0.05), over)
    end = CONTACT if rotor_gap(scene, points[-1].position) < 0 else BALANCE
    if fold := next((k for k, point in enumerate(points) if point.kind == FOLD), None):
        points, end = points[: fold + 1], FOLD
    return _averaged(torque, points, duration, end, e_folds)


@dataclass(frozen=True)
class Lasting:
    """The lowest interval of frequencies in which averaged trajectories last."""

    # low, high: Hz; NaN where none lasts
    low: float = np.nan
    high: float = np.nan
    ended_by: str = ""  # of trajectories above `high`, see `Drift`; or "border" of what was searched; "" without one
    growth_per_s: float = np.nan  # largest growth of a mode during the trajectory at `high`


def lasting_frequencies(
    scene: Scene,
    table: FieldTable,
    rates: Rates,
    start: Array,
    frequency: float,
    duration: float = 250.0,
    e_folds: float = E_FOLDS,
) -> Lasting:
    """Where a floater let go with body spin 0 remains levitated, by its averaged motion along a branch of equilibria.

    A trajectory of `duration` (s) is over where a mode has grown by `e_folds`: seven are 3 µm, what is left of a launch
    over a plate, to 3 mm.  Growth is added up along the drift of the body spin. Drag and conductivity are those of the
    `scene`, whose frequency is left open; `table` and `rates` have all effects that shall take part; `start` is a
    scaled state (12,) of an equilibrium of the branch at `frequency` (Hz).
    """
    family, over, sides = by_frequency(scene, rates), partial(is_over, scene), []
    for border in (LOWEST, HIGHEST):
        side = follow_branch(family, start, frequency, border, LONG_STEPS, over, np.inf)
        sides.append(side[: next((k for k, point in enumerate(side) if over(point)), len(side))])
    branch = [*sides[0][:0:-1], *sides[1]]

    @cache
    def ended(at: float) -> tuple[str, float]:
        """End of the trajectory at a frequency (Hz), "" if it lasts, and the largest growth in it, 1/s."""
        near = min(branch, key=lambda point: abs(point.parameter - at))
        point, there = at_frequency(scene, rates, near, at, LONG_STEPS, np.inf), replace(scene, frequency=at)
        flight = drift(there, table, 0.0, duration, rates, Scales.of(there).unpack(point.state), False, e_folds)
        lasts = flight.ended_by in (BALANCE, DURATION) or flight.levitated_s >= duration
        return "" if lasts else flight.ended_by, float(flight.growth_per_s.max())

    def edge(kept: float, gone: float) -> tuple[float, float]:
        """Two frequencies, at which the trajectory lasts and does not, nearer to each other."""
        while abs(gone - kept) > RESOLUTION:
            middle = (kept + gone) / 2
            kept, gone = (kept, middle) if ended(middle)[0] else (middle, gone)
        return kept, gone

    ends = branch[0].parameter, branch[-1].parameter
    grid = [float(at) for at in np.linspace(*ends, POINTS + 2)[1:-1]]
    if (first := next((at for at in grid if not ended(at)[0]), None)) is None:
        return Lasting()
    low = edge(first, max((at for at in grid if at < first), default=ends[0]))[0]
    gone = next((at for at in grid if at > first and ended(at)[0]), None)
    last = max(at for at in grid if gone is None or at < gone)
    if gone is None:
        return Lasting(low, ends[1], BORDER, ended(last)[1])
    high, lost = edge(last, gone)
    return Lasting(low, high, ended(lost)[0], ended(high)[1])
