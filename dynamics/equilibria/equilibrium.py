"""A synchronous equilibrium with its modes, the curve on which it lies, and the survey of all."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array, ComputationError, html_table, millimetres
from ..motion.state import State, left_product, polar_angle
from .balance import tangent_basis

INSTANTS = 129  # Of a turn, at which quantities in the laboratory are looked at; odd
UPRIGHT = 1e-9  # Part of the moment across the axis that is round-off
IN_PLATE, IN_ROTOR = "in the plate", "in the rotor"
# Why a solution is no equilibrium of a scene: the floater would overlap a body; with growing response of the plate it
# meets another and both cease to be; it could not be computed; the plate's field functions are not known there.
FOLD, NOT_CONVERGED, PAST_TABLE = "fold", "not converged", "past the plate's table"


# Growth rate (1/s) up to which an unstable equilibrium is marginal: e-folding in 250 s, the article's criterion.
MARGINAL = 0.004
CRITERION = f"growth rate at most {MARGINAL:g} s⁻¹, e-folding time {1 / MARGINAL:g} s or more"
# What is said of each kind.
STABILITIES = {"stable": "stable", "marginal": "marginally unstable", "unstable": "unstable"}


# Kinds of equilibria of a body that is not round about its moment.
LOCKED, AVERAGED = "frequency-locked", "averaged over its own turn"
# Names of the modes in data: along the axis; the slower and the faster of the others, in the rotor's frame.
AXIAL, SIDE, TILT = "bounce", ("side, backward", "side, forward"), ("precession", "nutation")
LIBRATION = "libration"
# Names on the console of modes whose names in data are older.
MODE_NAMES = {AXIAL: "axial", SIDE[0]: "backward whirl", SIDE[1]: "forward whirl"}


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of an equilibrium, in scaled time."""

    eigenvalues: Array  # (10,) complex, those of the motion that keeps |m̂| = 1 and the body spin
    errors: Array  # (10,) bounds of what round-off does to them
    shapes: Array  # (12, 10) complex, changes of the state, one mode a column

    @property
    def growth(self) -> float:
        return float(self.eigenvalues.real.max())

    @property
    def stable(self) -> bool:
        return bool(is_stable(self.eigenvalues, self.errors))

    @property
    def angular_frequencies(self) -> Array:
        """The distinct positive imaginary parts, ascending."""
        positive = np.sort(self.eigenvalues.imag[self.eigenvalues.imag > self.errors])
        return positive[np.diff(positive, prepend=-np.inf) > 1e-9]

    def in_seconds(self, time: float) -> dict[str, Any]:
        """Fields of an `Equilibrium` in SI units; `time` is the unit of the eigenvalues', s."""
        return {
            "stable": self.stable,
            "growth_per_s": self.growth / time,
            "growth_error_per_s": float(self.errors.max()) / time,
            "frequencies_hz": self.angular_frequencies / (2 * np.pi * time),
            "modes": named_modes(self, time),
        }


def eigenmodes(matrices: Array, tangents: Array) -> Modes:
    """Those of matrices (..., k, k) of rates on `tangents` (..., n, k), directions of states; errors as of `modes`."""
    values, right = np.linalg.eig(matrices)
    condition = np.linalg.norm(left_eigenvectors(right), axis=-1) * np.linalg.norm(right, axis=-2)
    round_off = 100 * np.finfo(float).eps * np.linalg.norm(matrices, axis=(-2, -1))[..., None]
    return Modes(values.astype(complex), np.minimum(round_off * condition, 1e-6), tangents @ right)


def is_stable(eigenvalues: NDArray[Any], errors: Array) -> NDArray[np.bool_]:
    """Where (...,) no mode of eigenvalues (..., 10) grows faster than its round-off error (..., 10)."""
    return np.asarray(np.all(eigenvalues.real <= errors, axis=-1))


def modes(state: Array, slope: Array) -> Modes:
    """Eigenvalues of the exact 12 × 12 Jacobian on the ten directions that keep |m̂| and s = Ω·m̂/ω.

    Without drag the eigenvalues of a stable equilibrium lie on the imaginary axis, so that the sign of a real part
    means nothing below its error.  That of a simple eigenvalue is ε‖A‖κ, with the condition number κ of its
    eigenvectors (J. H. Wilkinson, The Algebraic Eigenvalue Problem, 1965, ch. 2): about 1e-14 away from
    collisions of eigenvalues and 1e-8 at one, where Stokes drag makes 1e-7.  Of a scaled `state` (12,) and the `slope`
    (12, 12) of its rates, drag along the moment left out.
    """
    found = spectra(state[None], slope[None])
    return Modes(found.eigenvalues[0], found.errors[0], found.shapes[0])


def spectra(states: Array, slopes: Array) -> Modes:
    """`modes` of many equilibria in one call: eigenvalues (n, 10), their errors (n, 10) and shapes (n, 12, 10)."""
    tangents, projections = tangent_spaces(states)
    return eigenmodes(projections @ slopes @ tangents, tangents)


def left_eigenvectors(right: Array) -> Array:
    """Rows (..., k, k) dual to right eigenvectors, columns; a pseudoinverse takes six times as long."""
    try:
        return np.asarray(np.linalg.inv(right))
    except np.linalg.LinAlgError:  # one of them is singular to the last bit
        return np.asarray(np.linalg.pinv(right))


def tangent_spaces(states: Array) -> tuple[Array, Array]:
    """Ten directions (n, 12, 10) at states (n, 12), and the projections (n, 10, 12) on their coordinates."""
    moment, spin = states[:, 6:9], states[:, 9:]
    across = tangent_basis(moment)
    tangents, projections = np.zeros((len(states), 12, 10)), np.zeros((len(states), 10, 12))
    tangents[:, :6, :6] = projections[:, :6, :6] = np.eye(6)
    tangents[:, 6:9, 6:8] = tangents[:, 9:, 8:] = np.swapaxes(across, 1, 2)
    lost = np.einsum("nka,na->nk", across, spin)  # what the tilt takes from Ω·m̂ is given back
    tangents[:, 9:, 6:8] = -moment[:, :, None] * lost[:, None, :]
    projections[:, 6:8, 6:9] = projections[:, 8:, 9:] = across
    return tangents, projections


@dataclass(frozen=True)
class Mode:
    """One mode."""

    # "bounce" (axial), "side" (across it; forward or backward of the rotor), precession or nutation (slower and
    # faster turning of the moment)
    name: str
    growth_per_s: float  # 1/s; negative where it decays
    frequency_hz: float  # in the rotor's frame; 0 where it does not oscillate


def free_directions(state: Array) -> tuple[Array, Array]:
    """Directions (m, k) of a scaled state (m,) that keep what the equations keep, and projections (k, m) on them."""
    if len(state) == 12:
        tangents, projections = tangent_spaces(state[None])
        return tangents[0], projections[0]
    tangents, projections = np.zeros((13, 12)), np.zeros((12, 13))
    tangents[:6, :6] = projections[:6, :6] = np.eye(6)
    tangents[10:, 9:] = projections[9:, 10:] = np.eye(3)
    by_turn = 0.5 * np.stack(left_product(list(np.eye(3)), list(state[6:10, None] * np.ones(3))))
    tangents[6:10, 6:9], projections[6:9, 6:10] = by_turn, 4 * by_turn.T
    return tangents, projections


def named_modes(modes: Modes, time: float) -> tuple[Mode, ...]:
    """The floater's five modes, the axial one first; `time` is the unit of time of the eigenvalues, s.

    Of a pair that does not oscillate it is the one that grows more. A body that is not round has a sixth, its libration
    about the moment, which is the slowest of its turns.
    """
    values, shapes = modes.eigenvalues, np.abs(modes.shapes)
    turning = len(values) > 10
    chosen = [int(k) for k in np.argsort(-values.real) if values[k].imag >= 0]
    while len(chosen) > len(values) // 2:  # drop what decays most of those that do not oscillate
        still = [k for k in chosen if abs(values[k].imag) <= modes.errors[k]]
        chosen.remove((still or chosen)[-1])
    size = np.linalg.norm(shapes[[0, 1, 2, *range(6, len(shapes) - 3)]], axis=0)  # of place and turn alone
    axial, moving = shapes[2] / size, np.linalg.norm(shapes[:2], axis=0) / size
    bounce = max(chosen, key=lambda k: axial[k])
    others = sorted((k for k in chosen if k != bounce), key=lambda k: -moving[k])
    side, tilt = (sorted(part, key=lambda k: values[k].imag) for part in (others[:2], others[2:]))
    names = (LIBRATION, *TILT) if turning else TILT
    pairs = [("bounce", bounce), *zip(SIDE, side, strict=False), *zip(names, tilt, strict=False)]
    rates = [(name, complex(values[k]) / time) for name, k in pairs]
    return tuple(Mode(name, rate.real, rate.imag / (2 * np.pi)) for name, rate in rates)


class EquilibriumError(ComputationError):
    """There is no synchronous equilibrium, or not of the kind that was asked for."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """One synchronous equilibrium, along the rotor's axes; of one that is a periodic motion `state` is the mean."""

    state: State  #: position m, velocity m/s, moment direction, spin rad/s
    spin: float  #: body spin s = Ω·m̂/ω
    residual: float  #: largest unbalanced acceleration, as a part of gravity (or of ω²R without gravity)
    position_error: float  #: estimated error of the position, from round-off and from the table's own error, m
    stable: bool  #: whether no mode grows; with drag, whether all decay
    growth_per_s: float  #: largest growth rate of a mode, 1/s
    growth_error_per_s: float  #: what round-off may do to it, 1/s
    frequencies_hz: Array  #: (k,) frequencies of the modes in the rotor's frame
    modes: tuple[Mode, ...] = ()  #: by name
    #: (n, 3) the motion at equal intervals of a turn, the first at t = 0; None where it is at rest in this frame
    turn: State | None = None
    #: (n, k) states of the plate then, √J; None where the plate's currents are not modelled
    currents: Array | None = None
    #: the fixed point that it would be without the plate and with gravity along the axis
    without: "Equilibrium | None" = None
    #: (5, 5) derivatives of the scaled balances, see `Balance`; NaN for a periodic motion
    slope: Array = field(default_factory=lambda: np.full((5, 5), np.nan))
    #: (12, 12) derivatives of the scaled state's rates by the state; NaN for a periodic motion
    jacobian: Array = field(default_factory=lambda: np.full((12, 12), np.nan))
    #: "" of a round body, else `LOCKED`, at rest in the rotor's frame, or `AVERAGED` over turns about the moment
    kind: str = ""
    steady_frame: bool = False  #: whether the rotor is at rest, so that its frame is the laboratory's

    @property
    def stability(self) -> str:
        return "stable" if self.stable else "marginal" if self.growth_per_s <= MARGINAL else "unstable"

    @property
    def efolding_s(self) -> float | None:
        """Time in which the least stable mode grows by a factor e, s; None where none grows."""
        return None if self.stable else 1 / self.growth_per_s

    @property
    def start(self) -> State:
        return self.state if self.turn is None else self.turn[0]

    @property
    def position(self) -> Array:
        return self.state.position

    @cached_property
    def laboratory_turn(self) -> State:
        """The motion (n, 3) along the laboratory's axes at equal intervals of a turn, the first at t = 0."""
        turn = self.turn.each(lambda part: resampled(part, INSTANTS)) if self.turn else self.state[None][[0] * INSTANTS]
        return turn if self.steady_frame else turn.to_lab(2 * np.pi * np.arange(INSTANTS) / INSTANTS)

    @property
    def laboratory_position(self) -> Array:
        """(3,) mean over a turn along the laboratory's axes, m: on the axis for a steady motion."""
        return np.asarray(self.laboratory_turn.position.mean(axis=0))

    @cached_property
    def _course(self) -> tuple[Array, Array, Array]:
        """Distance and lateral offset, m, and polar angle, °, through a turn; one of each where it is at rest."""
        turn = self.state[None] if self.turn is None else self.laboratory_turn
        offset = np.hypot(*turn.position[:, :2].T)
        return np.linalg.norm(turn.position, axis=1), offset, np.degrees(polar_angle(turn.moment))

    @property
    def distance(self) -> float:
        """Distance from the rotor's origin, mean over a turn, m."""
        return float(self._course[0].mean())

    @property
    def lateral_offset(self) -> float:
        """Distance from the axis of rotation, mean over a turn, m."""
        return float(self._course[1].mean())

    @property
    def polar_angle_deg(self) -> float:
        """Angle between the moment and +z, mean over a turn."""
        return float(self._course[2].mean())

    @property
    def distance_swing(self) -> Array:
        return _extremes(self._course[0])

    @property
    def lateral_offset_swing(self) -> Array:
        return _extremes(self._course[1])

    @property
    def polar_angle_swing_deg(self) -> Array:
        return _extremes(self._course[2])

    @property
    def lag_deg(self) -> float:
        """Angle by which the part of the moment that turns with the rotor is behind its +x, in (-180, 180]; or 0."""
        x, y = self.state.moment[:2]
        if np.hypot(x, y) < UPRIGHT:
            return 0.0
        lag = float(np.degrees(np.arctan2(-y, x)))
        return 180.0 if lag < -180 + 1e-9 else lag + 0.0

    @property
    def spin_rate(self) -> float:
        return float(self.start.spin @ self.start.moment)

    def __repr__(self) -> str:
        x, y, z = 1e3 * (self.position if self.turn is None else self.laboratory_position)
        place = f"({x:.4f}, {y:.4f}, {z:.4f}) ± {1e3 * self.position_error:.1g} mm"
        place += "" if self.turn is None else ", mean over a turn in the laboratory"
        kind = self.stability if self.stable else f"{self.stability}, e-folding time {self.efolding_s:.2g} s"
        return f"Equilibrium at {place}, polar angle {self.polar_angle_deg:.3f}°, spin {self.spin:g}, {kind}"

    def _repr_html_(self) -> str:
        rows = {
            "position": f"{millimetres(self.position)} ± {1e3 * self.position_error:.1g} mm, rotor's frame",
            "mean position": f"{millimetres(self.laboratory_position)}, laboratory",
            "polar angle": f"{self.polar_angle_deg:.3f}°",
            "body spin": f"{self.spin:g}",
            "growth rate": f"{self.growth_per_s:.3g} s⁻¹",
            "modes": "; ".join(f"{MODE_NAMES.get(m.name, m.name)} {m.frequency_hz:.4g} Hz" for m in self.modes),
        }
        return html_table(f"Equilibrium, {self.stability}", rows)


def nearest_of(equilibria: Sequence[Equilibrium], place: Array) -> Equilibrium | None:
    """The one of the `equilibria` that is nearest to a `place` (3,) m; None without any."""
    return min(equilibria, key=lambda e: float(np.linalg.norm(e.position - place)), default=None)


def resampled(samples: Array, count: int) -> Array:
    """Trigonometric interpolation (count, ...) of samples (n, ...) at equidistant instants, both numbers odd."""
    return np.fft.irfft(np.fft.rfft(samples, axis=0)[: count // 2 + 1] * (count / len(samples)), count, axis=0)


def _extremes(values: Array) -> Array:
    return np.array([values.min(), values.max()])


@dataclass(frozen=True, eq=False)
class ForceCurve:
    """Axial force where everything else is balanced: figure "force against distance"."""

    position: Array = field(metadata={"units": "m"})  #: (n, 3) m, rotor's frame
    moment: Array  #: (n, 3) direction
    magnetic_force: Array = field(metadata={"units": "N"})  #: (n,) along +z, N


@dataclass(frozen=True, eq=False)
class LeftOut:
    """A solution that is no equilibrium of the scene, or is not known to be one."""

    known: Equilibrium  # the solution, or what it would be without the plate
    why: str  # `IN_PLATE`, `IN_ROTOR`, `FOLD`, `NOT_CONVERGED` or `PAST_TABLE`
    part: float = 1.0  # of the plate's response, and of gravity across the axis, up to which it was followed


@dataclass(frozen=True, eq=False)
class Survey:
    """Equilibria, the stable ones first and then by distance, the curves on which they lie, and what is left out."""

    equilibria: tuple[Equilibrium, ...]
    curves: tuple[ForceCurve, ...]
    left_out: tuple[LeftOut, ...] = ()

    @property
    def unknown(self) -> tuple[LeftOut, ...]:
        """Solutions left out of which it is not known whether they are equilibria."""
        return tuple(one for one in self.left_out if one.why in (NOT_CONVERGED, PAST_TABLE))
