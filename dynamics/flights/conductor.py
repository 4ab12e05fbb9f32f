"""Motion of a conductor along the axis of coils, carried by its own eddy currents.

State: height z of its centre, speed v, flux p_i of each mode (`fem/plate/floating`), and what heat, air and the coils'
supply take, whose sum with the energy stays:

    M v²/2 + M g z + ½ Σ x_i² + ∫ [Σ λ_i x_i² + c v² + Σ x_i G_is dI_s/dt] dt = constant,    x_i = p_i - Σ_s G_is I_s.

By the explicit method of order 8 of Dormand and Prince (SciPy).  Modes whose rate is `FAST` times the currents' and
more would decide its steps; they follow at once, λ_i x_i = -d(Σ_s G_is I_s)/dt, which leaves their loss and the balance
as they are and misses `FAST`⁻² of their share.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from ...fem.plate.floating import FloatingModes
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import AbsoluteStart, Coil, Scene

FAST = 40.0  # Rate over the highest angular frequency of a current from which a mode follows at once
TOLERANCE = 1e-8  # Of the integration: heights are then right to 1e-13 m
SMALL = 1e-3  # Height and its rate that absolute errors are relative to, in the height over the coils
LEAST, FARTHEST = 0.5, 8.0  # Range of heights over the coils that is precomputed, in the one where a motion begins
RASTER = 1e-4  # Ends of that range are multiples of this, m, so that motions that begin alike share it


def sources_of(coils: Sequence[Coil]) -> list[list[int]]:
    """The numbers of the coils of each source: those with currents in the same proportion at all times."""
    found: dict[object, list[int]] = {}
    for k, coil in enumerate(coils):
        table = isinstance(coil.current, np.ndarray)
        found.setdefault(("table", k) if table else (coil.frequency, coil.phase), []).append(k)
    return list(found.values())


@dataclass(frozen=True, eq=False)
class Supply:
    """The current of each source: of its first coil, which is not zero."""

    coils: Sequence[Coil]
    groups: Sequence[Sequence[int]]

    @property
    def shares(self) -> list[list[float]]:
        """For 1 A of each source the current of each coil."""
        found = np.zeros((len(self.groups), len(self.coils)))
        for row, group in zip(found, self.groups, strict=True):
            sizes = [1.0 if isinstance(c.current, np.ndarray) else c.current for c in (self.coils[k] for k in group)]
            row[list(group)] = np.array(sizes) / (sizes[0] or 1.0)
        return found.tolist()

    @property
    def leaders(self) -> list[Coil]:
        return [self.coils[group[0]] for group in self.groups]

    @property
    def knots(self) -> Array:
        """Times (n,) s at which a current has a corner."""
        tables = [coil.current[:, 0] for coil in self.coils if isinstance(coil.current, np.ndarray)]
        return np.unique(np.concatenate([np.zeros(1), *tables]))

    def functions(self, start: float) -> list[Callable[[float], tuple[float, float]]]:
        """Current (A) and its rate (A/s) of each source at a time (s) in the stretch that begins at one."""

        def wave(coil: Coil) -> Callable[[float], tuple[float, float]]:
            rate, size = 2 * np.pi * coil.frequency, float(coil.current)
            if not rate:
                return lambda t: (size, 0.0)
            return lambda t: (size * np.sin(rate * t + coil.phase), size * rate * np.cos(rate * t + coil.phase))

        def line(coil: Coil) -> Callable[[float], tuple[float, float]]:
            times, values = coil.current.T  # type: ignore[union-attr]
            k = int(np.searchsorted(times, start, "right")) - 1
            inside = 0 <= k < len(times) - 1
            slope = (values[k + 1] - values[k]) / (times[k + 1] - times[k]) if inside else 0.0
            base, at = (values[max(k, 0)], times[max(k, 0)])
            return lambda t: (base + slope * (t - at), slope)

        return [line(coil) if isinstance(coil.current, np.ndarray) else wave(coil) for coil in self.leaders]


@dataclass(frozen=True, eq=False)
class ConductorMotion:
    """A trajectory along the axis."""

    time: Array  # (n,) s
    height: Array  # (n,) m, of the centre
    speed: Array  # (n,) m/s
    heat: Array  # (n,) J, Joule loss since the start
    ended_by: str  # "duration", "contact" or "lost"
    energy_error: float  # largest violation of the energy balance, relative to what was turned over
    seconds: float  # of processor time


def heights_over(scene: Scene) -> tuple[float, float]:
    """Range of heights (m) of the floater's centre in which its modes are known.

    Raises InputError: a start that is not given, off the coils' axis or not above them, or a floater of no use here.
    """
    start, floater, coils = scene.start, scene.floater, scene.coils
    if not floater.conductivity or floater.remanence or len(floater.bodies) > 1:
        raise InputError(
            "Input floater must be one body with conductivity_S_m and no remanence_T beside coils; instead received "
            f"{floater.conductivity or 0:g} S/m and {floater.remanence:g} T."
        )
    if scene.rotor or scene.plate:
        raise InputError("Input scene must have no rotor and no plate beside coils; instead it has. Leave them out.")
    if not isinstance(start, AbsoluteStart):
        raise InputError("Input start.position_mm must be given beside coils; instead it is missing.")
    axes = np.array([*(coil.center[:2] for coil in coils), start.position[:2]])
    if np.ptp(axes, axis=0).max() > 1e-9 or np.abs(scene.gravity[:2]).max() > 0 or np.abs(start.velocity[:2]).max() > 0:
        raise InputError(
            "Input coils, start.position_mm, start.velocity_mm_s and gravity_m_s2 must have one vertical axis, along "
            "which the floater moves; instead they have not."
        )
    if start.moment[2] < 1 - 1e-12 or not {0, 1} <= set(floater.bodies[0].mirrors):
        raise InputError("Input start.moment must be [0, 0, 1], and the floater mirrored about it; instead it is not.")
    top, half = max(coil.center[2] + coil.height / 2 for coil in coils), float(floater.bodies[0].half_edges[2])
    gap = start.position[2] - half - top
    if gap <= RASTER:
        raise InputError(
            "Input start.position_mm must leave the floater above all coils; instead its lower end is "
            f"{1e3 * gap:.4g} mm over them."
        )
    low, high = np.floor(LEAST * gap / RASTER) * RASTER, np.ceil(FARTHEST * gap / RASTER) * RASTER
    return float(top + half + low), float(top + half + high)


def levitation_height(modes: FloatingModes, supply: Supply, weight: float) -> float:
    """Height (m) of the centre where the mean force carries a weight and falls with height; NaN where there is none.

    Parameters
    ----------
    modes : of the conductor over the coils
    supply : of the coils, whose currents are sinusoidal
    weight : N
    """
    leaders = supply.leaders
    phasors = np.array([coil.current * np.exp(1j * (coil.phase - np.pi / 2)) for coil in leaders])
    frequencies = np.array([coil.frequency for coil in leaders])

    def left(height: float) -> float:
        return modes.mean_force(height, phasors, frequencies) - weight

    every = np.linspace(*modes.heights, 200)[1:-1]
    forces = np.array([left(z) for z in every])
    falls = np.flatnonzero((forces[:-1] > 0) & (forces[1:] <= 0))
    return float(brentq(left, every[falls[0]], every[falls[0] + 1], xtol=1e-12)) if len(falls) else float("nan")


def conductor_motion(scene: Scene, modes: FloatingModes, duration: float, samples: int = 1000) -> ConductorMotion:
    """Simulate a conductor over the coils of a scene, from its start until contact, loss or the end.

    Parameters
    ----------
    scene : with an absolute start, within the heights of the modes
    modes : of its floater over its coils
    duration : s
    samples : in a second; times at which a current has a corner are added
    """
    begun, floater, start = process_time(), scene.floater, scene.start
    assert isinstance(start, AbsoluteStart)
    supply = Supply(scene.coils, sources_of(scene.coils))
    mass, gravity, brake, rates = floater.mass, -float(scene.gravity[2]), scene.drag.linear, modes.rates
    low, high = modes.heights
    currents = np.array([f(0.0)[0] for f in supply.functions(0.0)])
    fastest = 2 * np.pi * max(coil.frequency for coil in supply.leaders)
    kept = rates < FAST * fastest if fastest else np.full(len(rates), True)
    first = (modes.flux(start.position[2])[0] @ currents)[kept]
    state = np.concatenate([[start.position[2], start.velocity[2]], first, [0.0] * 2])
    gap = start.position[2] - low
    energy = mass * abs(gravity) * gap
    allowed = TOLERANCE * np.concatenate([
        [SMALL * gap, SMALL * np.sqrt(abs(gravity) * gap)], np.full(len(first), np.sqrt(energy)), [energy] * 2,
    ])  # fmt: skip
    times, states, ended = [np.zeros(1)], [state[None]], "duration"
    ends = [*(t for t in supply.knots if 0 < t < duration), duration]
    for begin, end in zip([0.0, *ends[:-1]], ends, strict=True):
        functions = supply.functions(begin)

        def slope(time: float, u: Array, functions: list[Callable[[float], tuple[float, float]]] = functions) -> Array:
            now, change = np.array([f(time) for f in functions]).T
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

        def contact(time: float, u: Array, *more: object) -> float:
            return float(u[0] - low)

        def lost(time: float, u: Array, *more: object) -> float:
            return float(high - u[0])

        contact.terminal = lost.terminal = True  # type: ignore[attr-defined]
        every = np.union1d(np.arange(np.ceil(begin * samples), np.floor(end * samples) + 1) / samples, [end])
        every = every[(every > begin) & (every <= end)]
        done = solve_ivp(
            slope, (begin, end), states[-1][-1], "DOP853", every, events=[contact, lost], rtol=TOLERANCE, atol=allowed
        )
        if len(done.t):
            times.append(done.t)
            states.append(done.y.T)
        if done.status == 1:
            ended, which = ("contact", 0) if len(done.t_events[0]) else ("lost", 1)
            times.append(done.t_events[which])
            states.append(done.y_events[which])
            break
    time, path = np.concatenate(times), np.concatenate(states)
    amperes = np.stack([coil.amperes(time) for coil in supply.leaders], axis=1)
    fluxes = np.array([modes.flux(z)[0][kept] for z in np.clip(path[:, 0], low, high)])
    own = path[:, 2:-2] - np.einsum("nms,ns->nm", fluxes, amperes)
    parts = [mass * path[:, 1] ** 2 / 2, mass * gravity * path[:, 0], np.sum(np.square(own), axis=1) / 2, path[:, -1]]
    turned = max(energy, float(np.ptp(path[:, -2])))
    error = float(np.ptp(np.sum(parts, axis=0))) / turned
    return ConductorMotion(time, path[:, 0], path[:, 1], path[:, -2], ended, error, process_time() - begun)
