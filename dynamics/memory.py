"""The plate's memory in the motion: its currents are states beside the floater's.

In the units of `Scales`, with energies in M R²/T², the plate's states p̃ and what they listen to,

    dp̃_i/dt = -λ_i T (p̃_i - s̃_i),    s̃_i = μ̃ b_i(x)·m̂ + rotor's share,    ỹ_i = p̃_i - s̃_i,    μ̃ = m/√(M R²/T²),

act on the floater by F = R μ̃ Σ ỹ_i ∇(m̂·b_i) and τ = (μ̃/i) m̂ × Σ ỹ_i b_i.  The plate turns backwards in the rotor's
frame and may go down, so that time enters.  Stored energy ½ Σ ỹ² and Jacobi integral together change by the loss
Σ λ_i T ỹ_i², and by what turning the plate's view, lowering it and turning the rotor against its currents takes:

    F·(W × r + u ẑ) + i W·τ + Σ ỹ_i ∂s̃_i/∂t (rotor's share),    u: speed of the plate's descent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ..fem.multipole import UPPER
from ..fem.plate_table import PlateTable
from ..fem.rotor_share import RotorShare
from ..geometry.scene import Plate
from .symbols import Parameter, Vector, cross, dot, turned


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
    stored : energy of the currents
    loss : power turned into heat
    drive : power that the currents give to what turns the rotor and lowers the plate
    """

    rates: Vector
    force: Vector
    torque: Vector
    stored: hy.expression
    loss: hy.expression
    drive: hy.expression


def memory_terms(memory: PlateMemory, position: Vector, moment: Vector, states: Vector) -> MemoryTerms:
    """The plate's part of the equations, from the floater's scaled position and moment and the plate's states."""
    strength, length = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.LENGTH]
    place, pointing = _seen_by_plate(memory.plate, position, moment)
    parts = memory.table.multipoles.expressions(place)
    source = [strength * m for m in pointing]
    heard = [dot(source, field) for field, _ in parts]
    basis, basis_rates = _rotor(memory.share)
    shares = memory.share.expressions(basis)
    signals = [_combined(row, heard) + share for row, share in zip(memory.table.weights, shares, strict=True)]
    currents = [p - s for p, s in zip(states, signals, strict=True)]
    weights = [_combined(column, currents) for column in memory.table.weights.T]
    pairs = list(zip(weights, parts, strict=True))
    field = [hy.sum([w * b[i] for w, (b, _) in pairs]) for i in range(3)]
    slope = {(i, j): hy.sum([w * g[i][j] for w, (_, g) in pairs]) for i, j in UPPER}
    slope[2, 2] = -slope[0, 0] - slope[1, 1]
    push = [hy.sum([source[i] * slope[min(i, j), max(i, j)] for i in range(3)]) for j in range(3)]
    force = [length * f for f in _seen_by_rotor(memory.plate, push)]
    turn = [strength * t for t in cross(moment, _seen_by_rotor(memory.plate, field))]
    decay = [-float(rate) * y for rate, y in zip(memory.table.rates, currents, strict=True)]
    descent = [*turned(position)[:2], hy.par[Parameter.PLATE_SPEED] if memory.plate.lowering else hy.expression(0.0)]
    drive = dot(force, descent) + hy.par[Parameter.RATE] * turn[2]
    return MemoryTerms(
        rates=[hy.par[Parameter.TIME] * d for d in decay],
        force=force,
        torque=[t / hy.par[Parameter.INERTIA] for t in turn],
        stored=0.5 * hy.sum([y * y for y in currents]),
        loss=-hy.par[Parameter.TIME] * hy.sum([d * y for d, y in zip(decay, currents, strict=True)]),
        drive=drive + _driven(memory.share.series, currents, basis_rates),
    )


def _combined(weights: Sequence[float] | np.ndarray, terms: Vector) -> hy.expression:
    return hy.sum([float(w) * t for w, t in zip(weights, terms, strict=True) if w])


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


def _rotor(share: RotorShare) -> tuple[list[list[hy.expression]], list[list[hy.expression]]]:
    """The scaled functions of time that the rotor's signals are sums of, and their rates."""
    names = hy.make_vars("rotor_angle", "plate_depth")
    angle = hy.par[Parameter.RATE] * hy.time
    speed = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_SPEED]
    depth = hy.par[Parameter.LENGTH] * hy.par[Parameter.PLATE_DEPTH] + speed * hy.time
    now = {"rotor_angle": angle, "plate_depth": depth}
    basis = share.basis(*names)
    rates = [
        [hy.par[Parameter.RATE] * hy.diff(f, names[0]) + speed * hy.diff(f, names[1]) for f in row] for row in basis
    ]
    scale = hy.par[Parameter.PLATE_SHARE]
    signals, slopes = ([[scale * hy.subs(f, now) for f in row] for row in rows] for rows in (basis, rates))
    return signals, slopes


def _driven(series: np.ndarray, currents: Vector, rates: list[list[hy.expression]]) -> hy.expression:
    """Σ y_i ∂s_i/∂t of the rotor's signals: the currents are summed first, for each function of time."""
    pairs = [(rate, column) for row, part in zip(rates, series, strict=True)
             for rate, column in zip(row, part.T, strict=True)]  # fmt: skip
    return hy.sum([rate * _combined(column, currents) for rate, column in pairs if column.any()])
