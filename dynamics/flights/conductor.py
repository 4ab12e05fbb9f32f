"""Motion of a conductor over coils, along their axis or freely, carried by its own eddy currents.

State: height z of its centre, speed v, flux p_i of each mode (`fem/plate/floating`), and what heat, air and the coils'
supply take, whose sum with the energy stays:

    M v²/2 + M g z + ½ Σ x_i² + ∫ [Σ λ_i x_i² + c v² + Σ x_i G_is dI_s/dt] dt = constant,    x_i = p_i - Σ_s G_is I_s.

By the explicit method of order 8 of Dormand and Prince (SciPy).  Modes whose rate is `FAST` times the currents' and
more would decide its steps; they follow at once, λ_i x_i = -d(Σ_s G_is I_s)/dt, which leaves their loss and the balance
as they are and misses `FAST`⁻² of their share.

One that is not on a common axis moves in six degrees: place, velocity, the unit quaternion of its axes, its spin along
these, and the same fluxes, whose rate is that of the coils' field at the moving dipoles that stand for each mode.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from time import process_time

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from ...fem.plate.floating import FloatingModes, FreeModes, Room
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import AbsoluteStart, Coil, Scene
from ..motion.state import matrices_of, quaternions_of, rotation_of

FAST = 40.0  # Rate over the highest angular frequency of a current from which a mode follows at once
LOWEST = 50.0  # Frequency (Hz) of which coils count at least: of steady ones the motion alone drives currents
TOLERANCE = 2e-7  # Of the integration: heights are then right to 1e-12 m, and energies balance to 1e-8
SAMPLES = 1000  # In a second; times at which a current has a corner are added
SMALL = 1e-3  # Height and its rate that absolute errors are relative to, in the height over the coils
LEAST, FARTHEST = 0.5, 8.0  # Range of heights over the coils that is precomputed, in the one where a motion begins
RASTER = 1e-4  # Ends of that range are multiples of this, m, so that motions that begin alike share it
SIDEWAYS = 4.0  # Of one that moves freely, how far aside of its start, in the height over the coils where it begins


@dataclass(frozen=True, eq=False)
class Supply:
    """The current of each source: of its first coil, which is not zero."""

    coils: Sequence[Coil]

    @cached_property
    def groups(self) -> list[list[int]]:
        """The numbers of the coils of each source: those with currents in the same proportion at all times."""
        found: dict[object, list[int]] = {}
        for k, coil in enumerate(self.coils):
            table = isinstance(coil.current, np.ndarray)
            found.setdefault(("table", k) if table else (coil.frequency, coil.phase), []).append(k)
        return list(found.values())

    @property
    def shares(self) -> list[list[float]]:
        """For 1 A of each source the current of each coil."""
        sizes = np.array([1.0 if isinstance(coil.current, np.ndarray) else coil.current for coil in self.coils])
        members = np.array([np.isin(np.arange(len(sizes)), group) for group in self.groups])
        return (members * sizes / [[sizes[group[0]] or 1.0] for group in self.groups]).tolist()  # type: ignore[no-any-return]

    @property
    def leaders(self) -> list[Coil]:
        return [self.coils[group[0]] for group in self.groups]

    @property
    def knots(self) -> Array:
        """Times (n,) s at which a current has a corner."""
        return np.unique([0.0, *(time for coil in self.coils for time in coil.corners)])

    def at(self, time: ArrayLike) -> Array:
        """(..., sources) A at times (...,) s."""
        return np.stack([coil.amperes(time) for coil in self.leaders], axis=-1)

    def kept(self, rates: Array) -> NDArray[np.bool_]:
        """Which modes of `rates` (states,) 1/s are states; the others follow at once."""
        return rates < FAST * 2 * np.pi * max(LOWEST, *(coil.frequency for coil in self.leaders))


def _current(coil: Coil, start: float, end: float) -> Callable[[float], tuple[float, float]]:
    """Current (A) and its rate (A/s) at a time (s) in a stretch in which it has no corner."""
    if rate := 2 * np.pi * coil.frequency:
        size = float(coil.current)
        return lambda t: (size * np.sin(rate * t + coil.phase), size * rate * np.cos(rate * t + coil.phase))
    first, last = coil.amperes([start, end]).tolist()
    slope = (last - first) / (end - start)
    return lambda t: (first + slope * (t - start), slope)


@dataclass(frozen=True, eq=False)
class ConductorMotion:
    """A trajectory."""

    time: Array  # (n,) s
    position: Array  # (n, 3) m, of the centre of mass
    velocity: Array  # (n, 3) m/s
    axes: Array  # (n, 3, 3), whose columns are the body's axes
    spin: Array  # (n, 3) rad/s, along these
    heat: Array  # (n,) J, Joule loss since the start
    ended_by: str  # "duration", "contact" or "lost"
    energy_error: float  # largest violation of the energy balance, relative to what was turned over
    seconds: float  # of processor time

    @property
    def height(self) -> Array:
        return self.position[:, 2]


def on_axis(scene: Scene) -> bool:
    """Whether a scene's floater keeps moving along the common axis of its coils."""
    start = scene.start
    assert isinstance(start, AbsoluteStart)
    axes = np.array([*(coil.center[:2] for coil in scene.coils), start.position[:2]])
    across = [np.ptp(axes, axis=0), scene.gravity[:2], start.velocity[:2], start.spin]
    still = all(float(np.abs(part).max()) <= 1e-9 for part in across)
    return still and start.moment[2] > 1 - 1e-12 and {0, 1} <= set(scene.floater.bodies[0].mirrors)


def heights_over(scene: Scene) -> tuple[float, float]:
    """Heights (m) of the floater's centre in which its modes are known. Raises InputError for a scene of no use."""
    start, floater, coils = scene.start, scene.floater, scene.coils
    if not floater.conductivity or floater.remanence or len(floater.bodies) > 1:
        raise InputError(
            "Input floater must be one body with conductivity_S_m and no remanence_T beside coils alone; instead "
            f"received {floater.conductivity or 0:g} S/m and {floater.remanence:g} T."
        )
    if scene.plate:
        raise InputError("Input plate must be left out where coils alone carry the floater; instead it is given.")
    if not isinstance(start, AbsoluteStart):
        raise InputError(
            "Input start.position_mm must be given where coils alone carry the floater; instead it is missing."
        )
    top = max(coil.center[2] + coil.height / 2 for coil in coils)
    down = -floater.axes(start.moment, start.body_x)[2]
    half = float(floater.bodies[0].support(down[None])[0] + floater.bodies[0].center @ down)
    gap = start.position[2] - half - top
    if gap <= RASTER:
        raise InputError(
            "Input start.position_mm must leave the floater above all coils; instead its lower end is "
            f"{1e3 * gap:.4g} mm over them."
        )
    low, high = np.floor(LEAST * gap / RASTER) * RASTER, np.ceil(FARTHEST * gap / RASTER) * RASTER
    return float(top + half + low), float(top + half + high)


def levitation_height(scene: Scene, modes: FloatingModes) -> float:
    """Height (m) of the centre where the mean force of `modes` carries a `scene`'s floater, and falls; NaN: nowhere."""
    leaders, weight = Supply(scene.coils).leaders, -scene.floater.mass * float(scene.gravity[2])
    phasors = np.array([coil.current * np.exp(1j * (coil.phase - np.pi / 2)) for coil in leaders])
    frequencies = np.array([coil.frequency for coil in leaders])

    def left(height: float) -> float:
        return modes.mean_force(height, phasors, frequencies) - weight

    every = np.linspace(*modes.heights, 200)[1:-1].tolist()
    fall = next((pair for pair in pairwise(every) if left(pair[0]) > 0 >= left(pair[1])), None)
    return float(brentq(left, *fall, xtol=1e-12)) if fall else float("nan")


def conductor_motion(scene: Scene, modes: FloatingModes, duration: float) -> ConductorMotion:
    """Simulate a conductor over a `scene`'s coils, along their axis by `modes`, for `duration` (s) or to an end."""
    begun, floater, start = process_time(), scene.floater, scene.start
    assert isinstance(start, AbsoluteStart)
    supply = Supply(scene.coils)
    mass, gravity, brake, rates = floater.mass, -float(scene.gravity[2]), scene.drag.linear, modes.rates
    low, high = modes.heights
    kept = supply.kept(rates)
    first = (modes.flux(start.position[2])[0] @ supply.at(0.0))[kept]
    state = np.concatenate([[start.position[2], start.velocity[2]], first, [0.0] * 2])
    gap = start.position[2] - low
    energy = mass * abs(gravity) * gap
    allowed = np.concatenate([
        [SMALL * gap, SMALL * np.sqrt(abs(gravity) * gap)], np.full(len(first), np.sqrt(energy)), [energy] * 2,
    ])  # fmt: skip

    def slope(u: Array, now: Array, change: Array) -> Array:
        flux, steeper, driven = modes.driven(min(max(u[0], low), high), now, change)
        own = np.where(kept, 0.0, -(driven + steeper * u[1]) / rates)
        own[kept] = u[2:-2] - flux[kept]
        decay = rates * own
        found = np.empty(len(u))
        found[0], found[1] = u[1], (own @ steeper - brake * u[1]) / mass - gravity
        found[2:-2] = -decay[kept]
        found[-2] = decay @ own
        found[-1] = found[-2] + brake * u[1] ** 2 + own @ driven
        return found

    inside: Ends = [("contact", lambda u: u[0] - low), ("lost", lambda u: high - u[0])]
    time, path, ended = _integrated(supply, state, slope, inside, allowed, duration)
    fluxes = np.array([modes.flux(z)[0][kept] for z in np.clip(path[:, 0], low, high)])
    own = path[:, 2:-2] - np.einsum("nms,ns->nm", fluxes, supply.at(time))
    parts = [mass * path[:, 1] ** 2 / 2, mass * gravity * path[:, 0], np.sum(np.square(own), axis=1) / 2, path[:, -1]]
    error = float(np.ptp(np.sum(parts, axis=0))) / max(energy, float(np.ptp(path[:, -2])))
    place, speed, still = np.tile(start.position, (len(time), 1)), np.zeros((len(time), 3)), np.zeros((len(time), 3))
    place[:, 2], speed[:, 2] = path[:, :2].T
    axes = np.tile(floater.axes(start.moment, start.body_x), (len(time), 1, 1))
    return ConductorMotion(time, place, speed, axes, still, path[:, -2], ended, error, process_time() - begun)


Ends = list[tuple[str, Callable[[Array], float]]]  # What ends a motion where a function of the state becomes negative


def _integrated(
    supply: Supply, state: Array, slope: Callable[[Array, Array, Array], Array], inside: Ends, allowed: Array,
    duration: float,
) -> tuple[Array, Array, str]:  # fmt: skip
    """Times (n,) s, states (n, m) and what ended it: of a slope by the state, the currents and their rates."""
    times, states = [np.zeros(1)], [state[None]]
    events = [lambda time, u, *more, f=f: float(f(u)) for _, f in inside]
    for event in events:
        event.terminal = True  # type: ignore[attr-defined]
    for begin, end in pairwise([0.0, *(t for t in supply.knots if 0 < t < duration), duration]):
        functions = [_current(coil, begin, end) for coil in supply.leaders]

        def at(time: float, u: Array, functions: list[Callable[[float], tuple[float, float]]] = functions) -> Array:
            return slope(u, *np.array([f(time) for f in functions]).T)

        every = np.union1d(np.arange(np.ceil(begin * SAMPLES), np.floor(end * SAMPLES) + 1) / SAMPLES, [end])
        every = every[(every > begin) & (every <= end)]
        step = partial(solve_ivp, at, method="DOP853", rtol=TOLERANCE, atol=TOLERANCE * allowed)
        done = step((begin, end), states[-1][-1], t_eval=every, events=events)
        if len(done.t):
            times.append(done.t)
            states.append(done.y.T)
        if done.status == 1:
            which = next(k for k, found in enumerate(done.t_events) if len(found))
            over = float(done.t_events[which][0])
            last = step((times[-1][-1], over), states[-1][-1])  # the state there, which was interpolated
            return np.append(np.concatenate(times), over), np.vstack([*states, last.y[:, -1]]), inside[which][0]
    return np.concatenate(times), np.concatenate(states), "duration"


def room_over(scene: Scene) -> Room:
    """Box (3,) m of the centre of a floater that moves freely, and the level (m) it keeps above. Raises InputError."""
    start, (low, high) = scene.start, heights_over(scene)
    assert isinstance(start, AbsoluteStart)
    top = max(coil.center[2] + coil.height / 2 for coil in scene.coils)
    gap = (high - low) / (FARTHEST - LEAST)
    sideways = np.ceil(SIDEWAYS * gap / RASTER) * RASTER
    corner = np.floor(start.position[:2] / RASTER) * RASTER
    box = np.array([*(corner - sideways), low]), np.array([*(corner + sideways), high])
    return box, float(np.floor((top + LEAST * gap) / RASTER) * RASTER)


def _turn(quaternion: Array) -> Array:
    return np.array(rotation_of((quaternion / np.linalg.norm(quaternion)).tolist()))


def free_motion(scene: Scene, modes: FreeModes, duration: float) -> ConductorMotion:
    """Simulate a conductor over a `scene`'s coils, in the room of `modes`, for `duration` (s) or to contact or loss."""
    begun, floater, start = process_time(), scene.floater, scene.start
    assert isinstance(start, AbsoluteStart)
    supply, (box, floor) = Supply(scene.coils), room_over(scene)
    body, mass, inertia, rates = floater.bodies[0], floater.mass, floater.principal_inertia, modes.rates
    places = body.center + modes.places @ body.rotation.T  # along the floater's axes
    moments = (modes.moments @ body.rotation.T).reshape(len(rates), -1)
    kept, count = supply.kept(rates), modes.sources

    def fluxes(u: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Rotation, arms (k, 3), B and its gradient at the dipoles for 1 A, and G (states, sources)."""
        turn = _turn(u[6:10])
        arms = places @ turn.T
        b, slope = modes.fields(u[:3] + arms)
        return turn, arms, b, slope, moments @ (b @ turn).reshape(count, -1).T

    def slope(u: Array, now: Array, change: Array) -> Array:
        turn, arms, b, slopes, flux = fluxes(u)
        velocity, (w, x, y, z), spin = u[3:6], u[6:10], u[10:13]
        field, slope = np.tensordot(now, b, 1), np.tensordot(now, slopes, 1)
        moving = np.einsum("kij,kj->ki", slope, velocity + np.cross(turn @ spin, arms)) @ turn
        driven, motional = flux @ change, moments @ (moving - np.cross(spin, field @ turn)).ravel()
        own = np.where(kept, 0.0, -(driven + motional) / rates)
        own[kept] = u[13:-2] - (flux @ now)[kept]
        decay, dipoles = rates * own, (own @ moments).reshape(-1, 3) @ turn.T
        each = np.einsum("ki,kij->kj", dipoles, slope)
        torque = (np.cross(dipoles, field) + np.cross(arms, each)).sum(axis=0) @ turn - scene.drag.angular * spin
        found = np.empty(len(u))
        found[:3], found[3:6] = velocity, (each.sum(axis=0) - scene.drag.linear * velocity) / mass + scene.gravity
        found[6], found[7:10] = -0.5 * np.dot([x, y, z], spin), 0.5 * (w * spin + np.cross([x, y, z], spin))
        found[10:13] = (torque - np.cross(spin, inertia * spin)) / inertia
        found[13:-2] = -decay[kept]
        found[-2] = decay @ own
        air = scene.drag.linear * velocity @ velocity + scene.drag.angular * spin @ spin
        found[-1] = found[-2] + air + own @ driven
        return found

    def above(u: Array) -> float:
        down = -_turn(u[6:10])[2]
        return float(u[2] - body.center @ down - body.support(down[None])[0] - floor)

    def within(u: Array) -> float:
        return float(min(*(u[:2] - box[0][:2]), *(box[1] - u[:3])))

    axes = floater.axes(start.moment, start.body_x)
    turning = np.array(quaternions_of(axes))
    state = np.concatenate([start.position, start.velocity, turning, axes.T @ start.spin, np.zeros(kept.sum() + 2)])
    state[13:-2] = (fluxes(state)[-1] @ supply.at(0.0))[kept]
    gap, pull = (box[1][2] - box[0][2]) / (FARTHEST - LEAST), float(np.linalg.norm(scene.gravity)) or 9.81
    energy = mass * pull * gap
    sizes = [SMALL * gap] * 3, [SMALL * np.sqrt(pull * gap)] * 3, [SMALL] * 4, [SMALL * np.sqrt(pull / gap)] * 3
    allowed = np.concatenate([*sizes, np.full(kept.sum(), np.sqrt(energy)), [energy] * 2])
    inside: Ends = [("contact", above), ("lost", within)]
    time, path, ended = _integrated(supply, state, slope, inside, allowed, duration)
    own = path[:, 13:-2] - [(fluxes(u)[-1] @ now)[kept] for u, now in zip(path, supply.at(time), strict=True)]
    parts = [mass * np.sum(path[:, 3:6] ** 2, axis=1) / 2, -mass * path[:, :3] @ scene.gravity,
             path[:, 10:13] ** 2 @ inertia / 2, np.sum(np.square(own), axis=1) / 2, path[:, -1]]  # fmt: skip
    error = float(np.ptp(np.sum(parts, axis=0))) / max(energy, float(np.ptp(path[:, -2])))
    turned = matrices_of(path[:, 6:10] / np.linalg.norm(path[:, 6:10], axis=1)[:, None])
    place, velocity, spin, heat = path[:, :3], path[:, 3:6], path[:, 10:13], path[:, -2]
    return ConductorMotion(time, place, velocity, turned, spin, heat, ended, error, process_time() - begun)
