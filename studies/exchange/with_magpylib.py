"""Rotors from magpylib's magnets, and the field of a table as a source of magpylib."""

from typing import Any

import magpylib
import numpy as np
from scipy.spatial.transform import Rotation

from ...fem.rotor_tables import RotorTable
from ...geometry.basics import MU_0, Array, InputError
from ...geometry.scenes import magnets


def from_magpylib(collection: Any, recoil_permeability: float = 1.05) -> dict[str, Any]:
    """The rotor that magpylib's magnets make, for `spinlev.scene(rotor=...)`.

    Parameters
    ----------
    collection : magpylib.Collection or magpylib.magnet.Cuboid
        Cuboids without a path, in the rotor's frame: the axis of rotation is z.
    recoil_permeability : float
        Relative permeability of all magnets; magpylib itself has none.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file, lengths in mm; the same field to 1e-12 where the permeability is 1.

    Raises
    ------
    InputError
        Nothing in it, a source that is no cuboid, one without size or polarisation, or one that moves along a path.

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
    return dict(magnets(*(_cuboid(source, recoil_permeability) for source in found)))


def _cuboid(source: Any, recoil_permeability: float) -> dict[str, Any]:
    if not isinstance(source, magpylib.magnet.Cuboid):
        raise InputError(f"Input collection must hold cuboids only; instead received {source!r}.")
    if source.dimension is None or source.polarization is None:
        raise InputError(f"Input collection must have magnets with a size and a polarisation; instead: {source!r}.")
    if np.ndim(source.position) != 1:
        raise InputError(f"Input collection must hold magnets at rest; instead {source!r} has a path.")
    return {
        "size_mm": _listed(1e3 * source.dimension),
        "center_mm": _listed(1e3 * source.position),
        "rotation_deg": _listed(source.orientation.as_euler("xyz", degrees=True)),
        "polarization_T": _listed(source.polarization),
        "recoil_permeability": float(recoil_permeability),
    }


def _listed(values: Any) -> list[float]:
    return [float(value) for value in np.asarray(values, float) + 0.0]


def to_magpylib(table: RotorTable) -> Any:
    """The field of a rotor's table as a collection of magpylib, for its `getB`, its sensors and its figures.

    Parameters
    ----------
    table : RotorTable
        From `spinlev.rotor_table`. Closed forms become cuboids; expansions (finite elements, dipoles) a custom source,
        which gives NaN where the table does not reach.

    Returns
    -------
    magpylib.Collection
        In the rotor's frame, SI units; the table's field to 1e-12.
    """
    sources: list[Any] = []
    for magnet in table.uniform:
        turn = Rotation.from_matrix(magnet.box.rotation)
        how = {"dimension": magnet.box.size, "polarization": magnet.polarization}
        sources.append(magpylib.magnet.Cuboid(position=magnet.box.center, orientation=turn, **how))
    if table.expansions:
        rest = RotorTable(table.model, table.magnets, (), table.expansions)
        sources.append(magpylib.misc.CustomSource(field_func=_Field(rest)))
    return magpylib.Collection(*sources)


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
