"""Scenes made in Python, with the keys, units and defaults of the scene file."""

from collections.abc import Mapping, Sequence
from typing import Any

from .assembly import assemble
from .contents import Scene

Table = Mapping[str, Any]
"""A table of the scene file."""


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
    frequency_hz : turns of the rotor per second about +z, Hz
    rotor : `horizontal`, `vertical`, `tilt`, `magnets`, or a mapping with the same keys
    floater : `sphere`
    plate : `plate`, or None
    gravity_m_s2 : (3,) m/s², laboratory frame
    drag : model ("stokes", or "air": what a real sphere feels at its Reynolds number and frequency), or linear_N_s_m
        and angular_N_m_s; left out, Stokes drag in air
    start : a mapping: "offset_mm" from the stable equilibrium (0.1 mm up), or "position_mm" with "velocity_mm_s",
        "moment" and "spin_hz"

    Raises
    ------
    SceneError : a missing, unknown or wrong key, with what is allowed, or bodies that overlap

    Examples
    --------
    >>> cube = tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
    >>> ball = sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    >>> scene(frequency_hz=130.0, rotor=cube, floater=ball).frequency
    130.0
    """
    keys = {"frequency_hz": frequency_hz, "gravity_m_s2": gravity_m_s2, "rotor": rotor, "floater": floater}
    keys |= {name: table for name, table in (("plate", plate), ("drag", drag), ("start", start)) if table is not None}
    return assemble(_plain(keys), "scene")


def horizontal(*, displacement_mm: float, edge_mm: float, remanence_T: float, **more: Any) -> Table:
    """One cube magnetised along +x, `displacement_mm` off the axis; more: see `magnets`."""
    material = {"edge_mm": edge_mm, "remanence_T": remanence_T}
    return {"configuration": "horizontal", "displacement_mm": displacement_mm, **material, **more}


def vertical(*, displacement_mm: float, edge_mm: float, remanence_T: float, **more: Any) -> Table:
    """A cube magnetised along +x and one `displacement_mm` above it along +z; more: see `magnets`."""
    material = {"edge_mm": edge_mm, "remanence_T": remanence_T}
    return {"configuration": "vertical", "displacement_mm": displacement_mm, **material, **more}


def tilt(*, angle_deg: float, edge_mm: float, remanence_T: float, **more: Any) -> Table:
    """One cube, magnetised along (cos angle, 0, sin angle); more: see `magnets`."""
    return {"configuration": "tilt", "angle_deg": angle_deg, "edge_mm": edge_mm, "remanence_T": remanence_T, **more}


def magnets(*cuboids: Table, **more: Any) -> Table:
    """Cuboids with size_mm, center_mm, polarization_T, rotation_deg, recoil_permeability, conductivity_S_m.

    More, for every rotor: recoil_permeability of the article's, conductivity_S_m of all magnets (their eddy currents,
    else left out), field_map, and conductors, a list of tables with shape ("cuboid" or "cylinder"), size_mm or
    diameter_mm and height_mm, center_mm, rotation_deg and conductivity_S_m: metal that turns with the rotor.
    """
    return {"magnets": list(cuboids), **more}


def sphere(*, diameter_mm: float, remanence_T: float, density_kg_m3: float, **more: Any) -> Table:
    """The floating sphere; more: recoil_permeability (1.05), conductivity_S_m (its eddy currents, else left out)."""
    return {"diameter_mm": diameter_mm, "remanence_T": remanence_T, "density_kg_m3": density_kg_m3, **more}


def plate(*, size_mm: Sequence[float], center_mm: Sequence[float], conductivity_S_m: float, **more: Any) -> Table:
    """A conducting plate; more: rotation_deg about x, y, z, and lowering = {start_s, speed_mm_s, distance_mm}."""
    return {"size_mm": size_mm, "center_mm": center_mm, "conductivity_S_m": conductivity_S_m, **more}


def _plain(value: Any) -> Any:
    """Tuples and arrays as lists, NumPy's numbers and integers as floats: as a scene file has them."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
