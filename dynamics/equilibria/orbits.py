"""Periodic motion in the rotor's frame, where a plate or tilted gravity forces the floater once a turn.

The floater's state at N equidistant instants of a turn is unknown; derivatives are those of the trigonometric
interpolation, so that the error falls geometrically with N.  The plate's states are eliminated exactly: at the
multiple h of the rotor's frequency p̃ = λ/(λ + ih) s̃.  Newton's method with exact derivatives (harmonic balance in the
time domain: J. P. Boyd, Chebyshev and Fourier Spectral Methods, 2001, ch. 6 and 15).

The equations keep |m̂| and the body spin s = Ω·m̂/ω; both are prescribed beside them.  Of a body that is not round they
keep the length of its quaternion alone: how it turns about its moment the motion itself decides.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..motion.body_shape import MISSED_BY_PLATE, response_error
from ..motion.events import clearance
from ..motion.plate import PlateCoupling, PlateForce, PlateMemory
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales, turned_about_z
from .balance import Indices
from .equilibrium import (
    FOLD,
    IN_PLATE,
    IN_ROTOR,
    NOT_CONVERGED,
    PAST_TABLE,
    Equilibrium,
    LeftOut,
    Modes,
    free_directions,
    left_eigenvectors,
    resampled,
)
from .path import DIFFERENCE, END, ON, Steps, directions, follow

FEWEST, MOST = 9, 65  # Instants in a turn, odd
TAIL = 1e-10  # Size of the highest harmonics, in floater radii and rad, below which there are enough instants
CONVERGED, LONGEST_STEP = 1e-11, 0.3
# Steps of Newton's method that are shorter than this, in floater radii and rad, and no longer shrink are round-off.
ROUNDED = 1e-7
SMALLEST_STEP = 1 / 64  # Of the way from no plate and gravity along the axis to the whole plate and the true gravity
JUMP = 0.5  # An orbit that moves farther in one longer step of that way, in floater radii, may be another one
# Along the curve of orbits, where a step of the way fails.
TURNING = Steps(longest=0.1, shortest=1e-5, turn=0.2, most=400)
SHAKING = [Parameter.GRAVITY_X, Parameter.GRAVITY_Y]
INSTANTS = 16  # Of a turn, at which a steady motion is looked at in the laboratory


@dataclass(frozen=True, eq=False)
class Orbit:
    """One turn of a periodic motion, scaled, along the rotor's axes."""

    states: Array  # (n, m) of the floater at n equidistant instants, the first at t = 0: m is 12, or 13 of `Scales`
    plate: Array  # (n, k) states of the plate
    derivatives: Array  # (n, m + k, m + k) of all rates by all states
    error: float  # estimate, from the highest harmonics and the last step of Newton's method

    @property
    def mean(self) -> Array:
        """(m,) mean state; its moment is made a unit vector again, or its quaternion."""
        state = self.states.mean(axis=0)
        state[6:-3] /= np.linalg.norm(state[6:-3])
        return np.asarray(state)


def periodic_orbit(rates: Rates, values: Array, spin: float, plate: PlateForce | None, guess: Array) -> Orbit | None:
    """The orbit near a `guess`, a scaled state (m,) or an odd number n of them; None where Newton's method finds none.

    By `rates` in the rotor's field with `values`, the drag along the moment left out and gravity in any direction, with
    body `spin` s, and with the currents of a `plate` if they are modelled.
    """
    count = FEWEST
    states = np.broadcast_to(guess, (count, len(guess))) if guess.ndim == 1 else resampled(guess, count)
    while True:
        found = _orbit_near(rates, values, spin, plate, states)
        if found is None or _tail(found.states) < TAIL or count >= MOST:
            return found
        count = 2 * count - 1
        states = resampled(found.states, count)


def _orbit_near(rates: Rates, values: Array, spin: float, plate: PlateForce | None, states: Array) -> Orbit | None:
    problem = OrbitProblem(rates, values, plate, len(states))
    states, size = states.copy(), np.inf
    for _ in range(25):
        before = size
        residual, slope = problem(states)
        rows, aims = conserved(states, spin * abs(values[Parameter.RATE]))
        if not np.isfinite(slope).all():
            return None
        matrix, target = np.vstack([slope, rows]), -np.append(residual, aims)
        step = scipy.linalg.lstsq(matrix, target, cond=1e-14, lapack_driver="gelsy", check_finite=False)[0]
        step = step.reshape(states.shape)
        size = float(np.abs(step).max())
        states = states + step * min(1.0, LONGEST_STEP / size)
        # Quadratic convergence would have squared a step that is so short: one that has not shrunk is round-off.
        if size < CONVERGED or before / 2 < size < ROUNDED:
            break
    else:
        return None
    return Orbit(states, *problem.whole(states), max(size, _tail(states)))


def _tail(states: Array) -> float:
    """Size of the highest harmonics of a turn (n, m): what more instants would add."""
    return float((np.abs(np.fft.rfft(states, axis=0)) / len(states))[-2:].max())


def one_sided(states: Array, like: Array) -> Array:
    """States (n, 13), of two quaternions of one attitude each with that on the side of a state `like` (13,)."""
    sides = np.ones_like(states)
    sides[:, 6:10] = np.sign(states[:, 6:10] @ like[6:10])[:, None]
    return states * sides


def conserved(states: Array, spin: float) -> tuple[Array, Array]:
    """Derivatives (2, 12 n) and values (2,) of |m̂|²/2 - 1/2 and Ω·m̂ - s at first; else (1,) of the quaternion."""
    if states.shape[1] > 12:
        rows, quaternion = np.zeros((1, states.size)), states[0, 6:10]
        rows[0, 6:10] = quaternion
        return rows, np.array([(quaternion @ quaternion - 1) / 2])
    moment, turning = states[0, 6:9], states[0, 9:]
    rows = np.zeros((2, states.size))
    rows[0, 6:9], rows[1, 6:9], rows[1, 9:12] = moment, turning, moment
    return rows, np.array([(moment @ moment - 1) / 2, turning @ moment - spin])


@dataclass(frozen=True, eq=False)
class Pencil:
    """T(λ) v = 0 of small deviations e^{λτ} v(τ) about a periodic one, v at n instants; T(0) is the orbit's own slope.

    The plate's states are eliminated exactly, as from the orbit: their memory M depends on λ.
    """

    change: Array  # (n, n) derivative by scaled time
    slopes: Array  # (n, m, m) of the floater's rates, the plate's currents as they are
    plate: PlateForce | None = None
    drive: PlateCoupling | None = None

    def matrix(self, shift: complex) -> NDArray[Any]:
        """T (m n, m n) at λ = `shift` per unit of scaled time."""
        n, size, _ = self.slopes.shape
        found = np.einsum("ab,xy->axby", self.change + shift * np.eye(n), np.eye(size))
        found[np.arange(n), :, np.arange(n)] -= self.slopes
        if self.plate is not None and self.drive is not None:
            parts = self.drive.fields, self.plate.remembered(n, shift) - np.eye(n), self.drive.by_state
            found[:, accelerated(size)] -= np.einsum("aix,iab,biy->axby", *parts, optimize=True)
        return np.asarray(found.reshape(size * n, size * n))

    def applied(self, vector: NDArray[Any], shift: complex) -> NDArray[Any]:
        """T(λ) v (m n,) of a vector (m n,), without the matrix."""
        count, size, _ = self.slopes.shape
        motion = vector.reshape(count, size)
        found = self.change @ motion + shift * motion - np.einsum("axy,ay->ax", self.slopes, motion)
        if self.plate is not None and self.drive is not None:
            signals = np.einsum("biy,by->bi", self.drive.by_state, motion)
            currents = np.einsum("iab,bi->ai", self.plate.remembered(count, shift), signals) - signals
            found[:, accelerated(size)] -= np.einsum("aix,ai->ax", self.drive.fields, currents)
        return np.asarray(found.ravel())


@dataclass(frozen=True, eq=False)
class OrbitProblem:
    """Equations of an orbit at `count` instants of a turn."""

    rates: Rates
    values: Array
    plate: PlateForce | None
    count: int

    @property
    def times(self) -> Array:
        """(n,) scaled."""
        return 2 * np.pi * np.arange(self.count) / self.count

    def __call__(self, states: Array) -> tuple[Array, Array]:
        """Residual (m n,) and its derivatives (m n, m n)."""
        residual, pencil = self.linear(states)
        return residual, pencil.matrix(0.0)

    def linear(self, states: Array) -> tuple[Array, Pencil]:
        """Residual (m n,), and the equations of small deviations about these states (n, m)."""
        n, change = self.count, differentiation(self.count)
        rates, slopes = self._floater(states)
        residual = change @ states - rates
        if self.plate is None:
            return residual.ravel(), Pencil(change, slopes)
        # The plate pulls with what its states have relaxed to, less the signals themselves: F (M - 1) s(x).
        drive = self.plate(self.times, states)
        currents = np.einsum("iab,bi->ai", self.plate.remembered(n), drive.signals) - drive.signals
        rows = accelerated(states.shape[1])
        residual[:, rows] -= np.einsum("aix,ai->ax", drive.fields, currents)
        # F changes at the same instant alone, the currents with the signals of all instants.
        slopes[:, rows] += np.einsum("akyx,ak->axy", drive.pull, self.plate.strengths(currents))
        return residual.ravel(), Pencil(change, slopes, self.plate, drive)

    def whole(self, states: Array) -> tuple[Array, Array]:
        """States of the plate (n, k), and derivatives of all rates by all states (n, m + k, m + k)."""
        slopes = self._floater(states)[1]
        if self.plate is None:
            return np.zeros((self.count, 0)), slopes
        drive, decay = self.plate(self.times, states), self.plate.rates
        memory = np.einsum("iab,bi->ai", self.plate.remembered(self.count), drive.signals)
        own = states.shape[1]
        size, rows = own + len(decay), accelerated(own)
        full = np.zeros((self.count, size, size))
        full[:, :own, :own] = slopes
        full[:, rows, :own] += np.einsum("akyx,ak->axy", drive.pull, self.plate.strengths(memory - drive.signals))
        full[:, rows, :own] -= np.einsum("aix,aiy->axy", drive.fields, drive.by_state)
        full[:, rows, own:] = drive.fields.swapaxes(1, 2)
        full[:, own:, :own] = decay[:, None] * drive.by_state
        full[:, own:, own:] = -np.diag(decay)
        return memory, full

    def _floater(self, states: Array) -> tuple[Array, Array]:
        rates, slopes = self.rates(states, self.values)
        gravity = np.append(self.values[Parameter.GRAVITY_X : Parameter.GRAVITY_Z], 0.0)
        rates[:, 3:6] += turned_about_z(gravity[None], -self.values[Parameter.RATE] * self.times)
        return rates, slopes


def accelerated(size: int) -> Indices:
    """(6,) places of velocity and spin in a state of this size."""
    return np.array([3, 4, 5, size - 3, size - 2, size - 1])


def differentiation(count: int) -> Array:
    """(n, n) derivative of the trigonometric interpolation at an odd number of equidistant instants of 2π."""
    order = np.arange(count)
    gap = order[:, None] - order
    with np.errstate(divide="ignore"):
        matrix = 0.5 * (-1.0) ** gap / np.sin(np.pi * gap / count)
    np.fill_diagonal(matrix, 0.0)
    return np.asarray(matrix)


# Steps in a turn, doubled once for the error, and again until it is small: so often at most.
STEPS, MOST_STEPS = 24, 384
ENOUGH = 1e-8  # Error of the multipliers that is small: 1e-6 /s of growth at 100 Hz
SHARE = 0.1  # Of the change by the last doubling, as the error: of a method of order six it is a 63rd
NODES = np.array([0.5 - np.sqrt(15) / 10, 0.5, 0.5 + np.sqrt(15) / 10])
COLLOCATION = np.array([
    [5 / 36, 2 / 9 - np.sqrt(15) / 15, 5 / 36 - np.sqrt(15) / 30],
    [5 / 36 + np.sqrt(15) / 24, 2 / 9, 5 / 36 - np.sqrt(15) / 24],
    [5 / 36 + np.sqrt(15) / 30, 2 / 9 + np.sqrt(15) / 15, 5 / 36],
])  # fmt: skip
# Gauss's method of order six (E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, 1996, ch. IV.5).
WEIGHTS = np.array([5, 8, 5]) / 18


def floquet_modes(orbit: Orbit) -> Modes:
    """Modes of an orbit that keep what the equations keep, as |m̂| and body spin: growth and frequencies over a turn.

    A multiplier ρ leaves a frequency open to whole multiples of the rotor's; each mode is given at the one that is
    strongest in its motion along the rotor's axes.  The error is that of the steps (twice as long for comparison) and
    of round-off.  Of the plate's own modes, which only decay, the floater's are distinguished by their shapes.
    """
    size, own_size = orbit.derivatives.shape[1], orbit.states.shape[1]
    currents = np.eye(size - own_size)
    tangent, projection = (scipy.linalg.block_diag(part, currents) for part in free_directions(orbit.states[0]))
    free = tangent.shape[1] - (size - own_size)
    coarse, steps = _propagated(orbit.derivatives, own_size, STEPS)[-1], 2 * STEPS
    while True:
        matrices = _propagated(orbit.derivatives, own_size, steps)
        turn = projection @ matrices[-1] @ tangent
        multipliers, right = np.linalg.eig(turn)
        left = left_eigenvectors(right)
        own = np.argsort(-np.linalg.norm(right[:free], axis=0))[:free]
        stepped = SHARE * np.abs(np.einsum("ij,ji->i", left @ (turn - projection @ coarse @ tangent), right))
        if stepped[own].max() < ENOUGH or steps >= MOST_STEPS:
            break
        coarse, steps = matrices[-1], 2 * steps
    condition = np.linalg.norm(left, axis=1) * np.linalg.norm(right, axis=0)
    rounded = 100 * np.finfo(float).eps * np.linalg.norm(turn) * condition
    rates = np.log(multipliers[own].astype(complex)) / (2 * np.pi)
    errors = (stepped + rounded)[own] / (2 * np.pi * np.abs(multipliers[own]))
    shapes = tangent @ right[:, own]
    return Modes(rates + 1j * _turns(matrices[:, :own_size], shapes, rates), errors, shapes[:own_size])


def _propagated(derivatives: Array, own_size: int, steps: int) -> Array:
    """Propagator (steps + 1, s, s) of deviations of the floater's states and the plate's, by steps of a turn."""
    count, size = derivatives.shape[:2]
    step = 2 * np.pi / steps
    spectrum = np.fft.rfft(derivatives, axis=0) / count
    spectrum[1:] *= 2
    instants = step * (np.arange(steps)[:, None] + NODES)
    slopes = np.tensordot(np.exp(1j * instants[..., None] * np.arange(len(spectrum))), spectrum, 1).real
    m = own_size
    own, fields, driven = slopes[..., :m, :m], slopes[..., :m, m:], slopes[..., m:, :m]
    decay = -np.diagonal(slopes[0, 0, m:, m:])
    damped = np.linalg.inv(np.eye(3) + step * decay[:, None, None] * COLLOCATION)
    lag = step * COLLOCATION @ damped
    lagging = [(fields * lag[:, :, k].T[:, None]).reshape(steps, 3 * m, size - m) @ driven[:, k] for k in range(3)]
    pull = np.stack(lagging, axis=-2).reshape(steps, 3, m, 3, m)
    pull[:, range(3), :, range(3)] += own.swapaxes(0, 1)
    kept = fields * (1 - decay[:, None] * lag.sum(axis=2)).T[:, None]
    system = np.eye(3 * m) - step * np.einsum("njxky,kl->njxly", pull, COLLOCATION).reshape(steps, 3 * m, 3 * m)
    right = np.concatenate([pull.sum(axis=3), kept], axis=-1).reshape(steps, 3 * m, size)
    stages = np.linalg.solve(system, right).reshape(steps, 3, m, size)
    signals = driven @ (np.eye(m, size) + step * np.einsum("kl,nlxs->nkxs", COLLOCATION, stages))
    signals -= np.eye(size)[m:] * decay[:, None]
    moved = step * np.einsum("j,njxs->nxs", WEIGHTS, stages)
    relaxed = step * sum(signals[:, k] * (WEIGHTS @ damped)[:, k, None] for k in range(3))
    found = [np.eye(size)]
    for change in np.concatenate([moved, relaxed], axis=1):
        found.append(found[-1] + change @ found[-1])
    return np.array(found)


def _turns(matrices: Array, shapes: Array, rates: Array) -> Array:
    """The multiple of the rotor's frequency that is strongest in the periodic part of each mode."""
    steps = len(matrices) - 1
    motion = (matrices[:-1] @ shapes) * np.exp(-np.outer(2 * np.pi * np.arange(steps) / steps, rates))[:, None]
    strength = np.sum(np.abs(np.fft.fft(motion, axis=0)) ** 2, axis=1)
    return np.asarray(np.fft.fftfreq(steps, 1 / steps)[np.argmax(strength, axis=0)])


@dataclass(frozen=True, eq=False)
class OrbitCurve:
    """A periodic motion as a function of one parameter, as equations of a curve: states divided by √n, parameter."""

    rates: Rates  # compiled equations of the rotor's field
    # parameter -> values of the runtime parameters, drag along the moment left out, and the plate's forces
    problem: Callable[[float], tuple[Array, PlateForce | None]]
    spin: float  # body spin s

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """Residual (1, m n) at one point (1, m n + 1), and its derivatives (1, m n, m n + 1).

        What the equations of an orbit keep is prescribed beside them, so that as many follow from the others; of their
        singular value decomposition as many are taken as there are unknowns but one.
        """
        states, around = self.states(points[0, :-1]), float(points[0, -1]) + DIFFERENCE * np.array([0, 1, -1])
        problem, *beside = (OrbitProblem(self.rates, *self.problem(part), len(states)) for part in around)
        residual, slope = problem(states)
        ends = [other(states)[0] for other in beside]
        rows, aims = conserved(states, self.spin * abs(problem.values[Parameter.RATE]))
        column = np.append((ends[0] - ends[1]) / (2 * DIFFERENCE), 0.0 * aims)
        every = np.column_stack([np.vstack([slope, rows]) * np.sqrt(len(states)), column])
        if not np.isfinite(every).all():
            return np.full((1, states.size), np.nan), np.full((1, states.size, states.size + 1), np.nan)
        left = np.linalg.svd(every)[0][:, : states.size].T
        return (left @ np.append(residual, aims))[None], (left @ every)[None]

    def onto(self, points: Array) -> Array:
        """The points: that moments have length one is among the equations."""
        return points

    def states(self, unknowns: Array) -> Array:
        """States (n, m) of unknowns (m n,)."""
        states = unknowns.reshape(-1, 13 if self.rates.turning else 12)
        return np.asarray(states * np.sqrt(len(states)))


@dataclass(frozen=True, eq=False)
class ForcedMotion:
    """A scene in which something makes the motion periodic."""

    scene: Scene  # gravity may have any direction
    rates: Rates  # compiled equations in the rotor's field
    values: Array  # their parameters; of a round body with the drag along the moment left out
    memory: PlateMemory | None  # the plate's currents, if they are modelled

    def reaches(self, known: Equilibrium) -> bool:
        """Whether the plate's table knows the places of an equilibrium through a whole turn."""
        if (memory := self.memory) is None:
            return True
        return bool(memory.table.in_range(memory.plate.box.to_body(known.laboratory_turn.position)).all())

    def equilibrium(self, known: Equilibrium) -> Equilibrium | LeftOut:
        """Periodic motion that a fixed point, or one in tilted gravity without plate, becomes; or why it is none."""
        scales, fixed = Scales.of(self.scene), known.without or known
        start = scales.pack(known.state if known.turn is None else known.turn)
        if known.turn is not None and self.rates.turning:
            start = one_sided(start, start[0])
        orbit, why, part = self._followed(start, known.spin, known.turn is None)
        if orbit is None:
            return LeftOut(known, why, part)
        turn, motion, wrong = scales.unpack(orbit.states), floquet_modes(orbit), 0.0
        if self.memory:  # the part of what the plate moves it that its table, and it for a shape, may be wrong by
            places = known.position if known.turn is None else resampled(known.turn.position, len(orbit.states))
            moved = np.linalg.norm(orbit.states[:, :3] * scales.length - places, axis=1).max()
            missed = response_error(self.scene.floater, MISSED_BY_PLATE)  # by its shape, of a force as small as this
            wrong = (self.memory.error + missed) * float(moved)
        own = float(np.mean(np.sum(turn.spin * turn.moment, axis=1)))
        found = Equilibrium(
            state=scales.unpack(orbit.mean),
            spin=own / self.scene.angular_velocity if self.rates.turning else fixed.spin,
            residual=orbit.error,
            position_error=known.position_error + wrong + orbit.error * scales.length,
            **motion.in_seconds(scales.time),
            turn=turn,
            currents=orbit.plate / self.values[Parameter.PLATE_SHARE] if self.memory else None,
            without=fixed,
            kind=known.kind,
        )
        why = overlap(self.scene, found) or ("" if self.reaches(found) else PAST_TABLE)
        return LeftOut(found, why) if why else found

    def _followed(self, start: Array, spin: float, tilts: bool) -> tuple[Orbit | None, str, float]:
        """The orbit that a state (m,), or a turn (n, m) of them, becomes while the plate grows to its full size.

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
            before = states if states.ndim == 1 else states.mean(axis=0)
            if ahead is None or (
                step > SMALLEST_STEP and np.linalg.norm((ahead.states.mean(axis=0) - before)[:3]) > JUMP
            ):
                step /= 2
            else:
                found, done, states = ahead, min(1.0, done + step), ahead.states
        if done == 1.0 or found is None:
            return found, NOT_CONVERGED, done
        arrived, why, part = _turned(OrbitCurve(self.rates, problem, spin), states, done)
        return None if arrived is None else orbit(1.0, arrived), why, part


def _turned(curve: OrbitCurve, states: Array, done: float) -> tuple[Array | None, str, float]:
    """States of an orbit at the whole of the way, by arc length from those (n, m) at a part; or why, and to where."""
    last, tangent = np.append(states.ravel() / np.sqrt(len(states)), done), np.zeros(states.size + 1)
    farthest = done

    def watch(which: Indices, points: Array, tangents: Array, lengths: Array) -> int:
        nonlocal last, tangent, farthest
        last, tangent, farthest = points[0], tangents[0], max(farthest, float(points[0, -1]))
        return END if tangent[-1] < 0 or last[-1] >= 1 else ON

    follow(curve, last[None], directions(curve, last[None], np.append(0.0 * last[:-1], 1.0)[None]), TURNING, watch)
    if last[-1] >= 1:
        return curve.states(last[:-1]), NOT_CONVERGED, farthest
    return None, FOLD if tangent[-1] < 0 else NOT_CONVERGED, farthest


def overlap(scene: Scene, known: Equilibrium) -> str:
    """Where in a turn the floater of an equilibrium would overlap the plate or the rotor, which; else nothing."""
    turn = known.turn or known.state[None][[0] * INSTANTS]
    times = np.arange(len(turn.position)) / (len(turn.position) * (scene.frequency or np.inf))
    if clearance(scene, times, turn.position, turn.orientation).min() >= 0:
        return ""
    free_of_rotor = clearance(replace(scene, plate=None), times, turn.position, turn.orientation).min() >= 0
    return IN_PLATE if free_of_rotor else IN_ROTOR
