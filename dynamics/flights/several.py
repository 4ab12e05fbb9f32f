"""Several rigid floaters below one rotor: their trajectories together, until one of them touches something or is lost.

Each moves by its own equations (`motion.equations`) in one unit of length and of time, with the force and torque of the
others: those of two rigid bodies' magnetisation on each other, of dipoles. A sphere is one in its centre; a body that
is round about its moment has dipoles along it with its first seven multipoles; any other has those of a rule over its
magnets, F, beside the few C in the middles of the magnets. Its shape matters twice to a pair of such bodies,

    U = U(F₁, C₂) + U(C₁, F₂) - U(C₁, C₂) + U(F₁ - C₁, F₂ - C₂),

and the last term is left out: the product of two corrections, each of the fourth power of size over distance for cubes.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, product
from typing import Any

import heyoka as hy
import numpy as np

from ...fem.rotor.floater import floater_sources, remanent_sources
from ...fem.rotor.table import FieldTable
from ...geometry.common import MU_0, Array
from ...geometry.overlap import parting
from ...geometry.scene.contents import Scene
from ...geometry.scene.floater import Floater
from ..motion.effect import ZERO, Added, Motion, interaction_of
from ..motion.effects import with_effects
from ..motion.equations import Equations
from ..motion.events import CONTACT, Events, first_contact
from ..motion.floater_effects import FloaterShape
from ..motion.state import Parameter, Scales, State, Vector, add, cross, dot, rotation_of, subtract
from .flight import Course, Flight, StartError, initial_state
from .trajectory import Checkpoint, FieldChanges, Trajectory

FINE, COARSE = 5, 1  # degrees of the polynomials over a body that is not round that its dipoles integrate
Pole = tuple[Array, Array]  # (3,) m and (3,) A m², along the axes of the body from its centre of mass


def poles_of(floater: Floater) -> tuple[list[Pole], list[Pole]]:
    """The dipoles of a floater's own field: those that know its shape, and the fewest that stand for it."""
    if floater.is_sphere:
        poles = [(np.zeros(3), floater.dipole)]
        return poles, poles
    sources = floater_sources(floater)
    if floater.round:
        shape, axis = FloaterShape.of(floater, sources, None), np.eye(3)[2]  # type: ignore[arg-type]
        own = shape.dipoles + (shape.heights == 0) * bool(floater.moment)
        poles = [(h * axis, d * (floater.moment or 1.0) * axis) for h, d in zip(shape.heights, own, strict=True)]
        return poles, poles
    fine, coarse = (remanent_sources(floater, degree) for degree in (FINE, COARSE))
    # what permeability does to the whole dipole it does to all of them
    whole, plain = (float(np.linalg.norm(part.multipoles(1, 1.0))) for part in (sources, fine))
    share = whole / plain
    return tuple([*zip(s.places, share * s.moments, strict=True)] for s in (fine, coarse))  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class Neighbours:
    """What the other floaters do to one of several; their states have its names and their number."""

    floaters: tuple[Floater, ...]
    number: int
    name: str = "the other floaters"

    def added(self, motion: Motion) -> Added:
        length, inertia, share = (hy.par[p] for p in (Parameter.LENGTH, Parameter.INERTIA, Parameter.PLATE_SHARE))
        here, fine, coarse = motion.position, *poles_of(self.floaters[self.number])
        axes = motion.axes or motion.moment
        force, torque, energy = [ZERO] * 3, [ZERO] * 3, ZERO
        for k, other in enumerate(self.floaters):
            if k == self.number:
                continue
            there = [_numbered(f"position_{axis}", k) for axis in "xyz"]
            turn: Any = [_numbered(f"moment_{axis}", k) for axis in "xyz"]
            if not other.round:
                turn = rotation_of([_numbered(f"turn_{part}", k) for part in "wxyz"])
            theirs, middles = poles_of(other)
            pairs = [(1.0, fine, middles), (1.0, coarse, theirs), (-1.0, coarse, middles)]
            pairs = [(1.0, fine, middles)] if theirs is middles else pairs
            pairs = [(1.0, coarse, theirs)] if fine is coarse else pairs
            apart = [length * d for d in subtract(here, there)]
            for weight, own, others in pairs:
                for arm, pole in _along(own, axes):
                    for away, source in _along(others, turn):
                        pull, turning, stored = _on_dipole(weight, pole, source, subtract(add(apart, arm), away))
                        force, torque = add(force, pull), add(torque, turning, cross(arm, pull))
                        energy = energy + stored
        unit = share * share
        return Added(
            force=[unit * length * f for f in force],
            torque=[unit / inertia * t for t in torque],
            energy=0.5 * unit * energy,  # the other half is the other's
            motor=ZERO,
        )


def _numbered(name: str, number: int) -> hy.expression:
    return hy.expression(f"{name}@{number}")


def _along(poles: Sequence[Pole], axes: Any) -> Iterator[tuple[Vector, Vector]]:
    """Arms (m) and moments (A m²) of dipoles along the rotor's axes, by the body's or its moment."""
    for arm, moment in poles:
        if isinstance(axes[0], list):
            yield tuple([hy.sum([float(p) * a for p, a in zip(part, row, strict=True)]) for row in axes]
                        for part in (arm, moment))  # type: ignore[misc]  # fmt: skip
        else:
            yield [float(arm[2]) * a for a in axes], [float(moment[2]) * a for a in axes]


def _on_dipole(weight: float, pole: Vector, source: Vector, way: Vector) -> tuple[Vector, Vector, hy.expression]:
    """Force (3,) N, torque (3,) N m and energy (J) of a dipole that lies a `way` (3,) m off another, its `source`."""
    inverse = 1.0 / dot(way, way)
    cube = weight * MU_0 / (4 * np.pi) * inverse * hy.sqrt(inverse)
    own, other, both = dot(pole, way), dot(source, way), dot(pole, source)
    five = 3.0 * cube * inverse
    along = both - 5.0 * own * other * inverse
    force = [five * (other * p + own * s + along * d) for p, s, d in zip(pole, source, way, strict=True)]
    field_there = [five * other * d - cube * s for s, d in zip(source, way, strict=True)]
    return force, cross(pole, field_there), cube * both - five * own * other


@dataclass(frozen=True, eq=False)
class Together:
    """Trajectories of several floaters, and how they ended."""

    trajectories: tuple[Trajectory, ...]
    ended_by: str  # "duration", "contact" or "lost"; "stopped" by the user
    which: tuple[int, ...] = ()  # floaters that touched something, each other where two, or were lost


class JointFlight(Flight):
    """Motion of a `scene`'s floaters in `tables` for `duration` (s). Raises StartError: not positive, or contact."""

    def __init__(self, scene: Scene, tables: Sequence[FieldTable], duration: float) -> None:
        if not duration > 0:
            raise StartError(f"Input duration must be positive; instead received {duration} s.")
        first, floaters = Scales.of(scene), tuple(one.floater for one in scene.each)
        self.flights, courses = list[Flight](), list[Course]()
        for k, (one, table) in enumerate(zip(scene.each, tables, strict=True)):
            scales = replace(Scales.of(one), length=first.length, time=first.time)
            whole = interaction_of(with_effects(one, table)).joined(Neighbours(floaters, k))
            flight = Flight(one, whole, duration, scales=scales)  # type: ignore[arg-type]
            if flight.balls:  # of one kind, as each pair of kinds is compiled
                flight.balls = replace(flight.balls, largest=True)
            self.flights.append(flight)
            courses.append(flight.begin(initial_state(one, table)[0], duration))
        super().__init__(scene, self.flights[0].whole.field, duration, in_balls=False)  # type: ignore[arg-type]
        self.stride = max(len(course.values) for course in courses)
        self.values = np.concatenate([np.pad(c.values, (0, self.stride - len(c.values))) for c in courses])
        ends = np.cumsum([0, *(len(course.state) - 1 for course in courses)]).tolist()
        self._own = [slice(a, b) for a, b in pairwise(ends)]
        state = np.concatenate([*(course.state[:-1] for course in courses), np.zeros(1)])
        error = max(course.changes.error for course in courses)
        self.course = Course(self, duration, self.values, state, changes=FieldChanges(error=error))

    @property
    def each(self) -> list[tuple[Flight, slice, slice]]:
        places = (slice(k * self.stride, (k + 1) * self.stride) for k in range(len(self.flights)))
        return list(zip(self.flights, places, self._own, strict=True))

    def degree(self, values: Array) -> tuple[int, ...]:
        return tuple(one.degree(values[where]) for one, where, _ in self.each)

    def step_error(self, degree: tuple[int, ...]) -> float:
        return min(flight.step_error(kind) for flight, kind in zip(self.flights, degree, strict=True))

    def equations(self, degree: tuple[int, ...]) -> tuple[Equations, Events]:
        """Those of all, with the numbers of floaters in the names of states and in what events mean."""
        variables, rates, jacobi, power, events = list[Any](), list[Any](), list[Any](), ZERO, list[Any]()
        for k, (flight, kind) in enumerate(zip(self.flights, degree, strict=True)):
            equations, ends = flight.equations(kind)
            after = {v: _numbered(str(v), k) for v in equations.variables}
            after |= {hy.par[p]: hy.par[p + k * self.stride] for p in range(self.stride if k else 0)}
            weight = flight.scene.floater.mass / self.scene.floater.mass
            variables += hy.subs(list(equations.variables), after)
            rates += hy.subs(list(equations.rates), after)
            jacobi += [weight * term for term in hy.subs(list(equations.jacobi), after)]
            power = power + weight * hy.subs([equations.power], after)[0]
            crossed = hy.subs([each for each, _ in ends], after)
            events += [(each, f"{meaning} {k}") for each, (_, meaning) in zip(crossed, ends, strict=True)]
        for i, j in combinations(range(len(self.flights)), 2):  # spheres touch then, others at the latest
            way = subtract(*([_numbered(f"position_{axis}", k) for axis in "xyz"] for k in (i, j)))
            within = sum(self.flights[k].scene.floater.inner_radius for k in (i, j)) / self.scales.length
            events.append((dot(way, way) - within**2, f"{CONTACT} {i} {j}"))
        return Equations(variables, rates, jacobi, power), events

    def touching(self, values: Array, times: Array, states: Array) -> tuple[int, tuple[int, ...]] | None:
        there, found = list[State](), list[tuple[int, tuple[int, ...]]]()
        for k, (flight, where, own) in enumerate(self.each):
            there.append(flight.scales.unpack(states[:, own]))
            if not flight.degree(values[where]):  # there are no bodies in a ball
                first = first_contact(flight.scene, times, there[k].position, there[k].orientation)
                found += [] if first is None else [(first, (k,))]
        for i, j in combinations(range(len(there)), 2):
            one, two = self.flights[i].scene.floater, self.flights[j].scene.floater
            if one.is_sphere and two.is_sphere:
                continue
            apart = np.linalg.norm(there[i].position - there[j].position, axis=1)
            ways: dict[int, Array] = {}
            for n in np.flatnonzero(apart < one.radius + two.radius):
                parts = (f.placed(s.position[n], s.orientation[n]) for f, s in ((one, there[i]), (two, there[j])))
                tried = [parting(a, b, ways.get(m)) for m, (a, b) in enumerate(product(*parts))]
                ways = {m: way for m, way in enumerate(tried) if way is not None}
                if len(ways) < len(tried):
                    found.append((int(n), (i, j)))
                    break
        return min(found, default=None)

    def fly(self, progress: Callable[[float], None] | None = None, checkpoint: Checkpoint | None = None) -> Together:
        """Simulate until the end, contact or loss, kept at `checkpoint` meanwhile. Raises IntegrationError."""
        self.course.sample(self.interval(self.course.duration))
        speed = self.course.travel(progress, checkpoint)
        return Together(tuple(self.course.trajectories(speed)), self.course.ended_by, self.course.which)
