"""The article's rotors as points of a study, and the scene that a point stands for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..geometry import rotor
from ..geometry.scene import Drag, Floater, Scene
from .study import Point

CONFIGURATIONS = ("horizontal", "vertical", "tilt")
LEVITATED = {"horizontal": (1, 2, 3, 4), "vertical": (10, 12, 14, 16), "tilt": (5, 10, 15, 20)}
"""Displacements (mm) and tilts (degrees) with which the article's floater levitated."""
UNITS = {"horizontal": "mm", "vertical": "mm", "tilt": "°"}
SYMBOLS = {"horizontal": "δx", "vertical": "δz", "tilt": "δθ"}
EDGE, REMANENCE, PERMEABILITY = 10e-3, 1.305, 1.05
FLOATER = Floater(6.35e-3, REMANENCE, PERMEABILITY, 7500.0)


def levitated(quick: bool) -> list[Point]:
    """One point for each rotor with which the article's floater levitated; `quick` has one of each configuration."""
    return list(_levitated(quick))


def _levitated(quick: bool) -> Iterator[Point]:
    for configuration, measures in LEVITATED.items():
        for measure in measures[1:2] if quick else measures:
            yield {"configuration": configuration, "measure": float(measure)}


def rotor_scene(
    configuration: str,
    measure: float,
    frequency: float = 100.0,
    edge: float = EDGE,
    remanence: float = REMANENCE,
    permeability: float = PERMEABILITY,
    floater: Floater = FLOATER,
) -> Scene:
    """A scene without plate and drag.

    Parameters
    ----------
    configuration, measure : "horizontal" or "vertical" and a displacement in mm, or "tilt" and degrees
    frequency : Hz
    edge, remanence, permeability : of the cubes, m, T and 1
    """
    size = np.radians(measure) if configuration == "tilt" else 1e-3 * measure
    magnets = getattr(rotor, configuration)(float(size), edge, remanence, permeability)
    return Scene(frequency, magnets, floater, Drag(0.0, 0.0))
