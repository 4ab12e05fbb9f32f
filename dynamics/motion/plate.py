"""A plate in the motion, the currents that the turning rotor alone drives in it known beforehand.

While the plate stands at depth d the rotor's share r_i = Re Σ_h r_ih e^{ihφ} of its signals leaves the states

    q_i(φ, d) = Re Σ_h λ_i/(λ_i + ihω) r_ih(d) e^{ihφ},    ∂q_i/∂t = -λ_i (q_i - r_i).

What is integrated is p_i - q_i.  The floater drives it, and the rotor only as the plate goes down, with speed u:

    d(p_i - q_i)/dt = -λ_i (p_i - q_i - m·b_i) - u ∂q_i/∂d,    y_i = (p_i - q_i - m·b_i) + (q_i - r_i),

exact for every motion: the rotor's harmonics, the fastest motion of all, act on the floater alone, by the weak field of
the currents q - r.  To the floater these are a field given in time.  So -m·Σ (q_i - r_i) b_i is counted as its energy
in a field from outside, and ½ Σ y_f², y_f = y - q + r, as what it has stored; together they lose, beside their work,

    Σ [λ y_f² + u y_f ∂q/∂d] + m·Σ b_i d(q_i - r_i)/dt.

With a drive the rate W changes, and q would follow with a delay.  There q is the share's mean r_0 over a turn alone,

    d(p_i - q_i)/dt = -λ_i (p_i - q_i - m·b_i) + λ_i (r_i - r_i0) - u ∂r_i0/∂d,

exact for every W(t), in shorter steps.  The plate's torque on the rotor is Σ y_i ∂r_i/∂φ.
"""

from dataclasses import dataclass, replace
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...fem.harmonics.expressions import turned_expressions, weighted
from ...fem.plate.multipoles import cartesian
from ...fem.plate.table import PlateTable, RotorShare
from ...geometry.common import Array
from ...geometry.scene.contents import Plate
from .effect import Added
from .state import (
    OF_BODY,
    STEADY,
    Parameter,
    Turn,
    Vector,
    about_z,
    add,
    cross,
    dot,
    dotted,
    matrices_of,
    rotation_slopes,
    turned_about_z,
)

SETTLED = 33  # Angles of a turn at which the rotor's field is seen
ENDLESS = 1e30  # Rate of a rotor, rad/s, that no current follows


@dataclass(frozen=True, eq=False)
class PlateMemory:
    """A plate in the motion."""

    plate: Plate  #: pose and way in the laboratory
    table: PlateTable  #: its currents and their fields, in its own frame
    share: RotorShare  #: what the turning rotor adds to the signals
    model: str = "reduced"  #: name of the plate's model
    neglected: float = 0.0  #: estimated relative error of the model itself: of a slab, what its edges would change

    @property
    def error(self) -> float:
        """Estimated relative error of what the plate does."""
        return max(self.table.errors.total, self.share.error) + self.neglected

    def left_by_rotor(self, angular_velocity: float) -> RotorShare:
        """States q left by a rotor that turns so fast (rad/s), in the form of r; at `ENDLESS` means over a turn."""
        series = self.share.series.copy()
        followed = 1 / (1 + 1j * angular_velocity * np.arange(1, len(series) // 2 + 1)[:, None] / self.table.rates)
        amplitudes = (series[1::2] - 1j * series[2::2]) * followed[:, :, None]
        series[1::2], series[2::2] = amplitudes.real, -amplitudes.imag
        return replace(self.share, series=series)

    def in_range(self, lab: Array, time: ArrayLike = 0.0) -> NDArray[np.bool_]:
        """Which places (n, 3) m along the laboratory's axes the table knows at a time or each of (n,), s."""
        depth = np.broadcast_to(self.plate.depth(time), len(lab))
        return self.table.in_range(self.plate.box.to_body(lab + depth[:, None] * [0.0, 0.0, 1.0]))

    def __repr__(self) -> str:
        said = f"relative error {self.error:.1e}, {len(self.share.series) // 2} harmonics of the rotor"
        return f"PlateMemory {self.model!r}: {said}\n{self.table!r}"


def plate_numbers(memory: PlateMemory, values: Array, driven: bool = False) -> Array:
    """Runtime parameters of a plate.

    They are -λT of each state, then for each harmonic of the rotor's share what its currents q - r are in each
    multipole, and, of a plate that goes down, the harmonics of q of each state, or, with a drive, those of r. The
    `values` are as of `parameters`; `driven`: the scene has a drive.
    """
    table = memory.table
    velocity = ENDLESS if driven else float(values[Parameter.RATE]) / float(values[Parameter.TIME])
    left = memory.left_by_rotor(velocity).series
    strengths = np.einsum("nim,ik->nmk", left[1:] - memory.share.series[1:], _signal_weights(table)).ravel()
    of_states = memory.share.series if driven else left if memory.plate.lowering else np.zeros((0, 0, 0))
    by_rotor = float(values[Parameter.PLATE_SHARE]) * np.concatenate([strengths, of_states.swapaxes(1, 2).ravel()])
    return np.concatenate([-table.rates * float(values[Parameter.TIME]), by_rotor])


def _signal_weights(table: PlateTable) -> Array:
    """(n, k) of the first derivatives of each multipole, without their factors."""
    return table.weights * table.multipoles.factors(1)


def memory_terms(memory: PlateMemory, first: int, position: Vector, moment: Vector, rotor: Turn) -> Added:
    """The plate's part of the equations of motion; its states are p - q.

    Its energy is that of the floater's currents, and of the floater in the field of the rotor's; power is what both
    gain from heat, from what turns the rotor and from what lowers the plate. The numbers of `memory` are the runtime
    parameters from number `first` on; `position` and `moment` are the floater's, scaled; the `rotor` is `STEADY` or
    `DRIVEN`.
    """
    plate, table = memory.plate, memory.table
    states = [hy.expression(f"plate_{i}") for i in range(len(table.rates))]
    strength, length = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.LENGTH]
    place = seen_by_plate(plate, position, rotor)
    source = [strength * m for m in turned_expressions(plate.box.rotation.T, about_z(moment, rotor.angle, 1.0))]
    # x, y and z enter only after the sums over multipoles: every operation counts in Taylor's method
    flux, slopes = (table.multipoles.derivatives(place, order) for order in (1, 2))
    along = [weighted(column, source) for column in cartesian(1).T]
    signals = [dot(along, entry) for entry in flux]  # of the floater in each multipole
    weights = _signal_weights(table)
    own = [p - weighted(row, signals) for p, row in zip(states, weights, strict=True)]
    decay = [hy.par[first + i] * y for i, y in enumerate(own)]
    by_rotor, forced, stored, spent, braked = _rotor_terms(memory, first, signals, own, rotor)
    # of all states together, so that the fields of 20 to 40 multipoles are summed instead of those of 40 to 90 states
    strengths = [weighted(column, own) + r for column, r in zip(weights.T, by_rotor, strict=True)]
    steeper = table.multipoles.factors(2) / table.multipoles.factors(1) / table.multipoles.scale
    strong = [float(factor) * each for factor, each in zip(steeper, strengths, strict=True)]
    field_sums, slope_sums = (
        [dotted(several, column) for column in zip(*each, strict=True)]
        for several, each in ((strengths, flux), (strong, slopes))
    )
    field = [weighted(row, field_sums) for row in cartesian(1)]
    push = [dot(source, [weighted(row, slope_sums) for row in rows]) for rows in cartesian(2)]
    force = [length * f for f in _seen_by_rotor(plate, push, rotor)]
    turn = [strength * t for t in cross(moment, _seen_by_rotor(plate, field, rotor))]
    speed = hy.par[Parameter.PLATE_SPEED] if plate.lowering else hy.expression(0.0)
    drive = dot(force, [*rotor.swept(position)[:2], speed]) + rotor.rate * turn[2]
    return Added(
        force=force,
        torque=[t / hy.par[Parameter.INERTIA] for t in turn],
        energy=0.5 * hy.sum([y * y for y in own]) + stored,
        power=dotted(own, decay) - spent - drive,
        motor=braked,
        states=states,
        rates=add(decay, forced) if forced else decay,
    )


def _rotor_terms(
    memory: PlateMemory, first: int, signals: Vector, own: Vector, rotor: Turn
) -> tuple[Vector, Vector, hy.expression, hy.expression, hy.expression]:
    """The part of the rotor's currents, from the floater's signals in each multipole and y_f of each state.

    They are Σ W_ik (q_i - r_i) of every multipole; what drives each state beside the floater, if the plate goes down or
    with a drive; the floater's energy in their field; its change by the field's own, less y_f times what drives; and,
    with a drive, the torque by which the plate brakes the rotor.
    """
    angle, depth = names = hy.make_vars("rotor_angle", "plate_depth")
    driven = rotor is not STEADY
    speed = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_SPEED]
    below = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_DEPTH] + speed * hy.time
    now = {"rotor_angle": rotor.angle, "plate_depth": below}
    constant, *turning = memory.share.basis(*names)
    functions, count = [f for row in turning for f in row], len(signals)
    here = hy.subs(functions, now) if functions else []
    # r and q are Σ number · basis: the basis is written once, its derivatives by angle and depth are heyoka's
    by_angle = [hy.subs(hy.diff(f, angle), now) for f in functions]
    changing = [rotor.rate * f for f in by_angle]
    start, zero = first + len(own), hy.expression(0.0)
    rows = [[hy.par[start + n * count + k] for k in range(count)] for n in range(len(functions))]
    sums, forced, braked = [dotted(row, signals) for row in rows], list[hy.expression](), zero

    def number(harmonic: int, state: int) -> hy.expression:
        """Of q of a state, or with a drive of r."""
        return hy.par[start + len(functions) * count + harmonic * len(own) + state]

    if memory.plate.lowering:
        sinking = [speed * hy.subs(hy.diff(f, depth), now) for f in [*constant, *functions]]
        changing = add(changing, sinking[len(constant) :])
        parts = sinking[: len(constant)] if driven else sinking
        forced = [-hy.sum([number(n, i) * f for n, f in enumerate(parts)]) for i in range(len(own))]
    if driven:
        weights = [[number(n, i) for n in range(len(constant), len(constant) + len(here))] for i in range(len(own))]
        shares = [dotted(row, here) for row in weights]
        forced = add(forced or [zero] * len(own), [-hy.par[first + i] * share for i, share in enumerate(shares)])
        braked = hy.sum([(r - y) * dotted(row, by_angle) for r, y, row in zip(shares, own, weights, strict=True)])
    spent = -dotted(own, forced) if forced else zero
    strengths = [dotted(column, here) for column in zip(*rows, strict=True)] or [zero] * count
    return strengths, forced, -dotted(here, sums), spent + dotted(changing, sums), braked


def raised(position: Vector, rotor: Turn) -> Vector:
    """A scaled position in the rotor's frame along the laboratory's axes, raised by what the plate has gone down, m."""
    depth = hy.par[Parameter.PLATE_DEPTH] + hy.par[Parameter.PLATE_SPEED] * hy.time
    x, y, z = about_z([hy.par[Parameter.LENGTH] * p for p in position], rotor.angle, 1.0)
    return [x, y, z + hy.par[Parameter.LENGTH] * depth]


def seen_by_plate(plate: Plate, position: Vector, rotor: Turn) -> Vector:
    """A scaled position in the rotor's frame along the plate's axes, m, from its centre."""
    away = [x - float(c) for x, c in zip(raised(position, rotor), plate.box.center, strict=True)]
    return turned_expressions(plate.box.rotation.T, away)


def _seen_by_rotor(plate: Plate, vector: Vector, rotor: Turn) -> Vector:
    return about_z(turned_expressions(plate.box.rotation, vector), rotor.angle, -1.0)


@dataclass(frozen=True, eq=False)
class PlateCoupling:
    """Plate and floater at n instants, scaled, along the rotor's axes."""

    signals: Array  # (n, states) s̃, the rotor's share included
    by_state: Array  # (n, states, m) their derivatives by the floater's state
    fields: Array  # (n, states, 6) acceleration of position and of spin by a unit current of each state
    pull: Array  # (n, k, m, 6) derivative of the multipoles' accelerations by the floater's state


@dataclass(frozen=True, eq=False)
class PlateForce:
    """The plate of a scene, seen from the frame that turns with the rotor."""

    memory: PlateMemory  # plate, table and the rotor's share
    values: Array  # runtime parameters of the equations of motion

    @property
    def rates(self) -> Array:
        return np.asarray(self.memory.table.rates * self.values[Parameter.TIME])

    def __call__(self, times: Array, states: Array) -> PlateCoupling:
        """How plate and floater act on each other at scaled times (n,) in scaled states (n, m), m = 12.

        Of a body that is not round m = 13, and accelerations of spin are along its own axes, as in its equations.
        """
        if states.shape[1] > 12:
            return self._on_body(times, states)
        multipoles, weights, box = self.memory.table.multipoles, self.memory.table.weights, self.memory.plate.box
        chosen = Parameter.PLATE_MOMENT, Parameter.INERTIA, Parameter.LENGTH
        strength, inertia, length = (float(self.values[p]) for p in chosen)
        turn = turned_about_z(np.eye(3)[None], -(self.values[Parameter.RATE] * times)[:, None])  # rows: lab axes
        axes = np.einsum("ia,nib->nab", box.rotation, turn)  # rows: the plate's axes, seen from the rotor
        lab = np.einsum("nib,nb->ni", turn, states[:, :3] * length) + np.array([0.0, 0.0, self._depth])
        places, moment = box.to_body(lab), states[:, 6:9]
        pointing = np.einsum("nab,nb->na", axes, moment)
        b, g = multipoles.evaluate(places)
        bend = np.einsum("na,nkabc->nkbc", pointing, multipoles.curvature(places))  # of the moment's part of B
        columns, rows = axes[:, None], axes.swapaxes(1, 2)[:, None]
        b, g, bend = b @ axes, rows @ g @ columns, rows @ bend @ columns  # along the rotor's axes
        by_state = np.zeros((*b.shape[:2], 12))
        by_state[..., :3] = strength * length * np.einsum("na,nkab->nkb", moment, g)
        by_state[..., 6:9] = strength * b
        across = strength / inertia * np.cross(moment[:, None], b)
        pull = np.zeros((*b.shape[:2], 12, 6))
        pull[..., :3, :3] = strength * length**2 * bend
        pull[..., 6:9, :3] = strength * length * g
        pull[..., :3, 3:] = strength * length / inertia * np.cross(moment[:, None, None], g)
        pull[..., 6:9, 3:] = strength / inertia * np.cross(np.eye(3), b[:, :, None])
        own = strength * np.einsum("na,nka->nk", moment, b)
        angles = self.values[Parameter.RATE] * times
        shares = self.values[Parameter.PLATE_SHARE] * self.memory.share.signals(angles, self._depth)
        return PlateCoupling(
            own @ weights.T + shares,
            np.einsum("ik,nkx->nix", weights, by_state),
            np.einsum("ik,nkx->nix", weights, np.concatenate([by_state[..., :3], across], axis=2)),
            pull,
        )

    def _on_body(self, times: Array, states: Array) -> PlateCoupling:
        """That of a round body with the same place and moment, by the turn of a body in states (n, 13)."""
        ratios, pointing = np.split(self.values[list(OF_BODY)], 2)
        quaternion = states[:, 6:10]
        axes = matrices_of(quaternion)
        turned, moment = rotation_slopes(quaternion), axes @ pointing
        found = self(times, np.concatenate([states[:, :6], moment, states[:, 10:]], axis=1))
        chain = np.zeros((len(states), 12, 13))  # of a round body's state by this one's
        chain[:, :3, :3], chain[:, 6:9, 6:10] = np.eye(3), (turned @ pointing).swapaxes(1, 2)
        across = np.einsum("na,nkax->nkx", moment, found.pull[..., 6:9, 3:])  # of the multipoles, linear in the moment
        pull, fields = np.einsum("nyz,nkyx->nkzx", chain, found.pull), found.fields.copy()
        pull[..., 3:] = pull[..., 3:] @ axes[:, None]
        pull[..., 6:10, 3:] += np.einsum("nkx,nqxj->nkqj", across, turned)
        fields[..., 3:] = fields[..., 3:] @ axes
        pull[..., 3:] /= ratios
        fields[..., 3:] /= ratios
        return PlateCoupling(found.signals, found.by_state @ chain, fields, pull)

    def strengths(self, currents: Array) -> Array:
        """(n, k) of the multipoles, from the currents (n, states)."""
        return np.asarray(currents @ self.memory.table.weights)

    def remembered(self, count: int, shift: complex = 0.0) -> NDArray[Any]:
        """(states, n, n): the plate's states at n instants by its signals, periodic, or e^{λτ} times it, λ `shift`."""
        decay = self.rates[:, None]
        harmonics = np.fft.fft(np.eye(count), axis=0)
        factors = decay / (decay + shift + 1j * self.values[Parameter.RATE] * np.fft.fftfreq(count, 1 / count))
        found = np.fft.ifft(factors[:, :, None] * harmonics, axis=1)
        return found if shift else found.real

    def settled(self, state: Array) -> Array:
        """States (states,) of the plate at t = 0 under a floater that has long turned with the rotor, (m,)."""
        times = 2 * np.pi * np.arange(SETTLED) / SETTLED
        signals = self(times, np.broadcast_to(state, (SETTLED, len(state)))).signals
        return np.asarray(np.einsum("ib,bi->i", self.remembered(SETTLED)[:, 0], signals))

    @property
    def _depth(self) -> float:
        depth = self.values[Parameter.PLATE_DEPTH] * self.values[Parameter.LENGTH]
        return float(depth) if self.memory.plate.lowering else 0.0
