"""Levitation at chosen heights and body spins: at which frequency, how the spin drifts there and what small motions do.

With the height given and the frequency unknown there is no fold: the equilibria are a smooth function of height and
spin, and the fold is the least of the frequencies.  Each effect enters to first order, so that any strength of it is
had afterwards by a factor: with left and right eigenvectors w and v of a small motion without losses, an effect that
adds M to the derivatives of the rates makes it grow by Re w*Mv/(w*v).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from ...dynamics.branches import Family, frequencies
from ...dynamics.effects import Dissipation, brake_slope, with_effects
from ...dynamics.motion import Interaction, Parameter, Rates, Scales, parameters
from ...dynamics.slow_drift import SlowTorque
from ...dynamics.steady import EquilibriumError, modes, named_modes, tangent_spaces
from ...fem.harmonics import CompiledField
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import MAGNET_CONDUCTIVITY, Array
from ...geometry.scenes import Drag, Scene

EFFECTS = ("floater", "magnets", "steel", "air")
"""What may make a small motion grow: currents in the floater, the rotor's magnets and the holder's steel, and air."""
MOTIONS = ("precession", "side")
"""Small motions that currents may make grow: a turning of the moment, and a circle about the axis."""
QUANTITIES = (
    *("frequency", "eddy", "air", "circle", "bounce", "bare"),
    *(f"{motion} {name}" for motion in MOTIONS for name in ("frequency", *EFFECTS)),
)
"""Of a node: frequency of the rotor, Hz; ds/dt by the floater's currents and by air, 1/s; distance from the axis, m;
frequency of the bounce, Hz; growth without losses, 1/s; of two motions the frequency, Hz, and growth by each effect."""
ITERATIONS, CLOSE = 40, 1e-10
UNIT = 50.0
"""Hz over which the equilibrium moves by about a radius of the floater."""
REACH = (11.5e-3, 0.15)
"""Distances between which the attraction is looked at, m."""
Losses = tuple[Dissipation | None, Dissipation | None]
OFF = [Parameter.LINEAR_DRAG, Parameter.TILT_DRAG, Parameter.SPIN_DRAG, Parameter.TILT_EDDY, Parameter.SPIN_EDDY]
AIR, EDDY = OFF[:3], OFF[3:]


@dataclass(frozen=True, eq=False)
class Levitating:
    """The floater of a scene whose frequency is open.

    Parameters
    ----------
    scene : without losses
    table : the rotor's field
    losses : gives those in the magnets and in the steel, None where they are not asked for; called when something
        levitates, so that one process compiles while another computes the losses that both need
    """

    scene: Scene
    table: FieldTable
    rates: Rates
    losses: Callable[[], Losses]

    @classmethod
    def of(cls, scene: Scene, interaction: Interaction, losses: Callable[[], Losses]) -> "Levitating":
        """With the floater's currents and real air among the compiled equations, where their strength is zero."""
        return cls(scene, interaction, Rates(with_effects(_lossy(scene), interaction)), losses)

    @cached_property
    def _field(self) -> CompiledField:
        """The table's own expressions, good to 1e-11 at these distances, without moments for what is far away."""
        return CompiledField(self.table.expressions)

    @property
    def hanging(self) -> float:
        """Distance on the axis at which the attraction alone carries the weight, m."""
        weight = self.scene.floater.mass * abs(float(self.scene.gravity[2])) / self.scene.floater.moment

        def excess(distances: ArrayLike) -> Array:
            return self._field(np.multiply.outer(distances, [0.0, 0.0, -1.0]))[1][:, 2, 2] - weight

        grid = np.geomspace(*REACH, 60)
        carried = np.flatnonzero(excess(grid)[:-1] > 0)
        if not len(carried):
            raise EquilibriumError("The attraction carries the weight at no distance.")
        ends = grid[carried[-1] : carried[-1] + 2]
        return float(brentq(lambda distance: excess([distance])[0], *ends))

    def nodes(self, heights: Array, spins: Array) -> Array:
        """Quantities (height, spin, quantity) at distances (n,) m along the axis and body spins; NaN where none is."""
        found = np.full((len(heights), len(spins), len(QUANTITIES)), np.nan)
        for j, spin in enumerate(spins):
            known: Array | None = None
            for k in range(len(heights) - 1, -1, -1):
                known = self._solved(float(heights[k]), float(spin), known)
                if known is not None:
                    found[k, j] = self._quantities(known, float(spin))
        return found

    def _solved(self, height: float, spin: float, near: Array | None) -> Array | None:
        """Unknowns (7,) of the equilibrium at a height: place and frequency are scaled as in `Family`."""
        family = Family(self.rates, frequencies(self.scene, spin), UNIT)
        length = self.scene.floater.radius
        for guess in (self._guess(height, spin, family), near):
            if guess is None:
                continue
            unknowns = guess.copy()
            unknowns[2] = -height / length
            for _ in range(ITERATIONS):
                if not unknowns[6] * family.unit > 1.0:
                    break
                value, slope = family.linear(unknowns[None], np.zeros(1, int))
                free = [0, 1, 3, 4, 5, 6]
                step = np.linalg.solve(slope[0][:, free], -value[0])
                step *= min(1.0, 0.3 / np.abs(step).max())
                unknowns[free] += step
                unknowns[3:6] /= np.linalg.norm(unknowns[3:6])
                if np.abs(step).max() < CLOSE:
                    return unknowns if unknowns[5] > 0 else None
        return None

    def _guess(self, height: float, spin: float, family: Family) -> Array | None:
        """From the axial force at a place on the axis, which gives the moment's angle, and the torque there."""
        floater, place = self.scene.floater, np.array([0.0, 0.0, -height])
        (field,), (slope,) = self._field(place[None])
        size, turn = np.hypot(slope[0, 2], slope[2, 2]), np.arctan2(slope[0, 2], slope[2, 2])
        cosine = floater.mass * abs(float(self.scene.gravity[2])) / (floater.moment * size)
        if not cosine < 1:
            return None
        for angle in (turn + np.arccos(cosine), turn - np.arccos(cosine)):
            torque = floater.moment * (np.cos(angle) * field[0] - np.sin(angle) * field[2])
            square = torque / (floater.inertia * np.sin(angle) * (spin - np.cos(angle)))
            if abs(angle) < np.pi / 2 and square > 0:
                moment = np.array([np.sin(angle), 0.0, np.cos(angle)])
                pull = floater.moment * moment @ slope[:, 0]
                place[0] = -pull / (floater.mass * square)
                frequency = np.sqrt(square) / (2 * np.pi)
                return np.concatenate([place / floater.radius, moment, [frequency / family.unit]])
        return None

    def _quantities(self, unknowns: Array, spin: float) -> Array:
        frequency = float(unknowns[6]) * UNIT
        scene = replace(_lossy(self.scene), frequency=frequency)
        scales, whole = Scales.of(scene), parameters(scene, Scales.of(scene))
        still, eddy, air = (_without(whole, off) for off in (OFF, AIR, EDDY))
        balance = Family(self.rates, frequencies(self.scene, spin), UNIT).balance(frequency)
        state = balance.states(unknowns[None, :3], unknowns[None, 3:6])
        drift = [SlowTorque(self.rates, values, scene.floater.radius, False)(state[0]) for values in (eddy, air)]
        bare = self.rates(state, still)[1][0]
        slopes = [
            self.rates(state, _without(v, [Parameter.SPIN_DRAG, Parameter.SPIN_EDDY]))[1][0] - bare for v in (eddy, air)
        ]
        there = scales.unpack(state[0])
        brakes = [np.zeros((12, 12)) if loss is None else brake_slope(loss, scene, there) for loss in self.losses()]
        small = modes(state[0], bare)
        named = {mode.name: mode.frequency_hz for mode in named_modes(small, scales.time)}
        effects = [slopes[0], *brakes, slopes[1]]
        units = np.array([1 / (2 * np.pi), *[1.0] * len(effects)]) / scales.time
        grown = [units * motion for motion in first_order(state[0], bare, effects)]
        return np.array([
            frequency, *drift, scales.length * np.hypot(*state[0, :2]), named.get("bounce", np.nan),
            small.growth / scales.time, *grown[0], *grown[1],
        ])  # fmt: skip


def first_order(state: Array, slope: Array, added: Sequence[Array]) -> tuple[Array, Array]:
    """(Scaled, angular) frequency of two small motions, and what each of the effects (12, 12) adds to their growth.

    They are the two that the first two effects make grow most; the side motion is the one that moves the place more.
    """
    tangents, projections = (part[0] for part in tangent_spaces(state[None]))
    values, right = np.linalg.eig(projections @ slope @ tangents)
    left = np.linalg.inv(right)
    each = np.array([np.einsum("kj,ji,ik->k", left, projections @ part @ tangents, right).real for part in added])
    two = np.argsort(np.where(values.imag > 1e-6, each[:2].sum(axis=0), -np.inf))[-2:]
    shapes = np.abs(tangents @ right[:, two])
    moving = np.hypot(*shapes[:2]) / np.linalg.norm(shapes[6:9], axis=0)
    precession, side = two[np.argsort(moving)]
    return tuple(np.array([values[k].imag, *each[:, k]]) for k in (precession, side))  # type: ignore[return-value]


def _lossy(scene: Scene) -> Scene:
    """The scene in real air, its floater conducting."""
    floater = replace(scene.floater, conductivity=MAGNET_CONDUCTIVITY)
    return replace(scene, floater=floater, drag=replace(Drag.stokes(floater.radius), air=True))


def _without(values: Array, off: Sequence[int]) -> Array:
    found = values.copy()
    found[list(off)] = 0.0
    return found
