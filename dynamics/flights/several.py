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
from time import perf_counter
from typing import Any

import heyoka as hy
import numpy as np

from ...fem.compiled_code import compiled
from ...fem.rotor.floater import FloaterSources, floater_sources, remanent_sources
from ...fem.rotor.table import FieldTable
from ...geometry.common import MU_0, Array
from ...geometry.overlap import parting
from ...geometry.scene.contents import Scene
from ...geometry.scene.floater import Floater
from ..motion.effect import ZERO, Added, Motion, interaction_of
from ..motion.effects import with_effects
from ..motion.events import CONTACT, first_contact, motion_legs
from ..motion.floater_effects import FloaterShape
from ..motion.state import Parameter, Scales, State, Vector, add, cross, dot, rotation_of, subtract
from .balls import DEGREE
from .flight import (
    LEFT,
    MOST_SAMPLES,
    OPTIMISATION,
    SHORT_TURNS,
    Course,
    Flight,
    StartError,
    initial_state,
)
from .trajectory import DURATION, STOPPED, Checkpoint, FieldChanges, Recorder, Trajectory

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
    return _poles(fine, whole / plain), _poles(coarse, whole / plain)


def _poles(sources: FloaterSources, share: float) -> list[Pole]:
    return list(zip(sources.places, share * sources.moments, strict=True))


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
                        way = subtract(add(apart, arm), away)
                        pull, turning, stored = _on_dipole(weight, pole, source, way)
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
class Joint:
    """Compiled motion of all floaters in balls of some degrees."""

    integrator: hy.taylor_adaptive
    meanings: list[tuple[str, tuple[int, ...]]]  # of its events, with the numbers of the floaters
    jacobi: hy.cfunc


@dataclass(frozen=True, eq=False)
class Together:
    """Trajectories of several floaters, and how they ended."""

    trajectories: tuple[Trajectory, ...]
    ended_by: str  # "duration", "contact" or "lost"; "stopped" by the user
    which: tuple[int, ...] = ()  # floaters that touched something, each other where two, or were lost


class JointFlight:
    """The motion of a scene's floaters.

    The `scene` has an absolute start of each, `tables` are the rotor's field for each, with its effects; it lasts for a
    `duration` (s). Raises StartError: that is not positive, or a floater would begin in contact.
    """

    def __init__(self, scene: Scene, tables: Sequence[FieldTable], duration: float) -> None:
        if not duration > 0:
            raise StartError(f"Input duration must be positive; instead received {duration} s.")
        self.scene, self.duration = scene, duration
        first, floaters = Scales.of(scene), tuple(one.floater for one in scene.each)
        self.flights, self.courses = list[Flight](), list[Course]()
        for k, (one, table) in enumerate(zip(scene.each, tables, strict=True)):
            scales = replace(Scales.of(one), length=first.length, time=first.time)
            whole = interaction_of(with_effects(one, table)).joined(Neighbours(floaters, k))
            flight = Flight(one, whole, duration, scales=scales)  # type: ignore[arg-type]
            self.flights.append(flight)
            course = flight.begin(initial_state(one, table)[0], duration, offset=flight.offset)
            if flight.balls:  # of one kind from the start on, as each pair of kinds is compiled
                flight.balls.enter(flight.balls.kinds[-1:], course.state, course.values)
            self.courses.append(course)
        self.weights = np.array([one.mass for one in floaters]) / floaters[0].mass
        self.stride = max(len(course.values) for course in self.courses)
        self._parts: dict[tuple[int, ...], Joint] = {}
        self.changes, self.ended, self.steps = FieldChanges(), (DURATION, tuple[int, ...]()), 0
        sizes = np.cumsum([0, *(len(course.state) - 1 for course in self.courses)])
        self._own = [slice(a, b) for a, b in pairwise(sizes)]
        self.state = np.concatenate([*(course.state[:-1] for course in self.courses), np.zeros(1)])
        self.time: tuple[float, float] = (0.0, 0.0)
        self.compile_seconds = 0.0

    @property
    def degrees(self) -> tuple[int, ...]:
        """Of the balls in which the floaters are; 0: in none."""
        return tuple(f.degree(c.values) for f, c in zip(self.flights, self.courses, strict=True))

    @property
    def values(self) -> Array:
        """Runtime parameters of all."""
        return np.concatenate([np.pad(c.values, (0, self.stride - len(c.values))) for c in self.courses])

    def part(self, degrees: tuple[int, ...]) -> Joint:
        """The compiled motion in balls of so many degrees."""
        if degrees not in self._parts:
            began = perf_counter()
            variables, rates, jacobi, power, events = list[Any](), list[Any](), list[Any](), ZERO, list[Any]()
            for k, (flight, degree) in enumerate(zip(self.flights, degrees, strict=True)):
                equations, ends = flight.equations(degree)
                renamed = self._renamed(k, [str(v) for v in equations.variables])
                variables += renamed(equations.variables)
                rates += renamed(equations.rates)
                weight = float(self.weights[k])
                jacobi += [weight * term for term in renamed(equations.jacobi)]
                power = power + weight * renamed([equations.power])[0]
                means = [(meaning, (k,)) for _, meaning in ends]
                events += zip(renamed([each for each, _ in ends]), means, strict=True)
            events += self._contacts()
            falling = hy.event_direction.negative
            integrator = compiled(
                hy.taylor_adaptive,
                [*zip(variables, rates, strict=True), (hy.expression("work"), power)],
                np.zeros(len(variables) + 1),
                tol=min(flight.step_error(degree) for flight, degree in zip(self.flights, degrees, strict=True)),
                compact_mode=True,
                opt_level=OPTIMISATION if self.scene.fastest * self.duration > SHORT_TURNS else 0,
                t_events=[hy.t_event(each, direction=falling) for each, _ in events],
            )
            function = compiled(hy.cfunc, jacobi, variables, compact_mode=True, opt_level=0)
            self._parts[degrees] = Joint(integrator, [meaning for _, meaning in events], function)
            self.compile_seconds += perf_counter() - began
        return self._parts[degrees]

    def _renamed(self, number: int, names: Sequence[str]) -> Callable[[Sequence[hy.expression]], list[hy.expression]]:
        """Expressions of one floater with its number in their names, and with parameters of its own."""
        after = {hy.expression(name): _numbered(name, number) for name in names}
        if number:
            after |= {hy.par[p]: hy.par[p + number * self.stride] for p in range(self.stride)}
        return lambda given: list(hy.subs(list(given), after))

    def _contacts(self) -> list[tuple[hy.expression, tuple[str, tuple[int, ...]]]]:
        """Events of two floaters that touch: spheres where they do, others at the latest; see `_touching`."""
        found: list[tuple[hy.expression, tuple[str, tuple[int, ...]]]] = []
        for pair in combinations(range(len(self.flights)), 2):
            way = subtract(*([_numbered(f"position_{axis}", k) for axis in "xyz"] for k in pair))
            within = sum(self.flights[k].scene.floater.inner_radius for k in pair) / self.flights[0].scales.length
            found.append((dot(way, way) - within**2, (CONTACT, pair)))
        return found

    def energies(self, degrees: tuple[int, ...], values: Array, times: Array, states: Array) -> Array:
        """Terms (k, n) of the Jacobi integral at scaled times (n,) and states (n, s) under parameters (p,)."""
        function = self.part(degrees).jacobi
        pars = np.empty((function.nparams, len(times)))
        pars[:] = values[: function.nparams, None]
        return np.asarray(function(np.ascontiguousarray(states[:, :-1].T), pars=pars, time=times))

    def _balanced(self, times: Array, states: Array) -> Array:
        energy = self.energies(self.degrees, self.values, times, states).sum(axis=0) - states[:, -1]
        return np.concatenate([states[:, :-1], energy[:, None]], axis=1)

    def _change_balls(self) -> None:
        """Go over to other balls where floaters have left theirs; the difference in energy is added to the work."""
        now, row, before = np.array([self.time[0]]), self.state[None], (self.degrees, self.values)
        for flight, course, own in zip(self.flights, self.courses, self._own, strict=True):
            if flight.balls is None:
                continue
            degree, *center, inverse = course.values[DEGREE : DEGREE + 5]
            away = self.state[own][:3] * flight.scales.length - center
            if degree and away @ away * inverse**2 < 1 - 1e-9:
                continue
            after = course.values.copy()
            error = flight.balls.enter(flight.balls.kinds[-1:], self.state[own], after, self.time[0])
            course.values = after
            self.changes = replace(self.changes, error=max(self.changes.error, error))
        if not np.array_equal(before[1], self.values):
            jump = float(self.energies(self.degrees, self.values, now, row).sum())
            jump -= float(self.energies(*before, now, row).sum())
            self.state = np.append(self.state[:-1], self.state[-1] + jump)
            known = self.changes
            self.changes = replace(
                known, count=known.count + 1, energy=known.energy + jump, total=known.total + abs(jump)
            )

    def fly(self, progress: Callable[[float], None] | None = None, checkpoint: Checkpoint | None = None) -> Together:
        """Simulate until the end, contact or loss; `checkpoint` is where the motion is kept while it lasts.

        Raises IntegrationError: the state became infinite.
        """
        began, scales = perf_counter(), self.flights[0].scales
        row, now = self.state[None], np.zeros(1)
        terms = self.energies(self.degrees, self.values, now, row)
        largest, whole = float(np.abs(terms).max()), abs(float(terms.sum()))
        scale = whole if whole > 1e-3 * largest else largest  # they may nearly cancel
        recorder = Recorder(self._balanced(now, row)[0], self.flights[0].interval(self.duration), MOST_SAMPLES)
        if (kept := checkpoint.read() if checkpoint else None) is not None:
            self._restore(kept, recorder)
        begun, written = self.time[0] * scales.time, perf_counter()
        try:
            for _ in self._pieces(recorder):
                if progress is not None:
                    progress(min(1.0, self.time[0] * scales.time / self.duration))
                if checkpoint and perf_counter() - written > checkpoint.every:
                    checkpoint.write(self._content(recorder))
                    written = perf_counter()
        except KeyboardInterrupt:
            self.ended = STOPPED, ()
            if checkpoint and self.steps:
                checkpoint.write(self._content(recorder))
        seconds = perf_counter() - began - self.compile_seconds
        return self._outcome(recorder, scale, (float(recorder.times[-1]) * scales.time - begun) / seconds)

    def _pieces(self, recorder: Recorder) -> Iterator[None]:
        scales = self.flights[0].scales
        for leg in motion_legs(self.scene, self.duration):
            if self.time[0] >= leg.end / scales.time:
                continue
            *_, end = (course.set_leg(leg) for course in self.courses)
            while self.time[0] < end:
                self._change_balls()
                times, states = self._piece(end, recorder)
                over = self.ended[0] not in (DURATION, LEFT) or times[-1] * scales.time >= self.duration * (1 - 1e-12)
                recorder.add(times[1:], self._balanced(times, states)[1:], over)
                yield
                if over:
                    return

    def _piece(self, end: float, recorder: Recorder) -> tuple[Array, Array]:
        """Go on to the end of a piece or to an event: scaled times and states."""
        part, scales = self.part(self.degrees), self.flights[0].scales
        often = recorder.interval
        # Samples alone tell of contact with what is no sphere.
        if not all(flight.scene.floater.is_sphere for flight in self.flights):
            often = self.flights[0].interval(self.duration)
        piece = recorder.piece(part.integrator, self.values, self.time, self.state, end, scales.time, often)
        self.time, self.state, times, states = piece.time, piece.state, piece.times, piece.states
        self.steps, self.ended = self.steps + piece.steps, (DURATION, ())
        if piece.event is not None:
            self.ended = part.meanings[piece.event]
        if (touching := self._touching(times * scales.time, states)) is not None:
            at, which = touching
            self.ended, times, states = (CONTACT, which), times[: at + 1], states[: at + 1]
        return times, states

    def _touching(self, times: Array, states: Array) -> tuple[int, tuple[int, ...]] | None:
        """The first sample at which bodies touch by their true surfaces, and the floaters; None where none do."""
        there = [flight.scales.unpack(states[:, own]) for flight, own in zip(self.flights, self._own, strict=True)]
        found: list[tuple[int, tuple[int, ...]]] = []
        for k, (flight, state) in enumerate(zip(self.flights, there, strict=True)):
            if not self.degrees[k]:  # there are no bodies in a ball
                first = first_contact(flight.scene, times, state.position, state.orientation)
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

    def _content(self, recorder: Recorder) -> dict[str, Any]:
        content = {"time": self.time, "state": self.state, "steps": self.steps, "interval": recorder.interval}
        content |= {f"values_{k}": course.values for k, course in enumerate(self.courses)}
        changes = self.changes.count, self.changes.energy, self.changes.total, self.changes.error
        return {**content, "times": recorder.times, "states": recorder.states, "changes": changes}

    def _restore(self, content: dict[str, Any], recorder: Recorder) -> None:
        high, low = content["time"].tolist()
        self.time, self.state, self.steps = (high, low), content["state"], int(content["steps"])
        for k, course in enumerate(self.courses):
            course.values = content[f"values_{k}"]
        count, *rest = content["changes"].tolist()
        self.changes = FieldChanges(int(count), *rest)
        recorder.times, recorder.states, recorder.interval = (content[k] for k in ("times", "states", "interval"))

    def _outcome(self, recorder: Recorder, scale: float, speed: float) -> Together:
        scales, scene, states = self.flights[0].scales, self.scene, recorder.states
        time = np.minimum(recorder.times * scales.time, self.duration)
        if self.ended[0] == DURATION:  # not a last digit less
            time[-1] = self.duration
        angle, error = scene.angle(time), float(np.abs(states[:, -1] - states[0, -1]).max()) / scale
        known, each, pose = self.changes, list[State](), scene.pose(time) if scene.moving else None
        given = np.zeros((len(time), 2)) if scene.drive else None
        for flight, own in zip(self.flights, self._own, strict=True):
            part = states[:, own]
            error = max(error, flight.scales.off_unit(part))
            lab = flight.scales.unpack(part).to_lab(angle)
            each.append(lab.moved(*pose) if pose else lab)
            if given is not None:
                unit = flight.scene.floater.mass * scales.length**2 / scales.time
                given += part[:, -2:] * [unit, unit / scales.time]
        common: dict[str, Any] = {
            "time": time, "angle": angle, "rate": scene.rate(time), "ended_by": self.ended[0], "energy_error": error,
            "realtime_factor": speed, "steps": self.steps, "compile_seconds": self.compile_seconds, "given": given,
            "pose": pose,
            "field_changes": replace(known, energy=known.energy / scale, total=known.total / scale),
        }  # fmt: skip
        return Together(tuple(Trajectory(lab=lab, **common) for lab in each), *self.ended)
