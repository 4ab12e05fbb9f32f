"""What one scene does, as labelled data: the command line's answers for programs and notebooks."""

from pathlib import Path

import xarray as xr

from ...dynamics.motion import PlateMemory
from ...fem.rotor_tables import FieldTable
from ...geometry.scenes import Scene, scene_text
from ..one_scene import Levitation
from ..results import found_dataset, lowering_times, trajectory_dataset
from ..terminal import FieldModel, InteractionModel, Models, PlateModel, heard


def rotor_table(
    scene: Scene | str | Path, model: FieldModel = "auto", rtol: float = Models.rtol, progress: bool = False
) -> FieldTable:
    """The rotor's field: `evaluate(points)` gives B (n, 3) T and its gradient (n, 3, 3) T/m at points (n, 3) m.

    Accurate to `rtol` wherever the floater can be; `relative_error(points)` is the estimate. Raises InputError for a
    model or a tolerance that is not allowed, and AccuracyError where it cannot be reached.
    """
    with heard(progress):
        return Levitation(scene, Models(model, rtol=rtol)).table


def plate_table(
    scene: Scene | str | Path,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    rtol: float = Models.rtol,
    plate_rtol: float = Models.plate_rtol,
    interaction: InteractionModel = "auto",
    progress: bool = False,
) -> PlateMemory | None:
    """The plate's currents around the place where the floater levitates, or None where none are modelled.

    Its `table` holds the network, its `share` what the rotor drives, its `error` the estimated relative error.
    """
    with heard(progress):
        return Levitation(scene, Models(model, plate_model, rtol, plate_rtol, interaction)).plate


def equilibria(
    scene: Scene | str | Path,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    rtol: float = Models.rtol,
    plate_rtol: float = Models.plate_rtol,
    interaction: InteractionModel = "auto",
    progress: bool = False,
) -> xr.Dataset:
    """All synchronous equilibria, the stable ones first, with errors, growth and frequency of each small motion.

    Parameters
    ----------
    scene : a scene or the path of a scene file
    model, plate_model : field model, and model of the plate
    spin : body spin S = Ω·m̂/ω
    rtol, plate_rtol : relative accuracy asked of the field and of the plate's reaction
    interaction : "rigid", "mutual" (rotor and floater magnetise each other) or "auto"
    progress : whether messages go to standard error

    Returns
    -------
    Dataset over `equilibrium`, `mode` and `axis`, SI units. Raises EquilibriumError for a rotor at rest, InputError for
    a model, tolerance or file that cannot be used.
    """
    with heard(progress):
        levitation = Levitation(scene, Models(model, plate_model, rtol, plate_rtol, interaction), spin)
        found = found_dataset(levitation.equilibria)
        return found.assign_attrs(study="equilibria", **_labels(levitation))


def stability(
    scene: Scene | str | Path,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    rtol: float = Models.rtol,
    plate_rtol: float = Models.plate_rtol,
    interaction: InteractionModel = "auto",
    progress: bool = False,
) -> xr.Dataset:
    """The five small motions about the equilibrium at which a flight begins, the nearest stable one if there is one.

    Parameters are those of `equilibria`.

    Returns
    -------
    Dataset over `mode` (bounce, two side motions, precession, nutation): growth (1/s; negative where it dies out) and
    frequency (Hz, rotor's frame); `stable`, `growth` and `growth_error` (what round-off may do to it) of the whole.
    Raises EquilibriumError where there is no equilibrium to begin at.
    """
    with heard(progress):
        levitation = Levitation(scene, Models(model, plate_model, rtol, plate_rtol, interaction), spin)
        found = found_dataset((levitation.stability,)).isel(equilibrium=0, drop=True).drop_vars("number")
        return found.assign_attrs(study="stability", **_labels(levitation))


def simulate(
    scene: Scene | str | Path,
    duration: float,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    rtol: float = Models.rtol,
    plate_rtol: float = Models.plate_rtol,
    interaction: InteractionModel = "auto",
    progress: bool = False,
) -> xr.Dataset:
    """The floater's motion for `duration` (s) from where the scene says; other parameters as for `equilibria`.

    Returns
    -------
    Dataset over `time`, SI units; how it ended and the violation of the energy ledger are attributes. Raises
    EquilibriumError where the scene starts from an equilibrium and has none.
    """
    with heard(progress):
        levitation = Levitation(scene, Models(model, plate_model, rtol, plate_rtol, interaction))
        flown = trajectory_dataset(levitation.flight(duration))
        return flown.assign_attrs(_labels(levitation), **lowering_times(levitation.scene))


def _labels(levitation: Levitation) -> dict[str, str]:
    """Models, and the scene as it was solved."""
    return {**levitation.labels, "scene": scene_text(levitation.scene)}
