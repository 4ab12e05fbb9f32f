"""What acts on a real floater: air beyond Stokes' drag, its shape, and eddy currents in it.

Stokes' drag is 6πηRv and Stokes' torque 8πηR³Ω (G. Kirchhoff, 1876); three things make the real ones larger.

A steady spin throws off a jet at the equator.  With Re = ΩR²/ν the torque is ½ρΩ²R⁵ C, C = 6.45/√Re + 32.1/Re for
20 ≤ Re ≤ 1000 (S. C. R. Dennis, S. N. Singh and D. B. Ingham, J. Fluid Mech. 101 (1980) 257: computed for 1 to 100, in
agreement with measurements; the first term is that of the boundary layer, so that laminar flow reaches further).
Stokes is C = 16π/Re; the two meet at Re = 7.9, and the larger one is taken.  E. Loth's fit of other data (AIAA J. 46
(2008) 801), 1 + 5/(64π) (4 Re)^0.6 times Stokes, is 11 % higher at Re = 20 and agrees within 5 % from 100 to 2000.

A small swing at the rotor's rate ω moves a layer of depth δ = √(2ν/ω), 0.28 mm at 60 Hz and 0.14 mm at 250 Hz.
Exactly, to first order in its angle (L. D. Landau and E. M. Lifshitz, Fluid Mechanics, section 24, problem on the
oscillating sphere), the part of the torque that is in phase with Ω is, over Stokes' and with q = R/δ,

    h = (3 + 6q + 6q² + 2q³) / (3 (1 + 2q + 2q²)),

eight at 60 Hz for the article's floater.  Seen from the laboratory a frequency-locked floater spins steadily
about the rotor's axis and swings across it once a turn: f is applied to Ω_z and h to the part of Ω across the axis.

A fast way through the air separates the flow: with Re = 2Rv/ν the drag is 1 + 0.15 Re^0.687 times Stokes', within 5 %
up to Re = 800 (L. Schiller and A. Naumann, Z. VDI 77 (1933) 318; R. Clift, J. R. Grace and M. E. Weber, Bubbles, Drops,
and Particles, 1978, table 5.2).  Left out is the memory of the layer in translation, which damps a small shaking at
frequency f by 1 + R/δ(f) times Stokes', ten at 10 Hz.  The air is far from walls, and the rotor does not stir it.

Bodies of other shapes have the drag of A. Haider and O. Levenspiel (Powder Technol. 58 (1989) 63), a fit to free falls
of compact bodies and discs in whatever attitude, by the sphericity φ, the surface of the sphere of their volume over
theirs; of cubes and octahedra it is within 5 % of the laws of E. S. Pettyjohn and E. B. Christiansen (Chem. Eng. Prog.
44 (1948) 157).  There is no such law of torques: theirs are those of the sphere of their volume, and what spheres in
them and about them would meet is the range that results state.

Eddy currents follow the rotor's field as the turning and moving floater sees it change (docs/mathematics-currents.md).
In a field that turns against the ball with angular velocity -w, a mode follows with a delay τ = μ0σR²/z², z a zero of
the spherical Bessel function j_{l-1} for a field of potential degree l (W. R. Smythe, Static and Dynamic Electricity,
3rd ed., section 10.06).  With X = w× of the field B of degree 1, and the commutator with w× of its gradient G of degree
2, the ball takes the dipole and quadrupole moments -κ Ḃ and -(2/21) R² κ Ġ, κ = (2π/15) σ R⁵,

    Ḃ = Σ c [(1 - τX)⁻² G v - X (1 - τX)⁻¹ B],        Ġ = Σ c [(v·∇) G - X (1 - τX)⁻¹ G],

with sums over the modes, c ∝ 1/z⁴, Σ c = 1, and drift v and lag w as seen from the rotor.  Exact for a steady turn at
every frequency; what changes the turn, and the drift through G, is taken as slow against the delays (`slow_error`).
A body of another shape has tensors of field and gradient in place of κ and (2/21) R² κ, and one between the two where
it has no centre of symmetry (`fem.floater_metal`).  Each part of a uniform field's has the shares c of a ball and
delays that are longer or shorter by one ratio, such that B̈ has the right factor; delays of the others are right in
the mean.  Degree 3 is left out: 1 to 2 % of this effect's growth rates at 14 to 22 mm, more nearer by.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any, TypeVar

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.closed_forms.eddy_bodies import skin_number
from ...fem.floater_metal import DIPOLE, GRADIENTS, QUADRUPOLE, current_shape
from ...fem.harmonics.interior import LocalField
from ...fem.rotor.floater import FloaterSources, force_and_torque
from ...fem.rotor.table import DerivedField, FieldFormula, FieldTable
from ...fem.rotor_metal import ROUNDED
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import AIR_VISCOSITY, Scene
from ...geometry.scene.floater import Floater
from .coils import CoilForce
from .effect import NOTHING, ZERO, Added, Effect, Motion, Poses, dissipative
from .state import Parameter, Vector, add, cross, dot

REAL_AIR = "air beyond Stokes"
AIR_DENSITY = 1.19  # kg/m³ at 20-25 °C
BOUNDARY_LAYER, REST = 6.45, 32.1
# Reynolds number at which a steady spin begins to meet more than Stokes' torque.
STOKES_UP_TO = ((16 * np.pi - REST) / BOUNDARY_LAYER) ** 2
# Reynolds number that is added in square to that of translation, so that its power is smooth at rest: 3 % there.
SLOW = 0.1
# Of Haider and Levenspiel's A, C and D: of their logarithms by powers of the sphericity, the highest first
HAIDER = (2.4486, -6.4581, 2.3288), (-10.2599, 18.4222, -13.8944, 4.905), (15.8855, -20.7322, 12.2584, 1.4681)
Value = TypeVar("Value", Array, hy.expression)


def reynolds(radius: float, angular_velocity: ArrayLike) -> Array:
    """ΩR²/ν in air of a sphere (m) that spins (rad/s)."""
    return np.asarray(np.abs(np.asarray(angular_velocity, float)) * radius**2 * AIR_DENSITY / AIR_VISCOSITY)


def spinning(reynolds_number: ArrayLike) -> Array:
    """Torque of a steady spin over Stokes' 8πηR³Ω, at Re = ΩR²/ν: 1 up to 7.9, about 4.7 at 1000."""
    return np.asarray(_beyond(np.maximum(np.asarray(reynolds_number, float), STOKES_UP_TO)))


def swinging(reynolds_number: ArrayLike) -> Array:
    """Torque in phase with a small swing at ω over Stokes' 8πηR³Ω, at ωR²/ν: 1 if slow, about 8 at 1000."""
    return np.asarray(_layered(np.sqrt(np.asarray(reynolds_number, float) / 2)))


def moving(reynolds_number: ArrayLike, sphericity: float | None = None) -> Array:
    """Drag of a steady way over Stokes' 6πηRv, at Re = 2Rv/ν, R of the sphere of its volume: 5.6 for one at 150."""
    square = np.asarray(reynolds_number, float) ** 2
    return np.asarray(_separated(square) if sphericity is None else _of_shape(square, sphericity))


@dataclass(frozen=True)
class RealAir:
    """What air does beyond the Stokes drag that the runtime parameters hold."""

    name: str = REAL_AIR
    # of a body that is no sphere: the radius of the sphere of its volume over its own, its sphericity, and, where it is
    # round about its moment, its moment of inertia about that over the one across it
    size: float = 1.0
    sphericity: float | None = None
    spin_ratio: float = 1.0

    @classmethod
    def of(cls, scene: Scene) -> "RealAir | None":
        floater = scene.floater
        if not scene.drag.air or floater.is_sphere:
            return cls() if scene.drag.air else None
        radius, ratio = floater.equal_radius, floater.spin_ratio if floater.round else 1.0
        area = sum(body.area for body in floater.bodies)
        return cls(REAL_AIR, radius / floater.radius, min(4 * np.pi * radius**2 / area, 1.0), ratio)

    @property
    def compiled_in(self) -> tuple[Any, ...]:
        return astuple(self)

    def added(self, motion: Motion) -> Added:
        length, time, spin, moment = hy.par[Parameter.LENGTH], hy.par[Parameter.TIME], motion.spin, motion.moment
        if self.spin_ratio != 1.0:  # it is L/I, see `Scales`
            along = (1.0 / self.spin_ratio - 1.0) * dot(spin, moment)
            spin = [s + along * m for s, m in zip(spin, moment, strict=True)]
        # Reynolds number of unit spin or speed, by the sphere of its volume
        unit = length * length / time * (self.size**2 * AIR_DENSITY / AIR_VISCOSITY)
        steady = _beyond(STOKES_UP_TO + hy.relu(unit * (hy.relu(spin[2]) + hy.relu(-spin[2])) - STOKES_UP_TO)) - 1.0
        swing = _layered(hy.sqrt(0.5 * unit * motion.turn.pace)) - 1.0
        torque = [-swing * spin[0], -swing * spin[1], -steady * spin[2]]
        tilt, along = hy.par[Parameter.TILT_DRAG], hy.par[Parameter.SPIN_DRAG]
        excess = (self.spin_ratio * along - tilt) * dot(torque, moment) if motion.axes is None else ZERO
        speed = 4.0 / self.size**2 * unit * unit * dot(motion.velocity, motion.velocity) + SLOW**2
        drag = _separated(speed) if self.sphericity is None else _of_shape(speed, self.sphericity)
        push = hy.par[Parameter.LINEAR_DRAG] * (1.0 - drag)
        force = [push * v for v in motion.velocity]
        brake = [tilt * torque[i] + excess * moment[i] for i in range(3)]
        return replace(dissipative(force, brake, motion), motor=ZERO)


def _beyond(number: Value) -> Value:
    return (BOUNDARY_LAYER * number**0.5 + REST) / (16 * np.pi)


def _layered(q: Value) -> Value:
    return (3.0 + 6.0 * q + 6.0 * q * q + 2.0 * q * q * q) / (3.0 * (1.0 + 2.0 * q + 2.0 * q * q))


def _separated(square: Value) -> Value:
    return 1.0 + 0.15 * square ** (0.687 / 2)


def _of_shape(square: Value, sphericity: float) -> Value:
    a, c, d = (float(np.exp(np.polyval(powers, sphericity))) for powers in HAIDER)
    return 1.0 + a * square ** ((0.0964 + 0.5565 * sphericity) / 2) + c / 24 * square / (square**0.5 + d)


FLOATER_SHAPE = "the floater's shape"
HEIGHTS = np.array([0.3, 0.6, 0.9])  # Of the dipoles off the centre, in half heights of the floater
# Of the radius, in place of the half height of a flatter floater, whose dipoles would cancel: those of 16 × 1 mm were
# 5e7 times what they are together, and energy was kept to 1e-6.
REACH = 0.55


@dataclass(frozen=True, eq=False)
class FloaterShape:
    """What the shape of a cylinder polarised along its axis adds to the dipole at its centre."""

    field: FieldFormula  # the rotor's
    heights: Array  # (k,) m along the moment; the first is zero
    dipoles: Array  # (k,) by the moment of the equations
    floater: Floater  # whose shape it is
    sources: FloaterSources
    name: str = FLOATER_SHAPE
    fields: tuple[LocalField, ...] = ()  # the field about the dipoles off the centre; none: as the table writes it

    @classmethod
    def of(cls, floater: Floater, sources: FloaterSources, field: FieldFormula) -> "FloaterShape":
        """Dipoles with the multipoles of a floater's `sources`, in `field`, less the one that the equations have."""
        axis = np.array([[0.0, 0.0, 1.0]])
        half = max(float(abs(body.center[2]) + body.reach(axis)[0]) for body in floater.bodies)
        half = max(half, REACH * floater.radius)
        heights = half * np.array([0.0, *HEIGHTS, *-HEIGHTS])
        degrees = np.arange(1, len(heights) + 1)
        powers = (heights / half) ** (degrees[:, None] - 1)
        wanted = sources.axial_moments(int(degrees[-1]))[degrees - 1] / (degrees * half ** (degrees - 1))
        dipoles = np.linalg.pinv(powers) @ wanted / (floater.moment or 1.0)
        return cls(field, heights, dipoles - (heights == 0) * bool(floater.moment), floater, sources)

    @property
    def count(self) -> int:
        return (len(self.heights) - 1) * LocalField.count

    @property
    def compiled_in(self) -> tuple[float, ...]:
        return (*self.heights.tolist(), *self.dipoles.tolist())

    def placed(self, first: int) -> "FloaterShape":
        numbers = range(len(self.heights) - 1)
        return replace(self, fields=tuple(LocalField(first + k * LocalField.count) for k in numbers))

    def numbers(self, field: DerivedField, poses: Poses) -> Array:
        found = []
        for height in self.heights[1:]:
            places = poses.places + height * poses.moment
            found += [places, field.derivatives(places, LocalField.ORDER)]
        return np.concatenate(found, axis=1)

    def added(self, motion: Motion) -> Added:
        length, torque, inertia = (hy.par[p] for p in (Parameter.LENGTH, Parameter.TORQUE, Parameter.INERTIA))
        fields: list[FieldFormula] = [self.field, *(self.fields or [self.field] * (len(self.heights) - 1))]
        moment, force, turn, energy = motion.moment, NOTHING, NOTHING, ZERO
        for height, dipole, formula in zip(self.heights, self.dipoles, fields, strict=True):
            place = [length * x + float(height) * m for x, m in zip(motion.position, moment, strict=True)]
            field, gradient = formula.expressions(place) if height else (motion.field, motion.gradient)
            strength = float(dipole) * torque
            pull = [strength * inertia * length * dot(moment, [gradient[i][j] for i in range(3)]) for j in range(3)]
            force = add(force, pull)
            arm = [float(height) / length / inertia * m for m in moment]
            turn = add(turn, [strength * t for t in cross(moment, field)], cross(arm, pull))
            energy = energy - strength * inertia * dot(moment, field)
        return Added(force, turn, energy=energy)

    def missed(self, table: FieldTable, position: Array, moment: Array) -> Array:
        """(n, 2) what the dipoles miss of torque, T, and of force, T/m, by the floater's moment.

        In the rotor's field of `table` at `position` (n, 3) m of the centre, rotor's frame, in directions `moment`
        (n, 3). Raises RangeError as `force_and_torque` does.
        """
        axes = np.array([self.floater.axes(m) for m in moment])
        force, torque = force_and_torque(self.sources, table, position, axes)
        for height, dipole in zip(self.heights, self.dipoles + (self.heights == 0), strict=True):
            places = position + height * moment
            if not table.in_range(places).all():  # a flat floater's are farther along its axis than it is itself
                return np.full((len(position), 2), np.inf)
            field, gradient = table.evaluate(places)
            strength = dipole * self.floater.moment
            pull = strength * np.einsum("nj,nji->ni", moment, gradient)
            force -= pull
            torque -= strength * np.cross(moment, field) + height * np.cross(moment, pull)
        missed = np.linalg.norm([torque, force], axis=2).T / (self.floater.moment or 1.0)
        return np.asarray(missed + self.sources.missed(*table.evaluate(position)))


EVEN = 1e-6  # By which entries of a polarizability may differ that is the same in all directions, as a cube's is


def is_even(tensor: Array) -> bool:
    """Whether a tensor (3, 3) is the same in all directions."""
    return bool(np.abs(tensor - tensor[0, 0] * np.eye(3)).max() <= EVEN * abs(tensor[0, 0]))


def by_tensor(tensor: Array, vector: Vector, motion: Motion) -> list[hy.expression]:
    """A tensor (3, 3) along the body's axes by a vector along the rotor's; of a round body it is round about z."""
    across, along = float(tensor[0, 0]), float(tensor[2, 2] - tensor[0, 0])
    if is_even(tensor):
        return [across * v for v in vector]
    if motion.axes is None:
        lengthwise = along * dot(motion.moment, vector)
        return [across * v + lengthwise * m for v, m in zip(vector, motion.moment, strict=True)]
    own = [dot([row[k] for row in motion.axes], vector) for k in range(3)]
    turned = [hy.sum([float(a) * b for a, b in zip(row, own, strict=True)]) for row in tensor]
    return [dot(row, turned) for row in motion.axes]


Matrix = list[list[hy.expression]]
GRADIENT = 2 / 21  # Share of a unit gradient in the loss, lengths in radii; κ is that of a unit field
# The first of j0 and of j1; all others together are as fast as the field.
ZEROS = (
    tuple(float(n * np.pi) for n in range(1, 9)),
    (4.493409457909064, 7.725251836937707, 10.904121659428899, 14.066193912831473, 17.22075527193077),
)
SUMS = ((1 / 90, 1 / 945), (1 / 350, 1 / 7875))  # Σ 1/z⁴ and Σ 1/z⁶ over all zeros (Rayleigh)
# Largest ωμ0σR², 2 R² over the skin depth's square: there the other modes are missed by 2 % of the torque.
THINNEST = 300.0

# Largest `slow_error` beside a remanence, which makes motions fast: there it would be a growth rate's error.
SLOW_ENOUGH = 0.25

FLOATER_CURRENTS = "currents in the floater"


def check_floater_metal(scene: Scene) -> None:
    """Refuse a floater whose currents are more modes than are followed, or too slow for the motions of a magnet.

    Raises InputError: with the skin depth, and the conductivity or frequency up to which it would do.
    """
    floater, frequency, radius = scene.floater, scene.fastest, _as_slow(scene.floater)
    number = skin_number(radius, floater.conductivity or 0.0, frequency)
    if too_slow(scene):
        rule = "leave its skin depth large against it where it has a remanence"
        said = f"{2 * frequency:.4g} Hz, twice the rotor's frequency,"
        depth, share = radius / np.sqrt(number), np.sqrt(SLOW_ENOUGH * 105) / 2 / number
    elif number > THINNEST:
        rule = f"leave its skin depth at least {np.sqrt(2 / THINNEST):.2g} of its radius"
        said, depth, share = f"{frequency:.4g} Hz", radius * np.sqrt(2 / number), THINNEST / number
    else:
        return
    most = ROUNDED * share
    ball = "in a ball" if floater.is_sphere else f"in a {floater.shape} whose currents are as slow as in a ball"
    raise InputError(
        f"Input floater.conductivity_S_m must {rule}; instead received {floater.conductivity:.3g} S/m: "
        f"{depth * 1e3:.3g} mm at {said} {ball} of {2e3 * radius:.4g} mm. Take at most "
        f"{most * (floater.conductivity or 0):.3g} S/m or {most * frequency:.3g} Hz, or leave it out."
    )


def _as_slow(floater: Floater) -> float:
    """Radius (m) of a ball whose currents are as slow as a floater's."""
    if floater.is_sphere or not floater.conductivity:
        return floater.radius
    return float(floater.radius * np.sqrt(current_shape(floater).delays.max()))


def slow_error(scene: Scene) -> float:
    """Relative error, at most 1, of what a conducting floater's currents do to motions: they are taken as slow.

    As for the rotor's metal (`fem.rotor_metal`) the fastest are at twice the rotor's frequency.  A drive of a
    rate of change a adds a τ² of the slowest mode, which follows the lag with its delay τ.
    """
    floater, radius, (times, rates, _) = scene.floater, _as_slow(scene.floater), scene.knots
    delay = skin_number(radius, floater.conductivity or 0.0, 1 / (2 * np.pi)) / ZEROS[0][0] ** 2
    ramp = float(np.abs(np.diff(rates) / np.diff(times)).max(initial=0.0)) * delay**2
    return min(1.0, (2 * skin_number(radius, floater.conductivity or 0.0, scene.fastest)) ** 2 / 105 + ramp)


def too_slow(scene: Scene) -> bool:
    """Whether currents of the floater are too slow for its motions: those of a magnet are as fast as the rotor."""
    return scene.floater.remanence > 0 and slow_error(scene) > SLOW_ENOUGH


Numbers = tuple[float, ...]
UNIT: Numbers = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class FloaterCurrents:
    """The floater's own eddy currents, by those of a ball of its radius, which the runtime parameters tell."""

    name: str = FLOATER_CURRENTS
    delays: Numbers = (1.0,)
    tensors: tuple[Numbers, ...] = (UNIT,)  # of the field (3, 3), one for each delay
    gradient: Numbers = ()  # (5, 5) by `GRADIENTS`; a ball's has none
    gradient_delay: float = 1.0
    coupling: Numbers = ()  # (3, 5) of field and gradient; none of a body with a centre of symmetry
    coupling_delay: float = 1.0  # by a ball's of the field

    @classmethod
    def of(cls, scene: Scene) -> "FloaterCurrents | None":
        if not scene.floater.conductivity:
            return None
        if scene.floater.is_sphere:
            return cls()
        shape = current_shape(scene.floater)
        tensors = tuple(tuple(tensor.ravel().tolist()) for tensor in shape.tensors)
        gradient = tuple(shape.gradient.ravel().tolist()), shape.gradient_delay
        coupling = tuple(shape.coupling.ravel().tolist()) if shape.coupling.any() else ()
        return cls(FLOATER_CURRENTS, tuple(shape.delays.tolist()), tensors, *gradient, coupling, shape.coupling_delay)

    @property
    def compiled_in(self) -> tuple[Any, ...]:
        return astuple(self)

    def added(self, motion: Motion) -> Added:
        length, inertia = hy.par[Parameter.LENGTH], hy.par[Parameter.INERTIA]
        tilt, along = hy.par[Parameter.TILT_EDDY], hy.par[Parameter.SPIN_EDDY]
        moment, drift, lag = motion.moment, motion.drift, self._lag(motion)
        gradient = [[length * entry for entry in row] for row in motion.gradient]
        bend, moving = curvature(motion), [dot(row, drift) for row in gradient]
        dipole = NOTHING
        for delay, tensor in zip(self.delays, self.tensors, strict=True):
            change = _changed_field(lag, motion.field, moving, delay)
            dipole = add(dipole, by_tensor(np.reshape(tensor, (3, 3)), change, motion))
        sheared = _turned_gradient(lag, gradient, self.gradient_delay)
        bent = [[dot(bend[i][j], drift) for j in range(3)] for i in range(3)]
        changed = [[bent[i][j] - sheared[i][j] for j in range(3)] for i in range(3)]
        share, coupled = GRADIENT, None  # changes of field (3) and gradient (3, 3) with the delay of what joins them
        if self.coupling:
            change = _changed_field(lag, motion.field, moving, self.coupling_delay)
            sheared = _turned_gradient(lag, gradient, self.coupling_delay * DIPOLE / QUADRUPOLE)
            coupled = change, [[bent[i][j] - sheared[i][j] for j in range(3)] for i in range(3)]
        if self.gradient:
            share = 1.0
            dipole, changed = self._of_shape(dipole, changed, coupled, motion)
        pull = [hy.sum([changed[i][j] * bend[i][j][k] for i in range(3) for j in range(3)]) for k in range(3)]
        force = [
            -tilt * inertia * (dot([gradient[i][k] for i in range(3)], dipole) + share * pull[k]) for k in range(3)
        ]
        product = [[dot(changed[i], gradient[j]) for j in range(3)] for i in range(3)]
        twist = [product[i][j] - product[j][i] for i, j in ((1, 2), (2, 0), (0, 1))]
        turn = cross(motion.field, dipole)
        torque = [turn[k] - 2 * share * twist[k] for k in range(3)]
        # a body that is not round has no spin of its own that is held
        excess = (along - tilt) * dot(torque, moment) if motion.axes is None else ZERO
        return dissipative(force, [tilt * torque[i] + excess * moment[i] for i in range(3)], motion)

    def _lag(self, motion: Motion) -> Vector:
        """The spin as seen from the rotor, along the moment too.

        That of a round body is in the equations with its part along the moment times a ratio, by which the torque along
        it turns it less (`state.Scales`); the power is that of the energy which has the same.
        """
        if not self.gradient or motion.axes is not None:
            return motion.lag
        less = (1.0 / hy.par[Parameter.INERTIA_Z] - 1.0) * dot(motion.spin, motion.moment)
        return add(motion.lag, [less * m for m in motion.moment])

    def _of_shape(
        self, dipole: Vector, changes: Matrix, coupled: tuple[Vector, Matrix] | None, motion: Motion
    ) -> tuple[list[hy.expression], Matrix]:
        """The dipole with what the gradient's change adds, and the quadrupole (3, 3), of the `changes`."""
        loss, mixed = np.reshape(self.gradient, (5, 5)), np.reshape(self.coupling or np.zeros(15), (3, 5))
        if motion.axes is None:
            return _of_round(loss, mixed, dipole, changes, coupled, motion.moment)
        axes, columns = motion.axes, [[row[k] for row in motion.axes] for k in range(3)]

        def along_axes(matrix: Matrix) -> list[hy.expression]:
            halves = [[dot(matrix[i], column) for i in range(3)] for column in columns]
            own = [[dot(halves[j], columns[i]) for j in range(3)] for i in range(3)]
            return [hy.sum([float(g[i, j]) * own[i][j] for i, j in np.argwhere(g)]) for g in GRADIENTS]

        parts = along_axes(changes)
        answers = [hy.sum([float(row[k]) * parts[k] for k in range(5)]) for row in loss]
        if coupled:
            parts = along_axes(coupled[1])
            more = [hy.sum([float(row[k]) * parts[k] for k in range(5)]) for row in mixed]
            dipole = add(dipole, [dot(row, more) for row in axes])
            seen = [dot(column, coupled[0]) for column in columns]
            answers = add(answers, [hy.sum([float(row[k]) * seen[k] for k in range(3)]) for row in mixed.T])
        whole = [[hy.sum([float(g[i, j]) * a for g, a in zip(GRADIENTS, answers, strict=True) if g[i, j]])
                  for j in range(3)] for i in range(3)]  # fmt: skip
        halves = [[dot(whole[i], row) for i in range(3)] for row in axes]
        return list(dipole), [[dot(halves[j], axes[i]) for j in range(3)] for i in range(3)]


def _of_round(
    loss: Array, mixed: Array, dipole: Vector, changes: Matrix, coupled: tuple[Vector, Matrix] | None, moment: Vector
) -> tuple[list[hy.expression], Matrix]:
    """`_of_shape` of a body round about m̂, by m̂·C m̂, C m̂ across m̂ and the rest; `loss`, coupling `mixed`."""
    rest, tilted, straight = (float(loss[k, k]) for k in (0, 3, 1))
    along, across = _pointed(changes, moment)
    lengthwise, sideways = 1.5 * (straight - rest) * along, [(tilted - rest) * a for a in across]
    if coupled:
        one, two = float(mixed[2, 1]), float(mixed[0, 3])
        along, across = _pointed(coupled[1], moment)
        dipole = [d + 1.5**0.5 * one * along * m + 2**0.5 * two * a
                  for d, m, a in zip(dipole, moment, across, strict=True)]  # fmt: skip
        seen = dot(coupled[0], moment)
        lengthwise = lengthwise + 1.5**0.5 * one * seen
        sideways = add(sideways, [0.5**0.5 * two * (c - seen * m) for c, m in zip(coupled[0], moment, strict=True)])
    whole = [[rest * changes[i][j] + lengthwise * moment[i] * moment[j] + sideways[i] * moment[j]
              + moment[i] * sideways[j] - (lengthwise / 3.0 if i == j else 0.0) for j in range(3)]
             for i in range(3)]  # fmt: skip
    return list(dipole), whole


def _pointed(changes: Matrix, moment: Vector) -> tuple[hy.expression, list[hy.expression]]:
    """m̂·C m̂ and C m̂ across m̂ (3) of a matrix C."""
    pointed = [dot(row, moment) for row in changes]
    along = dot(pointed, moment)
    return along, [p - along * m for p, m in zip(pointed, moment, strict=True)]


def _modes(degree: int, lag: Vector, slower: float) -> list[tuple[float, hy.expression, hy.expression]]:
    """At a lag the share c, delay τ and w²τ² of those that are followed, `slower` than a ball's by a factor.

    And of one for all others, so fast that it is never behind by much.
    """
    inverse = np.array(ZEROS[degree - 1]) ** -2.0
    fourth, sixth = SUMS[degree - 1]
    shares, delays = inverse**2 / fourth, inverse * slower
    rest = 1 - shares.sum()
    pairs = [*zip(shares.tolist(), delays.tolist(), strict=True)]
    pairs.append((float(rest), float(sixth / fourth * slower - shares @ delays) / float(rest)))
    square, slowness = dot(lag, lag), hy.par[Parameter.SLOWNESS]
    return [(c, t * slowness, square * (t * slowness) ** 2.0) for c, t in pairs]


def _changed_field(lag: Vector, field: Vector, moving: Vector, slower: float) -> Vector:
    """Σ c [(1 - τX)⁻² G v - X (1 - τX)⁻¹ B], from X³ = -w² X."""
    modes = [(c, t, s, 1 / (1 + s)) for c, t, s in _modes(1, lag, slower)]
    turned = hy.sum([c * once for c, _, _, once in modes])
    lifted = hy.sum([c * t * once for c, t, _, once in modes])
    late = hy.sum([2 * c * t * once * once for c, t, _, once in modes])
    later = hy.sum([c * t**2.0 * (3 + s) * once * once for c, t, s, once in modes])
    sheared = [late * a - turned * b for a, b in zip(moving, field, strict=True)]
    twice = [later * a - lifted * b for a, b in zip(moving, field, strict=True)]
    return add(moving, cross(lag, add(sheared, cross(lag, twice))))


def _turned_gradient(lag: Vector, gradient: Matrix, slower: float) -> Matrix:
    """Σ c X (1 - τX)⁻¹ G, from X (X² + w²) (X² + 4w²) = 0: 1/(1 - τ²X²) by Newton's differences at 0, w², 4w²."""
    modes, square = _modes(2, lag, slower), dot(lag, lag)
    powers = [_commutator(lag, gradient)]
    for _ in range(3):
        powers.append(_commutator(lag, powers[-1]))
    first, second, third, fourth = powers
    powers.append(_combined([-5.0 * square, -4.0 * square * square], [third, first]))
    odd, even = [], []
    for c, t, s in modes:
        once, both = 1 / (1 + s), 1 / ((1 + s) * (1 + 4 * s))
        weights = [c * (t**2.0 * once + square * t**4.0 * both), c * t**4.0 * both]
        odd.append(weights)
        even.append([t * weight for weight in weights])
    terms = [hy.expression(1.0), hy.sum([c * t for c, t, _ in modes])]
    # X²ⁿ⁺¹ goes with the odd part, X²ⁿ⁺² with the even one, which is one delay more
    terms += [hy.sum([row[0] for row in odd]), hy.sum([row[0] for row in even]), hy.sum([row[1] for row in odd])]
    sixth = _combined([-5.0 * square, -4.0 * square * square], [fourth, second])
    return _combined([*terms, hy.sum([row[1] for row in even])], [*powers, sixth])


def _combined(factors: Sequence[hy.expression], matrices: Sequence[Matrix]) -> Matrix:
    return [[hy.sum([f * m[i][j] for f, m in zip(factors, matrices, strict=True)]) for j in range(3)] for i in range(3)]


def curvature(motion: Motion) -> list[Matrix]:
    """∂²B_i/∂x_j∂x_k (T) with lengths in radii: symmetric in all indices and without trace, so that seven suffice."""
    gradient, upper = motion.gradient, ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2))
    tensors = hy.diff_tensors([gradient[i][j] for i, j in upper], diff_args=list(motion.position), diff_order=1)
    slopes = hy.par[Parameter.LENGTH] * np.asarray(tensors.jacobian).reshape(5, 3)
    known: dict[tuple[int, ...], hy.expression] = {(0, *pair): slopes[row, 0] for row, pair in enumerate(upper)}
    known |= {(1, 1, 1): slopes[3, 1], (1, 1, 2): slopes[4, 1]}
    known |= {(0, 2, 2): -known[0, 0, 0] - known[0, 1, 1], (1, 2, 2): -known[0, 0, 1] - known[1, 1, 1]}
    known |= {(2, 2, 2): -known[0, 0, 2] - known[1, 1, 2]}
    return [[[known[tuple(sorted((i, j, k)))] for k in range(3)] for j in range(3)] for i in range(3)]


def _commutator(turn: Vector, matrix: Matrix) -> Matrix:
    """w× M - M w× of a symmetric matrix: symmetric."""
    columns = [cross(turn, column) for column in matrix]  # [j][i]: of w× M
    return [[columns[j][i] + columns[i][j] for j in range(3)] for i in range(3)]


# The effects that a scene alone decides: `of(scene)` is one, or None where the scene is without it. Searches, motion,
# lists of effects and the keys of shared equations take from here what there is. Scenes that differ in frequency alone
# share their equations: what depends on it an effect takes from the runtime parameters.
OF_SCENE = FloaterCurrents, RealAir, CoilForce


def scene_effects(scene: Scene) -> list[Effect]:
    """The effects of `OF_SCENE` that a scene has."""
    return [effect for kind in OF_SCENE if (effect := kind.of(scene))]
