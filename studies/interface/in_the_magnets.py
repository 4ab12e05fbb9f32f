"""Whether the magnets of a scene demagnetise, for programs and notebooks."""

from pathlib import Path

import xarray as xr

from ...geometry.scenes import Scene, scene_text
from ..one_scene import Levitation, working_point_dataset
from ..terminal import FieldModel, InteractionModel, Models, heard


def working_point(
    scene: Scene | str | Path,
    model: FieldModel = "auto",
    rtol: float = Models.rtol,
    interaction: InteractionModel = "auto",
    progress: bool = False,
) -> xr.Dataset:
    """The lowest μ0 H along each magnet's easy axis, with the floater where it levitates, against the knee.

    In step with the rotor the floater's field in the magnets is the same all over a turn; `lowest_turning` is the
    lowest if the floater stays behind for a whole turn. No hysteresis: what is below the knee is told, not followed.
    On an edge the field can be infinite; `lowest` keeps 2 % of the edge of a cube of the magnet's volume off all edges.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or the path of its file.
    model : {"auto", "dipole", "cuboid", "fem", "map"}
        Model of the rotor's field that places the floater; in the magnets the field is always of finite elements.
    rtol : float
        Relative accuracy asked of that field.
    interaction : {"auto", "rigid", "mutual"}
        Whether rotor and floater magnetise each other where the floater is placed; in the magnets they always do.
    progress : bool
        Whether messages go to standard error.

    Returns
    -------
    xarray.Dataset
        Over `magnet` (numbered from 1), SI units: `lowest` T with `place` and `error`, `knee`, `share_below` (of the
        volume), `levels` (the field over the volume), and a `section` through each magnet.

    Raises
    ------
    InputError
        No magnet has a polarisation, or a model, a tolerance or a file that cannot be used.
    """
    with heard(progress):
        levitation = Levitation(scene, Models(model, rtol=rtol, interaction=interaction))
        return working_point_dataset(levitation).assign_attrs(study="working-point", scene=scene_text(levitation.scene))
