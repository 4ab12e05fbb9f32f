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

from dataclasses import dataclass

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...fem.harmonics.expansion import UPPER
from ...fem.plate.table import PlateTable, RotorShare
from ...geometry.common import Array
from ...geometry.scene.contents import Plate
from .state import Parameter, Vector, cross, dot, dotted, turned, turned_about_z


@dataclass(frozen=True, eq=False)
class PlateMemory:
    """A plate in the motion."""

    plate: Plate  # pose and way in the laboratory
    table: PlateTable  # its currents and their fields, in its own frame
    share: RotorShare  # what the turning rotor adds to the signals
    model: str = "reduced"  # name of the plate's model
    neglected: float = 0.0  # estimated relative error of the model itself: of a slab, what its edges would change

    @property
    def error(self) -> float:
        """Estimated relative error of what the plate does."""
        return max(self.table.errors.total, self.share.error) + self.neglected

    def driven(self, angular_velocity: float) -> tuple[RotorShare, RotorShare]:
        """States q and currents q - r that a rotor turning so fast (rad/s) alone leaves in the plate."""
        turns = np.arange(len(self.share.series) // 2 + 1)[:, None]
        followed = np.asarray(1 / (1 + 1j * angular_velocity * turns / self.table.rates), complex)
        return self.share.filtered(followed), self.share.filtered(np.asarray(followed - 1.0))

    def in_range(self, lab: Array, depth: Array) -> NDArray[np.bool_]:
        """Which places (n, 3) m along the laboratory's axes the table knows, the plate at depths (n,) m."""
        return self.table.in_range(self.plate.box.to_body(lab + depth[:, None] * [0.0, 0.0, 1.0]))

    def __repr__(self) -> str:
        harmonics = len(self.share.series) // 2
        told = f"relative error {self.error:.1e}, {harmonics} harmonics of the rotor"
        return f"PlateMemory {self.model!r}: {told}\n{self.table!r}"


@dataclass(frozen=True, eq=False)
class MemoryTerms:
    """What a plate adds to the equations of motion, in scaled units."""

    rates: Vector  # of its states
    force: Vector  # accelerations of the floater's position and spin
    torque: Vector
    stored: hy.expression  # energy of the floater's currents, and of the floater in the field of the rotor's
    spent: hy.expression  # what both lose to heat, to what turns the rotor and to what lowers the plate


def plate_numbers(memory: PlateMemory, values: Array) -> Array:
    """Runtime parameters of a plate, from those of `parameters`.

    They are -λT of each state, then for each harmonic of the rotor's share what its currents q - r are in each
    multipole, and, of a plate that goes down, the harmonics of q of each state.
    """
    table, velocity = memory.table, float(values[Parameter.RATE]) / float(values[Parameter.TIME])
    left, currents = memory.driven(velocity)
    strengths = np.einsum("nim,ik->nmk", currents.series[1:], table.weights).ravel()
    sinking = left.series.swapaxes(1, 2).ravel() if memory.plate.lowering else np.zeros(0)
    unit = float(values[Parameter.PLATE_SHARE])
    return np.concatenate([-table.rates * float(values[Parameter.TIME]), unit * np.concatenate([strengths, sinking])])


def memory_terms(memory: PlateMemory, first: int, position: Vector, moment: Vector, states: Vector) -> MemoryTerms:
    """The plate's part of the equations of motion.

    Parameters
    ----------
    memory, first : the plate, whose numbers are the runtime parameters from number `first` on
    position, moment : of the floater, scaled
    states : p - q of the plate
    """
    plate, table, lowered = memory.plate, memory.table, memory.plate.lowering is not None
    strength, length = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.LENGTH]
    place, pointing = seen_by_plate(memory, position), _product(plate.box.rotation.T, _turn(moment, 1.0))
    source = [strength * m for m in pointing]
    multipoles = table.multipoles.expressions(place)
    signals = [dot(source, field) for field, _ in multipoles]  # of the floater in each multipole
    own = [p - _weighted(row, signals) for p, row in zip(states, table.weights, strict=True)]
    by_rotor, sinking, stored, spent = _rotor_terms(memory, first + len(own), signals, own)
    # of all states together, so that the fields of 20 to 40 multipoles are summed instead of those of 40 to 90 states
    strengths = [_weighted(column, own) + r for column, r in zip(table.weights.T, by_rotor, strict=True)]
    pairs = list(zip(strengths, multipoles, strict=True))
    field = [hy.sum([w * b[i] for w, (b, _) in pairs]) for i in range(3)]
    slope = {(i, j): hy.sum([w * g[i][j] for w, (_, g) in pairs]) for i, j in UPPER}
    slope[2, 2] = -slope[0, 0] - slope[1, 1]
    push = [hy.sum([source[i] * slope[min(i, j), max(i, j)] for i in range(3)]) for j in range(3)]
    force = [length * f for f in _seen_by_rotor(plate, push)]
    turn = [strength * t for t in cross(moment, _seen_by_rotor(plate, field))]
    decay = [hy.par[first + i] * y for i, y in enumerate(own)]
    speed = hy.par[Parameter.PLATE_SPEED] if lowered else hy.expression(0.0)
    drive = dot(force, [*turned(position)[:2], speed]) + hy.par[Parameter.RATE] * turn[2]
    return MemoryTerms(
        rates=[a + b for a, b in zip(decay, sinking, strict=True)] if lowered else decay,
        force=force,
        torque=[t / hy.par[Parameter.INERTIA] for t in turn],
        stored=0.5 * hy.sum([y * y for y in own]) + stored,
        spent=spent + drive - dotted(own, decay),
    )


def _rotor_terms(
    memory: PlateMemory, first: int, signals: Vector, own: Vector
) -> tuple[Vector, Vector, hy.expression, hy.expression]:
    """The part of the rotor's currents, from the floater's signals in each multipole and y_f of each state.

    They are Σ W_ik (q_i - r_i) of every multipole; -u ∂q/∂d of each state, if the plate goes down; the floater's energy
    in their field; and its change by the field's own, with Σ u y_f ∂q/∂d.
    """
    angle, depth = names = hy.make_vars("rotor_angle", "plate_depth")
    speed = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_SPEED]
    below = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_DEPTH] + speed * hy.time
    now = {"rotor_angle": hy.par[Parameter.RATE] * hy.time, "plate_depth": below}
    constant, *turning = memory.share.basis(*names)
    functions = [f for row in turning for f in row]
    here = hy.subs(functions, now) if functions else []
    lowered = memory.plate.lowering is not None
    sinking = [speed * hy.subs(hy.diff(f, depth), now) for f in [*constant, *functions]] if lowered else []
    changing = [hy.par[Parameter.RATE] * hy.subs(hy.diff(f, angle), now) for f in functions]
    if lowered:
        changing = [a + b for a, b in zip(changing, sinking[len(constant) :], strict=True)]
    count = len(signals)
    # r and q are Σ number · basis: the basis is written once, its derivatives by angle and depth are heyoka's
    rows = [[hy.par[first + n * count + k] for k in range(count)] for n in range(len(functions))]
    sums = [dotted(row, signals) for row in rows]
    lowering, start = list[hy.expression](), first + len(functions) * count
    spent = dotted(changing, sums)
    if lowered:
        numbers = [[hy.par[start + n * len(own) + i] for n in range(len(sinking))] for i in range(len(own))]
        lowering = [-dotted(row, sinking) for row in numbers]
        spent = spent - dotted(own, lowering)
    strengths = [hy.sum([row[k] * f for row, f in zip(rows, here, strict=True)]) for k in range(count)]
    return strengths, lowering, -dotted(here, sums), spent


def _weighted(weights: Array, terms: Vector) -> hy.expression:
    return hy.sum([float(w) * t for w, t in zip(weights, terms, strict=True) if w])


def seen_by_plate(memory: PlateMemory, position: Vector) -> Vector:
    """A scaled position in the rotor's frame along the plate's axes, m, from its centre."""
    plate, depth = memory.plate, hy.par[Parameter.PLATE_DEPTH] + hy.par[Parameter.PLATE_SPEED] * hy.time
    lab = [hy.par[Parameter.LENGTH] * x for x in _turn(position, 1.0)]
    if plate.lowering:
        lab[2] = lab[2] + hy.par[Parameter.LENGTH] * depth
    return _product(plate.box.rotation.T, [lab[i] - float(plate.box.center[i]) for i in range(3)])


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
class PlateCoupling:
    """Plate and floater at n instants, scaled, along the rotor's axes."""

    signals: Array  # (n, states) s̃, the rotor's share included
    by_state: Array  # (n, states, 12) their derivatives by the floater's state
    fields: Array  # (n, states, 6) acceleration of position and of spin by a unit current of each state
    pull: Array  # (n, k, 12, 6) derivative of the multipoles' accelerations by the floater's state


@dataclass(frozen=True, eq=False)
class PlateForce:
    """The plate of a scene, seen from the frame that turns with the rotor."""

    memory: PlateMemory  # plate, table and the rotor's share
    values: Array  # runtime parameters of the equations of motion

    @property
    def rates(self) -> Array:
        """(states,) decay of the currents, scaled."""
        return np.asarray(self.memory.table.rates * self.values[Parameter.TIME])

    def __call__(self, times: Array, states: Array) -> PlateCoupling:
        """How plate and floater act on each other at scaled times (n,) in scaled states (n, 12)."""
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
        return PlateCoupling(
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
