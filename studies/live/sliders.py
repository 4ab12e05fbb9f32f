"""Which numbers of a scene a page lets its reader move, and how far."""

from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Box
from .state import PageState

MEASURES = {
    "horizontal": ("rotor.displacement_mm", "Displacement (mm)", 0.0, 10.0),
    "vertical": ("rotor.displacement_mm", "Displacement (mm)", 5.0, 30.0),
    "tilt": ("rotor.angle_deg", "Tilt (°)", 0.0, 45.0),
}
"""What moves a rotor of the article."""


@dataclass(frozen=True)
class Control:
    """A number that a slider moves.

    Parameters
    ----------
    key : of the scene file, with dots, or `spin`
    title : with the unit
    value : now
    low, high, step : the slider's
    """

    key: str
    title: str
    value: float
    low: float
    high: float
    step: float


PLATE_REACH = 20.0
"""How far a plate whose middle is level with the rotor's can be moved, mm."""
ROTOR_SIZES = {
    "edge_mm": "Edge of the cube (mm)",
    "diameter_mm": "Rotor's diameter (mm)",
    "height_mm": "Rotor's height (mm)",
}
"""Titles of the sizes that a rotor of the article may have, for its shape."""
FLOATER_SIZES = {"diameter_mm": "Floater's diameter (mm)", "height_mm": "Floater's height (mm)"}


def controls(state: PageState) -> list[Control]:
    """The sliders of a state, from the most to the least used: of what its scene has."""
    found = [_control("frequency_hz", "Frequency (Hz)", state.scene.frequency, 20.0, 300.0, 0.5)]
    keys = state.keys
    rotor, floater = keys["rotor"], keys["floater"]
    if (kind := rotor.get("configuration")) in MEASURES:
        key, title, low, high = MEASURES[kind]
        low = max(low, 1e3 * float(state.scene.rotor[0].body.size[2])) if kind == "vertical" else low  # they touch
        found.append(_control(key, title, rotor[key.partition(".")[2]], low, high, 0.05))
        sizes = [(key, title) for key, title in ROTOR_SIZES.items() if key in rotor]
        found += [_control(f"rotor.{key}", title, rotor[key], 3.0, 20.0, 0.05) for key, title in sizes]
    for key, title in FLOATER_SIZES.items():
        if key in floater:
            found.append(_control(f"floater.{key}", title, floater[key], 3.0, 30.0, 0.05))
    for k, size in enumerate(floater.get("size_mm", ())):
        found.append(
            _control(f"floater.size_mm.{k}", f"Floater's edge along its {'xyz'[k]} (mm)", size, 3.0, 30.0, 0.05)
        )
    found.append(_control("spin", "Body spin S", state.spin, -2.0, 2.0, 0.01))
    if state.scene.plate is not None:
        axis = _facing(state.scene.plate.box)
        title = ("Plate, x (mm)", "Plate, y (mm)", "Plate's height (mm)")[axis]
        place = keys["plate"]["center_mm"][axis]
        near, far = (0.4 * place, 2.5 * place) if place else (-PLATE_REACH, PLATE_REACH)
        found.append(_control(f"plate.center_mm.{axis}", title, place, min(near, far), max(near, far), 0.25))
    return found


def _control(key: str, title: str, value: float, low: float, high: float, step: float) -> Control:
    """One whose range has room for its value."""
    low, high = np.floor(min(low, value) / step) * step, np.ceil(max(high, value) / step) * step
    return Control(key, title, float(value), round(float(low), 6), round(float(high), 6), step)


def _facing(box: Box) -> int:
    """The axis of the laboratory along which a plate is thin."""
    return int(np.abs(box.rotation[:, int(np.argmin(box.size))]).argmax())
