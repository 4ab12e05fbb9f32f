"""The article's floater, rotor and scene (doi.org/10.1063/5.0267494), for tests in any folder; lengths in m."""

from places import HORIZONTAL

from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import horizontal, tilt, vertical
from spinlev.geometry.scene.contents import Drag, Scene
from spinlev.geometry.scene.files import load_scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.scene.making import sphere

RADIUS = 6.35e-3
FLOATER = Floater(RADIUS, 1.305, 1.0, 7500.0)
PERMEABLE = Floater(RADIUS, 1.305, 1.05, 7500.0)
"""The same of a material that answers to the rotor's field."""
MAGNETS = horizontal(2e-3, 10e-3, 1.305, 1.0)
"""A cube 2 mm off the axis, magnetised square to it."""
PERMEABLE_MAGNETS = load_scene(HORIZONTAL).rotor
"""The same of such a material, as commands read it, so that tables of both, seconds each, have one key in the cache."""
NO_DRAG = Drag(0.0, 0.0)
SCENE = Scene(110.0, MAGNETS, FLOATER, NO_DRAG)
BALL = sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
"""The floater as the table of a scene's file."""


def moved_rotors(name, measures, model="dipole", floater=PERMEABLE, rtol=1e-4):
    """Scenes whose permeable rotors differ in displacement (m) or tilt (rad), and their fields."""
    make = {"horizontal": horizontal, "vertical": vertical, "tilt": tilt}[name]
    scenes = [Scene(110.0, make(x, 10e-3, 1.305, 1.05), floater, NO_DRAG) for x in measures]
    return scenes, [rotor_table(scene.rotor, model, rtol) for scene in scenes]
