"""Rotors from magpylib's magnets, and the field of a table as a source of magpylib."""

from typing import Any

import magpylib
import numpy as np
from scipy.spatial.transform import Rotation

from ...fem.rotor_tables import RotorTable
from ...geometry.basics import MU_0, Array, Cylinder, InputError, Ring, Solid, Sphere
from ...geometry.scenes import magnets


def from_magpylib(collection: Any, recoil_permeability: float = 1.05) -> dict[str, Any]:
    """The rotor that magpylib's magnets make, for `spinlev.scene(rotor=...)`.

    Parameters
    ----------
    collection : magpylib.Collection or one of its magnets
        Cuboids, cylinders, spheres and rings (segments of 360°) without a path, in the rotor's frame: the axis of
        rotation is z.
    recoil_permeability : float
        Relative permeability of all magnets; magpylib itself has none.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file, lengths in mm; the same field to 1e-12 where the permeability is 1.

    Raises
    ------
    InputError
        Nothing in it, a source of another kind, one without size or polarisation, or one that moves along a path.

    Examples
    --------
    >>> import magpylib
    >>> cube = magpylib.magnet.Cuboid(dimension=(0.01, 0.01, 0.01), polarization=(1.3, 0, 0), position=(0.002, 0, 0))
    >>> from_magpylib(cube)["magnets"][0]["center_mm"]
    [2.0, 0.0, 0.0]
    """
    found = collection.sources_all if isinstance(collection, magpylib.Collection) else [collection]
    if not found:
        raise InputError("Input collection must hold at least one magnet; instead it is empty.")
    return dict(magnets(*(_magnet(source, recoil_permeability) for source in found)))


def _magnet(source: Any, recoil_permeability: float) -> dict[str, Any]:
    shape = _shape(source)
    if shape is None or source.polarization is None:
        raise InputError(f"Input collection must have magnets with a size and a polarisation; instead: {source!r}.")
    if np.ndim(source.position) != 1:
        raise InputError(f"Input collection must hold magnets at rest; instead {source!r} has a path.")
    return {
        **shape,
        "center_mm": _listed(1e3 * source.position),
        "rotation_deg": _listed(source.orientation.as_euler("xyz", degrees=True)),
        "polarization_T": _listed(source.polarization),
        "recoil_permeability": float(recoil_permeability),
    }


def _shape(source: Any) -> dict[str, Any] | None:
    """The keys of a source's shape; None where it has no size yet."""
    if isinstance(source, magpylib.magnet.Sphere):
        return None if source.diameter is None else {"shape": "sphere", "diameter_mm": 1e3 * float(source.diameter)}
    if not isinstance(source, magpylib.magnet.Cuboid | magpylib.magnet.Cylinder | magpylib.magnet.CylinderSegment):
        raise InputError(
            f"Input collection must hold cuboids, cylinders, rings and spheres only; instead received {source!r}."
        )
    if source.dimension is None:
        return None
    size = _listed(1e3 * np.asarray(source.dimension))
    if isinstance(source, magpylib.magnet.Cuboid):
        return {"size_mm": size}
    if isinstance(source, magpylib.magnet.Cylinder):
        return {"shape": "cylinder", "diameter_mm": size[0], "height_mm": size[1]}
    inner, outer, height = size[:3]
    if abs(source.dimension[4] - source.dimension[3] - 360) > 1e-9:
        raise InputError(f"Input collection must hold whole rings, of 360°; instead received {source!r}.")
    if not inner:
        return {"shape": "cylinder", "diameter_mm": 2 * outer, "height_mm": height}
    return {"shape": "ring", "diameter_mm": 2 * outer, "inner_diameter_mm": 2 * inner, "height_mm": height}


def _listed(values: Any) -> list[float]:
    return [float(value) for value in np.asarray(values, float) + 0.0]


def to_magpylib(table: RotorTable) -> Any:
    """The field of a rotor's table as a collection of magpylib, for its `getB`, its sensors and its figures.

    Parameters
    ----------
    table : RotorTable
        From `spinlev.rotor_table`. Closed forms become magnets; expansions (finite elements, dipoles) a custom source,
        which gives NaN where the table does not reach.

    Returns
    -------
    magpylib.Collection
        In the rotor's frame, SI units; the table's field to 1e-12.
    """
    sources: list[Any] = []
    for magnet in table.uniform:
        turn = Rotation.from_matrix(magnet.body.rotation)
        pose = {"position": magnet.body.center, "orientation": turn, "polarization": magnet.polarization}
        sources.append(_source(magnet.body, pose))
    if table.expansions:
        rest = RotorTable(table.model, table.magnets, (), table.expansions)
        sources.append(magpylib.misc.CustomSource(field_func=_Field(rest)))
    return magpylib.Collection(*sources)


def _source(body: Solid, pose: dict[str, Any]) -> Any:
    if isinstance(body, Sphere):
        return magpylib.magnet.Sphere(diameter=2 * body.radius, **pose)
    if isinstance(body, Ring):
        return magpylib.magnet.CylinderSegment(dimension=(body.inner_radius, body.radius, body.height, 0, 360), **pose)
    if isinstance(body, Cylinder):
        return magpylib.magnet.Cylinder(dimension=(2 * body.radius, body.height), **pose)
    return magpylib.magnet.Cuboid(dimension=body.size, **pose)


class _Field:
    """A table's B (T) and H (A/m) outside the magnets, as magpylib asks for them."""

    def __init__(self, table: RotorTable) -> None:
        self.table = table

    def __call__(self, field: str, observers: Array) -> Array | None:
        """(n, 3) at `observers` (n, 3) m; None for what magpylib may also ask of a source, J and M."""
        if field not in ("B", "H"):
            return None
        points = np.asarray(observers, float).reshape(-1, 3)
        found, known = np.full(points.shape, np.nan), self.table.in_range(points)
        found[known] = self.table.evaluate(points[known])[0]
        return found if field == "B" else found / MU_0
