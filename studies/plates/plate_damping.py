"""What a plate does to levitation: damping of each small motion, drag, lift and loss against its place and material.

In the motion are Stokes drag and, but in the quick settings, real air, eddy currents in floater and rotor, and that
both magnetise each other; the plate's currents answer the rigid floater and the rotor.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace

import xarray as xr
from numpy.typing import ArrayLike

from ...dynamics.equilibria import plate_action
from ...dynamics.steady import Equilibrium, Survey
from ..one_scene import Levitation
from ..results import AXIS, MODES, Columns, Point, Study, columns, variable
from .plate_cases import PlateCase, cases, without_plate
from .plate_damping_figure import FIGURES
from .plate_damping_report import damping_lines

RTOL = 3e-3


def damping_points(quick: bool) -> list[Point]:
    """The plates and rotors as points of the study."""
    return [asdict(case) for case in cases(quick)]


def plate_damping(point: Point) -> xr.Dataset:
    """Levitation of a rotor of the article beside or above one plate.

    Returns
    -------
    Dataset over `case`: growth and frequency of each mode, displacement, mean force, torque and loss; NaN where the
    plate undoes the equilibrium.  Plates are infinite slabs but for those called real.

    Raises
    ------
    EquilibriumError : nothing levitates even without the plate
    """
    case = PlateCase(**point)
    alone, start = without_plate(case)
    models = replace(alone.models, plate_model=case.model, plate_rtol=RTOL)
    beside = alone.elsewhere(models, plate=case.plate(start.position))
    beside.adopt(Survey((start,), ()))
    row, scene = _row(beside, start), alone.scene
    return xr.Dataset(
        {
            **columns(COLUMNS, row, mode=len(MODES), axis=len(AXIS)),
            "sweep": ((), case.sweep),
            "configuration": ((), case.configuration),
            "value": variable((), case.value, "SI, mm or °", "what is varied in the sweep"),
            "rotor_frequency": variable((), scene.frequency, "Hz", "frequency of the rotor"),
        },
        {"mode": list(MODES), "axis": list(AXIS)},
        {"weight_N": scene.floater.mass * 9.81, "plate_rtol": RTOL},
    ).expand_dims("case")


def gather_damping(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """The plates one after the other."""
    return xr.concat(parts, "case", data_vars="minimal", coords="minimal", compat="override", join="exact")


COLUMNS: Columns = {
    "growth": (("mode",), "1/s", "growth rate of a small motion"),
    "growth_without": (("mode",), "1/s", "growth rate without a plate"),
    "frequency": (("mode",), "Hz", "frequency of a small motion, rotor's frame"),
    "shift": (("axis",), "m", "displacement of the equilibrium by the plate"),
    "force": (("axis",), "N", "mean force of the plate on the floater"),
    "torque": (("axis",), "N m", "mean torque of the plate on the floater"),
    "loss": ((), "W", "heat in the plate, by floater and rotor"),
    "error": ((), "1", "estimated relative error of the plate's table"),
}


def _row(levitation: Levitation, start: Equilibrium) -> dict[str, ArrayLike]:
    memory, found = levitation.plate, levitation.equilibria
    row: dict[str, ArrayLike] = {"growth_without": [mode.growth_per_s for mode in start.modes]}
    if memory is None or not found or found[0].currents is None:
        return row
    return {
        **row,
        "growth": [mode.growth_per_s for mode in found[0].modes],
        "frequency": [mode.frequency_hz for mode in found[0].modes],
        "shift": found[0].position - start.position,
        **vars(plate_action(levitation.scene, memory, found[0])),
        "error": max(memory.table.errors.total, memory.share.error),
    }


STUDY = Study(
    name="plate-damping",
    summary="what a plate does to each small motion, against its place, conductivity and thickness",
    points=damping_points,
    compute=plate_damping,
    gather=gather_damping,
    figures=FIGURES,
    report=damping_lines,
)
