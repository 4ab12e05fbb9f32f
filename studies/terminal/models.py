"""Which tables a command is asked for; read by the command line before the numeric libraries are imported."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from cyclopts import Parameter

from ...geometry.basics import InputError

FieldModel = Literal["dipole", "cuboid", "fem", "map", "auto"]
Quantity = Literal["equilibria", "flight", "field"]
PlateModel = Literal["none", "slab", "fem", "reduced", "auto"]


@Parameter(name="*")
@dataclass(frozen=True)
class Models:
    """Which tables are asked for.

    Parameters
    ----------
    model
        Field model of the motion.
    plate_model
        none, slab (infinite), fem or reduced (the network of the finite elements), or auto.
    rtol
        Relative accuracy asked of the field wherever the floater can be.
    plate_rtol
        Relative accuracy asked of the plate's reaction.
    """

    model: FieldModel = "auto"
    plate_model: PlateModel = "auto"
    rtol: float = 3e-6
    plate_rtol: float = 3e-3

    def checked(self) -> Models:
        """Itself.

        Raises
        ------
        InputError : a model that does not exist, or a tolerance out of range
        """
        for name, known in (("model", get_args(FieldModel)), ("plate_model", get_args(PlateModel))):
            if (value := getattr(self, name)) not in known:
                raise InputError(f"Input {name} must be one of {', '.join(known)}; instead received {value}.")
        if not 1e-13 <= self.rtol < 1:
            raise InputError(f"Input --rtol must be at least 1e-13 and less than 1; instead received {self.rtol}.")
        if not 1e-5 <= self.plate_rtol <= 0.1:
            raise InputError(
                f"Input --plate-rtol must be at least 1e-5 and at most 0.1; instead received {self.plate_rtol}."
            )
        return self
