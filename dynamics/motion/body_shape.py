"""What the shape of a body that is not round about its moment adds to the dipole in its centre of mass.

Three forms of one energy. In a ball of a trajectory it is that of its multipoles up to a degree; their components
along the rotor's axes are states of the motion: they turn with the body, Ṁ = (Ω - W)·G M, as the moment of a round one.
Beside a magnet, where no ball is, it is that of a few dipoles with the same multipoles. About a pose, for equilibria
and modes, it is force and torque on many dipoles all over the body with their exact derivatives.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from ...fem.harmonics import interior
from ...fem.harmonics.expressions import regular_harmonics
from ...fem.harmonics.interior import Ball, BallField
from ...fem.harmonics.solid import tensors
from ...fem.rotor.floater import FloaterSources, floater_sources, polarizability_tensor, shares, slopes_of, strength
from ...fem.rotor.table import DerivedField, FieldFormula, RangeError
from ...geometry.common import Array, even_directions
from ...geometry.scene.floater import Floater
from ...geometry.solids import Solid
from .effect import NOTHING, ZERO, Added, Motion, Poses
from .floater_effects import FLOATER_SHAPE, by_tensor, is_even
from .rotor_effects import Mutual
from .state import Parameter, State, Vector, add, cross, dot, dotted, matrices_of, subtract

HIGHEST = 7  # degree of the multipoles in a trajectory
LESS = 3  # degrees by which what they feel in a ball is of a lower one than the field there
# Of the dipole's force, one radius off the body: shells of multipoles with less are left out of simulations
KEPT = 5e-3
# Size of the multipoles' states by those of the dipole: a step must not be short for their sake, but as short as what
# they do asks for. A cube takes 27.8 steps a turn at 1, 20.6 at 1e-2, and 15.9 at 1e-4 and below, where the motion
# alone decides, in which it is shaken four times a turn. Below 1e-4 other bodies keep their energy less well.
LITTLE = 1e-4
ROUND_OFF = 1e-9  # of the moment, below which a rest of it is none
# Error of the force in a ball by that of the dipole, by the degree of what multipoles feel: a large ball is left for
# others, and its error is what energy is not continuous by.
ALLOWED = {2: 4e-3, 3: 1e-3, 5: 1e-4}
REACHES = 0.6, 0.4, 0.25  # of the distance from a magnet: radii of the sphere on which the field is expanded
# Degrees of the polynomials that dipoles integrate: about a pose of a cube, more of long or hollow bodies up to the
# second, and by how many more, of them and of the turns of a mean, dipoles are compared with others. Four: of a cube
# eight turns leave multipoles of order 8, twelve those of 12.
SUMMED, MOST, FINER = 8, 18, 4
WHICH = Parameter.LENGTH, Parameter.INERTIA, Parameter.PLATE_SHARE
# Times the multipoles' shares: a response misses them as its source and in its force, and near a body's ends they are
# twice their mean over directions. Of a cube, a cuboid, a disc and a rod up to 3.4 is found.
MISSED = 4.0
# The same of a plate's: of a perfectly conducting one up to 5.1, a third of the radius off it.
MISSED_BY_PLATE = 5.2
# Of the radius: how far from the centre dipoles stand for multipoles. The nearer, the less they have of further ones
# (of a cube's a fiftieth), and the stronger they are.
STAND = 0.25


def all_over(floater: Floater, more: int = 0) -> FloaterSources:
    """Dipoles all over a floater, for polynomials of so many degrees `more`; of its mean over turns where it is one."""
    degree = int(min(max(1.0, floater.radius / (floater.inner_radius or 1e-9) / 3**0.5) * SUMMED, MOST))
    sources = floater_sources(floater, degree=degree + more)
    return sources.averaged(more) if floater.mean and not floater.turned else sources


@dataclass(frozen=True, eq=False)
class BodyShape:
    """The shape of a floater in the field of a rotor."""

    field: FieldFormula  # the rotor's
    floater: Floater
    magnets: tuple[Solid, ...]  # bodies of the rotor's magnets
    sources: FloaterSources
    name: str = FLOATER_SHAPE
    first: int | None = None  # number of the first of its runtime parameters; None: as the table writes it
    ball: BallField | None = None  # whose centre and radius are among the runtime parameters

    @classmethod
    def of(cls, floater: Floater, field: FieldFormula, magnets: Sequence[Solid]) -> "BodyShape":
        """That of a floater in a `field` of `magnets`."""
        return cls(field, floater, tuple(magnets), all_over(floater))

    @cached_property
    def finer(self) -> FloaterSources:
        """More dipoles all over it, which tell what these miss."""
        return all_over(self.floater, FINER)

    def missed(self, field: DerivedField, position: Array, axes: Array) -> Array:
        """(n, 2) what the dipoles miss of torque, T, and of force, T/m, by the floater's moment.

        In the rotor's `field`, as of `wrench`; `position` (n, 3) m is the centre's, `axes` (n, 3, 3) are the body's.
        """
        own, finer = (slopes_of(each, field, position, axes)[0] for each in (self.sources, self.finer))
        missed = np.linalg.norm((own - finer).reshape(-1, 2, 3)[:, ::-1], axis=2) / (self.floater.moment or 1.0)
        return np.asarray(missed + self.sources.missed(*tensors(field.derivatives(position, 2))))

    def placed(self, first: int) -> "BodyShape":
        return self._changed(first=first)

    def in_ball(self, ball: BallField, first: int) -> "BodyShape":
        return self._changed(ball=ball, first=first)

    def _changed(self, **changes: Any) -> "BodyShape":
        """The same elsewhere, with what is known of the multipoles: a ball would take half a second without."""
        found = replace(self, **changes)
        found.__dict__.update({name: getattr(self, name) for name in ("moments", "shares", "kept", "rest")})
        return found

    @property
    def count(self) -> int:
        return 3 + 4 + 6 + 36 if self.ball is None else len(self.kept) * (self._way + 1) ** 2

    @property
    def _way(self) -> int:
        """Degree of what the multipoles feel, in a place within the ball."""
        assert self.ball is not None
        return max(self.ball.degree - LESS, 2)

    @property
    def _known(self) -> NDArray[np.bool_]:
        """(k, (way + 1)²) which of its numbers in a ball are not zero: in a mirrored field half of them are."""
        assert self.ball is not None
        alike = interior.odd_harmonics(HIGHEST)[self.kept, None] == interior.odd_harmonics(self._way)
        return np.asarray(alike | (not self.ball.mirrored))

    # The multipoles

    @cached_property
    def moments(self) -> Array:
        """(K,) A m of degrees up to `HIGHEST` beside the dipole, lengths in its radius, along its own axes."""
        found = self.sources.multipoles(HIGHEST, self.floater.radius)
        found[1:4] -= FloaterSources.dipole(self.floater.dipole).multipoles(1, self.floater.radius)[1:4]
        return found

    @cached_property
    def shares(self) -> Array:
        """(`HIGHEST` + 1,) of each degree in the force one radius off the body, see `fem.rotor.floater.shares`."""
        return shares(self.floater, self.sources, HIGHEST)

    @cached_property
    def rest(self) -> Array:
        """(3,) A m², what the floater's dipole misses of its moment, along its own axes; zero up to round-off."""
        missed = self.sources.dipole_moment - self.floater.dipole
        return np.asarray(missed * (np.linalg.norm(missed) > ROUND_OFF * strength(self.floater)))

    @cached_property
    def kept(self) -> NDArray[np.intp]:
        """(k,) numbers of the multipoles that are states in trajectories: of degree 2 at least."""
        degrees = interior.shells(HIGHEST)
        return np.flatnonzero((self.shares[degrees] > KEPT) & (degrees > 1))

    @cached_property
    def poles(self) -> FloaterSources:
        """Dipoles with the multipoles that trajectories keep, and no others up to the highest degree of these.

        On pairs of opposite places, so that they have none of even degrees, of all degrees, where the body has none.
        """
        degree = int(interior.shells(HIGHEST)[self.kept].max(initial=1))
        degrees = interior.shells(degree)
        # three components of each pair have to make the multipoles of odd degrees, or those of even ones
        pairs = max(int(np.sum((degrees % 2 == odd) & (degrees > 0))) for odd in (0, 1)) // 3 + 1
        half = STAND * even_directions(2 * pairs)[:pairs]  # in a half space, so that none is opposite to another
        places = np.concatenate([half, -half])
        columns = np.moveaxis(interior.harmonics(degree, places)[1], 1, 0).reshape(len(degrees), -1)
        wanted = np.zeros(len(interior.shells(HIGHEST)))
        wanted[self.kept] = self.moments[self.kept]
        unit = interior.sizes(degree)[:, None]
        solved = np.linalg.lstsq(columns / unit, wanted[: len(degrees)] / unit[:, 0], rcond=1e-12)[0]
        moments = np.asarray(self.floater.radius * solved.reshape(-1, 3), float)
        return FloaterSources(self.floater.radius * places, moments, np.zeros((0, 3)), np.zeros(0))

    @property
    def truncation(self) -> float:
        """What simulations leave out of the force one radius off the body, by that of the moment."""
        left = self.shares.sum() - self.shares[1] - self.shares[np.unique(interior.shells(HIGHEST)[self.kept])].sum()
        ratio = self.shares[-1] / max(self.shares[-3], 1e-300) if self.shares[-3] else 0.0
        return float(left + self.shares[-1] * min(ratio, 1.0) ** 0.5)

    @property
    def _turns(self) -> Array:
        """(3, k, k) of their states by a unit turn about each of the rotor's axes."""
        return interior.turns(HIGHEST)[:, self.kept[:, None], self.kept]

    @property
    def _unit(self) -> float:  # of the multipoles' states, A m
        return strength(self.floater) / self.floater.radius / LITTLE

    def states_at(self, state: State) -> Array:
        axes = state.axes
        assert axes is not None
        turn = Rotation.from_matrix(axes).as_rotvec() @ self._turns.swapaxes(0, 1)
        return np.asarray(expm(turn) @ (self.moments / interior.sizes(HIGHEST))[self.kept] / self._unit)

    # Force and torque

    def added(self, motion: Motion) -> Added:
        if self.first is not None and self.ball is None:
            return self._about_pose(motion)
        dipole = self._dipole(motion)
        if not len(self.kept):  # it is all of it
            return dipole
        states = [hy.expression(f"multipole_{k}") for k in range(len(self.kept))]
        turned = [[_combined(row, states) for row in matrix] for matrix in self._turns]  # (3, k) by a unit turn
        rates = [dot(motion.lag, [part[k] for part in turned]) for k in range(len(states))]
        shape = self._by_dipoles(motion) if self.ball is None else self._in_ball(motion, states, turned)
        return Added(
            force=shape.force,
            torque=add(shape.torque, dipole.torque),
            pulled=dipole.pulled,
            more=dipole.more,
            energy=shape.energy + dipole.energy,
            states=states,
            rates=rates,
        )

    def _dipole(self, motion: Motion) -> Added:  # what the `rest` does
        along = float(self.rest @ self.floater.pointing)
        across = self.rest - along * self.floater.pointing
        if np.linalg.norm(across) <= ROUND_OFF * strength(self.floater):
            return Added(more=along)
        assert motion.axes is not None
        length, inertia, share = (motion.given[p] for p in WHICH)
        unit, side = share * share, [_combined(across, row) for row in motion.axes]
        return Added(
            torque=[unit / inertia * t for t in cross(side, motion.field)],
            pulled=[unit * length * s for s in side],
            more=along,
            energy=-unit * dot(side, motion.field),
        )

    def _in_ball(self, motion: Motion, states: Vector, turned: Sequence[Vector]) -> Added:
        assert self.ball is not None
        assert self.first is not None
        length, inertia, share = (motion.given[p] for p in WHICH)
        place = regular_harmonics(self._way, self.ball.offset([length * p for p in motion.position]))
        first, known = self.first, self._known
        numbers = [
            [hy.par[first + k * len(row) + n] if one else ZERO for n, one in enumerate(row)]
            for k, row in enumerate(known.tolist())
        ]
        unit = self._unit * share * share
        sums = [dotted(column, states) for column in zip(*numbers, strict=True)]
        field = [dotted(row, place) for row in numbers]
        slopes = interior.matrices(self._way)[0]
        reach, inverse = -unit * length, hy.par[self.ball.first + 3]
        force = [inverse * (reach * dotted([_combined(column, sums) for column in slope.T], place)) for slope in slopes]
        return Added(
            force=force,
            torque=[-unit / inertia * dotted(field, part) for part in turned],
            energy=unit * dotted(sums, place),
        )

    def _by_dipoles(self, motion: Motion) -> Added:
        assert motion.axes is not None
        length, inertia, share = (motion.given[p] for p in WHICH)
        axes, unit, poles, force, torque, energy = motion.axes, share * share, self.poles, NOTHING, NOTHING, ZERO
        for own, pole in zip(poles.places, poles.moments, strict=True):
            arm, source = ([_combined(part, row) for row in axes] for part in (own, pole))
            field, gradient = self.field.expressions(
                [length * p + a for p, a in zip(motion.position, arm, strict=True)]
            )
            pull = [dot(source, column) for column in zip(*gradient, strict=True)]
            force, torque = add(force, pull), add(torque, cross(source, field), cross(arm, pull))
            energy = energy - dot(source, field)
        return Added([unit * length * f for f in force], [unit / inertia * t for t in torque], energy=unit * energy)

    def _about_pose(self, motion: Motion) -> Added:
        assert self.first is not None
        given = [hy.par[self.first + k] for k in range(self.count)]
        if motion.quaternion is None:
            turn: Vector = cross(given[3:6], motion.moment)
        else:
            (w, *before), (a, *now) = given[3:7], motion.quaternion
            # twice the vector part of q q0*, which is the small turn from the one to the other
            turn = [2.0 * (n * w - a * b + c) for n, b, c in zip(now, before, cross(before, now), strict=True)]
        change = [*subtract(motion.position, given), *turn]
        values = [given[7 + i] + dotted(given[13 + 6 * i : 19 + 6 * i], change) for i in range(6)]
        return Added(values[:3], values[3:])

    def numbers(self, field: DerivedField, poses: Poses) -> Array:
        length, inertia, share = (poses.values[:, [p]] for p in WHICH)
        if poses.quaternion is None:
            axes, turn = np.array([self.floater.axes(m) for m in poses.moment]), np.pad(poses.moment, ((0, 0), (0, 1)))
        else:
            axes, turn = matrices_of(poses.quaternion), poses.quaternion
        wrench, slopes = self.wrench(field, poses.places, axes)
        units = np.concatenate([np.repeat(share**2 * length, 3, 1), np.repeat(share**2 / inertia, 3, 1)], axis=1)
        steps = np.concatenate([np.repeat(length, 3, 1), np.ones_like(poses.moment)], axis=1)
        scaled = units[:, :, None] * slopes * steps[:, None]
        return np.concatenate([poses.position, turn, units * wrench, scaled.reshape(-1, 36)], axis=1)

    def wrench(self, field: DerivedField, position: Array, axes: Array) -> tuple[Array, Array]:
        """Force and torque (n, 6), N and N m, beside the dipole's, and their derivatives (n, 6, 6).

        The latter by a change of place, m, and by a small turn about the rotor's axes. In the rotor's `field` at
        `position` (n, 3) m of the centre, rotor's frame; the columns of `axes` (n, 3, 3) are the body's axes.
        """
        own = slopes_of(FloaterSources.dipole(self.floater.dipole), field, position, axes)
        whole = slopes_of(self.sources, field, position, axes)
        return whole[0] - own[0], whole[1] - own[1]

    def fit(self, ball: Ball, gradient: Array) -> tuple[Array, float]:
        """See `Fittable`; what the place in the ball does beyond `_way` is its error."""
        apart = min((float(body.distance(ball.center)) for body in self.magnets), default=np.inf)
        degree = int(interior.shells(HIGHEST)[self.kept].max(initial=1)) + self._way + 1
        for share in REACHES:
            try:
                there = interior.field_coefficients(
                    lambda points: self.field.evaluate(points)[0],  # type: ignore[attr-defined]
                    ball.center, max(share * min(apart, 10 * self.floater.radius), ball.radius), degree,
                    self.floater.radius,
                )  # fmt: skip
                break
            except RangeError:
                continue
        else:
            raise RangeError("Input ball must lie where the field of the rotor is known; instead it does not.")
        unit = interior.sizes(HIGHEST)[self.kept, None]
        moved = unit * interior.shifted(there, degree, self._way + 1)[self.kept]
        way = interior.shells(self._way + 1)
        moved *= (ball.radius / self.floater.radius) ** way
        found, known = moved[:, way <= self._way], self._known
        left_out = np.concatenate([moved[:, way == self._way + 1], found * ~known], axis=1)
        rest = np.linalg.norm(left_out, axis=1) @ np.abs(self.moments[self.kept] / unit[:, 0])
        error = (self._way + 1) * rest / ball.radius / (strength(self.floater) * float(np.linalg.norm(gradient)) or 1.0)
        return (found * known).ravel(), float(error) / ALLOWED[self._way]


def response_error(floater: Floater, missed: float = MISSED) -> float:
    """Error of what responds to a floater as to its dipole and a sphere of its volume, by the force of that response.

    From a third of its radius off contact; of the torque it is that part of the force times the radius. `missed` is
    `MISSED` or `MISSED_BY_PLATE`.
    """
    if floater.is_sphere:
        return 0.0
    return missed * float(shares(floater, floater_sources(floater), HIGHEST).sum())


INDUCED_SHAPE = "shape of what is induced in the floater"


@dataclass(frozen=True, eq=False)
class InducedShape:
    """What the rotor's field at its centre induces in a floater beyond a sphere of its magnets' volume.

    Its energy is -½ B·A B with the difference A of the two polarizabilities, which turns with the body. It states what
    `mutual` misses of such a body.
    """

    tensor: Array  # (3, 3) A m²/T, along the body's axes
    name: str = INDUCED_SHAPE
    mutual: Mutual | None = None  # magnetisation of the rotor and a sphere of the floater's volume
    floater: Floater | None = None  # that body

    @classmethod
    def of(cls, floater: Floater, mutual: Mutual | None = None) -> "InducedShape":
        """That of a floater; one that is round about its moment, or the mean of turns about it, has a round one."""
        tensor = polarizability_tensor(floater) - floater.polarizability * np.eye(3)
        if floater.round:
            across = (tensor[0, 0] + tensor[1, 1]) / 2
            tensor = np.diag([across, across, tensor[2, 2]])
        return cls(tensor, mutual=mutual, floater=floater)

    def doubt(self, points: Array, field: Array) -> tuple[Array, Array]:
        """See `Unsure`; of the torque as `response_error` has it."""
        if self.mutual is None or self.floater is None:
            return np.zeros(len(points)), np.zeros(len(points))
        force = response_error(self.floater) * self.mutual.sizes(points, field)[1]
        return self.floater.radius * force, force

    @property
    def compiled_in(self) -> tuple[float, ...]:
        return tuple(self.tensor.ravel().tolist())

    def added(self, motion: Motion) -> Added:
        length, inertia, share = (motion.given[p] for p in WHICH)
        unit, induced = share * share, by_tensor(self.tensor, motion.field, motion)
        energy, pulled = -0.5 * unit * dot(induced, motion.field), [unit * length * b for b in induced]
        if is_even(self.tensor):  # as of a sphere, whatever its turn: there is no torque
            return Added(pulled=pulled, energy=energy)
        return Added(pulled=pulled, torque=[unit / inertia * t for t in cross(induced, motion.field)], energy=energy)


def _combined(weights: Array, values: Vector) -> hy.expression:
    """Σ weight · value without what is zero; a product is one expression whatever its sign, for sums to share it."""
    parts = [[abs(float(w)) * v for w, v in zip(weights, values, strict=True) if sign * w > 0] for sign in (1.0, -1.0)]
    plus, minus = map(hy.sum, parts)
    return plus if not parts[1] else plus - minus if parts[0] else -minus
