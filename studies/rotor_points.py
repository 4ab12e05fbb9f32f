"""The article's rotors as points of a study, and the scene that a point stands for."""

from __future__ import annotations

from collections.abc import Iterator

from ..geometry.scene import Drag, Floater, Scene
from .article import CONFIGURATIONS as ARTICLE
from .article import EDGE, FLOATER, PERMEABILITY, REMANENCE
from .study import Point

CONFIGURATIONS = tuple(ARTICLE)
UNITS = {name: kind.unit for name, kind in ARTICLE.items()}
SYMBOLS = {name: kind.symbol for name, kind in ARTICLE.items()}


def levitated(quick: bool) -> list[Point]:
    """One point for each rotor with which the article's floater levitated; `quick` has one of each configuration."""
    return list(_levitated(quick))


def _levitated(quick: bool) -> Iterator[Point]:
    for configuration, kind in ARTICLE.items():
        for measure in kind.levitated[1:2] if quick else kind.levitated:
            yield {"configuration": configuration, "measure": measure}


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
    kind = ARTICLE[configuration]
    magnets = kind.make(kind.si(measure), edge, remanence, permeability)
    return Scene(frequency, magnets, floater, Drag(0.0, 0.0))
