"""Simulated trajectories: Taylor integration of the equations of motion to round-off.

A. Jorba and M. Zou, Exp. Math. 14 (2005) 99; heyoka: F. Biscani and D. Izzo, MNRAS 504 (2021) 2614.

A `Flight` is a scene's motion in machine code, one part for each kind of ball and one for the table's own field.  A
`Course` is how far one trajectory is: all that decides the rest of it, so that it goes on from a `Checkpoint` to the
last bit.  `initial_state` says where a trajectory begins.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from time import perf_counter
from typing import Any

import heyoka as hy
import numpy as np

from ...fem.compiled_code import compiled
from ...fem.harmonics.interior import BallField
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import AbsoluteStart, OffsetStart, Scene
from ..continuation.frequencies import way_out
from ..equilibria.equilibrium import AXIAL, Equilibrium, EquilibriumError
from ..equilibria.search import find_equilibria
from ..motion import events
from ..motion.effect import Stateful
from ..motion.effects import with_effects
from ..motion.equations import Equations, equations_of_motion, parameters
from ..motion.plate import ENDLESS, PlateForce, PlateMemory, plate_numbers
from ..motion.state import DRIVEN, SAME, STEADY, Given, Parameter, Scales, State, moved
from .balls import DEGREE, Balls, in_ball, is_long
from .trajectory import DURATION, STOPPED, Checkpoint, FieldChanges, FlightStopped, Recorder, Trajectory, propagated

LEFT = "left"
INSIDE = 1 - 1e-9  # Square of the distance from a ball's centre, in radii, from which on the floater has left it
# Of a Taylor step. Measured over 1300 turns: J drifts by 3e-13 at 1e-15, by 1e-14 at 1e-16 with 1 % more steps.
TOLERANCE = 1e-16
# Of a Taylor step with a plate: energy is balanced to 1e-7 in 20 s (3e-9 at 1e-13, which is 1.4 times as slow), while
# the plate's table is known to 5e-3 by default and to 1e-5 at best.
PLATE_TOLERANCE = 1e-12
# A step's error is relative to the largest of states and events: 250 and more by the event of loss, 3 in a ball.
# Measured: in a ball J drifts by 3e-14 in 1100 turns at 3e-14, and by 2e-14 in the table's field at 1e-16.
LOOSER = 300
# The same of a body that is not round. Taylor's order follows from it alone, 18: in 10 s of a cube J drifts by 3e-14 to
# 3e-13; by up to 2e-12 at 17 and 16, as what is left out comes in odd and even orders, and the odd ones nearly cancel.
LOOSER_BODY = 100
# An event of this size that never happens, in a ball of such a body: steps' errors are relative to it, so that they are
# a sixth longer than by the states' size, and take what those of order 16 took by that.
SIZE = 50.0
# Of the compiler. Measured: more takes twice as long to compile, and the code is not faster, but often slower.
OPTIMISATION = 1
# Of a body that is not round in a ball: a cube's step takes 8 % less, and compilation 0.4 instead of 0.3 s.
THOROUGH = 3
# Turns up to which code that is not optimised is done sooner. Measured for a dipole, closed forms and in a ball (over a
# plate): loops are compiled in 0.1 (0.2) instead of 0.4 to 0.7 (1.4) s, and a turn takes 0.3 to 0.5 (1 to 5) ms longer.
SHORT_TURNS, SHORT_OVER_PLATE = 1000.0, 200.0
# Turns from which on straight code saves more time (in a ball 21 of 47 µs a step) than its compilation takes.
STRAIGHT_TURNS = 2e5
LOOKED_AHEAD = 16.0  # Turns in the middle of whose way a ball is put: three periods of the axial mode
MOST_SAMPLES, SAMPLES_PER_TURN = 20000, 32
AT_ONCE = 256  # Samples whose energy is computed at once: each has a copy of all runtime parameters


@dataclass(frozen=True, eq=False)
class Part:
    """Compiled motion: the integrator, the meanings of its terminal events, and the terms of the Jacobi integral."""

    integrator: hy.taylor_adaptive
    meanings: list[str]
    jacobi: hy.cfunc


class Flight:
    """The motion of a `scene` in `table`, compiled part by part when it is first needed.

    How long it shall last, `duration` (s), decides how much compilation is worth. `tolerance` is the relative error of
    a step, by default `TOLERANCE`, if None with a plate's currents `PLATE_TOLERANCE`; `compact` code of loops is sooner
    ready than straight code, and up to twice as slow (None: chosen). `memory` is of the plate's currents, if they are
    modelled, else it is only an obstacle; `in_balls`: the rotor's field is expanded in balls about the floater (None:
    where its expressions are long); `scales` are units of the states, by default the scene's; `shared`: the code of a
    body that is not round is for others as well, which differ in runtime parameters.
    """

    def __init__(
        self,
        scene: Scene,
        table: FieldTable,
        duration: float,
        tolerance: float | None = TOLERANCE,
        compact: bool | None = None,
        memory: PlateMemory | None = None,
        in_balls: bool | None = None,
        scales: Scales | None = None,
        shared: bool = False,
    ) -> None:
        self.scene, self.memory, self._shared = scene, memory, shared
        inertia = scene.floater.principal_inertia
        even = not scene.floater.round and not shared and bool(np.ptp(inertia) <= SAME * inertia.max())
        self.scales = scales or replace(Scales.of(scene), even=even)
        self.whole, self.tilted = with_effects(scene, table), bool(np.any(scene.gravity[:2]))
        self.balls = Balls(scene, self.whole) if (is_long(table) if in_balls is None else in_balls) else None
        self.first = self.balls.end if self.balls else len(Parameter)
        values = parameters(scene, self.scales)
        own = np.zeros(0) if memory is None else plate_numbers(memory, values, bool(scene.drive))
        # runtime parameters, in no ball: those of the equations, of a ball, and of the plate
        self.values = np.concatenate([values, np.zeros(self.first - len(values)), own])
        self.parts: dict[Any, Part] = {}  # by the `number` of the ball's kind, 0: in none
        self.compile_seconds, self._turns = 0.0, scene.fastest * duration
        self._tolerance = tolerance or (PLATE_TOLERANCE if memory else TOLERANCE)
        long = memory is None and self._turns > STRAIGHT_TURNS  # straight code of a plate takes minutes to compile
        self._straight = long if compact is None else not compact

    @property
    def offset(self) -> Array | None:
        """(3,) m of the scene's start from an equilibrium, if it begins at one."""
        return self.scene.start.offset if isinstance(self.scene.start, OffsetStart) else None

    @property
    def each(self) -> "list[tuple[Flight, slice, slice]]":
        """Of each floater its motion alone, its runtime parameters and states: here this, all, all but the work."""
        return [(self, slice(None), slice(-1))]

    def degree(self, values: Array) -> Any:
        """The `number` of the ball's kind in runtime parameters; 0: none."""
        return int(values[DEGREE]) if self.balls else 0

    def step_error(self, degree: Any) -> float:
        """Relative error of a step in balls of a kind, or, 0, in the table's own field."""
        looser = LOOSER_BODY if self.whole.turning else LOOSER
        return self._tolerance * (looser if degree else 1)

    def part(self, degree: Any) -> Part:
        """The compiled motion in balls of a kind, or, 0, in the table's own field."""
        if degree not in self.parts:
            # in small balls most of a long trajectory is spent: straight code is for them, or where there are none
            began = perf_counter()
            equations, ends = self.equations(degree)
            thorough = THOROUGH if self.whole.turning and degree and not self.memory else OPTIMISATION
            steps = self._turns * (2 if self.whole.turning else 1)  # in those of a sphere's turns
            small = [kind.number for kind in self.balls.kinds[:-1]] if self.balls else []
            integrator = compiled(
                hy.taylor_adaptive,
                [*zip(equations.variables, equations.rates, strict=True), (hy.expression("work"), equations.power)],
                np.zeros(len(equations.variables) + 1),
                tol=self.step_error(degree),
                compact_mode=not self._straight or (self.balls is not None and degree not in small),
                opt_level=thorough if steps > (SHORT_OVER_PLATE if self.memory else SHORT_TURNS) else 0,
                t_events=[hy.t_event(each, direction=hy.event_direction.negative) for each, _ in ends],
            )
            terms = list(equations.jacobi), list(equations.variables)
            # In balls expressions are so short that straight code is ready sooner and twice as fast at 20 000 samples.
            jacobi = compiled(hy.cfunc, *terms, compact_mode=not (self.balls and degree), opt_level=0)
            self.parts[degree] = Part(integrator, [meaning for _, meaning in ends], jacobi)
            self.compile_seconds += perf_counter() - began
        return self.parts[degree]

    def equations(self, degree: Any) -> tuple[Equations, events.Events]:
        """Equations of motion and terminal events; a ball is free of bodies and ends before the floater is lost."""
        ball = BallField(DEGREE + 1, abs(degree), degree < 0)
        whole = in_ball(self.whole, ball) if degree else self.whole
        rotor = moved() if self.scene.moving else DRIVEN if self.scene.drive else STEADY
        given = Given(self.values if whole.turning and not self._shared else None)
        equations = equations_of_motion(whole, self.tilted, self.memory, self.first, rotor, given, self.scales.frame)
        position = equations.variables[:3]
        if degree:
            away = ball.offset([given[Parameter.LENGTH] * x for x in position])  # as the field has it
            ends = [(1.0 - hy.sum([a * a for a in away]), LEFT)]
            if whole.turning:
                ends.append((SIZE + equations.variables[6], LEFT))  # no number may be one; a part of a unit vector
        else:
            ends = events.flight_events(self.scene, position, rotor)
        return equations, ends if self.memory is None else [*ends, *events.range_events(self.memory, position, rotor)]

    def jacobi(self, values: Array, times: Array, states: Array) -> Array:
        """Terms (k, n) of J at scaled times (n,), states (n, s), by parameters `values` (p,), the plate as it is."""
        function, found = self.part(self.degree(values)).jacobi, []
        pars = np.repeat(values[: max(function.nparams, len(Parameter)), None], min(len(times), AT_ONCE), axis=1)
        pars[Parameter.PLATE_SPEED] = 0.0
        for start in range(0, len(times), AT_ONCE):
            now, inputs = times[start : start + AT_ONCE], states[start : start + AT_ONCE, :-1].T
            if self.scene.plate is not None:
                depth = self.scene.plate.depth(now * self.scales.time)
                pars[Parameter.PLATE_DEPTH, : len(now)] = depth / self.scales.length
            given = np.ascontiguousarray(pars[: function.nparams, : len(now)])
            found.append(function(np.ascontiguousarray(inputs), pars=given, time=now))
        return np.concatenate(found, axis=1)

    def balanced(self, values: Array, times: Array, states: Array) -> Array:
        """The floaters' own at scaled times (n,), and J - work, from states (n, s) under parameters `values`.

        With a drive what the motor has given each, angular momentum and work, follows its own.
        """
        energy = self.jacobi(values, times, states).sum(axis=0) - states[:, -1]
        given = (-2, -1) if self.scene.drive else ()
        kept = [states[:, own][:, [*range(one.scales.size), *given]] for one, _, own in self.each]
        return np.concatenate([*kept, energy[:, None]], axis=1)

    def touching(self, values: Array, times: Array, states: Array) -> tuple[int, tuple[int, ...]] | None:
        """The first of times (n,) s at which something overlaps in states (n, s), and which of several floaters do."""
        there = self.scales.unpack(states)
        first = events.first_contact(self.scene, times, there.position, there.orientation)
        return None if first is None else (first, ())

    def begin(
        self,
        start: State,
        duration: float,
        currents: Array | None = None,
        interval: float | None = None,
        offset: Array | None = None,
    ) -> "Course":
        """The course of `duration` (s) from a start (rotor's frame, t = 0), the plate's states being `currents` (k,).

        It is sampled at multiples of `interval`, scaled; None: not at all. `offset` (3,) m: from an equilibrium.
        """
        values, own = self.values.copy(), np.zeros(0)
        farthest = max(0.1, 2 * float(np.linalg.norm(start.position)))  # of the rotor's origin; beyond, it is lost
        values[Parameter.LOST_DISTANCE] = farthest / self.scales.length
        if self.memory is not None:
            depth = float(self.memory.plate.depth(0.0))
            rate = ENDLESS if self.scene.drive else self.scene.angular_velocity
            left = self.memory.left_by_rotor(rate).signals(0.0, depth)
            own = ((0.0 if currents is None else currents) - left) * values[Parameter.PLATE_SHARE]
        given = np.zeros(3 if self.scene.drive else 1)  # by the motor, and the work
        course = Course(self, duration, values, np.concatenate([self.own_states(start), own, given]))
        course.enter_ball(offset)
        if interval is not None:
            course.sample(interval)
        return course

    def own_states(self, state: State) -> Array:
        """Scaled states of floater and effects in a `state` along the rotor's axes."""
        more = [effect.states_at(state) for effect in self.whole.effects if isinstance(effect, Stateful)]
        return np.concatenate([self.scales.pack(state), *more])

    def interval(self, duration: float) -> float:
        """First scaled time between samples of a trajectory of so many seconds."""
        turn = 1 / self.scene.fastest if self.scene.fastest else np.inf
        return float(min(turn / SAMPLES_PER_TURN, duration / 1000) / self.scales.time)


@dataclass(eq=False)
class Course:
    """How far a trajectory is, or those of several floaters."""

    flight: Flight  # the problem, and when it ends (s) if nothing ends it before
    duration: float
    values: Array  # runtime parameters, with those of the ball that the floater is in
    state: Array  # scaled (s,), with the plate's and the work
    # scaled, the sum of two numbers, so that it loses nothing over millions of turns
    time: tuple[float, float] = (0.0, 0.0)
    ended_by: str = DURATION  # what has ended the last piece
    steps: int = 0  # of Taylor's method so far
    changes: FieldChanges = field(default_factory=FieldChanges)  # from ball to ball, so far; energies scaled
    recorder: Recorder | None = None  # samples with J - work, and the size of J; none where only the end is asked for
    scale: float = 1.0
    sound: bool = True  # whether samples and state belong together: not where an interrupt comes between them
    which: tuple[int, ...] = ()  # of several floaters those that have ended it

    @property
    def seconds(self) -> float:
        return self.time[0] * self.flight.scales.time

    def enter_ball(self, offset: Array | None = None) -> None:
        """Begin in a ball, a small one if it will do; of a body not round about an equilibrium `offset` (3,) m away."""
        if not (balls := self.flight.balls):
            return
        about = self.flight.whole.turning and offset is not None
        kinds, off = (balls.kinds, offset) if about else (balls.usual, None)
        error = balls.enter(kinds, self.state, self.values, self.time[0], off)
        # Such a body swings about another place than its mean, and what a ball misses of multipoles is the cube of the
        # distance from its centre: a ball about the middle of the first turns' way, if there is one that holds that.
        if about and (number := self.flight.degree(self.values)):
            integrator = self.flight.part(number).integrator
            times = self.time[0] + 2 * np.pi * np.arange(0.0, LOOKED_AHEAD, 0.125)
            event, *_, states = propagated(integrator, self.values, self.time, self.state, times)
            if event is None:
                error = balls.centre(self.values, states[:, :3] * self.values[Parameter.LENGTH]) or error
        self.changes = FieldChanges(error=error)

    def sample(self, interval: float) -> None:
        """Keep samples from now on at multiples of `interval`, scaled."""
        row, now = self.state[None], np.array([self.time[0]])
        terms = self.flight.jacobi(self.values, now, row)
        largest, whole = float(np.abs(terms).max()), abs(float(terms.sum()))
        self.scale = whole if whole > 1e-3 * largest else largest  # they may nearly cancel
        self.recorder = Recorder(self.flight.balanced(self.values, now, row)[0], interval, MOST_SAMPLES)

    def _gained(self, before: Array) -> float:
        flight, now, row = self.flight, np.array([self.time[0]]), self.state[None]
        return float(flight.jacobi(self.values, now, row).sum() - flight.jacobi(before, now, row).sum())

    def change_ball(self) -> None:
        """Go over to larger balls about places now; the difference in energy is added to the work."""
        before, known, error = self.values, self.changes, self.changes.error
        self.values = before.copy()
        for one, where, own in self.flight.each:
            if one.balls is None:
                continue
            values, state = self.values[where], self.state[own]
            degree, *center, inverse = values[DEGREE : DEGREE + 5]
            away = state[:3] * values[Parameter.LENGTH] - center
            if not degree or away @ away * inverse**2 >= INSIDE:
                error = max(error, one.balls.enter(one.balls.after(int(degree)), state, values, self.time[0]))
        if not np.array_equal(self.values, before):
            jump = self._gained(before)
            self.state = np.append(self.state[:-1], self.state[-1] + jump)
            self.changes = FieldChanges(known.count + 1, known.energy + jump, known.total + abs(jump), error)

    def travel(self, progress: Callable[[float], None] | None, checkpoint: Checkpoint | None) -> float:
        """Go on, from a checkpoint if there is one, to an end or an interrupt: simulated seconds per second."""
        flight, began = self.flight, perf_counter() - self.flight.compile_seconds
        if (kept := checkpoint.read() if checkpoint else None) is not None:
            self.restore(kept)
        begun = self.seconds
        assert self.recorder is not None
        try:
            self.fly(progress, checkpoint)
        except KeyboardInterrupt:
            self.ended_by, self.which = STOPPED, ()
            if checkpoint and self.steps and self.sound:
                checkpoint.write(self.content())
        done = float(self.recorder.times[-1]) * flight.scales.time - begun
        return done / (perf_counter() - flight.compile_seconds - began)

    def fly(self, progress: Callable[[float], None] | None = None, checkpoint: Checkpoint | None = None) -> None:
        flight, unit, kept = self.flight, self.flight.scales.time, perf_counter()
        assert self.recorder is not None
        for leg in events.motion_legs(flight.scene, self.duration):
            if self.time[0] >= leg.end / unit:
                continue
            end = self.set_leg(leg)
            while self.time[0] < end:
                self.change_ball()
                times, states = self._piece(end, self.recorder)
                over = self.ended_by not in (DURATION, LEFT) or times[-1] * unit >= self.duration * (1 - 1e-12)
                self.recorder.add(times[1:], states[1:], over)
                self.sound = True
                if progress is not None:
                    progress(min(1.0, times[-1] * unit / self.duration))
                if over:
                    return
                if checkpoint and perf_counter() - kept > checkpoint.every:
                    checkpoint.write(self.content())
                    kept = perf_counter()

    def set_leg(self, leg: events.Leg) -> float:
        """Let plate and rotor move as on a leg; scaled time of its end."""
        before = self.values.copy()
        for one, where, _ in self.flight.each:
            leg.write(self.values[where], one.scales, one.scene)
        if leg.way and self.recorder:  # a rotor whose axis begins to turn has another J
            self.state = np.append(self.state[:-1], self.state[-1] + self._gained(before))
        return leg.end / self.flight.scales.time

    def _piece(self, end: float, recorder: Recorder) -> tuple[Array, Array]:
        """Go on to the end of a piece or to an event: scaled times, and states with J - work."""
        flight, part = self.flight, self.flight.part(self.flight.degree(self.values))
        watched, often = LEFT not in part.meanings, recorder.interval  # there are no bodies in a ball
        if watched and not all(one.scene.floater.is_sphere for one, _, _ in flight.each):
            often = flight.interval(self.duration)  # samples alone tell of contact with its surface
        grid = recorder.grid(self.time[0], end, often)
        event, steps, times, states = propagated(part.integrator, self.values, self.time, self.state, grid)
        self.sound = False
        self.time, self.state = part.integrator.dtime, part.integrator.state.copy()
        self.steps, self.ended_by, self.which = self.steps + steps, DURATION, ()
        if event is not None:
            self.ended_by, *which = part.meanings[event].split()
            self.which = tuple(map(int, which))
        if watched and (first := self.touching(times, states)) is not None:
            self.ended_by = events.CONTACT
            times, states = times[: first + 1], states[: first + 1]
            if first:
                between = times[-2:], states[-2:], self.touching
                times[-1], states[-1] = recorder.crossing(part.integrator, self.values, *between)
        return times, flight.balanced(self.values, times, states)

    def touching(self, times: Array, states: Array) -> int | None:
        """The first of scaled times (n,) at which the floater overlaps something in its state (n, s)."""
        if (found := self.flight.touching(self.values, times * self.flight.scales.time, states)) is None:
            return None
        first, self.which = found
        return first

    def content(self) -> dict[str, Any]:
        """All that decides the rest, for a checkpoint, and the region (2, 3) m of the plate's table; zeros: none."""
        memory, recorder = self.flight.memory, self.recorder
        assert recorder is not None
        content = {name: getattr(self, name) for name in ("time", "state", "values", "steps")}
        content |= {name: getattr(recorder, name) for name in ("times", "states", "interval")}
        region = np.zeros((2, 3)) if memory is None else [memory.table.region.lower, memory.table.region.upper]
        return {**content, "changes": astuple(self.changes), "region": region}

    def restore(self, content: Mapping[str, Any]) -> None:
        assert self.recorder is not None
        high, low = content["time"].tolist()
        self.time, self.state, self.values = (high, low), content["state"], content["values"]
        count, *rest = content["changes"].tolist()
        self.steps, self.changes = int(content["steps"]), FieldChanges(int(count), *rest)
        self.recorder.times, self.recorder.states = content["times"], content["states"]
        self.recorder.interval = float(content["interval"])

    def trajectories(self, speed: float) -> list[Trajectory]:
        """The samples of each floater, at so many simulated seconds per second."""
        assert self.recorder is not None
        scales, scene, changes, memory = self.flight.scales, self.flight.scene, self.changes, self.flight.memory
        time, states = np.minimum(self.recorder.times * scales.time, self.duration), self.recorder.states
        if self.ended_by == DURATION:  # not a last digit less
            time[-1] = self.duration
        angle, pose, labs = scene.angle(time), scene.pose(time) if scene.moving else None, list[State]()
        error = float(np.abs(states[:, -1] - states[0, -1]).max()) / self.scale
        given = np.zeros((len(time), 2)) if scene.drive else None
        for one, _, _ in self.flight.each:
            own, states = np.split(states, [one.scales.size + (0 if given is None else 2)], axis=1)
            error = max(error, one.scales.off_unit(own))
            lab = one.scales.unpack(own).to_lab(angle)
            labs.append(lab.moved(*pose) if pose else lab)
            if given is not None:
                unit = one.scene.floater.mass * scales.length**2 / scales.time  # of an angular momentum
                given += own[:, -2:] * [unit, unit / scales.time]
        known = memory is None or memory.in_range(labs[0].position, time)
        beyond, left = float(1 - np.mean(known)), self.ended_by == events.BEYOND
        said = (
            events.LOST if left else self.ended_by,
            error,
            speed,
            self.steps,
            self.flight.compile_seconds,
            beyond,
            left,
        )
        changes = replace(changes, energy=changes.energy / self.scale, total=changes.total / self.scale)
        return [Trajectory(time, lab, angle, scene.rate(time), *said, changes, given, pose) for lab in labs]


def integrate(
    flight: Flight,
    start: State,
    duration: float,
    progress: Callable[[float], None] | None = None,
    currents: Array | None = None,
    checkpoint: Checkpoint | None = None,
) -> Trajectory:
    """Integrate from `start` (rotor's frame, t = 0) until `duration` (s), contact or loss.

    Raises FlightStopped: by a keyboard interrupt; it has what is finished, and so has the checkpoint; IntegrationError:
    the state became infinite. `progress` is called with the finished part, 0 to 1, a few times a second. `currents` are
    the plate's states at the start, √J; zero if not given. At `checkpoint` the course is kept while it lasts, and goes
    on from there.

    Accuracy: energy and |m̂| drift by about 1e-14 in a thousand turns; over a plate see `PLATE_TOLERANCE`.
    """
    course = flight.begin(start, duration, currents, flight.interval(duration), flight.offset)
    if flight.memory and not flight.memory.in_range(start.position[None])[0]:
        course.ended_by = events.BEYOND  # no event reports a range in which it never was
        return course.trajectories(0.0)[0]
    (found,) = course.trajectories(course.travel(progress, checkpoint))
    if course.ended_by == STOPPED:
        raise FlightStopped(found)
    return found


def simulate(
    scene: Scene,
    table: FieldTable,
    duration: float,
    equilibria: Sequence[Equilibrium] | None = None,
    tolerance: float | None = None,
    compact: bool | None = None,
    progress: Callable[[float], None] | None = None,
    memory: PlateMemory | None = None,
    checkpoint: Checkpoint | None = None,
) -> Trajectory:
    """Simulate the trajectory of a scene's floater for `duration` (s), or until contact or loss.

    Raises EquilibriumError: the trajectory is to begin near a stable equilibrium and there is none; StartError: it
    begins in contact, or `duration` is not positive; FlightStopped: as of `integrate`, whose are `progress` and
    `checkpoint`. `equilibria` are those of the scene, if already known; `tolerance` and `compact` are as of `Flight`;
    `memory` is of the plate's currents (left out, the plate is only an obstacle).
    """
    if not duration > 0:
        raise StartError(f"Input duration must be positive; instead received {duration} s.")
    start, currents = initial_state(scene, table, equilibria, memory)
    flight = Flight(scene, table, duration, tolerance, compact, memory)
    return integrate(flight, start, duration, progress, currents, checkpoint)


SLOWLY = 1 / 3  # Growth rate (1/s) with which a trajectory may still begin: by e in the shortest one that counts, 3 s


class StartError(InputError):
    """The trajectory cannot begin where the scene says."""


def initial_state(
    scene: Scene, table: FieldTable, equilibria: Sequence[Equilibrium] | None = None, memory: PlateMemory | None = None
) -> tuple[State, Array]:
    """State at t = 0, when the rotor's frame is the laboratory's, and the states (k,), √J, of the plate of `memory`.

    An `OffsetStart` of `scene` displaces the stable equilibrium in the rotor's frame, with the floater at rest; among
    several it takes the nearest; where there is none, what `starting_point` says.  An absolute start finds the plate as
    if the floater had long turned with the rotor there.  `equilibria` are found if they are not given. Raises
    EquilibriumError: no equilibrium to start from; it says why and which frequency has one; StartError: the floater
    would overlap a magnet or the plate.
    """
    currents = np.zeros(0)
    if isinstance(scene.start, AbsoluteStart):
        start = scene.start
        moment = start.moment / np.linalg.norm(start.moment)
        axes = None if scene.floater.round else scene.floater.axes(moment, start.body_x)
        state = State(start.position, start.velocity, moment, start.spin, axes)
        if memory is not None:
            currents = settled_currents(scene, memory, state)
    else:
        known = find_equilibria(scene, table, memory=memory) if equilibria is None else equilibria
        if (chosen := starting_point(known)) is None:
            raise EquilibriumError(way_out(scene, table, known, memory=memory))
        begun = chosen.start
        if not scene.floater.round and begun.axes is None:  # the mean over all turns about the moment
            begun = replace(begun, axes=scene.floater.axes(begun.moment))
        state = displaced(begun, scene.start.offset, scene.angular_velocity)
        currents = currents if chosen.currents is None else chosen.currents[0]
    check_free("start", scene, state.position, orientation=state.orientation)
    return state, currents


def settled_currents(scene: Scene, memory: PlateMemory, state: State) -> Array:
    """States (k,), √J, of the plate of `memory` if the floater had long turned with the rotor where `state` has it."""
    plate = PlateForce(memory, parameters(scene, Scales.of(scene)))
    return np.asarray(plate.settled(Scales.of(scene).pack(state)) / plate.values[Parameter.PLATE_SHARE])


def check_free(name: str, scene: Scene, position: Array, time: float = 0.0, orientation: Array | None = None) -> None:
    """Raises StartError where a floater at `position` (3,) m, rotor's frame, overlaps a body of `scene` at `time` (s).

    `name` is what the message calls its place; see `clearance` for `orientation`.
    """
    turned = None if orientation is None else orientation[None]
    gap = float(events.clearance(scene, np.array([time]), position[None], turned)[0])
    if gap < 0:
        where = ", ".join(f"{1e3 * c:.6g}" for c in position)
        raise StartError(
            f"Input {name} must leave the floater free of the magnets and the plate; instead it begins at ({where}) "
            f"mm, {-1e3 * gap:.3g} mm inside one of them. Move the plate or the {name}."
        )


def starting_point(equilibria: Sequence[Equilibrium]) -> Equilibrium | None:
    """The nearest stable equilibrium, else one that only the plate destabilises, else one that grows in minutes."""
    stable = [e for e in equilibria if e.stable] or [e for e in equilibria if e.without and e.without.stable]
    return next(iter(stable or (e for e in equilibria if e.growth_per_s < SLOWLY)), None)


def most_like_levitation(equilibria: Sequence[Equilibrium]) -> Equilibrium | None:
    """A `starting_point`, else what grows least, of those below the rotor and axially stable if there are such."""
    below = [e for e in equilibria if np.hypot(*e.position[:2]) < abs(e.position[2])]
    along = [e for e in below if any(m.name == AXIAL and m.growth_per_s <= SLOWLY for m in e.modes)]
    return starting_point(equilibria) or min(along or equilibria, key=lambda e: e.growth_per_s, default=None)


def displaced(start: State, offset: Array, angular_velocity: float) -> State:
    """State `start` moved by `offset` (..., 3) m, as much at rest in a frame of `angular_velocity` as it was."""
    turning = np.cross([0.0, 0.0, angular_velocity], offset)
    many = start.each(lambda part: np.broadcast_to(part, offset.shape[:-1] + part.shape))
    return replace(many, position=start.position + offset, velocity=start.velocity + turning)
