"""Scenes of the article's rotors, and how they levitate."""

from dataclasses import replace

import numpy as np

from ...dynamics.continuation.frequencies import StableRange, reference_state, stable_range
from ...dynamics.motion.rates import Rates
from ...geometry.common import MAGNET_CONDUCTIVITY
from ...geometry.scene.contents import Drag, Floater, Plate, Scene
from ...geometry.shapes import Box
from ..cli.options import FieldModel, InteractionModel, Models
from ..levitation import Levitation
from ..study import Point
from .article import CONFIGURATIONS, EDGE, FLOATER, PERMEABILITY, PLATE_CONDUCTIVITY, PLATE_SIZE, REMANENCE, RTOL


def levitated_rotors(quick: bool) -> list[Point]:
    """A point for each rotor that levitated in the experiment; `quick` has one of each configuration."""
    return [
        {"configuration": configuration, "measure": measure}
        for configuration, kind in CONFIGURATIONS.items()
        for measure in (kind.levitated[1:2] if quick else kind.levitated)
    ]


def article_scene(
    configuration: str,
    value: float,
    frequency: float = 100.0,
    *,
    drag: bool = True,
    edge: float = EDGE,
    remanence: float = REMANENCE,
    permeability: float = PERMEABILITY,
    floater: Floater = FLOATER,
) -> Scene:
    """A rotor of the article above its floater, without a plate.

    Parameters
    ----------
    configuration, value : of the rotor; displacement in mm or tilt in degrees
    frequency : Hz
    drag : whether there is air (Stokes)
    edge, remanence, permeability : of the cubes, m, T and 1
    """
    kind = CONFIGURATIONS[configuration]
    magnets = kind.make(kind.si(value), edge, remanence, permeability)
    return Scene(frequency, magnets, floater, Drag.stokes(floater.radius) if drag else Drag(0.0, 0.0))


def levitation_of(
    scene: Scene, model: FieldModel, rtol: float = RTOL, interaction: InteractionModel = "rigid"
) -> Levitation:
    """A scene in one model's field, its plate left out."""
    return Levitation(scene, Models(model, "none", rtol, interaction=interaction))


def conducting(scene: Scene, rotor: bool = True) -> Scene:
    """The scene with eddy currents in the floater and, unless told otherwise, in the rotor's magnets."""
    magnets = tuple(replace(m, conductivity=MAGNET_CONDUCTIVITY if rotor else None) for m in scene.rotor)
    return replace(scene, rotor=magnets, floater=replace(scene.floater, conductivity=MAGNET_CONDUCTIVITY))


def article_plate(face: float) -> Plate:
    """The article's plate below the rotor, its upper face at this height (m) from the rotor's origin."""
    return Plate(Box(np.array(PLATE_SIZE), np.array([0.0, 0.0, face - PLATE_SIZE[2] / 2])), PLATE_CONDUCTIVITY)


def stable_frequencies(scene: Scene, rates: Rates) -> StableRange:
    """Frequencies of stable levitation of a rotor, whose motion has these `rates`; the scene's own is any.

    Raises
    ------
    EquilibriumError : it levitates stably at no frequency
    """
    return stable_range(scene, rates, *reference_state(scene))
