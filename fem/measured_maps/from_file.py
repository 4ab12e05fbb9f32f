"""A rotor's field as it was measured: a map from a file, fitted about the rotor's magnets."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...geometry.bodies import Magnet
from .field_map import FieldMapError
from .fit import fit_field_map
from .fitted_table import GriddedTable
from .readers import read_field_map


def map_table(path: Path | None, magnets: Sequence[Magnet]) -> GriddedTable:
    """Table of a map of B in the rotor's frame; the sources lie in the smallest spheres about the magnets.

    What the map holds inside those spheres is left out. Only the magnets' shapes and places matter, not their strength.

    Raises
    ------
    FieldMapError : no map, a file that is none, or too few values outside the spheres
    """
    if path is None:
        raise FieldMapError("Input rotor.field_map must name a file for the model map; instead it is missing.")
    field_map = read_field_map(path)
    radius = max(magnet.box.circumradius for magnet in magnets)
    centers = np.array([magnet.box.center for magnet in magnets])
    for center in centers:
        field_map = field_map.outside(center, radius)
    return fit_field_map(field_map, centers, radius)
