"""The currents that the turning rotor alone drives in a plate, known beforehand.

While the plate stands at depth d the rotor's share r_i = Re Σ_h r_ih e^{ihφ} of its signals leaves the states

    q_i(φ, d) = Re Σ_h λ_i/(λ_i + ihω) r_ih(d) e^{ihφ},    ∂q_i/∂t = -λ_i (q_i - r_i).

What is integrated is p_i - q_i.  It hears the floater, and of the rotor only that the plate goes down, with speed u:

    d(p_i - q_i)/dt = -λ_i (p_i - q_i - m·b_i) - u ∂q_i/∂d,    y_i = (p_i - q_i - m·b_i) + (q_i - r_i),

exact for every motion.  The rotor's harmonics would be the fastest motion among all states and decide how long a step
of Taylor's method may be; so they act on the floater alone, by the weak field of the currents q - r.

Energy.  To the floater the currents y_r = q - r are a field that is given as a function of time: they are what the
motor makes them to be, whatever the floater does.  So -m·Σ y_ri b_i is counted as the energy of a dipole in a field
from outside, and ½ Σ y_f², y_f = y - y_r, as what the floater has stored; together they lose, beside their work on it,

    Σ [λ y_f² + u y_f ∂q/∂d] + m·Σ b_i dy_ri/dt.

Whatever depends on the rotor's rate is a runtime parameter.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import heyoka as hy
import numpy as np

from ...fem.closed_forms.eddy_sphere import ComplexArray
from ...fem.plate.table import PlateTable, RotorShare
from ...geometry.common import Array
from ...geometry.scene.contents import Plate
from .state import Parameter, Vector, cross, dot, dotted, turned, turned_about_z


@dataclass(frozen=True, eq=False)
class RotorCurrents:
    """The rotor's share of a plate's signals, and what it leaves.

    Parameters
    ----------
    share : r
    rates : (states,) λ, 1/s
    angular_velocity : ω of the rotor, rad/s
    """

    share: RotorShare
    rates: Array
    angular_velocity: float

    @property
    def left(self) -> RotorShare:
        """The states q."""
        return self.share.filtered(self.rates / self._impedance)

    @property
    def currents(self) -> RotorShare:
        """The currents q - r."""
        return self.share.filtered(self.rates / self._impedance - 1.0)

    @property
    def _impedance(self) -> ComplexArray:
        """λ + ihω, (H+1, states)."""
        turns = np.arange(len(self.share.series) // 2 + 1)
        return np.asarray(self.rates + 1j * self.angular_velocity * turns[:, None])

    def numbers(self, weights: Array, reach: Sequence[int], unit: float, lowered: bool) -> Array:
        """Runtime parameters for `rotor_terms`, from the weights W (states, k) and the scaled unit of √energy."""
        strengths = np.einsum("nim,ik->nmk", self.currents.series[1:], weights).reshape(len(reach), -1)
        left = self.left.series.swapaxes(1, 2).ravel() if lowered else np.zeros(0)
        return unit * np.concatenate([*(row[:count] for row, count in zip(strengths, reach, strict=True)), left])


@dataclass(frozen=True, eq=False)
class RotorTerms:
    """What the rotor's currents add to the equations of motion, in scaled units.

    Parameters
    ----------
    strengths : Σ W_ik (q_i - r_i) of every function
    lowering : -u ∂q/∂d of each state; none of a plate that stays
    stored : the floater's energy in their field
    spent : its change by the field's own, and Σ u y_f ∂q/∂d
    """

    strengths: Vector
    lowering: Vector
    stored: hy.expression
    spent: hy.expression


def rotor_terms(
    share: RotorShare, reach: Sequence[int], first: int, lowered: bool, heard: Vector, own: Vector
) -> RotorTerms:
    """The rotor's part, by time.

    Parameters
    ----------
    share : of the rotor; only its shape counts, the numbers are runtime parameters from number `first` on
    reach : how many of the functions k have the terms of the share, those without h = 0 in their order
    lowered : whether the plate may go down
    heard : of each function k of the plate's fields what the floater's moment gives it
    own : y_f of each state, scaled
    """
    angle, depth = names = hy.make_vars("rotor_angle", "plate_depth")
    speed = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_SPEED]
    below = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_DEPTH] + speed * hy.time
    now = {"rotor_angle": hy.par[Parameter.RATE] * hy.time, "plate_depth": below}
    constant, *turning = share.basis(*names)
    functions = [f for row in turning for f in row]
    here = hy.subs(functions, now) if functions else []
    sinking = [speed * hy.subs(hy.diff(f, depth), now) for f in [*constant, *functions]] if lowered else []
    changing = [hy.par[Parameter.RATE] * hy.subs(hy.diff(f, angle), now) for f in functions]
    if lowered:
        changing = [a + b for a, b in zip(changing, sinking[len(constant) :], strict=True)]
    starts = [first + sum(reach[:n]) for n in range(len(reach) + 1)]
    rows = [[hy.par[start + k] for k in range(count)] for start, count in zip(starts[:-1], reach, strict=True)]
    sums = [dotted(row, heard[: len(row)]) for row in rows]
    lowering, start = list[hy.expression](), starts[-1]
    spent = dotted(changing, sums)
    if lowered:
        numbers = [[hy.par[start + n * len(own) + i] for n in range(len(sinking))] for i in range(len(own))]
        lowering = [-dotted(row, sinking) for row in numbers]
        spent = spent - dotted(own, lowering)
    strengths = [
        hy.sum([row[k] * f for row, f in zip(rows, here, strict=True) if k < len(row)]) for k in range(len(heard))
    ]
    return RotorTerms(strengths, lowering, -dotted(here, sums), spent)


@dataclass(frozen=True, eq=False)
class PlateMemory:
    """A plate in the motion.

    Parameters
    ----------
    plate : pose and way in the laboratory
    table : its currents and their fields, in its own frame
    share : what the turning rotor adds to the signals
    model : name of the plate's model
    neglected : estimated relative error of the model itself: of a slab, what its edges would change
    """

    plate: Plate
    table: PlateTable
    share: RotorShare
    model: str = "reduced"
    neglected: float = 0.0

    @property
    def error(self) -> float:
        """Estimated relative error of what the plate does."""
        return max(self.table.errors.total, self.share.error) + self.neglected

    def driven(self, angular_velocity: float) -> RotorCurrents:
        """What a rotor turning so fast (rad/s) leaves in the plate."""
        return RotorCurrents(self.share, self.table.rates, angular_velocity)

    def __repr__(self) -> str:
        harmonics = len(self.share.series) // 2
        told = f"relative error {self.error:.1e}, {harmonics} harmonics of the rotor"
        return f"PlateMemory {self.model!r}: {told}\n{self.table!r}"


@dataclass(frozen=True, eq=False)
class MemoryTerms:
    """What a plate adds to the equations of motion, in scaled units.

    Parameters
    ----------
    rates : of its states
    force, torque : accelerations of the floater's position and spin
    stored : energy of the floater's currents, and of the floater in the field of the rotor's
    spent : what both lose to heat, to what turns the rotor and to what lowers the plate
    """

    rates: Vector
    force: Vector
    torque: Vector
    stored: hy.expression
    spent: hy.expression


Felt = Callable[[Vector], tuple[Vector, Vector]]
"""Field (T/√E) and ∇(source·field) along the plate's axes, of the functions with given strengths."""


class PlateFormula(Protocol):
    """How the fields of a plate's states are written."""

    @property
    def memory(self) -> PlateMemory:
        """The plate."""

    @property
    def share(self) -> RotorShare:
        """Of the rotor: with as many terms as count."""

    @property
    def reach(self) -> list[int]:
        """How many of the functions have each term of the share, see `rotor_terms`."""

    @property
    def first(self) -> int:
        """Number of the first of the runtime parameters, which `numbers` are for."""

    @property
    def lowered(self) -> bool:
        """Whether the plate may be on its way."""

    @property
    def weights(self) -> list[list[hy.expression | None]]:
        """W of each state (rows) and function; None for zero."""

    @property
    def further(self) -> int:
        """Number of the runtime parameters that it has itself, before those of `rotor_numbers`."""

    def seen(self, place: Vector, source: Vector) -> tuple[Vector, Felt]:
        """What each function hears of a moment at a place (m), both along the plate's axes, and what it does there."""


def pushed(slope: dict[tuple[int, int], hy.expression], source: Vector) -> Vector:
    """∇(source·B) from the upper entries of the gradient of B, which is symmetric and without trace."""
    slope[2, 2] = -slope[0, 0] - slope[1, 1]
    return [hy.sum([source[i] * slope[min(i, j), max(i, j)] for i in range(3)]) for j in range(3)]


def decay_numbers(rates: Array, values: Array) -> Array:
    """Runtime parameters of the decay of states with rates (n,) 1/s, from those of `parameters`: -λT."""
    return -rates * float(values[Parameter.TIME])


def rotor_numbers(formula: PlateFormula, weights: Array, values: Array) -> Array:
    """Runtime parameters of the rotor's currents for weights W (states, k), from those of `parameters`."""
    velocity = float(values[Parameter.RATE]) / float(values[Parameter.TIME])
    rotor = RotorCurrents(formula.share, formula.memory.table.rates, velocity)
    return rotor.numbers(weights, formula.reach, float(values[Parameter.PLATE_SHARE]), formula.lowered)


def memory_terms(formula: PlateFormula, position: Vector, moment: Vector, states: Vector) -> MemoryTerms:
    """The plate's part of the equations, from the floater's scaled position and moment and the plate's states p - q."""
    plate, start = formula.memory.plate, formula.first + formula.further
    strength, length = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.LENGTH]
    place, pointing = seen_by_plate(formula, position), _product(plate.box.rotation.T, _turn(moment, 1.0))
    source = [strength * m for m in pointing]
    heard, felt = formula.seen(place, source)
    weights = formula.weights
    own = [p - _picked(row, heard) for p, row in zip(states, weights, strict=True)]
    rotor = rotor_terms(formula.share, formula.reach, start + len(own), formula.lowered, heard, own)
    strengths = [_picked(column, own) for column in zip(*weights, strict=True)]
    field, push = felt([a + b for a, b in zip(strengths, rotor.strengths, strict=True)])
    force = [length * f for f in _seen_by_rotor(plate, push)]
    turn = [strength * t for t in cross(moment, _seen_by_rotor(plate, field))]
    decay = [hy.par[start + i] * y for i, y in enumerate(own)]
    speed = hy.par[Parameter.PLATE_SPEED] if formula.lowered else hy.expression(0.0)
    drive = dot(force, [*turned(position)[:2], speed]) + hy.par[Parameter.RATE] * turn[2]
    return MemoryTerms(
        rates=[a + b for a, b in zip(decay, rotor.lowering, strict=True)] if rotor.lowering else decay,
        force=force,
        torque=[t / hy.par[Parameter.INERTIA] for t in turn],
        stored=0.5 * hy.sum([y * y for y in own]) + rotor.stored,
        spent=rotor.spent + drive - dotted(own, decay),
    )


def _picked(weights: Sequence[hy.expression | None], terms: Vector) -> hy.expression:
    """Σ weight · term."""
    return hy.sum([w * t for w, t in zip(weights, terms, strict=True) if w is not None])


def seen_by_plate(formula: PlateFormula, position: Vector) -> Vector:
    """A scaled position in the rotor's frame along the plate's axes, m, from its centre."""
    plate, depth = formula.memory.plate, hy.par[Parameter.PLATE_DEPTH]
    if formula.lowered:
        depth = depth + hy.par[Parameter.PLATE_SPEED] * hy.time
    lab = [hy.par[Parameter.LENGTH] * x for x in _turn(position, 1.0)]
    if plate.lowering:
        lab[2] = lab[2] + hy.par[Parameter.LENGTH] * depth
    shifted = [lab[i] - float(plate.box.center[i]) for i in range(3)]
    return _product(plate.box.rotation.T, shifted)


def _seen_by_rotor(plate: Plate, vector: Vector) -> Vector:
    return _turn(_product(plate.box.rotation, vector), -1.0)


def _turn(vector: Vector, sense: float) -> list[hy.expression]:
    angle = hy.par[Parameter.RATE] * hy.time
    cosine, sine = hy.cos(angle), sense * hy.sin(angle)
    x, y, z = vector
    return [cosine * x - sine * y, sine * x + cosine * y, z]


def _product(matrix: np.ndarray, vector: Vector) -> list[hy.expression]:
    exact = np.where(np.abs(matrix) < 1e-15, 0.0, matrix)  # a quarter turn leaves 6e-17, which would cost operations
    return [hy.sum([float(row[i]) * vector[i] for i in range(3) if row[i]]) for row in exact]


@dataclass(frozen=True, eq=False)
class Heard:
    """Plate and floater at n instants, scaled, along the rotor's axes.

    Parameters
    ----------
    signals : (n, states) s̃, the rotor's share included
    by_state : (n, states, 12) their derivatives by the floater's state
    fields : (n, states, 6) acceleration of position and of spin by a unit current of each state
    pull : (n, k, 12, 6) derivative of the multipoles' accelerations by the floater's state
    """

    signals: Array
    by_state: Array
    fields: Array
    pull: Array


@dataclass(frozen=True, eq=False)
class PlateForce:
    """The plate of a scene, seen from the frame that turns with the rotor.

    Parameters
    ----------
    memory : plate, table and the rotor's share
    values : runtime parameters of the equations of motion
    """

    memory: PlateMemory
    values: Array

    @property
    def rates(self) -> Array:
        """(states,) decay of the currents, scaled."""
        return np.asarray(self.memory.table.rates * self.values[Parameter.TIME])

    def __call__(self, times: Array, states: Array) -> Heard:
        """What plate and floater hear of each other at scaled times (n,) in scaled states (n, 12)."""
        strength, inertia, length = (
            self.values[p] for p in (Parameter.PLATE_MOMENT, Parameter.INERTIA, Parameter.LENGTH)
        )
        moment = states[:, 6:9]
        b, g, h = self._multipoles(times, states[:, :3] * length)
        count = b.shape[1]
        by_state = np.zeros((len(times), count, 12))
        by_state[..., :3] = strength * length * np.einsum("na,nkab->nkb", moment, g)
        by_state[..., 6:9] = strength * b
        across = strength / inertia * np.cross(moment[:, None], b)
        pull = np.zeros((len(times), count, 12, 6))
        pull[..., :3, :3] = strength * length**2 * np.einsum("na,nkabc->nkcb", moment, h)
        pull[..., 6:9, :3] = strength * length * g
        pull[..., :3, 3:] = strength * length / inertia * np.cross(moment[:, None, None], g.swapaxes(2, 3))
        pull[..., 6:9, 3:] = strength / inertia * np.cross(np.eye(3), b[:, :, None])
        weights = self.memory.table.weights
        own = strength * np.einsum("na,nka->nk", moment, b)
        return Heard(
            own @ weights.T + self._shares(times),
            np.einsum("ik,nkx->nix", weights, by_state),
            np.einsum("ik,nkx->nix", weights, np.concatenate([by_state[..., :3], across], axis=2)),
            pull,
        )

    def strengths(self, currents: Array) -> Array:
        """(n, k) of the multipoles, from the currents (n, states)."""
        return np.asarray(currents @ self.memory.table.weights)

    def remembered(self, count: int) -> Array:
        """(states, n, n): the plate's states at n instants of a turn, from its signals at them, all periodic."""
        decay = self.rates[:, None]
        harmonics = np.fft.fft(np.eye(count), axis=0)
        factors = decay / (decay + 1j * self.values[Parameter.RATE] * np.fft.fftfreq(count, 1 / count))
        return np.fft.ifft(factors[:, :, None] * harmonics, axis=1).real

    def settled(self, state: Array, count: int = 33) -> Array:
        """States (states,) of the plate at t = 0 under a floater that has long turned with the rotor, (12,)."""
        times = 2 * np.pi * np.arange(count) / count
        signals = self(times, np.broadcast_to(state, (count, 12))).signals
        return np.asarray(np.einsum("ib,bi->i", self.remembered(count)[:, 0], signals))

    def _shares(self, times: Array) -> Array:
        angles = self.values[Parameter.RATE] * times
        return np.asarray(self.values[Parameter.PLATE_SHARE] * self.memory.share.signals(angles, self._depth))

    @property
    def _depth(self) -> float:
        if self.memory.plate.lowering is None:
            return 0.0
        return float(self.values[Parameter.PLATE_DEPTH] * self.values[Parameter.LENGTH])

    def _multipoles(self, times: Array, position: Array) -> tuple[Array, Array, Array]:
        """B (n, k, 3), its first and second derivatives at positions (n, 3) m, along the rotor's axes."""
        box = self.memory.plate.box
        turn = turned_about_z(np.eye(3)[None], -(self.values[Parameter.RATE] * times)[:, None])  # rows: lab axes
        axes = np.einsum("ia,nib->nab", box.rotation, turn)  # rows: the plate's axes, seen from the rotor
        lab = np.einsum("nib,nb->ni", turn, position) + np.array([0.0, 0.0, self._depth])
        places = box.to_body(lab)
        b, g = self.memory.table.multipoles.evaluate(places)
        h = self.memory.table.multipoles.curvature(places)
        columns, rows = axes[:, None], axes.swapaxes(1, 2)[:, None]
        bent = rows[:, None] @ h @ columns[:, None]
        return b @ axes, rows @ g @ columns, (rows @ bent.reshape(*h.shape[:3], 9)).reshape(h.shape)
