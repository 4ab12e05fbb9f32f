"""Where the flights of an ensemble begin: given, or drawn at random about where the scene begins."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..dynamics.flights.flight import displaced, initial_state
from ..dynamics.motion.plate import PlateMemory
from ..dynamics.motion.state import State
from ..fem.rotor.floater import FloaterSources, floater_sources, force_and_torque
from ..fem.rotor.near_field import NEAR_RTOL, complete
from ..fem.rotor.table import FieldTable, RangeError, RotorTable
from ..geometry.common import Array, InputError
from ..geometry.overlap import body_overlap
from ..geometry.scene.contents import OffsetStart, Scene
from ..geometry.scene.files import scene_text
from ..geometry.solids import moved
from .answers import left_out_text
from .cli.console import heard, note
from .cli.options import FieldModel, InteractionModel, Models, PlateModel
from .demagnetising import working_point_dataset
from .levitation import Levitation
from .result import found_dataset, lowering_times, trajectory_dataset, variable

UNITS = {"offset_mm": 1e-3, "position_mm": 1e-3, "velocity_mm_s": 1e-3, "moment": 1.0, "spin_hz": 2 * np.pi}
"""SI units of the keys of `[start]`."""
SPREADS = {"offset_mm": 1e-3, "velocity_mm_s": 1e-3, "moment_deg": np.pi / 180, "spin_hz": 2 * np.pi}


def given_starts(levitation: Levitation, starts: Mapping[Any, Any]) -> State:
    """States (n, 3) at t = 0 from the keys of a scene's `[start]`, each three numbers a flight, or three for all.

    Raises
    ------
    InputError : a key, a shape or a number that is not allowed, with the way out
    EquilibriumError : offsets are given, and there is no equilibrium
    """
    columns = {str(key): _rows("starts", str(key), values, UNITS) for key, values in starts.items()}
    if ("offset_mm" in columns) == ("position_mm" in columns):
        raise InputError(f"Input starts must have either offset_mm or position_mm; instead received {list(columns)}.")
    if "offset_mm" in columns and len(columns) > 1:
        raise InputError(f"Input starts must have offset_mm alone, or position_mm; instead received {list(columns)}.")
    lengths = {key: len(rows) for key, rows in columns.items() if len(rows) != 1}
    if len(set(lengths.values())) > 1:
        raise InputError(f"Input starts must have as many rows in each key; instead received {lengths}.")
    count = next(iter(lengths.values()), 1)
    if "offset_mm" in columns:
        scene = levitation.elsewhere(start=OffsetStart(np.zeros(3)))
        begun, _ = initial_state(scene.scene, levitation.interaction, levitation.equilibria)
        return displaced(begun, columns["offset_mm"], levitation.scene.angular_velocity)
    defaults = {"velocity_mm_s": (0.0, 0.0, 0.0), "moment": (0.0, 0.0, 1.0), "spin_hz": (0.0, 0.0, 0.0)}
    whole = {key: columns.get(key, np.array([defaults.get(key)])) for key in list(UNITS)[1:]}
    position, velocity, moment, spin = (np.tile(v, (count, 1)) if len(v) == 1 else v for v in whole.values())
    sizes = np.linalg.norm(moment, axis=1)
    if not sizes.all():
        raise InputError("Input starts.moment must be directions, not zero; instead received one that is.")
    return State(position, velocity, moment / sizes[:, None], spin)


def drawn_starts(levitation: Levitation, count: int, seed: int, spread: Mapping[str, Any]) -> State:
    """States (count, 3) about where the scene begins, each component normal with the standard deviations of `spread`.

    The same seed gives the same numbers; those of one key do not depend on what the others' spreads are.
    """
    sizes = {key: _rows("spread", key, values, SPREADS)[0] for key, values in spread.items()}
    if not sizes or any((size < 0).any() for size in sizes.values()):
        raise InputError(
            f"Input spread must have standard deviations, not negative, of some of {', '.join(SPREADS)}; "
            f"instead received {dict(spread)}."
        )
    draws = np.random.default_rng(seed).normal(size=(count, len(SPREADS), 3))
    offset, velocity, moment, spin = (
        draws[:, k] * sizes.get(key, np.zeros(3)) for k, key in enumerate(SPREADS)
    )  # fmt: skip
    known = () if levitation.absolute else levitation.equilibria
    begun, _ = initial_state(levitation.scene, levitation.interaction, known)
    begun = displaced(begun, offset, levitation.scene.angular_velocity)
    turned = begun.moment + moment
    turned = turned / np.linalg.norm(turned, axis=1)[:, None]
    return State(begun.position, begun.velocity + velocity, turned, begun.spin + spin)


def _rows(name: str, key: str, values: Any, units: Mapping[str, float]) -> Array:
    """Numbers (n, 3), SI units."""
    if key not in units:
        raise InputError(f"Input {name} must have keys among {', '.join(units)}; instead received {key!r}.")
    try:
        rows = np.asarray(values, float)
    except (TypeError, ValueError):
        raise InputError(f"Input {name}.{key} must be numbers; instead received {values!r}.") from None
    if name == "spread" and rows.ndim == 0:
        rows = np.full(3, rows)
    fine = rows.ndim in (1, 2) and rows.shape[-1] == 3 and rows.size and np.isfinite(rows).all()
    if not fine or (name == "spread" and rows.ndim > 1):
        shape = "one or three finite numbers" if name == "spread" else "three finite numbers for each flight, (n, 3)"
        what = values if rows.ndim == 0 else f"an array of shape {rows.shape}"
        raise InputError(f"Input {name}.{key} must be {shape}; instead received {what}.")
    return np.atleast_2d(rows) * units[key]


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


COARSE = 12
"""Degree of the rule whose difference from the full one is told as an error."""


def floater_force(
    scene: Scene | str | Path,
    position: ArrayLike,
    moment: ArrayLike,
    body_x: ArrayLike | None = None,
    model: FieldModel = "auto",
    rtol: float = Models.rtol,
    progress: bool = False,
) -> xr.Dataset:
    """Force and torque of the rotor's field on the floater held in any pose: a sphere, a cuboid or a cylinder.

    The floater's own multipoles in the rotor's field, those of its permeability as well; what rotor and floater induce
    in each other is left out. Gravity, plate and motion do not enter.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or the path of its file.
    position : array_like
        (n, 3) or (3,) of the floater's centre, m, rotor's frame.
    moment : array_like
        (n, 3) or (3,) directions of its moment, the body's z.
    body_x : array_like, optional
        (n, 3) or (3,) directions near which the body's x lies; left out, near the rotor's x. It matters to a cuboid.
    model : {"auto", "dipole", "cuboid", "fem", "map"}
        Model of the rotor's field.
    rtol : float
        Relative accuracy asked of that field.
    progress : bool
        Whether messages go to standard error.

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
    >>> import spinlev as sl
    >>> cube = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
    >>> disc = {"shape": "cylinder", "diameter_mm": 12.0, "height_mm": 6.0}
    >>> disc |= {"remanence_T": 1.305, "recoil_permeability": 1.0, "density_kg_m3": 7500.0}
    >>> scene = sl.scene(frequency_hz=130.0, rotor=cube, floater=disc)
    >>> found = sl.floater_force(scene, [0.0, 0.0, -0.02], [-1.0, 0.0, 0.0], model="cuboid")
    >>> print(f"{found.force.values[0, 2]:.3f} N")
    1.466 N
    """
    with heard(progress):
        levitation = Levitation(scene, Models(model, rtol=rtol))
        floater, table = levitation.scene.floater, levitation.table
        places, pointing = _vectors("position", position), _directions("moment", moment)
        places, pointing = np.broadcast_arrays(places, pointing)
        axes = np.array([floater.axes(m) for m in pointing])
        if body_x is not None:
            axes = _turned(axes, np.broadcast_to(_directions("body_x", body_x), places.shape))
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
        coords={"axis": list("xyz")},
        attrs={"study": "floater-force", "model": table.model, "scene": scene_text(levitation.scene)},
    )


def _vectors(name: str, value: ArrayLike) -> Array:
    try:
        found = np.atleast_2d(np.asarray(value, float))
    except (TypeError, ValueError):
        found = np.zeros((0, 0))
    if found.ndim != 2 or found.shape[1] != 3 or not np.isfinite(found).all():
        raise InputError(f"Input {name} must be three numbers or a list of such; instead received {value!r}.")
    return found


def _directions(name: str, value: ArrayLike) -> Array:
    found = _vectors(name, value)
    length = np.linalg.norm(found, axis=1, keepdims=True)
    if not length.all():
        raise InputError(f"Input {name} must be a direction, not zero; instead received {value!r}.")
    return np.asarray(found / length)


def _turned(axes: Array, near: Array) -> Array:
    """Body axes (n, 3, 3) turned about their z so that x is as near as can be to unit vectors (n, 3)."""
    z = axes[:, :, 2]
    x = near - np.sum(near * z, axis=1, keepdims=True) * z
    length = np.linalg.norm(x, axis=1, keepdims=True)
    if not (length > 1e-9).all():
        raise InputError("Input body_x must not be along the moment; instead it is.")
    return np.stack([x / length, np.cross(z, x / length), z], axis=2)


def _check_free(scene: Scene, places: Array, axes: Array) -> None:
    for place, turn in zip(places, axes, strict=True):
        body = moved(scene.floater.solid, place, turn)
        depth = max((body_overlap(other, body) for other in scene.turning_bodies), default=-1.0)
        if depth > 0:
            where = ", ".join(f"{1e3 * c:.6g}" for c in place)
            raise InputError(
                f"Input position must leave the floater free of the rotor; instead received ({where}) mm, where it "
                f"overlaps it by {1e3 * depth:.3g} mm. Move it away by as much."
            )


def _acting(sources: FloaterSources, table: FieldTable, places: Array, axes: Array) -> tuple[Array, Array]:
    try:
        return force_and_torque(sources, table, places, axes)
    except RangeError as error:
        raise InputError(
            f"Input position must be where the field of the rotor is known all over the floater; instead {error} "
            'Move it away, or take model="cuboid".'
        ) from None
