"""The tables of a scene, made in Python."""

from collections.abc import Mapping, Sequence
from typing import Any

Table = Mapping[str, Any]
"""A table of the scene file."""


def horizontal(*, displacement_mm: float, remanence_T: float, edge_mm: float | None = None, **more: Any) -> Table:
    """One cube magnetised along +x and displaced along it from the axis.

    Parameters
    ----------
    displacement_mm : float
        Of the cube's centre, mm.
    remanence_T : float
        Remanence, T.
    edge_mm : float, optional
        Edge of the cubes, mm; left out where `shape` is "sphere" (with diameter_mm) or "cylinder" (and height_mm).
    **more : float or list
        Further keys, as for `magnets`.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file.
    """
    material = _article_material(remanence_T, edge_mm)
    return {"configuration": "horizontal", "displacement_mm": displacement_mm, **material, **more}


def vertical(*, displacement_mm: float, remanence_T: float, edge_mm: float | None = None, **more: Any) -> Table:
    """A cube magnetised along +x and one above it along +z.

    Parameters
    ----------
    displacement_mm : float
        From centre to centre, mm.
    remanence_T : float
        Remanence, T.
    edge_mm : float, optional
        Edge of the cubes, mm; left out where `shape` is "sphere" (with diameter_mm) or "cylinder" (and height_mm).
    **more : float or list
        Further keys, as for `magnets`.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file.
    """
    material = _article_material(remanence_T, edge_mm)
    return {"configuration": "vertical", "displacement_mm": displacement_mm, **material, **more}


def tilt(*, angle_deg: float, remanence_T: float, edge_mm: float | None = None, **more: Any) -> Table:
    """One cube, turned with its magnetisation about y.

    Parameters
    ----------
    angle_deg : float
        The magnetisation is along (cos angle, 0, sin angle), degrees.
    remanence_T : float
        Remanence, T.
    edge_mm : float, optional
        Edge of the cubes, mm; left out where `shape` is "sphere" (with diameter_mm) or "cylinder" (and height_mm).
    **more : float or list
        Further keys, as for `magnets`.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file.
    """
    material = _article_material(remanence_T, edge_mm)
    return {"configuration": "tilt", "angle_deg": angle_deg, **material, **more}


def _article_material(remanence_T: float, edge_mm: float | None) -> Table:
    return {"remanence_T": remanence_T} | ({} if edge_mm is None else {"edge_mm": edge_mm})


def magnets(*bodies: Table, **more: Any) -> Table:
    """Any set of magnets.

    Parameters
    ----------
    *bodies : dict
        Each with size_mm, center_mm, polarization_T, and where they are not the usual ones rotation_deg,
        recoil_permeability, conductivity_S_m, coercivity_kA_m.  For other shapes than "cuboid", in place of size_mm:
        shape "cylinder" with diameter_mm and height_mm, "ring" with inner_diameter_mm beside, "sphere" with
        diameter_mm.
    **more : float or list
        Further keys of every rotor: recoil_permeability of the article's, conductivity_S_m of all magnets (their eddy
        currents, else left out), coercivity_kA_m (the knee of their demagnetisation curves), field_map, and
        conductors, a list of tables with shape ("cuboid" or "cylinder"), size_mm or diameter_mm and height_mm,
        center_mm, rotation_deg and conductivity_S_m: metal that turns with the rotor.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file.
    """
    return {"magnets": list(bodies), **more}


def sphere(*, diameter_mm: float, remanence_T: float, density_kg_m3: float, **more: Any) -> Table:
    """The floating sphere.

    Parameters
    ----------
    diameter_mm : float
        Diameter, mm.
    remanence_T : float
        Remanence, T.
    density_kg_m3 : float
        Density, kg/m³.
    **more : float
        Further keys: recoil_permeability (1.05), conductivity_S_m (its eddy currents, else left out).

    Returns
    -------
    dict
        The table `[floater]` of a scene file.
    """
    return {"diameter_mm": diameter_mm, "remanence_T": remanence_T, "density_kg_m3": density_kg_m3, **more}


def plate(*, size_mm: Sequence[float], center_mm: Sequence[float], conductivity_S_m: float, **more: Any) -> Table:
    """A conducting plate.

    Parameters
    ----------
    size_mm : sequence of 3 floats
        Edges, mm.
    center_mm : sequence of 3 floats
        Centre in the laboratory frame, mm.
    conductivity_S_m : float
        Conductivity, S/m.
    **more : list or dict
        Further keys: rotation_deg about x, y, z, and lowering = {start_s, speed_mm_s, distance_mm}.

    Returns
    -------
    dict
        The table `[plate]` of a scene file.
    """
    return {"size_mm": size_mm, "center_mm": center_mm, "conductivity_S_m": conductivity_S_m, **more}
