"""What is known of a synchronous equilibrium, and of the curve on which it lies."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...geometry.basics import Array, ComputationError, html_table, millimetres
from ..motion import State
from .stability import Mode


class EquilibriumError(ComputationError):
    """There is no synchronous equilibrium, or not of the kind that was asked for."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """One synchronous equilibrium, along the rotor's axes.

    Where a plate or tilted gravity shakes the floater once a turn it is a periodic motion, and `state` its mean.

    Parameters
    ----------
    state : position m, velocity m/s, moment direction, spin rad/s
    spin : body spin s = Ω·m̂/ω
    residual : largest unbalanced acceleration, as a part of gravity (or of ω²R without gravity)
    position_error : estimated error of the position, from round-off and from the table's own error, m
    stable : whether every small motion stays small; with drag, whether it dies out
    growth_per_s : largest growth rate of a small motion, 1/s
    growth_error_per_s : what round-off may do to it, 1/s
    frequencies_hz : (k,) frequencies of the small motions in the rotor's frame
    modes : the small motions by name
    turn : (n, 3) the motion at equal intervals of a turn, the first at t = 0; None where it is at rest in this frame
    currents : (n, k) states of the plate then, √J; None where the plate's currents are not modelled
    without : the fixed point that it would be without the plate and with gravity along the axis
    slope : (5, 5) derivatives of the scaled balances, see `Balance`; NaN for a periodic motion
    jacobian : (12, 12) derivatives of the scaled state's rates by the state; NaN for a periodic motion
    """

    state: State
    spin: float
    residual: float
    position_error: float
    stable: bool
    growth_per_s: float
    growth_error_per_s: float
    frequencies_hz: Array
    modes: tuple[Mode, ...] = ()
    turn: State | None = None
    currents: Array | None = None
    without: Equilibrium | None = None
    slope: Array = field(default_factory=lambda: np.full((5, 5), np.nan))
    jacobian: Array = field(default_factory=lambda: np.full((12, 12), np.nan))

    @property
    def start(self) -> State:
        """The state at t = 0."""
        if self.turn is None:
            return self.state
        return State(*(vector[0] for vector in self.turn.vectors))

    @property
    def position(self) -> Array:
        """(3,) m."""
        return self.state.position

    @property
    def distance(self) -> float:
        """Distance from the rotor's origin, m."""
        return float(np.linalg.norm(self.position))

    @property
    def polar_angle_deg(self) -> float:
        """Angle between the moment and +z."""
        x, y, z = self.state.moment
        return float(np.degrees(np.arctan2(np.hypot(x, y), z)))

    @property
    def lag_deg(self) -> float:
        """Angle by which the moment's azimuth is behind the rotor's +x, in (-180, 180]."""
        x, y = self.state.moment[:2]
        lag = float(np.degrees(np.arctan2(-y, x)))
        return 180.0 if lag < -180 + 1e-9 else lag + 0.0

    def __repr__(self) -> str:
        x, y, z = 1e3 * self.position
        place = f"({x:.4f}, {y:.4f}, {z:.4f}) ± {1e3 * self.position_error:.1g} mm"
        kind = "stable" if self.stable else f"unstable, e-fold in {1 / self.growth_per_s:.2g} s"
        return f"Equilibrium at {place}, polar angle {self.polar_angle_deg:.3f}°, spin {self.spin:g}, {kind}"

    def _repr_html_(self) -> str:
        rows = {
            "position": f"{millimetres(self.position)} ± {1e3 * self.position_error:.1g} mm",
            "polar angle": f"{self.polar_angle_deg:.3f}°",
            "body spin": f"{self.spin:g}",
            "growth": f"{self.growth_per_s:.3g} /s",
            "small motions": ", ".join(f"{mode.name} {mode.frequency_hz:.4g} Hz" for mode in self.modes),
        }
        return html_table(f"Equilibrium, {'stable' if self.stable else 'unstable'}", rows)


@dataclass(frozen=True, eq=False)
class ForceCurve:
    """Axial force where everything else is balanced: figure "force against distance".

    Parameters
    ----------
    position : (n, 3) m, rotor's frame
    moment : (n, 3) direction
    magnetic_force : (n,) along +z, N
    """

    position: Array
    moment: Array
    magnetic_force: Array


@dataclass(frozen=True, eq=False)
class Survey:
    """Equilibria, the stable ones first and then by distance, and the curves on which they lie."""

    equilibria: tuple[Equilibrium, ...]
    curves: tuple[ForceCurve, ...]
