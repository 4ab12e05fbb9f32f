"""What one scene does, as labelled data: the command line's answers for programs and notebooks."""

from pathlib import Path

import xarray as xr

from ...geometry.scenes import Scene, scene_text
from ..one_scene import Levitation, left_out_text
from ..results import found_dataset, lowering_times, trajectory_dataset
from ..terminal import FieldModel, InteractionModel, Models, PlateModel, heard


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
    scene : Scene, str or Path
        The scene, or the path of its file.
    model : {"auto", "dipole", "cuboid", "fem", "map"}
        Model of the rotor's field.
    plate_model : {"auto", "none", "slab", "reduced", "fem"}
        Model of the plate.
    spin : float
        Body spin S = Ω·m̂/ω of the floater about its own moment.
    rtol, plate_rtol : float
        Relative accuracy asked of the field and of the plate's reaction.
    interaction : {"auto", "rigid", "mutual"}
        Whether rotor and floater magnetise each other.
    progress : bool
        Whether messages go to standard error.

    Returns
    -------
    xarray.Dataset
        Over `equilibrium`, `mode` and `axis`, SI units; attribute `left_out` names the solutions that are no equilibria
        of the scene, or are not known to be.

    Raises
    ------
    EquilibriumError
        The rotor is at rest and the floater does not spin about its moment.
    InputError
        A model, a tolerance or a file that cannot be used.
    """
    with heard(progress):
        levitation = Levitation(scene, Models(model, plate_model, rtol, plate_rtol, interaction), spin)
        found = found_dataset(levitation.equilibria)
        left_out = left_out_text(levitation.survey.left_out)
        return found.assign_attrs(study="equilibria", left_out=left_out, **_labels(levitation))


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

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or the path of its file.
    model : {"auto", "dipole", "cuboid", "fem", "map"}
        Model of the rotor's field.
    plate_model : {"auto", "none", "slab", "reduced", "fem"}
        Model of the plate.
    spin : float
        Body spin S = Ω·m̂/ω of the floater about its own moment.
    rtol, plate_rtol : float
        Relative accuracy asked of the field and of the plate's reaction.
    interaction : {"auto", "rigid", "mutual"}
        Whether rotor and floater magnetise each other.
    progress : bool
        Whether messages go to standard error.

    Returns
    -------
    xarray.Dataset
        Over `mode` (bounce, two side motions, precession, nutation): growth (1/s; negative where it dies out) and
        frequency (Hz, rotor's frame); `stable`, `growth` and `growth_error` (what round-off may do to it) of the whole.

    Raises
    ------
    EquilibriumError
        There is no equilibrium to begin at.
    InputError
        A model, a tolerance or a file that cannot be used.
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
    """The floater's motion from where the scene says.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or the path of its file.
    duration : float
        Simulated time, s.
    model : {"auto", "dipole", "cuboid", "fem", "map"}
        Model of the rotor's field.
    plate_model : {"auto", "none", "slab", "reduced", "fem"}
        Model of the plate.
    rtol, plate_rtol : float
        Relative accuracy asked of the field and of the plate's reaction.
    interaction : {"auto", "rigid", "mutual"}
        Whether rotor and floater magnetise each other.
    progress : bool
        Whether messages go to standard error.

    Returns
    -------
    xarray.Dataset
        Over `time`, SI units; how it ended and the violation of the energy ledger are attributes.

    Raises
    ------
    EquilibriumError
        The scene starts from an equilibrium and has none.
    InputError
        A model, a tolerance or a file that cannot be used.
    """
    with heard(progress):
        levitation = Levitation(scene, Models(model, plate_model, rtol, plate_rtol, interaction))
        flight = levitation.flight(duration)
        flown = trajectory_dataset(flight, levitation.flight_plate)
        return flown.assign_attrs(_labels(levitation), **lowering_times(levitation.scene))


def _labels(levitation: Levitation) -> dict[str, str]:
    """Models, and the scene as it was solved."""
    return {**levitation.labels, "scene": scene_text(levitation.scene)}
