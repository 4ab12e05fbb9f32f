"""The scenes in which equilibria are looked for: one, and a small map over frequency and displacement of its cube."""

from dataclasses import replace

import numpy as np
from flight_scene import SCENE
from problems import MAP_DISPLACEMENTS, MAP_FREQUENCIES, SLOTS

BELOW, SAME = -0.011, 2e-3
"""Heights that count as below the rotor, and how near to a slot an equilibrium belongs to it, m."""


def scenes(case):
    """The scene, or those of the map, displacement by displacement."""
    if case == "one scene":
        return [SCENE]
    (cube,) = SCENE.rotor
    moved = [(replace(cube, body=replace(cube.body, center=np.array([x, 0.0, 0.0]))),) for x in MAP_DISPLACEMENTS]
    return [replace(SCENE, rotor=rotor, frequency=frequency) for rotor in moved for frequency in MAP_FREQUENCIES]


def rows(case, found):
    """What is compared: of one scene the place in each slot, of the map the nearest place of each; zeros if missing.

    `found`: for each scene positions (n, 3) m."""
    if case == "one scene":
        return [_first(found[0][np.abs(found[0][:, 2] - slot) < SAME]) for slot in SLOTS]
    return [_first(places[places[:, 2] < BELOW]) for places in found]


def _first(places):
    return places[np.argmax(places[:, 2])] if len(places) else np.zeros(3)
