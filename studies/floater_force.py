"""Force and torque of the rotor's field on a fixed floater of any shape, in any pose."""

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..fem.rotor.floater import FloaterSources, floater_sources, force_and_torque
from ..fem.rotor.table import FieldTable, RangeError
from ..geometry.common import Array
from ..geometry.overlap import body_overlap
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import scene_text
from .cli.console import note
from .cli.options import FieldModel, Models, documented, refused, wrong
from .levitation import Levitation
from .plan import SceneLike
from .result import AXIS, variable

COARSE = 12  # degree of the rule whose difference from the full one is the error of the sums


@documented
def floater_force(
    scene: SceneLike,
    position_mm: ArrayLike,
    moment: ArrayLike,
    body_x: ArrayLike | None = None,
    model: FieldModel = "auto",
    rtol: float = Models.rtol,
    progress: bool | None = None,
) -> xr.Dataset:
    """Force and torque of the rotor's field on the floater fixed in any pose.

    The floater's own multipoles in the rotor's field, those of its permeability as well; what rotor and floater induce
    in each other is left out. Gravity, plate and motion do not enter.

    Parameters
    ----------
    position_mm : array_like
        (n, 3) or (3,) of the floater's centre, mm, rotor's frame.
    moment : array_like
        (n, 3) or (3,) directions of its moment.
    body_x : array_like, optional
        (n, 3) or (3,) directions near which the body's x lies; left out, near the rotor's x. It matters to a body that
        is not round.

    Returns
    -------
    xarray.Dataset
        Over `pose` and `axis`, SI units: `force`, `torque` about the centre, their errors `force_error` and
        `torque_error` (the field's all over the body, and of the sums over it), and the `position` and `body_axes`.

    Raises
    ------
    InputError
        A pose in which the floater overlaps the rotor, or that is none.

    Examples
    --------
    >>> disc = {"shape": "cylinder", "diameter_mm": 12.0, "height_mm": 6.0}
    >>> disc |= {"remanence_T": 1.305, "recoil_permeability": 1.0, "density_kg_m3": 7500.0}
    >>> scene = sl.scene(frequency_hz=130.0, rotor=cube, floater=disc)
    >>> found = sl.floater_force(scene, [0.0, 0.0, -20.0], [-1.0, 0.0, 0.0], model="cuboid")
    >>> print(f"{found.force.values[0, 2]:.3f} N")
    1.466 N
    """
    levitation = Levitation(scene, Models(model, rtol=rtol))
    floater, table = levitation.scene.floater, levitation.table
    centres = 1e-3 * _vectors("position_mm", position_mm)
    places, pointing = np.broadcast_arrays(centres, _directions("moment", moment))
    near = [None] * len(places) if body_x is None else np.broadcast_to(_directions("body_x", body_x), places.shape)
    axes = np.array([floater.axes(m, x) for m, x in zip(pointing, near, strict=True)])
    _check_free(levitation.scene, places, axes)
    fine, coarse = floater_sources(floater, note), floater_sources(floater, note, COARSE)
    force, torque = _acting(fine, table, places, axes)
    rough = _acting(coarse, table, places, axes)
    unsure = fine.unsure(table, places, axes)
    errors = [
        doubt + np.linalg.norm(one - other, axis=1)
        for doubt, one, other in zip(unsure, (force, torque), rough, strict=True)
    ]
    return xr.Dataset(
        {
            "position": variable(("pose", "axis"), places, "m", "position, rotor's frame"),
            "body_axes": variable(("pose", "axis", "body_axis"), axes, "1", "axes of the body as columns"),
            "force": variable(("pose", "axis"), force, "N", "magnetic force"),
            "torque": variable(("pose", "axis"), torque, "N m", "magnetic torque about the centre"),
            "force_error": variable(("pose",), errors[0], "N", "estimated error of the force"),
            "torque_error": variable(("pose",), errors[1], "N m", "estimated error of the torque"),
        },
        coords={"axis": list(AXIS)},
        attrs={"study": "floater-force", "model": table.model, "scene": scene_text(levitation.scene)},
    )


def _vectors(name: str, value: ArrayLike) -> Array:
    try:
        found = np.atleast_2d(np.asarray(value, float))
    except (TypeError, ValueError):
        found = np.zeros((0, 0))
    if found.ndim != 2 or found.shape[1] != 3 or not np.isfinite(found).all():
        raise refused(name, "be three numbers or a list of such", value)
    return found


def _directions(name: str, value: ArrayLike) -> Array:
    found = _vectors(name, value)
    length = np.linalg.norm(found, axis=1, keepdims=True)
    if not length.all():
        raise refused(name, "be a direction, not zero", value)
    return np.asarray(found / length)


def _check_free(scene: Scene, places: Array, axes: Array) -> None:
    for place, turn in zip(places, axes, strict=True):
        parts = scene.floater.placed(place, turn)
        depth = max((body_overlap(other, part) for other in scene.turning_bodies for part in parts), default=-1.0)
        if depth > 0:
            where = ", ".join(f"{1e3 * c:.6g}" for c in place)
            instead = f"received ({where}) mm, where it overlaps it by {1e3 * depth:.3g} mm. Move it away by as much."
            raise wrong("position_mm", "leave the floater free of the rotor", instead)


def _acting(sources: FloaterSources, table: FieldTable, places: Array, axes: Array) -> tuple[Array, Array]:
    try:
        return force_and_torque(sources, table, places, axes)
    except RangeError as error:
        rule = "be where the field of the rotor is known all over the floater"
        raise wrong("position_mm", rule, f'{error} Move it away, or take model="cuboid".') from None
