"""The plate's memory in the motion: its currents are states beside the floater's.

In the units of `Scales`, with energies in M R²/T², the plate's states p̃ and what they listen to,

    dp̃_i/dt = -λ_i T (p̃_i - s̃_i),    s̃_i = μ̃ b_i(x)·m̂ + r̃_i(φ, d),    ỹ_i = p̃_i - s̃_i,    μ̃ = m/√(M R²/T²),

with the rotor's share r̃, act on the floater by F = R μ̃ Σ ỹ_i ∇(m̂·b_i) and τ = (μ̃/i) m̂ × Σ ỹ_i b_i.  Integrated are
p̃_i less what the rotor alone leaves (`rotor_currents`).  The plate turns backwards in the rotor's frame and may go
down, so that time enters.  Stored energy ½ Σ ỹ² and Jacobi integral together change by the loss
Σ λ_i T ỹ_i², and by what turning the plate's view, lowering it and turning the rotor against its currents takes:

    F·(W × r + u ẑ) + i W·τ + Σ ỹ_i ∂s̃_i/∂t (rotor's share),    u: speed of the plate's descent.
"""

from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.harmonics import UPPER
from ...fem.plate_tables import PlateTable, RotorShare
from ...geometry.scenes import Plate
from .rotor_currents import RotorCurrents, rotor_terms
from .symbols import Parameter, Vector, combined, cross, dot, turned


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

    @property
    def names(self) -> list[str]:
        """Names of the states."""
        return [f"plate_{i}" for i in range(len(self.table.rates))]


@dataclass(frozen=True, eq=False)
class MemoryTerms:
    """What a plate adds to the equations of motion, in scaled units.

    Parameters
    ----------
    rates : of its states
    force, torque : accelerations of the floater's position and spin
    stored : energy of the currents, without that of the rotor's currents alone
    spent : power that it gives to heat, and to what turns the rotor and lowers the plate
    """

    rates: Vector
    force: Vector
    torque: Vector
    stored: hy.expression
    spent: hy.expression


def memory_terms(
    memory: PlateMemory, angular_velocity: float, position: Vector, moment: Vector, states: Vector
) -> MemoryTerms:
    """The plate's part of the equations, from the floater's scaled position and moment and the plate's states p - q."""
    strength, length = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.LENGTH]
    place, pointing = _seen_by_plate(memory.plate, position, moment)
    parts = memory.table.multipoles.expressions(place)
    source = [strength * m for m in pointing]
    heard = [dot(source, field) for field, _ in parts]
    own = [p - combined(row, heard) for p, row in zip(states, memory.table.weights, strict=True)]
    rotor = rotor_terms(memory.driven(angular_velocity), memory.table.weights, own)
    strengths = [combined(column, own) for column in memory.table.weights.T]
    weights = [a + b for a, b in zip(strengths, rotor.strengths, strict=True)]
    pairs = list(zip(weights, parts, strict=True))
    field = [hy.sum([w * b[i] for w, (b, _) in pairs]) for i in range(3)]
    slope = {(i, j): hy.sum([w * g[i][j] for w, (_, g) in pairs]) for i, j in UPPER}
    slope[2, 2] = -slope[0, 0] - slope[1, 1]
    push = [hy.sum([source[i] * slope[min(i, j), max(i, j)] for i in range(3)]) for j in range(3)]
    force = [length * f for f in _seen_by_rotor(memory.plate, push)]
    turn = [strength * t for t in cross(moment, _seen_by_rotor(memory.plate, field))]
    lost = [float(rate) * y for rate, y in zip(memory.table.rates, own, strict=True)]
    decay = [-hy.par[Parameter.TIME] * term for term in lost]
    heat = hy.par[Parameter.TIME] * hy.sum([term * y for term, y in zip(lost, own, strict=True)])
    descent = [*turned(position)[:2], hy.par[Parameter.PLATE_SPEED] if memory.plate.lowering else hy.expression(0.0)]
    drive = dot(force, descent) + hy.par[Parameter.RATE] * turn[2]
    return MemoryTerms(
        rates=[a + b for a, b in zip(decay, rotor.lowering, strict=True)] if rotor.lowering else decay,
        force=force,
        torque=[t / hy.par[Parameter.INERTIA] for t in turn],
        stored=0.5 * hy.sum([y * y for y in own]) + rotor.stored,
        spent=heat + rotor.spent + drive,
    )


def _seen_by_plate(plate: Plate, position: Vector, moment: Vector) -> tuple[Vector, Vector]:
    """Position (m, from the plate's centre) and moment direction along the plate's axes."""
    depth = hy.par[Parameter.PLATE_DEPTH] + hy.par[Parameter.PLATE_SPEED] * hy.time
    lab = [hy.par[Parameter.LENGTH] * x for x in _turn(position, 1.0)]
    if plate.lowering:
        lab[2] = lab[2] + hy.par[Parameter.LENGTH] * depth
    shifted = [lab[i] - float(plate.box.center[i]) for i in range(3)]
    axes = plate.box.rotation.T
    return _product(axes, shifted), _product(axes, _turn(moment, 1.0))


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
