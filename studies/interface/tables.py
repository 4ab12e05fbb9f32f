"""The tables of a scene, for programs and notebooks."""

from pathlib import Path

from ...dynamics.motion import PlateMemory
from ...fem.rotor_tables import NEAR_RTOL, FieldTable, RotorTable, complete
from ...geometry.scenes import Scene
from ..one_scene import Levitation
from ..terminal import FieldModel, InteractionModel, Models, PlateModel, heard


def rotor_table(
    scene: Scene | str | Path, model: FieldModel = "auto", rtol: float = Models.rtol, progress: bool = False
) -> FieldTable:
    """The rotor's field as a table, accurate to `rtol` wherever the floater can be.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or the path of its file.
    model : {"auto", "dipole", "cuboid", "fem", "map"}
        Model of the rotor's field.
    rtol : float
        Relative accuracy asked of the field.
    progress : bool
        Whether messages go to standard error.

    Returns
    -------
    FieldTable
        Its `evaluate(points)` gives B (n, 3) T and its gradient (n, 3, 3) T/m at points (n, 3) m of the rotor's frame,
        `relative_error(points)` the estimated errors. With "cuboid" and "fem" also in the magnets, in gaps and at
        faces, there to `rtol` or 1e-4 of the remanence, whichever is more; `fields(points)` has H and M, too.

    Raises
    ------
    InputError
        A model, a tolerance or a file that cannot be used; of `evaluate`, a point on an edge of a magnet.
    AccuracyError
        The accuracy cannot be reached.
    """
    with heard(progress):
        table = Levitation(scene, Models(model, rtol=rtol)).table
        return complete(table, max(rtol, NEAR_RTOL)) if isinstance(table, RotorTable) else table


def plate_table(
    scene: Scene | str | Path,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    rtol: float = Models.rtol,
    plate_rtol: float = Models.plate_rtol,
    interaction: InteractionModel = "auto",
    progress: bool = False,
) -> PlateMemory | None:
    """The plate's currents around the place where the floater levitates.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or the path of its file.
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
    PlateMemory or None
        Its `table` holds the network, `share` what the rotor drives, `error` the estimated relative error; None where
        no currents are modelled.

    Raises
    ------
    InputError
        A model, a tolerance or a file that cannot be used.
    """
    with heard(progress):
        return Levitation(scene, Models(model, plate_model, rtol, plate_rtol, interaction)).plate
