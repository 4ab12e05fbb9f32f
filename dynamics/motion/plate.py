"""The plate's memory in the motion: its currents are states beside the floater's.

In the units of `Scales`, with energies in M R²/T², the plate's states p̃ and what they listen to,

    dp̃_i/dt = -λ_i T (p̃_i - s̃_i),    s̃_i = μ̃ b_i(x)·m̂ + r̃_i(φ, d),    ỹ_i = p̃_i - s̃_i,    μ̃ = m/√(M R²/T²),

with the rotor's share r̃, act on the floater by F = R μ̃ Σ ỹ_i ∇(m̂·b_i) and τ = (μ̃/i) m̂ × Σ ỹ_i b_i.  Integrated are
p̃_i less what the rotor alone leaves (`rotor_currents`).  The plate turns backwards in the rotor's frame and may go
down, so that time enters.  The field functions are sums b_i = Σ_k W_ik B_k, by what a `PlateFormula` says: in the
table, of its multipoles (`local_plates`).  Stored energy and Jacobi integral together change by the loss Σ λ_i T ỹ_i²,
and by what turning the plate's view, lowering it and the change of the rotor's currents take:

    F·(W × r + u ẑ) + i W·τ + μ̃ m̂·Σ b_i dỹ_i/dt (rotor's currents),    u: speed of the plate's descent.

What depends on the rotor's rate or on the units is a runtime parameter: one code serves all frequencies.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import heyoka as hy
import numpy as np

from ...fem.plate_tables import PlateTable, RotorShare
from ...geometry.basics import Array
from ...geometry.scenes import Plate
from .rotor_currents import RotorCurrents, rotor_terms
from .symbols import Parameter, Vector, cross, dot, dotted, turned


@dataclass(frozen=True, eq=False)
class PlateMemory:
    """A plate in the motion.

    Parameters
    ----------
    plate : pose and way in the laboratory
    table : its currents and their fields, in its own frame
    share : what the turning rotor adds to the signals
    model : name of the plate's model
    neglected : estimated relative error of the model itself: of a slab, what its edges would change
    """

    plate: Plate
    table: PlateTable
    share: RotorShare
    model: str = "reduced"
    neglected: float = 0.0

    @property
    def error(self) -> float:
        """Estimated relative error of what the plate does."""
        return max(self.table.errors.total, self.share.error) + self.neglected

    def driven(self, angular_velocity: float) -> RotorCurrents:
        """What a rotor turning so fast (rad/s) leaves in the plate."""
        return RotorCurrents(self.share, self.table.rates, angular_velocity)

    def __repr__(self) -> str:
        harmonics = len(self.share.series) // 2
        told = f"relative error {self.error:.1e}, {harmonics} harmonics of the rotor"
        return f"PlateMemory {self.model!r}: {told}\n{self.table!r}"


@dataclass(frozen=True, eq=False)
class MemoryTerms:
    """What a plate adds to the equations of motion, in scaled units.

    Parameters
    ----------
    rates : of its states
    force, torque : accelerations of the floater's position and spin
    stored : energy of the floater's currents, and of the floater in the field of the rotor's
    spent : what both lose to heat, to what turns the rotor and to what lowers the plate
    """

    rates: Vector
    force: Vector
    torque: Vector
    stored: hy.expression
    spent: hy.expression


Felt = Callable[[Vector], tuple[Vector, Vector]]
"""Field (T/√E) and ∇(source·field) along the plate's axes, of the functions with given strengths."""


class PlateFormula(Protocol):
    """How the fields of a plate's states are written."""

    @property
    def memory(self) -> PlateMemory:
        """The plate."""

    @property
    def share(self) -> RotorShare:
        """Of the rotor: with as many terms as count."""

    @property
    def reach(self) -> list[int]:
        """How many of the functions have each term of the share, see `rotor_terms`."""

    @property
    def first(self) -> int:
        """Number of the first of the runtime parameters, which `numbers` are for."""

    @property
    def lowered(self) -> bool:
        """Whether the plate may be on its way."""

    @property
    def weights(self) -> list[list[hy.expression | None]]:
        """W of each state (rows) and function; None for zero."""

    @property
    def further(self) -> int:
        """Number of the runtime parameters that it has itself, before those of `rotor_numbers`."""

    def seen(self, place: Vector, source: Vector) -> tuple[Vector, Felt]:
        """What each function hears of a moment at a place (m), both along the plate's axes, and what it does there."""


def pushed(slope: dict[tuple[int, int], hy.expression], source: Vector) -> Vector:
    """∇(source·B) from the upper entries of the gradient of B, which is symmetric and without trace."""
    slope[2, 2] = -slope[0, 0] - slope[1, 1]
    return [hy.sum([source[i] * slope[min(i, j), max(i, j)] for i in range(3)]) for j in range(3)]


def decay_numbers(rates: Array, values: Array) -> Array:
    """Runtime parameters of the decay of states with rates (n,) 1/s, from those of `parameters`: -λT."""
    return -rates * float(values[Parameter.TIME])


def rotor_numbers(formula: PlateFormula, weights: Array, values: Array) -> Array:
    """Runtime parameters of the rotor's currents for weights W (states, k), from those of `parameters`."""
    velocity = float(values[Parameter.RATE]) / float(values[Parameter.TIME])
    rotor = RotorCurrents(formula.share, formula.memory.table.rates, velocity)
    return rotor.numbers(weights, formula.reach, float(values[Parameter.PLATE_SHARE]), formula.lowered)


def memory_terms(formula: PlateFormula, position: Vector, moment: Vector, states: Vector) -> MemoryTerms:
    """The plate's part of the equations, from the floater's scaled position and moment and the plate's states p - q."""
    plate, start = formula.memory.plate, formula.first + formula.further
    strength, length = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.LENGTH]
    place, pointing = seen_by_plate(formula, position), _product(plate.box.rotation.T, _turn(moment, 1.0))
    source = [strength * m for m in pointing]
    heard, felt = formula.seen(place, source)
    weights = formula.weights
    own = [p - _picked(row, heard) for p, row in zip(states, weights, strict=True)]
    rotor = rotor_terms(formula.share, formula.reach, start + len(own), formula.lowered, heard, own)
    strengths = [_picked(column, own) for column in zip(*weights, strict=True)]
    field, push = felt([a + b for a, b in zip(strengths, rotor.strengths, strict=True)])
    force = [length * f for f in _seen_by_rotor(plate, push)]
    turn = [strength * t for t in cross(moment, _seen_by_rotor(plate, field))]
    decay = [hy.par[start + i] * y for i, y in enumerate(own)]
    speed = hy.par[Parameter.PLATE_SPEED] if formula.lowered else hy.expression(0.0)
    drive = dot(force, [*turned(position)[:2], speed]) + hy.par[Parameter.RATE] * turn[2]
    return MemoryTerms(
        rates=[a + b for a, b in zip(decay, rotor.lowering, strict=True)] if rotor.lowering else decay,
        force=force,
        torque=[t / hy.par[Parameter.INERTIA] for t in turn],
        stored=0.5 * hy.sum([y * y for y in own]) + rotor.stored,
        spent=rotor.spent + drive - dotted(own, decay),
    )


def _picked(weights: Sequence[hy.expression | None], terms: Vector) -> hy.expression:
    """Σ weight · term."""
    return hy.sum([w * t for w, t in zip(weights, terms, strict=True) if w is not None])


def seen_by_plate(formula: PlateFormula, position: Vector) -> Vector:
    """A scaled position in the rotor's frame along the plate's axes, m, from its centre."""
    plate, depth = formula.memory.plate, hy.par[Parameter.PLATE_DEPTH]
    if formula.lowered:
        depth = depth + hy.par[Parameter.PLATE_SPEED] * hy.time
    lab = [hy.par[Parameter.LENGTH] * x for x in _turn(position, 1.0)]
    if plate.lowering:
        lab[2] = lab[2] + hy.par[Parameter.LENGTH] * depth
    shifted = [lab[i] - float(plate.box.center[i]) for i in range(3)]
    return _product(plate.box.rotation.T, shifted)


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
