"""Many trajectories at once, as SIMD batches in one core's vector registers.

Taylor steps of a batch are taken together, but each trajectory has its own time and step, and no numbers of one enter
another's: it is the same to the last bit whichever are in its batch, in one worker or in many, where BLAS has one
thread (the default).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...fem.compiled_code import compiled
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import OffsetStart, Scene
from ...geometry.scene.files import startless_text
from ..motion import events
from ..motion.equations import Equations
from ..motion.plate import ENDLESS, PlateForce, PlateMemory
from ..motion.state import DRIVEN, STEADY, Parameter, State, Vector
from .flight import LEFT, MOST_SAMPLES, Course, Flight, settled_currents
from .trajectory import DIVISIONS, DURATION, PARTS, IntegrationError, Recorder, Trajectory

BATCH = 8  # Measured: a trajectory in a batch of 8 takes a quarter of the time of one alone, of 4 a half, of 16 a third
TOGETHER = 200  # Steps between two looks for trajectories that have ended; a hundred are about 16 turns
STEP_ERROR = 1e-9  # Of a launch, which is chaotic: a trajectory depends on the error of a step, but not the shares
FLAT = 1e-9  # Sine of the angle to the horizontal that a plate may have
Begun = tuple[State, Array | None]  # starts, and their offsets from an equilibrium where they are known


class _Passenger(Course):
    """A trajectory on a slot for balls of one kind; each leg of drive and plate is one for itself.

    A plate whose currents are not modelled is only in its way.
    """

    over = watched = False  # whether it is; whether its samples are looked at for contact
    end = 0.0  # Scaled time at which "duration" interrupts it

    def __init__(self, course: Course, left: bool = False) -> None:
        super().__init__(**vars(course))
        self.left = left  # Whether it was ever beyond the range of the plate's table
        scene = self.flight.scene if self.flight.memory else replace(self.flight.scene, plate=None)
        self._legs = iter(events.motion_legs(scene, self.duration))
        self.onward()

    def onward(self) -> bool:
        """Begin the next leg; False where there is none."""
        if (leg := next(self._legs, None)) is not None:
            self.end = self.set_leg(leg)
        return leg is not None

    def record(self, times: Array, states: Array) -> None:
        assert self.recorder is not None
        self.recorder.add(times, self.flight.balanced(self.values, times, states), self.over)

    def follow(self, meaning: str) -> bool:
        """After what interrupted it, with time and state as they are then: whether it goes on on its slot."""
        if meaning == DURATION:
            last, now = self.end == self.duration / self.flight.scales.time, np.array([self.time[0]])
            if last:
                self.ended_by, self.over = DURATION, True
            if self.recorder:
                self.record(now, self.state[None])
            return not last and self.onward()
        if meaning == events.BEYOND:
            self.ended_by, self.left, self.over = events.BEYOND, True, True
            return False
        degree = self.flight.degree(self.values)
        self.change_ball()
        return bool(self.flight.degree(self.values) == degree)

    def alone(self) -> None:
        if self.recorder is None:
            first = self.flight.balanced(self.values, np.array([self.time[0]]), self.state[None])[0]
            recorder = Recorder(first, self.flight.interval(self.duration), MOST_SAMPLES, self.time[0])
            self.recorder = recorder.doubled(self.time[0])
        self.fly()
        self.time, self.state = (float(self.recorder.times[-1]), 0.0), self.recorder.states[-1]
        self.left, self.over = self.ended_by == events.BEYOND, True


class _Launch(_Passenger):
    """A launch over a plate's currents, whose way is of interest only where samples tell of contact with no sphere."""

    def __init__(self, course: Course, left: bool) -> None:
        super().__init__(course, left)
        self.ended_by = events.CONTACT
        if not self.flight.scene.floater.is_sphere:
            self.recorder, self.watched = Recorder(np.zeros(0), self.flight.interval(self.duration), 1), True

    def record(self, times: Array, states: Array) -> None:
        """Nothing: it is not of interest where it was."""

    def follow(self, meaning: str) -> bool:
        """Beyond the table it goes on; at the end of a leg the next one begins."""
        if meaning == events.BEYOND:
            self.left = True
        elif meaning != DURATION or not self.onward():
            self.ended_by = meaning
            return False
        return True


class SimdBatch:
    """An integrator for many trajectories whose equations are the same but for runtime parameters.

    `equations` and `ends` are the motion's and what interrupts it, `tolerance` is the relative error of a step;
    `with_work`: the energy's work is integrated as the last state.
    """

    def __init__(self, equations: Equations, ends: events.Events, tolerance: float, with_work: bool) -> None:
        system = list(zip(equations.variables, equations.rates, strict=True))
        self._count = len(system) + with_work
        if with_work:
            system.append((hy.expression("work"), equations.power))
        self._meanings = [meaning for _, meaning in ends]
        self._integrator = compiled(
            hy.taylor_adaptive_batch,
            system,
            np.zeros((len(system), BATCH)),
            tol=tolerance,
            compact_mode=True,
            opt_level=1,
            t_events=[hy.t_event_batch(each, direction=hy.event_direction.negative) for each, _ in ends],
        )

    def fly(self, passengers: Sequence[_Passenger]) -> None:
        """Integrate each until it does not go on here. Raises IntegrationError: a state became infinite."""
        integrator, waiting, ends = self._integrator, iter(passengers), np.zeros(BATCH)
        integrator.set_time(ends)
        for slot in range(BATCH):  # one that stays empty must be finite too: the equations are not, where all is zero
            self._put(slot, passengers[0])
        active = {slot: first for slot in range(BATCH) if (first := self._next(slot, waiting, ends))}
        while active:
            recorded = any(one.recorder for one in active.values())
            found, _ = integrator.propagate_until(ends, max_steps=TOGETHER, c_output=recorded)
            touched = self._record(active, ends, found) if recorded else {}
            for slot, (outcome, _, _, steps) in enumerate(integrator.propagate_res):
                if slot not in active:
                    continue
                one = active[slot]
                one.steps += int(steps)
                time, state = touched.get(slot, (float(integrator.time[slot]), integrator.state[:, slot]))
                one.time, one.state = (time, 0.0), one.state.copy()
                one.state[: self._count] = state
                if slot in touched:
                    meaning = events.CONTACT
                elif outcome in (hy.taylor_outcome.success, hy.taylor_outcome.step_limit):
                    continue
                elif outcome == hy.taylor_outcome.err_nf_state:
                    raise IntegrationError(
                        f"A floater's state became infinite at t = {one.seconds:.6g} s: it began in a magnet, or the "
                        "plate's table is too small for this start."
                    )
                elif outcome == hy.taylor_outcome.time_limit:
                    meaning = DURATION
                else:
                    meaning = self._meanings[-outcome.value - 1]
                if one.follow(meaning):
                    ends[slot] = one.end
                    self._put(slot, one, meaning == LEFT)  # else what it has crossed must not count again
                elif following := self._next(slot, waiting, ends):
                    active[slot] = following
                else:
                    del active[slot]

    def _next(self, slot: int, waiting: Iterator[_Passenger], ends: Array) -> _Passenger | None:
        following = next(waiting, None)
        ends[slot] = following.end if following else self._integrator.time[slot]
        if following is None:
            return None
        whole, rest = (part.copy() for part in self._integrator.dtime)
        whole[slot], rest[slot] = following.time
        self._integrator.set_dtime(whole, rest)
        self._put(slot, following)
        return following

    def _put(self, slot: int, one: _Passenger, anew: bool = True) -> None:
        self._integrator.state[:, slot] = one.state[: self._count]
        self._integrator.pars[:, slot] = one.values[: len(self._integrator.pars)]
        if anew:
            self._integrator.reset_cooldowns(slot)

    def _record(self, active: Mapping[int, _Passenger], ends: Array, found: Any) -> dict[int, tuple[float, Array]]:
        """Have samples recorded; scaled time and state of those watched that touch something, by their slots."""
        now, due = self._integrator.time, dict[int, Array]()
        for slot, one in active.items():
            if one.recorder:
                due[slot] = one.recorder.due(one.time[0], float(now[slot]), float(ends[slot]))
        if not (most := max(len(times) for times in due.values())):
            return {}
        grid = np.tile(now, (most, 1))
        for slot, times in due.items():
            grid[: len(times), slot] = times
        states, touched = found(grid), dict[int, tuple[float, Array]]()
        for slot, times in due.items():
            one, own = active[slot], states[: len(times), :, slot]
            if len(times):
                one.record(times, own)
            if len(times) and one.watched and (first := one.touching(times, own)) is not None:
                span = np.append(one.time[0], times)[first : first + 2]
                for _ in range(DIVISIONS):
                    grid = np.tile(now, (PARTS + 1, 1))
                    grid[:, slot] = np.linspace(span[0], span[1], PARTS + 1)
                    own = found(grid)[:, :, slot]
                    first = one.touching(grid[:, slot], own) or PARTS
                    span = grid[first - 1 : first + 1, slot]
                touched[slot] = float(span[-1]), own[first]
        return touched


@dataclass(frozen=True, eq=False)
class Endings:
    """The ends of n trajectories."""

    ended_by: NDArray[np.str_]  # (n,) "duration", "contact" or "lost"
    levitated_s: Array  # (n,) when, s
    last: State  # states (n, 3) then, along the rotor's axes, SI units
    changes: NDArray[np.int_]  # (n,) how often a floater went from one ball to another
    # (n,) whether it was ever beyond the range of the plate's table, where its field is a continuation
    left_plate_table: NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: "Sequence[Endings]") -> "Endings":
        axes = [part.last.axes for part in parts if part.last.axes is not None]
        last = State(*map(np.concatenate, zip(*(part.last.vectors for part in parts), strict=True)))
        last = replace(last, axes=np.concatenate(axes) if axes else None)
        names = vars(parts[0]).keys() - {"last"}
        return cls(last=last, **{name: np.concatenate([vars(part)[name] for part in parts]) for name in names})

    def replaced(self, some: NDArray[np.intp], others: "Endings") -> "Endings":
        """These with `some` (k,) of them as they are in `others`."""
        order = np.arange(len(self.ended_by))
        order[some] = len(order) + np.arange(len(some))
        return Endings(**{name: part[order] for name, part in vars(Endings.joined([self, others])).items()})

    def __repr__(self) -> str:
        counts = ", ".join(f"{np.sum(self.ended_by == end)} by {end}" for end in np.unique(self.ended_by))
        left = int(np.sum(self.left_plate_table))
        beyond = f"; {left} left the range of the plate's table" if left else ""
        return f"Endings of {len(self.ended_by)} trajectories: {counts}{beyond}"


def ensemble(
    scene: Scene,
    table: FieldTable,
    starts: State,
    duration: float,
    mapped: Callable[[Callable[[Begun], Endings], Iterable[Begun]], Iterable[Any]] = map,
    together: int = 512,
    offset: Array | None = None,
    memory: PlateMemory | None = None,
    currents: Array | None = None,
) -> Endings:
    """Simulate the floater of a `scene` in `table` from many starts for `duration` (s) each, or to contact or loss.

    Raises InputError: `duration` is not positive, or there is no start; IntegrationError: a state became infinite.
    `starts` are states (n, 3) at t = 0, SI units, whose moments are made unit vectors; without their axes bodies that
    are not round are turned about them as little as can be. They are `mapped` as by the built-in `map`, so many
    `together`: `concurrent.futures.ProcessPoolExecutor(2).map` uses two cores. `offset` is (n, 3) m of the starts from
    an equilibrium, if it is known: bodies that are not round are faster about it. `memory` is of the plate's currents
    (left out, the plate is only an obstacle), and `currents` (k,) √J are its states at all starts (left out, those of a
    floater that had long turned at each).

    Accuracy: that of a trajectory in balls, whose field errs by 1e-6 of its gradient; see `ERROR_OF_BODIES` for those
    of a body that is not round.
    """
    _check(scene, starts, duration)
    starts = _whole(scene, starts)
    pieces = [slice(first, first + together) for first in range(0, len(starts.moment), together)]
    given = [(starts[piece], None if offset is None else offset[piece]) for piece in pieces]
    return Endings.joined(list(mapped(partial(_ended, scene, table, duration, memory, currents), given)))


def _check(scene: Scene, starts: State, duration: float) -> None:
    if not duration > 0:
        raise InputError(f"Input duration must be positive; instead received {duration} s.")
    if not len(starts.position):
        raise InputError("Input starts must have one state at least; instead received none.")
    if scene.moving:
        raise InputError("Input drive must have no center_mm and no axis in many trajectories at once; instead it has.")


def _whole(scene: Scene, starts: State) -> State:
    unit = starts.moment / np.linalg.norm(starts.moment, axis=1)[:, None]
    starts = replace(starts, moment=unit)
    if scene.floater.round or starts.axes is not None:
        return starts
    return replace(starts, axes=np.array([scene.floater.axes(moment) for moment in unit]))


def _ended(
    scene: Scene, table: FieldTable, duration: float, memory: PlateMemory | None, currents: Array | None, given: Begun
) -> Endings:
    starts, offsets = given
    flight = Flight(scene, table, duration, tolerance=None, compact=True, memory=memory, in_balls=True)
    passengers = list[_Passenger]()
    for k, offset in enumerate([None] * len(starts.position) if offsets is None else offsets):
        left = settled_currents(scene, memory, starts[k]) if memory and currents is None else currents
        passengers.append(_begun(flight, starts[k], duration, False, offset, left))
    _fly(passengers)
    return _endings(passengers)


def _endings(passengers: Sequence[_Passenger]) -> Endings:
    flight = passengers[0].flight
    return Endings(
        np.array([events.LOST if f.ended_by == events.BEYOND else f.ended_by for f in passengers], dtype="<U8"),
        np.minimum([f.seconds for f in passengers], passengers[0].duration),
        flight.scales.unpack(np.array([f.state[: flight.scales.size] for f in passengers])),
        np.array([f.changes.count for f in passengers]),
        np.array([f.left for f in passengers]),
    )


def simulate_together(
    scenes: Sequence[Scene], table: FieldTable, starts: Sequence[State], duration: float
) -> list[Trajectory | None]:
    """Trajectories of `duration` (s) of `scenes` in the field of one `table`, from one of `starts` each.

    Their equations are the same but for runtime parameters. Each is what `simulate` gives without a plate's currents,
    but for round-off; None where the start is in contact.
    Raises IntegrationError: a state became infinite.
    """
    began, known = perf_counter(), dict[str, Flight]()
    passengers, keys = [], [startless_text(scene) for scene in scenes]
    for scene, start, key in zip(scenes, starts, keys, strict=True):
        if key not in known:
            known[key] = Flight(scene, table, duration, compact=True, in_balls=True, shared=len(set(keys)) > 1)
        offset = scene.start.offset if isinstance(scene.start, OffsetStart) else None  # each has its own
        passengers.append(_begun(known[key], start, duration, True, offset))
    _fly(passengers)

    speed = sum(f.seconds for f in passengers) / (perf_counter() - began)
    return [f.trajectories(speed)[0] if f.recorder else None for f in passengers]


def _begun(
    flight: Flight, start: State, duration: float, recorded: bool, offset: Array | None, currents: Array | None = None
) -> _Passenger:
    start = replace(start, moment=start.moment / np.linalg.norm(start.moment))
    free = events.clearance(flight.scene, np.zeros(1), start.position[None], start.orientation[None])[0] >= 0
    course = flight.begin(start, duration, currents, flight.interval(duration) if recorded and free else None, offset)
    found = _Passenger(course)
    if not free:
        found.ended_by, found.over = events.CONTACT, True
    elif flight.memory and not flight.memory.in_range(start.position[None])[0]:
        found.follow(events.BEYOND)
    return found


def _fly(courses: Sequence[_Passenger]) -> None:
    """In slots, in small balls first, then in large ones; at last one by one near bodies, and where it is too fast."""
    balls = courses[0].flight.balls if courses else None
    for kind in balls.kinds if balls else ():
        here = [f for f in courses if not f.over and f.flight.degree(f.values) == kind.number]
        if here:
            flight = here[0].flight
            SimdBatch(*flight.equations(kind.number), flight.step_error(kind.number), True).fly(here)
    for course in courses:
        if not course.over:
            course.alone()


def launched(
    scene: Scene,
    table: FieldTable,
    memory: PlateMemory,
    starts: State,
    duration: float,
    step_error: float = STEP_ERROR,
    currents: Array | None = None,
) -> Endings:
    """Simulate a scene's floater over its plate from many starts, for `duration` (s) each, or until contact or loss.

    Contact with the rotor is that of `flight_events`; where a step misses an edge, contact is noticed at the latest
    where the sphere meets the largest one inside the magnet. The plate is an obstacle without edges. Of a floater that
    is no sphere samples tell of contact, as in a trajectory alone. The field is the table's own expressions, so that a
    short one (dipoles, closed forms) is fast. Raises InputError: `duration` is not positive, there is no start, or the
    plate does not lie flat. The `scene` has the plate of `memory`, which may be lowered; `table` may be an
    `Interaction`; `starts` are states (n, 3) at t = 0, SI units; `step_error` is relative, of a Taylor step; `currents`
    are (n, k) the plate's states then, √J (left out, those under a floater long at rest).

    Accuracy: that of the tables; beyond the range of the plate's the currents' field is continued as it is, and
    `Endings.left_plate_table` says which trajectories went there.
    """
    _check(scene, starts, duration)
    flight, count = Flight(scene, table, duration, memory=memory, in_balls=False), len(starts.position)
    equations, (scales, values) = flight.equations(0)[0], (flight.scales, flight.values)
    position, turn = equations.variables[:3], DRIVEN if scene.drive else STEADY
    ends = [
        *events.flight_events(replace(scene, plate=None), position, turn),
        *events.range_events(memory, position, turn),
        *((obstacle, events.CONTACT) for obstacle in _obstacles(scene, memory, position)),
    ]
    starts = _whole(scene, starts)
    if currents is None:  # what the floater's moment alone leaves in the plate; the rotor's part is not integrated
        force, now, states = PlateForce(memory, values), np.zeros(count), replace(scales, pointing=None).pack(starts)
        silent = np.where(np.isin(np.arange(12), (6, 7, 8)), 0.0, states)
        own = force(now, states).signals - force(now, silent).signals
        if scene.drive:  # there the rotor's part is integrated, but for its mean
            depth = float(memory.plate.depth(0.0))
            left, mean = (memory.left_by_rotor(rate).signals(0.0, depth) for rate in (scene.angular_velocity, ENDLESS))
            own = own + (left - mean) * values[Parameter.PLATE_SHARE]
    outside = ~memory.in_range(starts.position)
    passengers = []
    for k in range(count):
        course = flight.begin(starts[k], duration, None if currents is None else currents[k])
        if currents is None:
            first = len(flight.own_states(starts[k]))
            course.state[first : first + own.shape[1]] = own[k]
        passengers.append(_Launch(course, bool(outside[k])))
    free = events.clearance(scene, np.zeros(count), starts.position, starts.orientation) > 0
    if free.any():
        SimdBatch(equations, ends, step_error, False).fly([passengers[k] for k in np.flatnonzero(free)])
    return _endings(passengers)


def _obstacles(scene: Scene, memory: PlateMemory, position: Vector) -> list[hy.expression]:
    """Polynomials of the scaled position that are negative in contact: no step misses them. Raises InputError."""
    box, length = memory.plate.box, hy.par[Parameter.LENGTH]
    normal = int(np.argmin(box.size))
    if memory.plate.each:
        raise InputError("Input plate must be one for many trajectories at once; instead there are several.")
    if abs(abs(box.rotation[2, normal]) - 1) > FLAT:
        raise InputError("Input plate must lie flat under the rotor; instead it is turned. Leave out rotation_deg.")
    face, inner = float(box.center[2] + box.size[normal] / 2), scene.floater.inner_radius
    depth = hy.par[Parameter.PLATE_DEPTH] + hy.par[Parameter.PLATE_SPEED] * hy.time
    found = [position[2] + depth - face / length - inner / scene.floater.radius]
    for body in scene.turning_bodies:
        apart = [length * position[i] - float(body.center[i]) for i in range(3)]
        near = float(np.min(body.size)) / 2 + inner
        found.append((hy.sum([a * a for a in apart]) - near**2) / (length * length))
    return found
