"""A scene's motion compiled to machine code: integrator, events and the ledger of energy."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import heyoka as hy
import numpy as np

from ...fem.compiled_code import compiled
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..motion.effects import with_effects
from ..motion.equations import Equations, equations_of_motion, parameters
from ..motion.events import flight_events, plate_depth, range_events
from ..motion.plate import PlateFormula, PlateMemory
from ..motion.state import Parameter, Scales, State
from .plate_formula import Reduction, WholePlate
from .trajectory import FieldChanges

TOLERANCE = 1e-16
"""Of a Taylor step. Measured over 1300 turns: J drifts by 3e-13 at 1e-15, by 1e-14 at 1e-16 with 1 % more steps."""
OPTIMISATION = 1
"""Of the compiler. Measured: more takes twice as long to compile, and the code is not faster, but often slower."""
SHORT_TURNS = 1000.0
"""Turns up to which code that is not optimised at all is done sooner.

Measured for a dipole, for closed forms and in a ball: loops are compiled in 0.05 to 0.1 s instead of 0.4 to 0.7 s, and
a turn takes 0.3 to 0.5 ms longer.
"""
STRAIGHT_TURNS = 8e4
"""Turns from which on straight code may save more time (in a ball 21 of 47 µs a step) than its compilation takes."""


@dataclass(frozen=True, eq=False)
class Flight:
    """A compiled problem: the integrator, what its events mean, and the ledger of energy.

    Parameters
    ----------
    integrator : heyoka's, with the twelve states of the floater, those of the plate, and the work
    meanings : of the terminal events, by number
    ledger : compiled terms of the Jacobi integral
    values : runtime parameters
    scales : units of the state
    scene, memory : the problem
    compile_seconds : time that compilation took
    first : number of the first further runtime parameter
    numbers : values of these, which `values` do not have
    reduction : of the plate's states to those that are integrated, if these are not all
    """

    integrator: hy.taylor_adaptive
    meanings: list[str]
    ledger: hy.cfunc
    values: Array
    scales: Scales
    scene: Scene
    memory: PlateMemory | None
    compile_seconds: float
    first: int
    numbers: Array
    reduction: Reduction | None = None

    def given(self, values: Array, count: int) -> Array:
        """(count, n) runtime parameters of compiled code, a column for each row of values (n, q)."""
        given = np.empty((count, len(values)))
        own = min(self.first, count) if len(self.numbers) else count
        given[:own] = values.T[:own]
        given[own:] = self.numbers[: count - own, None]
        return given

    def start(self, values: Array) -> None:
        """Give the integrator its runtime parameters."""
        self.integrator.pars[:] = self.given(values[None], len(self.integrator.pars))[:, 0]

    def take(self, time: float | tuple[float, float], state: Array) -> None:
        """Go on at a scaled time, one number or the sum of two, from a state with all of the plate's."""
        self.integrator.dtime = time if isinstance(time, tuple) else (time, 0.0)
        self.integrator.state[:] = self.own(state)
        self.integrator.reset_cooldowns()

    def own(self, state: Array) -> Array:
        """The integrator's state, from one with all of the plate's."""
        return state if self.reduction is None else self.reduction.own(state)

    @property
    def whole(self) -> Array:
        """State where the integrator is, with all of the plate's."""
        state = self.integrator.state.copy()
        return state if self.reduction is None else self.reduction.whole(self.integrator.time, state)

    def leg(self, values: Array, depth: float, speed: float, changes: FieldChanges) -> FieldChanges:
        """Let the plate move, scaled, from now on; what has been done of changes of the field."""
        values[Parameter.PLATE_DEPTH], values[Parameter.PLATE_SPEED] = depth, speed
        return changes

    def state(self, start: State, currents: Array) -> Array:
        """Scaled state at t = 0, from the floater's and the plate's (k,), √J."""
        return scaled_state(self.scene, self.memory, start, currents)

    def part(self, values: Array) -> Flight:
        """What flies on with these runtime parameters: itself (see `LocalFlight`)."""
        return self

    def enter(self, start: State, values: Array, time: float = 0.0) -> float:
        """Set the runtime parameters for a flight from a start at a scaled time; error of the representation chosen."""
        return 0.0

    def onward(self, values: Array, changes: FieldChanges) -> FieldChanges:
        """Go over to another representation of the field where it must; what has been done of that."""
        return changes

    def terms(self, times: Array, states: Array, values: Array) -> Array:
        """Terms (k, n) of the Jacobi integral at scaled times (n,), states (n, s) and runtime parameters (n, p)."""
        inputs, pars = np.ascontiguousarray(states[:, :-1].T), self.given(values, self.ledger.nparams)
        return np.asarray(self.ledger(inputs, pars=pars, time=times))


def compile_flight(
    scene: Scene,
    table: FieldTable,
    duration: float,
    tolerance: float = TOLERANCE,
    compact: bool | None = None,
    memory: PlateMemory | None = None,
) -> Flight:
    """Compile the motion of a scene in a table's field.

    Parameters
    ----------
    scene, table : the problem
    duration : how long it shall fly, s: it decides how much compilation is worth
    tolerance : relative error of a step
    compact : compile loops instead of straight code: sooner ready, up to twice as slow; None to choose
    memory : the plate's currents, if they are modelled
    """
    tilted = bool(np.any(scene.gravity[:2]))
    plate = None if memory is None else WholePlate(memory)
    equations = equations_of_motion(with_effects(scene, table), tilted, plate)
    events = flight_events(scene, equations.variables[:3])
    if plate is not None:
        ends = range_events(plate, equations.variables[:3])
        events = events[0] + ends[0], events[1] + ends[1]
    if compact is None:
        compact = not _worth_compiling(equations, scene, duration)
    return flight_of(scene, equations, events, duration, tolerance, compact, plate)


def flight_of(
    scene: Scene,
    equations: Equations,
    events: tuple[list[hy.t_event], list[str]],
    duration: float,
    tolerance: float,
    compact: bool,
    plate: PlateFormula | None,
) -> Flight:
    """Compile equations of motion with their terminal events and what these mean; else as `compile_flight`."""
    started = perf_counter()
    scales = Scales.of(scene)
    integrator = compiled(
        hy.taylor_adaptive,
        [*zip(equations.variables, equations.rates, strict=True), (hy.expression("work"), equations.power)],
        np.zeros(len(equations.variables) + 1),
        tol=tolerance,
        compact_mode=compact,
        opt_level=OPTIMISATION if scene.frequency * duration > SHORT_TURNS else 0,
        t_events=events[0],
    )
    ledger = compiled(hy.cfunc, list(equations.jacobi), list(equations.variables), compact_mode=True, opt_level=0)
    values, memory = parameters(scene, scales), plate.memory if plate else None
    numbers = plate.numbers(values) if isinstance(plate, WholePlate) else np.zeros(0)
    first, seconds = plate.first if plate else len(values), perf_counter() - started
    return Flight(integrator, events[1], ledger, values, scales, scene, memory, seconds, first, numbers)


def scaled_state(scene: Scene, memory: PlateMemory | None, start: State, currents: Array) -> Array:
    """Scaled state at t = 0, with work, from the floater's and the plate's (k,), √J."""
    scales = Scales.of(scene)
    if memory is not None:
        depth = float(plate_depth(memory.plate, np.zeros(1))[0])
        left = memory.driven(scene.angular_velocity).left.signals(0.0, depth)
        currents = (currents - left) * parameters(scene, scales)[Parameter.PLATE_SHARE]
    return np.concatenate([scales.pack(start), currents, [0.0]])


def _worth_compiling(equations: Equations, scene: Scene, duration: float) -> bool:
    """Whether straight code saves more time than its compilation takes.

    Measured: it takes 3 s for a dipole (n = 67) and 17 to 23 s for closed forms (n = 139 to 152), n being the length of
    the decomposed rates, and then each of some six steps a turn saves n · 0.1 µs.
    """
    turns = scene.frequency * duration
    if turns < STRAIGHT_TURNS:
        return False
    rates = compiled(hy.cfunc, list(equations.rates), list(equations.variables), compact_mode=True, opt_level=0)
    size = len(rates.dc)
    return 8e-4 * size**2 < 6 * turns * size * 0.1e-6
