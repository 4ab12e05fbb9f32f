"""The fields of a plate's currents as its table has them: sums of multipoles behind the plate's surface."""

from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.harmonics import UPPER
from ...fem.plate_tables import RotorShare
from ...geometry.basics import Array
from ..motion import Felt, Parameter, PlateMemory, Vector, decay_numbers, dot, pushed, rotor_numbers


@dataclass(frozen=True, eq=False)
class WholePlate:
    """The table's own multipoles: they hold wherever the table does.

    Parameters
    ----------
    memory : the plate
    first : number of the first runtime parameter
    """

    memory: PlateMemory
    first: int = len(Parameter)
    further: int = 0

    @property
    def share(self) -> RotorShare:
        """See `PlateFormula`."""
        return self.memory.share

    @property
    def reach(self) -> list[int]:
        """See `PlateFormula`: all."""
        series = self.share.series
        return [len(self.memory.table.multipoles.kinds)] * ((len(series) - 1) * series.shape[2])

    @property
    def lowered(self) -> bool:
        """See `PlateFormula`."""
        return self.memory.plate.lowering is not None

    @property
    def weights(self) -> list[list[hy.expression | None]]:
        """See `PlateFormula`."""
        return [[hy.expression(float(w)) if w else None for w in row] for row in self.memory.table.weights]

    def numbers(self, values: Array) -> Array:
        """Values of its runtime parameters, from those of `parameters`."""
        table = self.memory.table
        return np.concatenate([decay_numbers(table.rates, values), rotor_numbers(self, table.weights, values)])

    def seen(self, place: Vector, source: Vector) -> tuple[Vector, Felt]:
        """See `PlateFormula`."""
        parts = self.memory.table.multipoles.expressions(place)

        def felt(strengths: Vector) -> tuple[Vector, Vector]:
            pairs = list(zip(strengths, parts, strict=True))
            field = [hy.sum([w * b[i] for w, (b, _) in pairs]) for i in range(3)]
            slope = {(i, j): hy.sum([w * g[i][j] for w, (_, g) in pairs]) for i, j in UPPER}
            return field, pushed(slope, source)

        return [dot(source, field) for field, _ in parts], felt
