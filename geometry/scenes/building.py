"""Scenes made in Python, with the keys, units and defaults of the scene file."""

from collections.abc import Mapping, Sequence
from typing import Any

from .assembly import assemble
from .contents import Scene
from .parts import Table

DEEPEST = 10
"""Tables and lists in each other; a scene has five."""
LARGEST = 2**1000
"""Integers below it are floats."""


def scene(
    *,
    frequency_hz: float,
    rotor: Table,
    floater: Table,
    plate: Table | None = None,
    gravity_m_s2: Sequence[float] = (0.0, 0.0, -9.81),
    drag: Table | None = None,
    start: Table | None = None,
) -> Scene:
    """A scene from the tables of a scene file; the object itself is in SI units.

    Parameters
    ----------
    frequency_hz : float
        Turns of the rotor per second about +z, Hz.
    rotor : dict
        `horizontal`, `vertical`, `tilt`, `magnets`, or a mapping with the same keys.
    floater : dict
        `sphere`, or a mapping with shape "cuboid" (and size_mm) or "cylinder" (and diameter_mm, height_mm).
    plate : dict, optional
        `plate`; left out, none.
    gravity_m_s2 : sequence of 3 floats
        In the laboratory frame, m/s².
    drag : dict, optional
        "model" ("stokes", or "air": what a real sphere feels at its Reynolds number and frequency), or "linear_N_s_m"
        and "angular_N_m_s"; left out, Stokes drag in air.
    start : dict, optional
        "offset_mm" from the stable equilibrium, or "position_mm" with "velocity_mm_s", "moment" and "spin_hz"; left
        out, 0.1 mm above the stable equilibrium.

    Returns
    -------
    Scene
        In SI units.

    Raises
    ------
    SceneError
        A missing, unknown or wrong key, with what is allowed, or bodies that overlap.

    Examples
    --------
    >>> import spinlev as sl
    >>> cube = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
    >>> ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    >>> sl.scene(frequency_hz=130.0, rotor=cube, floater=ball).frequency
    130.0
    """
    keys = {"frequency_hz": frequency_hz, "gravity_m_s2": gravity_m_s2, "rotor": rotor, "floater": floater}
    keys |= {name: table for name, table in (("plate", plate), ("drag", drag), ("start", start)) if table is not None}
    return assemble(_plain(keys), "scene")


def _plain(value: Any, depth: int = 0) -> Any:
    """Tuples and arrays as lists, NumPy's numbers and integers as floats: as a scene file has them.

    What is deeper than any scene, or too large for a float, is left as it is: the schema refuses it.
    """
    if depth > DEEPEST:
        return value
    if isinstance(value, Mapping):
        return {str(key): _plain(item, depth + 1) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist(), depth + 1)
    if isinstance(value, list | tuple):
        return [_plain(item, depth + 1) for item in value]
    whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < LARGEST
    return float(value) if whole else value
