"""The compiled parts of a flight through balls: one for balls of each kind, and one for the table's own field.

A plate's currents have balls of their own (`local_plates`), in the laboratory, while the plate stands still.
"""

from dataclasses import dataclass, field, replace
from typing import cast

import heyoka as hy
import numpy as np

from ...fem.harmonics import BallField
from ...fem.rotor_tables import FieldTable
from ...geometry.scenes import Scene
from ..effects import with_effects
from ..local_plates import KEY, PlateInBall, PlateKind, WholePlate
from ..motion import (
    Effect,
    Equations,
    Fittable,
    InBall,
    Interaction,
    Parameter,
    PlateFormula,
    PlateMemory,
    equations_of_motion,
    flight_events,
    interaction_of,
    range_events,
    seen_by_plate,
)
from .compiled_flight import STRAIGHT_TURNS, Flight, compile_flight, flight_of

LEFT = "left"
DEGREE = len(Parameter)
"""Number of the runtime parameter that says of which degree the ball is: 0 where there is none."""
SMALL, LARGE = BallField(DEGREE + 1, 7), BallField(DEGREE + 1, 9)
"""The second kind, twice as wide and half again as slow, is for a floater that has left a small ball."""
FIRST = DEGREE + 1 + LARGE.count
"""Number of the first runtime parameter of the effects in a ball."""
LOOSER = 300
"""A step's error is relative to the largest of states and events: 250 and more by the event of loss, 3 in a ball.

Measured: in a ball J drifts by 3e-14 in 1100 turns at 3e-14, and by 2e-14 in the table's field at 1e-16.
"""
WORTH = 5e6
"""Length of a field's expressions, written out, from which on balls are faster.

A dipole has 6e3, a cuboid's closed form 2e4, two of them 4e4, moments up to degree 9 4e6 (as fast as a ball), a cube's
table by finite elements 9e6 from 3 mm off contact on and 1e8 from contact on.
"""


@dataclass(frozen=True, eq=False)
class Parts:
    """What flies in balls of a degree, or in the table's own field; compiled when it is first needed.

    Parameters
    ----------
    scene, table : the problem
    duration, tolerance, compact, memory : as of `compile_flight`
    """

    scene: Scene
    table: FieldTable
    duration: float
    tolerance: float
    compact: bool | None
    memory: PlateMemory | None
    _known: dict[tuple[int, PlateKind | None], Flight] = field(default_factory=dict)

    def of(self, degree: int, kind: PlateKind | None = None) -> Flight:
        """The part for balls of a degree, 0: in none; and for a kind of a plate's, None: in its table's own fields."""
        if (degree, kind) not in self._known:
            self._known[degree, kind] = self._compiled(degree, kind)
        return self._known[degree, kind]

    @property
    def first(self) -> int:
        """Number of the first runtime parameter of a plate."""
        return FIRST + sum(effect.count for effect in fitted(with_effects(self.scene, self.table), LARGE)) + KEY

    @property
    def compile_seconds(self) -> float:
        """Time that compilation took so far."""
        return sum(part.compile_seconds for part in self._known.values())

    def _compiled(self, degree: int, kind: PlateKind | None) -> Flight:
        scene, memory = self.scene, self.memory
        if not degree:
            return compile_flight(scene, self.table, self.duration, self.tolerance, True, memory)
        plate: PlateFormula | None = None
        if memory is not None:
            plate = PlateInBall(memory, kind, self.first) if kind else WholePlate(memory, self.first)
        equations, inside = ball_equations(scene, self.table, BallField(DEGREE + 1, degree), plate)
        leaves = [inside]
        if isinstance(plate, PlateInBall):
            offset = plate.offset(seen_by_plate(plate, equations.variables[:3]))
            leaves.append(1.0 - hy.sum([t * t for t in offset]))
        events = [hy.t_event(each, direction=hy.event_direction.negative) for each in leaves]
        meanings, tolerance = [LEFT] * len(events), LOOSER * self.tolerance
        if plate is not None:
            lost, meaning = flight_events(replace(scene, rotor=(), conductors=(), plate=None), equations.variables[:3])
            ends, told = range_events(plate, equations.variables[:3])
            events, meanings, tolerance = [*events, *lost, *ends], [*meanings, *meaning, *told], self.tolerance
        long = memory is None and degree == SMALL.degree and scene.frequency * self.duration > STRAIGHT_TURNS
        straight = long if self.compact is None else not self.compact
        return flight_of(scene, equations, (events, meanings), self.duration, tolerance, not straight, plate)


def ball_equations(
    scene: Scene, table: FieldTable, formula: BallField, plate: PlateFormula | None = None
) -> tuple[Equations, hy.expression]:
    """The motion in a ball, with the effects of the table, and what becomes negative outside of it."""
    tilted, inside = bool(np.any(scene.gravity[:2])), in_ball(with_effects(scene, table), formula)
    equations = equations_of_motion(inside, tilted, plate)
    offset = formula.offset([hy.par[Parameter.LENGTH] * x for x in equations.variables[:3]])
    return equations, 1.0 - hy.sum([t * t for t in offset])


def in_ball(whole: Interaction, formula: BallField) -> Interaction:
    """A field and its effects as they are in a ball."""
    effects: list[Effect] = []
    first = FIRST
    for effect in whole.effects:
        if isinstance(effect, Fittable):
            effects.append(local := effect.in_ball(formula, first))
            first += local.count
        else:
            effects.append(effect)
    return Interaction(formula, tuple(effects))


def fitted(whole: Interaction, formula: BallField) -> list[InBall]:
    """Those of the effects in a ball that have numbers of their own."""
    pairs = zip(whole.effects, in_ball(whole, formula).effects, strict=True)
    return [cast(InBall, local) for effect, local in pairs if isinstance(effect, Fittable)]


def is_long(table: FieldTable) -> bool:
    """Whether a field's or an effect's expressions are longer than those of a ball."""
    if any(isinstance(effect, Fittable) for effect in interaction_of(table).effects):
        return True
    field, gradient = table.expressions(hy.make_vars("x", "y", "z"))
    return sum(len(e) for e in [*field, *(e for row in gradient for e in row)]) > WORTH
