"""Samples of a trajectory, how it ended, of what kind it was, and the file in which it is kept while it lasts."""

import hashlib
import io
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np

from ...fem.cache import TableKind
from ...geometry.common import Array, ComputationError, InputError, html_table, millimetres
from ...geometry.files import seal, unsealed, write_whole
from ..equilibria.balance import Indices
from ..motion.events import CONTACT, LOST
from ..motion.state import Parameter, State

DURATION, STOPPED = "duration", "stopped"
# The most turns and samples between two looks at the motion. A step ends where a piece does, so that pieces must not
# depend on how fast the machine is.
PIECE_TURNS, PIECE_SAMPLES = 256, 256
PARTS, DIVISIONS = 16, 3  # Into so many parts the time between two samples is divided, so often, to find a border


class IntegrationError(ComputationError):
    """The motion could not be integrated."""


@dataclass(frozen=True)
class FieldChanges:
    """What changes of the field's representation did in a trajectory through balls."""

    count: int = 0  # of the changes
    # Their sum U_new - U_old, each at the place of the change; relative, as the error of the energy balance
    energy: float = 0.0
    total: float = 0.0  # sum of |U_new - U_old|, relative
    error: float = 0.0  # largest error of a ball's field or gradient against the table, relative


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Samples of a trajectory and how it ended."""

    time: Array  #: (n,) s, at equal intervals but for the last
    lab: State  #: motion (n, 3) along the laboratory's axes, SI units
    angle: Array  #: (n,) of the rotor, rad
    rate: Array  #: (n,) its angular velocity, rad/s
    ended_by: str  #: "duration", "contact" or "lost"; "stopped" by the user
    energy_error: float  #: largest relative violation of the energy balance or of |m̂| = 1
    realtime_factor: float  #: simulated seconds per second of integration, compilation left out
    steps: int  #: number of Taylor steps
    compile_seconds: float  #: time spent on compilation (little where heyoka's cache knows the system)
    #: part of the samples at which the floater was out of the range of the plate's table
    beyond_plate_table: float = 0.0
    #: whether it ended, as "lost", where that range does: the plate's field is not known farther on
    left_plate_table: bool = False
    #: from one representation of the rotor's field to another; the energy balance is that of the motion between them
    field_changes: FieldChanges = field(default_factory=FieldChanges)
    #: (n, 2) angular momentum about the axis, N m s, and work, J, that the motor has given; None without a drive
    given: Array | None = None
    #: origin (n, 3) m and axes (n, 3, 3) of the rotor's frame before its own turn, where it is moved; else None
    pose: tuple[Array, Array] | None = None

    def __repr__(self) -> str:
        place = ", ".join(f"{1e3 * value:.4f}" for value in self.lab.position[-1])
        return (
            f"Trajectory of {self.levitated_s:.4g} s ({len(self.time)} samples), ended by {self.ended_by} at ({place}) "
            f"mm\n  energy balance to {self.energy_error:.1e}; {self.steps} steps, {self.realtime_factor:.3g} times "
            "real time"
        )

    def _repr_html_(self) -> str:
        rows = {"ended by": self.ended_by, "at": millimetres(self.lab.position[-1])}
        rows |= {"samples": str(len(self.time)), "energy balance": f"{self.energy_error:.1e}"}
        return html_table(f"Trajectory of {self.levitated_s:.4g} s", rows)

    @property
    def levitated_s(self) -> float:
        return float(self.time[-1])

    @property
    def lost_at_hz(self) -> float | None:
        """Frequency of the rotor at which the floater touched something or was lost, Hz; None where neither."""
        return float(self.rate[-1]) / (2 * np.pi) if self.ended_by in (CONTACT, LOST) else None

    @property
    def motor(self) -> Array:
        """(n, 2) torque, N m, and power, W, of the motor, each the mean since the sample before."""
        assert self.given is not None
        mean = np.diff(self.given, axis=0) / np.diff(self.time)[:, None]
        return np.concatenate([mean[:1], mean]) if len(mean) else np.zeros_like(self.given)

    @property
    def rotor(self) -> State:
        """Motion (n, 3) along the rotor's axes, SI units."""
        if self.pose is None:
            return self.lab.to_rotor(self.angle)
        back = replace(self.lab, position=self.lab.position - self.pose[0])
        return back.moved(np.zeros(3), self.pose[1].swapaxes(1, 2)).to_rotor(self.angle)


# All that are kept have so many bytes at most
FLIGHTS = TableKind("flight", Trajectory, "Trajectory of a floater", most=2**27)


class FlightStopped(KeyboardInterrupt):
    """The user stopped a trajectory; `simulated` is what is finished of it. Uncaught it ends the program."""

    def __init__(self, simulated: Trajectory) -> None:
        self.simulated = simulated
        super().__init__(f"The simulation was stopped at {simulated.levitated_s:.4g} s.")


@dataclass(frozen=True)
class Checkpoint:
    """The file in which a trajectory is kept while it lasts."""

    path: Path  #: where it is
    identity: str  #: everything that the trajectory depends on, as text; another trajectory's checkpoint is refused
    every: float = 5.0  #: seconds between two writings
    resumed: bool = True  #: whether what an earlier process kept is read; else it stays until this one writes

    @property
    def _key(self) -> str:
        return hashlib.sha256(self.identity.encode()).hexdigest()

    def write(self, content: Mapping[str, Any]) -> None:
        """Keep arrays by name; the file is whole or as it was."""
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, key=np.array(self._key), **content)
        write_whole(self.path, seal(stream.getvalue()))

    def read(self) -> dict[str, Any] | None:
        """Arrays by name, with the `region` (2, 3) m of the plate's table (zeros: none); None: no file, not `resumed`.

        Raises InputError: the file is damaged, or belongs to another trajectory.
        """
        if not self.resumed or not os.path.lexists(self.path):
            return None
        whole = unsealed(self.path, name="checkpoint")  # so that no library meets a damaged archive
        if whole is None:
            raise InputError(
                f"Input {self.path} must be a checkpoint; instead it is damaged or of an older version: delete it."
            )
        with np.load(io.BytesIO(whole)) as data:
            content = dict(data)
        if str(content.pop("key")) != self._key:
            raise InputError(
                f"Input {self.path} must be a checkpoint of this trajectory; instead it was kept by another scene, "
                "model, duration or version: delete it, choose another --out, or leave out --resume."
            )
        return content

    def remove(self) -> None:
        self.path.unlink(missing_ok=True)


STABLE, LINEAR_FALL, OSCILLATING_LOSS = "stable", "linear fall", "oscillating loss"
DRIFTING, GROWING, LOST_AT_ONCE = "drifting", "growing oscillation", "lost at once"
NOT_FOLLOWED = "not followed"  # To its end: it left the range of the plate's table
# Parts into which a trajectory is divided; the last one, in which the floater may already fall freely, is left out.
WINDOWS = 20
FEWEST = 4  # Samples in a part: a trend takes three
VISIBLE = 2e-5  # Smallest drift or oscillation that counts while the floater still levitates, m
# A loss before this time, s, is no levitation: too short for a few axial oscillations; nor is a trend seen in less.
SHORTEST = 0.5


def flight_kind(flight: Trajectory) -> str:
    """How a trajectory went.

    By the mean distance, and from the size of the oscillation in the rotor's frame about its trend, in twenty
    parts of the time.  Lost or in contact: "lost at once", with no levitation; an "oscillating loss" if the oscillation
    grew more than the mean distance changed until it was largest, in all of the time or in its last part; else a
    "linear fall".  Levitating at the end: "growing oscillation" if it became more than twice as large, or "drifting" if
    the distance goes on changing steadily in the second half, both by 0.02 mm at least; else "stable".
    """
    if flight.left_plate_table:
        return NOT_FOLLOWED
    lasted = flight.ended_by in (DURATION, STOPPED)
    whole = np.arange(len(flight.time))
    if len(whole) < FEWEST * WINDOWS or flight.levitated_s <= SHORTEST:
        return STABLE if lasted else LOST_AT_ONCE
    if not lasted:
        end = np.array_split(whole, WINDOWS)[-1]
        return OSCILLATING_LOSS if _swings(flight, whole) or _swings(flight, end) else LINEAR_FALL
    means, sizes = _trends(flight, whole)
    late = sizes[-WINDOWS // 4 :].mean()
    if late > VISIBLE and late > 2 * sizes[: WINDOWS // 4].mean():
        return GROWING
    means, steps = means[WINDOWS // 2 :], np.arange(WINDOWS - WINDOWS // 2)
    line = np.polynomial.Polynomial.fit(steps, means, 1)
    visible = max(VISIBLE, 3 * float(np.std(means - line(steps))))
    return DRIFTING if abs(line(steps[-1]) - line(0)) > visible else STABLE


def _swings(flight: Trajectory, samples: Indices) -> bool:
    """Whether the oscillation grew more than the mean distance changed until it was largest; not of too few samples."""
    if len(samples) < FEWEST * WINDOWS:
        return False
    means, sizes = (trend[:-1] for trend in _trends(flight, samples))
    largest = int(np.argmax(sizes))  # soon afterwards it may fall
    return bool(sizes[largest] - sizes[0] > max(VISIBLE, abs(means[largest] - means[0])))


def _trends(flight: Trajectory, samples: Indices) -> tuple[Array, Array]:
    """Mean distance, and size of the oscillation about a smooth trend in the rotor's frame, in parts of samples, m."""
    means, sizes, every = [], [], flight.rotor.position
    for part in np.array_split(samples, WINDOWS):
        time, places = flight.time[part], every[part]
        terms = np.vander((time - time[0]) / np.ptp(time), 3)
        rest = places - terms @ np.linalg.lstsq(terms, places)[0]
        means.append(np.linalg.norm(places, axis=1).mean())
        sizes.append(np.sqrt(2 * np.mean(rest**2, axis=0).sum()))
    return np.array(means), np.array(sizes)


class Recorder:
    """Samples at multiples of an interval, which doubles, dropping every other sample, when there are too many.

    From a `state` (n,) at the time `now` on, with a first `interval`; at most `capacity` samples are kept.
    """

    def __init__(self, state: Array, interval: float, capacity: int, now: float = 0.0) -> None:
        self.interval, self.capacity = interval, capacity
        self.times, self.states = np.array([now]), state[None]  # (m,) and (m, n)

    @staticmethod
    def grid(now: float, end: float, interval: float) -> Array:
        """Times to visit next: `now`, then some multiples of an `interval`, and `end` if they reach it."""
        count = int(np.clip(PIECE_TURNS * 2 * np.pi / interval, 1, PIECE_SAMPLES))
        first = int(np.floor(now / interval + 1e-9)) + 1
        times = interval * np.arange(first, first + count)
        times = times[times < end - 1e-9 * interval]
        return np.concatenate([[now], times, [end] if len(times) < count else []])

    @staticmethod
    def crossing(
        integrator: Any, values: Array, times: Array, states: Array, first_over: Callable[[Array, Array], int | None]
    ) -> tuple[float, Array]:
        """Time and state (s,) at which a motion crosses a border between `times` (2,), its `states` (2, s) being there.

        `integrator`, `values`: as of `propagated`; `first_over` gives the first of times (n,) at which a state is
        over the border; None: at none of them.
        """
        for _ in range(DIVISIONS):
            grid = np.linspace(times[0], times[1], PARTS + 1)
            *_, times, states = propagated(integrator, values, (times[0], 0.0), states[0], grid)
            first = first_over(times, states) or len(times) - 1
            times, states = times[first - 1 : first + 1], states[first - 1 : first + 1]
        return float(times[-1]), states[-1]

    def doubled(self, now: float) -> "Recorder":
        """With the interval that so many samples as there would have been until `now` had led to."""
        while np.floor(now / self.interval + 1e-9) + 1 > self.capacity:
            self.interval *= 2
        return self

    def due(self, seen: float, now: float, end: float) -> Array:
        """Multiples of the interval after `seen`, up to `now` and before `end`."""
        first, last = (int(np.floor(time / self.interval + 1e-9)) for time in (seen, now))
        times = self.interval * np.arange(first + 1, last + 1)
        return np.asarray(times[times < end - 1e-9 * self.interval])

    def add(self, times: Array, states: Array, last: bool) -> None:
        """Keep `states` (m, n) at those of `times` that are multiples of the interval, and the very `last`."""
        kept = np.abs(times / self.interval - np.round(times / self.interval)) < 1e-9
        kept[-1:] |= last
        self.times, self.states = np.append(self.times, times[kept]), np.concatenate([self.states, states[kept]])
        while len(self.times) > self.capacity:
            self.interval *= 2
            even = np.round(self.times / self.interval) * self.interval
            kept = np.abs(self.times - even) < 1e-6 * self.interval
            kept[-1] |= last
            self.times, self.states = self.times[kept], self.states[kept]


def propagated(
    integrator: Any, values: Array, time: tuple[float, float], state: Array, times: Array
) -> tuple[int | None, int, Array, Array]:
    """Number of the event that ended a motion before the last of `times` (n,), steps, those up to it, and states there.

    From a `time`, the sum of two numbers, and a `state` (s,) with runtime parameters `values` of the `integrator`; all
    scaled. Raises IntegrationError: the state became infinite.
    """
    integrator.pars[:], integrator.state[:] = values[: len(integrator.pars)], state
    integrator.dtime = time
    integrator.reset_cooldowns()
    outcome, _, _, steps, _, states = integrator.propagate_grid(times)
    if outcome == hy.taylor_outcome.err_nf_state:
        raise IntegrationError(
            f"A floater's state became infinite at t = {integrator.time * values[Parameter.TIME]:.6g} s. "
            "Look whether the start lies inside a magnet or the table's range is too small."
        )
    if outcome == hy.taylor_outcome.time_limit:
        return None, steps, times, states
    times, states = np.append(times[: len(states)], integrator.time), np.vstack([states, integrator.state])
    return -outcome.value - 1, steps, times, states
